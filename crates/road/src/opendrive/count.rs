//! Counts objects, signals and elements that are not read.

use std::collections::BTreeMap;

use roxmltree::Node;

use super::xml::Source;

/// Elements that would change the surface or the lanes and are not read.
const UNSUPPORTED: [&str; 8] = [
    "shape",
    "crossfall",
    "height",
    "CRG",
    "include",
    "crossSectionSurface",
    "elevationGrid",
    "virtualConnection",
];
/// Elements that are read.
const READ: [&str; 37] = [
    "OpenDRIVE",
    "header",
    "geoReference",
    "offset",
    "road",
    "link",
    "predecessor",
    "successor",
    "type",
    "speed",
    "planView",
    "geometry",
    "line",
    "arc",
    "spiral",
    "poly3",
    "paramPoly3",
    "elevationProfile",
    "elevation",
    "lateralProfile",
    "superelevation",
    "lanes",
    "laneOffset",
    "laneSection",
    "left",
    "center",
    "right",
    "lane",
    "width",
    "border",
    "objects",
    "tunnel",
    "bridge",
    "signals",
    "junction",
    "connection",
    "laneLink",
];

pub(super) type Counts = BTreeMap<String, (usize, u32)>;

/// Counts objects and signals by type, and elements that are not read.
pub(super) fn counts(
    source: &Source<'_>,
    root: Node<'_, '_>,
) -> (BTreeMap<String, usize>, Counts, Counts) {
    let (mut objects, mut unsupported, mut ignored) =
        (BTreeMap::new(), Counts::new(), Counts::new());
    for n in root.descendants().filter(Node::is_element) {
        let name = n.tag_name().name();
        if name == "object" || name == "signal" {
            let kind = n.attribute("type").filter(|t| !t.is_empty()).unwrap_or("unknown");
            *objects.entry(format!("{name}:{kind}")).or_insert(0) += 1;
        }
        let parent = n.parent_element().map_or("", |p| p.tag_name().name());
        let drawing = matches!(parent, "object" | "signal" | "roadMark" | "outline" | "repeat");
        if READ.contains(&name) && !drawing {
            continue;
        }
        let counter = if UNSUPPORTED.contains(&name)
            && matches!(
                parent,
                "lateralProfile" | "lane" | "surface" | "OpenDRIVE" | "junction" | "road"
            ) {
            &mut unsupported
        } else {
            &mut ignored
        };
        counter.entry(name.to_string()).or_insert_with(|| (0, source.line(n))).0 += 1;
    }
    (objects, unsupported, ignored)
}
