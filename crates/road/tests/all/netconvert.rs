//! SUMO's netconvert, where it is installed, reads what the writer writes: an independent reader
//! puts the lanes where the road has them.
#![expect(clippy::disallowed_macros, reason = "a skipped test says so")]
#![expect(clippy::unwrap_used, reason = "a test may fail")]

use std::path::{Path, PathBuf};
use std::process::Command;

use road::{LaneKind, Road, builtin};

const OPTIONS: [&str; 6] = [
    "--opendrive.curve-resolution=2",
    "--offset.disable-normalization",
    "--output.original-names",
    "--precision=6",
    "--no-turnarounds",
    "--opendrive.internal-shapes",
];

/// SUMO 1.15 lacks it, 1.28 has it: lanes end where the map says, and not where netconvert's junctions begin.
const ENDPOINT_SHAPE: &str = "--junctions.endpoint-shape";

/// Shapes of the lanes of the network file: points x, y, z.
fn lanes(net: &str) -> Vec<Vec<[f64; 3]>> {
    let doc = roxmltree::Document::parse(net).unwrap();
    let normal =
        doc.descendants().filter(|n| n.has_tag_name("edge") && !n.has_attribute("function"));
    normal
        .flat_map(|e| e.children().filter(|n| n.has_tag_name("lane")))
        .map(|lane| {
            let number = |v: &str| v.parse::<f64>().unwrap();
            let point = |p: &str| {
                let v: Vec<f64> = p.split(',').map(number).collect();
                [v[0], v[1], v.get(2).copied().unwrap_or(0.0)]
            };
            lane.attribute("shape").unwrap().split_whitespace().map(point).collect()
        })
        .collect()
}

/// The program beside the SUMO that the tests use, else the one on the path.
fn netconvert() -> PathBuf {
    let beside =
        std::env::var_os("SUMO_BINARY").map(|sumo| Path::new(&sumo).with_file_name("netconvert"));
    beside.filter(|p| p.exists()).unwrap_or_else(|| "netconvert".into())
}

/// Largest distance of netconvert's through lanes from ours across and in height, m, and how many
/// lanes it made.
fn compare(road: &Road) -> Option<(f64, f64, usize)> {
    let folder = std::env::temp_dir().join(format!(
        "road-netconvert-{}-{}",
        road.name(),
        std::process::id()
    ));
    std::fs::create_dir_all(&folder).unwrap();
    let (map, net) = (folder.join("map.xodr"), folder.join("map.net.xml"));
    std::fs::write(&map, road.write_opendrive()).unwrap();
    let Ok(help) = Command::new(netconvert()).arg("--help").output() else {
        println!("skipped: netconvert is neither beside SUMO_BINARY nor on the path");
        return None;
    };
    let knows_it = String::from_utf8_lossy(&help.stdout).contains(ENDPOINT_SHAPE);
    let output = Command::new(netconvert())
        .arg("--opendrive-files")
        .arg(&map)
        .arg("-o")
        .arg(&net)
        .args(OPTIONS)
        .args(knows_it.then_some(ENDPOINT_SHAPE))
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    if said.contains("could not be loaded from 'built in type map'") {
        std::fs::remove_dir_all(&folder).unwrap();
        println!("skipped: SUMO's data (its type maps) are not installed: {}", said.trim());
        return None;
    }
    assert!(output.status.success(), "{said}");
    let lanes = lanes(&std::fs::read_to_string(&net).unwrap());
    std::fs::remove_dir_all(&folder).unwrap();
    let (mut across, mut height) = (0.0_f64, 0.0_f64);
    for shape in &lanes {
        for [x, y, z] in shape {
            let at = road.project(*x, *y, None).unwrap();
            let lanes = || road.lanes_at(at.s_m).filter(|l| l.kind != LaneKind::Shoulder);
            // netconvert lays a ramp beside the through lanes without the space between, and joins
            // lanes where their number changes over some metres.
            let ramp = lanes().any(|l| l.kind != LaneKind::Driving);
            let joint = road.section_starts_m().any(|s| s > 0.0 && (s - at.s_m).abs() < 20.0);
            if !ramp && !joint {
                let centres = lanes().map(|l| (l.center_d_m(at.s_m) - at.d_m).abs());
                across = across.max(centres.fold(f64::MAX, f64::min));
            }
            // netconvert leaves bank out (the reference line's height for all lanes), and moves the
            // ends of lanes along the slope where it joins them.
            if !joint {
                height = height.max((road.at(at.s_m, 0.0).z_m - z).abs());
            }
        }
    }
    Some((across, height, lanes.len()))
}

#[test]
fn netconvert_puts_the_lanes_of_the_built_in_roads_where_they_are() {
    for road in [builtin::flat(2_000.0), builtin::test_site(), builtin::highway()] {
        let Some((across, height, count)) = compare(&road) else { return };
        println!("{}: {count} lanes, across {across:.4} m, height {height:.4} m", road.name());
        assert!(count >= 2 && across < 0.02 && height < 0.02);
    }
}
