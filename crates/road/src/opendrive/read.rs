//! XML into the model: header, roads, plan view, profiles, links, junctions, counts.

use std::borrow::Cow;
use std::collections::BTreeSet;

use roxmltree::Node;

use super::count::counts;
use super::model::{Connection, Contact, Header, Junction, Link, Network, RoadRecord};
use super::read_lanes;
use super::xml::{Source, child, children};
use crate::bake::Baker;
use crate::xml::{self, MAX_BYTES};
use crate::{Cubics, GeoReference, Line, Placed, RoadError, RoadObject, Shape};

/// A longer road is taken for a mistake, m.
const MAX_ROAD_M: f64 = 1e6;
/// A longer map is taken for a mistake, m.
const MAX_TOTAL_M: f64 = 1e7;
/// More turning in one element than this is taken for a mistake, rad.
const MAX_TURN_RAD: f64 = 200.0;

impl Network {
    /// Reads a map from a file.
    ///
    /// # Errors
    /// [`RoadError`] names the file, the line and the element.
    pub fn load(path: &str) -> Result<Self, RoadError> {
        let io = |why: String| RoadError::Io { path: path.into(), why };
        let bytes = std::fs::metadata(path).map_err(|e| io(e.to_string()))?.len();
        if bytes > MAX_BYTES {
            return Err(io(format!("{bytes} bytes, at most {MAX_BYTES} are read")));
        }
        let text = std::fs::read(path).map_err(|e| io(e.to_string()))?;
        let text = String::from_utf8(text).map_err(|e| io(e.to_string()))?;
        Self::parse(path, &text)
    }

    /// Reads a map from its text; `name` stands for the file in messages.
    ///
    /// # Errors
    /// As [`Network::load`].
    pub fn parse(name: &str, text: &str) -> Result<Self, RoadError> {
        let text = without_late_declaration(text.trim_start_matches('\u{feff}'));
        let doc = xml::parse(&text).map_err(|e| RoadError::OpenDrive {
            path: name.into(),
            line: e.line,
            element: "xml".into(),
            why: e.why,
        })?;
        let (source, root) = (Source::new(name, &text), doc.root_element());
        if root.tag_name().name() != "OpenDRIVE" {
            return Err(source.error(root, "the root element must be <OpenDRIVE>"));
        }
        let header = header(&source, root)?;
        let mut roads = Vec::new();
        let mut ids = BTreeSet::new();
        let mut total_m = 0.0;
        for node in children(root, "road") {
            let road = road(&source, node)?;
            if !ids.insert(road.id.clone()) {
                return Err(source.error(node, format!("id = {:?} is used twice", road.id)));
            }
            total_m += road.length_m;
            if total_m > MAX_TOTAL_M {
                return Err(source.error(node, format!("more than {MAX_TOTAL_M} m of road")));
            }
            roads.push(road);
        }
        if roads.is_empty() {
            return Err(source.error(root, "no <road>"));
        }
        let junctions =
            children(root, "junction").map(|n| junction(&source, n)).collect::<Result<_, _>>()?;
        let (objects, unsupported, ignored) = counts(&source, root);
        Ok(Self { name: name.into(), header, roads, junctions, objects, unsupported, ignored })
    }
}

/// Some tools put a licence comment before the XML declaration, which XML forbids. The declaration
/// is blanked there, so that lines keep their numbers.
fn without_late_declaration(text: &str) -> Cow<'_, str> {
    let begin = text.find("<?xml ").filter(|&i| {
        let before = text[..i].trim();
        i > 0 && (before.is_empty() || (before.starts_with("<!--") && before.ends_with("-->")))
    });
    let end = begin.and_then(|i| text[i..].find("?>").map(|n| i + n + 2));
    match (begin, end) {
        (Some(i), Some(end)) => {
            let blank = text[i..end].replace(|c: char| c != '\n', " ");
            Cow::Owned([&text[..i], &blank, &text[end..]].concat())
        }
        _ => Cow::Borrowed(text),
    }
}

fn header(source: &Source<'_>, root: Node<'_, '_>) -> Result<Header, RoadError> {
    let node = child(root, "header").ok_or_else(|| source.error(root, "no <header>"))?;
    let (major, minor) = (source.integer(node, "revMajor")?, source.integer(node, "revMinor")?);
    if major != 1 || !(1..=9).contains(&minor) {
        let why = format!("revision {major}.{minor}; 1.1 to 1.9 are read (written for 1.4 to 1.8)");
        return Err(source.error(node, why));
    }
    Ok(Header {
        rev_major: major as u32,
        rev_minor: minor as u32,
        name: node.attribute("name").unwrap_or("").into(),
        geo_reference: geo_reference(source, node)?,
    })
}

