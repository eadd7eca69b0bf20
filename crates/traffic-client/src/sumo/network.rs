//! SUMO's private copy of the road: written by us, made by `netconvert`, read back, checked.
//!
//! Only the names and the plan view are taken from it. Height, bank and lane geometry stay ours.
//! The safe way from a SUMO lane to our lane track is its `origId` parameter.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::{Path, PathBuf};

use road::Road;

use super::error::SumoError;
use super::plain::plain;
use super::process::Programs;

/// Options of the import.
const OPTIONS: [&str; 8] = [
    "--offset.disable-normalization",
    "--precision",
    "4",
    "--no-turnarounds",
    "--junctions.limit-turn-speed",
    "-1",
    "--default.junctions.radius",
    "0",
];

/// One lane of the network.
#[derive(Debug, Clone, PartialEq)]
pub struct SumoLane {
    /// SUMO's id.
    pub id: String,
    /// Edge that it belongs to.
    pub edge: String,
    /// Index on the edge, 0 = rightmost.
    pub index: u32,
    /// Lane tracks that it stands for, by their index.
    pub original: Vec<String>,
    /// Length as SUMO uses it, m.
    pub length_m: f64,
    /// Speed limit, m/s.
    pub speed_m_s: f64,
    /// Width, m.
    pub width_m: f64,
    /// Centre line, map x and y, m.
    pub shape_m: Vec<[f64; 2]>,
}

/// The network as far as it is needed.
#[derive(Debug, Clone, PartialEq)]
pub struct Network {
    /// The file that SUMO loads.
    pub file: PathBuf,
    /// Lanes of all edges, internal ones left out.
    pub lanes: Vec<SumoLane>,
    /// Edges that an edge leads to.
    pub next: BTreeMap<String, BTreeSet<String>>,
}

/// Brings a road into SUMO: writes plain files into `folder`, with edges cut at these further
/// stations, runs netconvert with these further options, reads the result.
///
/// # Errors
/// [`SumoError::NetConvert`] with its words, [`SumoError::Map`] if its output is unusable,
/// [`SumoError::File`].
pub fn convert(
    programs: &Programs,
    road: &Road,
    folder: &Path,
    further_cuts_m: &[f64],
    options: &[String],
) -> Result<Network, SumoError> {
    let text = plain(road, further_cuts_m);
    let write = |name: &str, text: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(|e| file_error(&path, &e)).map(|()| path)
    };
    let net = &folder.join("road.net.xml");
    let out = programs
        .command(&programs.netconvert)
        .arg("--node-files")
        .arg(write("road.nod.xml", &text.nodes)?)
        .arg("--edge-files")
        .arg(write("road.edg.xml", &text.edges)?)
        .arg("--connection-files")
        .arg(write("road.con.xml", &text.connections)?)
        .arg("-o")
        .arg(net)
        .args(OPTIONS)
        .args(options)
        .output()
        .map_err(|e| SumoError::NetConvert {
            exit: "not started".to_owned(),
            stderr: format!("{}: {e}", programs.netconvert.display()),
        })?;
    if !out.status.success() {
        let text = String::from_utf8_lossy(&out.stderr);
        let lines = text.lines().filter(|line| !line.contains("proj.db"));
        let stderr = lines.take(8).collect::<Vec<_>>().join(" | ");
        return Err(SumoError::NetConvert { exit: out.status.to_string(), stderr });
    }
    let text = std::fs::read_to_string(net).map_err(|e| file_error(net, &e))?;
    read(&text, net)
}

/// A file error in this crate's terms.
pub(crate) fn file_error(path: &Path, e: &std::io::Error) -> SumoError {
    SumoError::File { path: path.display().to_string(), why: e.to_string() }
}

/// Reads a network. SUMO crashes on a malformed one, so this also is the check before it starts.
///
/// # Errors
/// [`SumoError::Map`] names what is missing.
pub fn read(text: &str, file: &Path) -> Result<Network, SumoError> {
    let bad = |why: String| SumoError::Map { why };
    let document = road::xml::parse(text).map_err(|e| bad(e.to_string()))?;
    let mut network = Network { file: file.to_owned(), lanes: Vec::new(), next: BTreeMap::new() };
    for node in document.root_element().children() {
        match node.tag_name().name() {
            "location"
                if node
                    .attribute("netOffset")
                    .is_some_and(|o| o != "0.0000,0.0000" && o != "0.00,0.00") =>
            {
                return Err(bad(format!(
                    "netOffset {:?} is not zero",
                    node.attribute("netOffset")
                )));
            }
            "edge" if node.attribute("function") != Some("internal") => {
                let edge = node.attribute("id").ok_or_else(|| bad("edge without id".to_owned()))?;
                network.next.entry(edge.to_owned()).or_default();
                for lane in node.children().filter(|n| n.has_tag_name("lane")) {
                    network.lanes.push(read_lane(edge, lane)?);
                }
            }
            "connection" => {
                if let (Some(from), Some(to)) = (node.attribute("from"), node.attribute("to"))
                    && !from.starts_with(':')
                    && !to.starts_with(':')
                {
                    network.next.entry(from.to_owned()).or_default().insert(to.to_owned());
                }
            }
            _ => {}
        }
    }
    if network.lanes.is_empty() {
        return Err(bad("no lanes in the network".to_owned()));
    }
    Ok(network)
}