/// The header's projection and the offset of the map in it.
fn geo_reference(source: &Source<'_>, header: Node<'_, '_>) -> Result<GeoReference, RoadError> {
    let text = child(header, "geoReference").and_then(|g| g.text()).unwrap_or("");
    let mut geo = GeoReference { projection: text.trim().into(), ..GeoReference::default() };
    if let Some(node) = child(header, "offset") {
        geo.offset_m =
            [source.number(node, "x")?, source.number(node, "y")?, source.number(node, "z")?];
        geo.offset_heading_rad = source.number(node, "hdg")?;
    }
    Ok(geo)
}

fn road(source: &Source<'_>, node: Node<'_, '_>) -> Result<RoadRecord, RoadError> {
    let length_m = source.length(node, "length")?;
    if length_m > MAX_ROAD_M {
        return Err(source.error(node, format!("length = {length_m}, at most {MAX_ROAD_M} m")));
    }
    let plan = plan(source, node)?;
    let elevation = profile(source, node, "elevationProfile", "elevation")?;
    let bank = profile(source, node, "lateralProfile", "superelevation")?;
    let lanes = child(node, "lanes").ok_or_else(|| source.error(node, "no <lanes>"))?;
    let lane_offset = cubics(source, lanes, "laneOffset", "s")?;
    let sections = read_lanes::sections(source, lanes, length_m)?;
    let link = child(node, "link");
    let end = |name| match link.and_then(|l| child(l, name)) {
        Some(n) => road_link(source, n),
        None => Ok(None),
    };
    let mut types = Vec::new();
    let mut speed_limits = Vec::new();
    for n in children(node, "type") {
        let s = source.length(n, "s")?;
        types.push((s, n.attribute("type").unwrap_or("unknown").to_string()));
        let speed = child(n, "speed").map(|v| read_lanes::speed_m_s(source, v)).transpose()?;
        // A type without a limit ends the one before it.
        speed_limits.push((s, speed.unwrap_or(f64::INFINITY)));
    }
    if speed_limits.iter().all(|l| l.1 == f64::INFINITY) {
        speed_limits.clear();
    }
    Ok(RoadRecord {
        id: source.text(node, "id")?.into(),
        name: node.attribute("name").unwrap_or("").into(),
        file_line: source.line(node),
        length_m,
        junction: node.attribute("junction").filter(|j| !matches!(*j, "-1" | "")).map(Into::into),
        left_hand: node.attribute("rule") == Some("LHT"),
        predecessor: end("predecessor")?,
        successor: end("successor")?,
        line: bake(&plan, elevation, bank),
        plan,
        lane_offset,
        sections,
        speed_limits,
        types,
        objects: tunnels(source, node)?,
    })
}

/// Bakes the plan view so that each element begins at its stated station.
fn bake(plan: &[Placed], elevation: Cubics, bank: Cubics) -> Line {
    let mut baker = Baker::default();
    for (i, e) in plan.iter().enumerate() {
        let to_next = plan.get(i + 1).map_or(e.length_m, |n| n.s_m - baker.length_m());
        let rounding = (to_next - e.length_m).abs() < 0.01 && to_next > 0.0;
        baker.push(if rounding { to_next } else { e.length_m }, &|ds| e.at(ds));
    }
    baker.finish_at(plan.first(), elevation, bank)
}

fn plan(source: &Source<'_>, node: Node<'_, '_>) -> Result<Vec<Placed>, RoadError> {
    let view = child(node, "planView").ok_or_else(|| source.error(node, "no <planView>"))?;
    let mut out: Vec<Placed> = Vec::new();
    for g in children(view, "geometry") {
        let placed = Placed {
            s_m: source.number(g, "s")?,
            x_m: source.number(g, "x")?,
            y_m: source.number(g, "y")?,
            heading_rad: source.number(g, "hdg")?,
            length_m: source.length(g, "length")?,
            shape: Shape::Line,
        };
        if placed.length_m > MAX_ROAD_M {
            return Err(source.error(g, format!("length = {} m", placed.length_m)));
        }
        if out.last().is_some_and(|before| placed.s_m < before.s_m - 1e-3) {
            return Err(source.error(g, format!("s = {} goes back", placed.s_m)));
        }
        let shape = shape(source, g, placed.length_m)?;
        if placed.length_m > 1e-6 {
            let placed = Placed { shape, ..placed };
            if let Some(curve_m) = placed.odd_length_m() {
                let why =
                    format!("length = {}, but the curve is {curve_m} m long", placed.length_m);
                return Err(source.error(g, why));
            }
            out.push(placed);
        }
    }
    if out.is_empty() {
        return Err(source.error(view, "no <geometry> with a length"));
    }
    Ok(out)
}

fn shape(source: &Source<'_>, g: Node<'_, '_>, length_m: f64) -> Result<Shape, RoadError> {
    let node = g.children().find(|c| {
        matches!(c.tag_name().name(), "line" | "arc" | "spiral" | "poly3" | "paramPoly3")
    });
    let node = node.ok_or_else(|| {
        source.error(g, "needs one of <line>, <arc>, <spiral>, <poly3>, <paramPoly3>")
    })?;
    let turn = |k: f64| {
        if (k * length_m).abs() > MAX_TURN_RAD {
            return Err(source.error(node, format!("curvature {k} over {length_m} m")));
        }
        Ok(k)
    };
    Ok(match node.tag_name().name() {
        "arc" => Shape::Arc { curvature_1_m: turn(source.number(node, "curvature")?)? },
        "spiral" => Shape::Spiral {
            start_1_m: turn(source.number(node, "curvStart")?)?,
            end_1_m: turn(source.number(node, "curvEnd")?)?,
        },
        "poly3" => Shape::Poly3 { v: source.cubic(node, "")? },
        "paramPoly3" => Shape::ParamPoly3 {
            u: source.cubic(node, "U")?,
            v: source.cubic(node, "V")?,
            normalized: match node.attribute("pRange") {
                Some("arcLength") => false,
                Some("normalized") | None => true,
                Some(other) => {
                    let why = format!("pRange = {other:?}, arcLength or normalized is needed");
                    return Err(source.error(node, why));
                }
            },
        },
        _ => Shape::Line,
    })
}

fn profile(
    source: &Source<'_>,
    road: Node<'_, '_>,
    group: &str,
    record: &str,
) -> Result<Cubics, RoadError> {
    child(road, group).map_or(Ok(Cubics::default()), |n| cubics(source, n, record, "s"))
}

/// The records of one name under a node as a piecewise cubic.
pub(super) fn cubics(
    source: &Source<'_>,
    node: Node<'_, '_>,
    record: &str,
    station: &str,
) -> Result<Cubics, RoadError> {
    let mut pieces: Vec<(f64, [f64; 4])> = Vec::new();
    for n in children(node, record) {
        let s = source.number(n, station)?;
        if pieces.last().is_some_and(|p| s < p.0) {
            return Err(source.error(n, format!("{station} = {s} goes back")));
        }
        pieces.push((s, source.cubic(n, "")?));
    }
    Ok(Cubics::from_pieces(&pieces))
}

fn road_link(source: &Source<'_>, node: Node<'_, '_>) -> Result<Option<Link>, RoadError> {
    let id = source.text(node, "elementId")?.to_string();
    match node.attribute("elementType") {
        Some("junction") => Ok(Some(Link::Junction { id })),
        Some("road") | None => {
            let contact = match node.attribute("contactPoint") {
                Some("start") => Contact::Start,
                Some("end") => Contact::End,
                // 1.6 gives elementS and elementDir for virtual junctions; such a link ends a route.
                _ => return Ok(None),
            };
            Ok(Some(Link::Road { id, contact }))
        }
        Some(other) => Err(source.error(node, format!("elementType = {other:?}"))),
    }
}

fn tunnels(source: &Source<'_>, road: Node<'_, '_>) -> Result<Vec<RoadObject>, RoadError> {
    let Some(objects) = child(road, "objects") else { return Ok(Vec::new()) };
    let found = objects.children().filter(|n| matches!(n.tag_name().name(), "tunnel" | "bridge"));
    found
        .map(|n| {
            let s_start_m = source.length(n, "s")?;
            Ok(RoadObject {
                kind: n.tag_name().name().into(),
                name: n.attribute("name").unwrap_or("").into(),
                s_start_m,
                s_end_m: s_start_m + source.length(n, "length")?,
            })
        })
        .collect()
}

fn junction(source: &Source<'_>, node: Node<'_, '_>) -> Result<Junction, RoadError> {
    let direct = node.attribute("type") == Some("direct");
    let mut connections = Vec::new();
    for n in children(node, "connection") {
        let key = if n.has_attribute("linkedRoad") { "linkedRoad" } else { "connectingRoad" };
        // Virtual connections carry neither; they do not lead anywhere else.
        let (Some(incoming), Some(connecting)) = (n.attribute("incomingRoad"), n.attribute(key))
        else {
            continue;
        };
        let contact = match n.attribute("contactPoint") {
            Some("end") => Contact::End,
            Some("start") | None => Contact::Start,
            Some(other) => return Err(source.error(n, format!("contactPoint = {other:?}"))),
        };
        let lane_links = children(n, "laneLink")
            .map(|l| Ok((source.integer(l, "from")?, source.integer(l, "to")?)))
            .collect::<Result<_, RoadError>>()?;
        connections.push(Connection {
            incoming_road: incoming.into(),
            connecting_road: connecting.into(),
            contact,
            lane_links,
        });
    }
    Ok(Junction {
        id: source.text(node, "id")?.into(),
        name: node.attribute("name").unwrap_or("").into(),
        direct,
        file_line: source.line(node),
        connections,
    })
}