fn read_lane(edge: &str, node: roxmltree::Node<'_, '_>) -> Result<SumoLane, SumoError> {
    let id = node.attribute("id").unwrap_or_default().to_owned();
    let bad = |what: &str| SumoError::Map { why: format!("lane `{id}`: {what}") };
    let number = |name: &str| node.attribute(name).and_then(|x| x.parse::<f64>().ok());
    let shape = node.attribute("shape").ok_or_else(|| bad("no shape"))?;
    let shape_m = shape
        .split_whitespace()
        .map(|point| {
            let mut xyz = point.split(',').map(str::parse::<f64>);
            match (xyz.next(), xyz.next()) {
                (Some(Ok(x)), Some(Ok(y))) if x.is_finite() && y.is_finite() => Ok([x, y]),
                _ => Err(bad(&format!("shape point `{point}`"))),
            }
        })
        .collect::<Result<Vec<_>, _>>()?;
    let original = node
        .children()
        .find(|n| n.has_tag_name("param") && n.attribute("key") == Some("origId"))
        .and_then(|n| n.attribute("value"))
        .map(|list| list.split_whitespace().map(str::to_owned).collect())
        .unwrap_or_default();
    Ok(SumoLane {
        edge: edge.to_owned(),
        index: node
            .attribute("index")
            .and_then(|x| x.parse().ok())
            .ok_or_else(|| bad("no index"))?,
        original,
        length_m: number("length").filter(|x| *x > 0.0).ok_or_else(|| bad("no length"))?,
        speed_m_s: number("speed").ok_or_else(|| bad("no speed"))?,
        width_m: number("width").unwrap_or(3.2),
        shape_m,
        id: id.clone(),
    })
}

impl SumoLane {
    /// Whether it stands for a lane track.
    #[must_use]
    pub fn is_of(&self, track: u16) -> bool {
        self.original.iter().any(|id| id.parse() == Ok(track))
    }

    /// Stations of its ends, m, on the road that it was made of.
    #[must_use]
    pub fn stretch_m(&self, road: &Road) -> Option<(f64, f64)> {
        let at = |point: Option<&[f64; 2]>| point.and_then(|p| road.project(p[0], p[1], None));
        Some((at(self.shape_m.first())?.s_m, at(self.shape_m.last())?.s_m))
    }
}

impl Network {
    /// Edges that nothing leads to.
    #[must_use]
    pub fn entries(&self) -> Vec<&str> {
        let reached: BTreeSet<&str> = self.next.values().flatten().map(String::as_str).collect();
        self.next.keys().map(String::as_str).filter(|edge| !reached.contains(edge)).collect()
    }

    /// The shortest chain of edges from one to each edge that leads nowhere.
    #[must_use]
    pub fn routes_from(&self, entry: &str) -> Vec<Vec<String>> {
        let mut before: BTreeMap<&str, &str> = BTreeMap::new();
        let mut queue: VecDeque<&str> =
            self.next.get_key_value(entry).map(|(k, _)| k.as_str()).into_iter().collect();
        let mut seen: BTreeSet<&str> = queue.iter().copied().collect();
        let mut routes = Vec::new();
        while let Some(edge) = queue.pop_front() {
            let next = self.next.get(edge);
            if next.is_none_or(BTreeSet::is_empty) {
                let mut route = vec![edge.to_owned()];
                let mut at = edge;
                while let Some(&previous) = before.get(at) {
                    route.push(previous.to_owned());
                    at = previous;
                }
                route.reverse();
                routes.push(route);
            }
            for to in next.into_iter().flatten() {
                if seen.insert(to) {
                    before.insert(to, edge);
                    queue.push_back(to);
                }
            }
        }
        routes
    }

    /// Lanes of an edge, rightmost first.
    pub fn lanes_of<'a>(&'a self, edge: &'a str) -> impl Iterator<Item = &'a SumoLane> {
        self.lanes.iter().filter(move |lane| lane.edge == edge)
    }

    /// Length of a route, m.
    #[must_use]
    pub fn route_length_m(&self, route: &[String]) -> f64 {
        route.iter().filter_map(|edge| self.lanes_of(edge).next()).map(|lane| lane.length_m).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NET: &str = r#"<net><location netOffset="0.0000,0.0000"/>
<edge id=":j" function="internal"><lane id=":j_0" index="0" speed="1" length="1" shape="0,0 1,1"/></edge>
<edge id="a"><lane id="a_0" index="0" speed="25" length="100" width="3.75" shape="0,0 100,0">
<param key="origId" value="1_-2 1_-1"/></lane></edge>
<edge id="b"><lane id="b_0" index="0" speed="25" length="50" shape="100,0,2 150,0,2"/></edge>
<edge id="c"><lane id="c_0" index="0" speed="25" length="50" shape="100,0 150,-9"/></edge>
<connection from="a" to="b" fromLane="0" toLane="0"/><connection from="a" to="c" fromLane="0" toLane="0"/></net>"#;

    #[test]
    fn lanes_names_and_routes_come_out_of_a_network() {
        let net = read(NET, Path::new("x.net.xml")).unwrap();
        assert_eq!(net.lanes.len(), 3);
        assert_eq!(net.lanes[0].original, ["1_-2", "1_-1"]);
        assert_eq!(net.lanes[1].shape_m, [[100.0, 0.0], [150.0, 0.0]]);
        assert_eq!(net.entries(), ["a"]);
        assert_eq!(net.routes_from("a"), [["a", "b"], ["a", "c"]]);
        assert_eq!(net.route_length_m(&["a".to_owned(), "b".to_owned()]), 150.0);
    }

    #[test]
    fn a_malformed_network_is_named_before_sumo_can_crash_on_it() {
        // The story: with a malformed network SUMO opens its port, accepts, and dies of a
        // segmentation fault without a word.
        let e = |text: &str| read(text, Path::new("x")).unwrap_err().to_string();
        assert!(e("<net><edge").contains("map for SUMO"));
        assert!(e("<net/>").contains("no lanes"));
        assert!(e(&NET.replace("100,0,2", "nan,0")).contains("b_0"));
        assert!(e(&NET.replace("0.0000,0.0000", "5,0")).contains("netOffset"));
    }
}
