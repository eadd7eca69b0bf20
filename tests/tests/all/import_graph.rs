//! Who may import whom: the drawing in ARCHITECTURE.md, checked against `cargo metadata`.

use std::collections::{BTreeMap, BTreeSet};

/// For each crate of the workspace the crates of the workspace that it may link.
fn allowed() -> BTreeMap<&'static str, Vec<&'static str>> {
    let plant = vec![
        "tractrix-core",
        "road",
        "driver-models",
        "dynamics",
        "planner",
        "traffic-client",
        "tractrix-j1939",
    ];
    BTreeMap::from([
        ("tractrix-core", vec![]),
        ("road", vec!["tractrix-core"]),
        ("dynamics", vec!["tractrix-core", "road"]),
        ("driver-models", vec![]),
        ("planner", vec!["tractrix-core", "road", "driver-models"]),
        ("traffic-client", vec!["tractrix-core", "road", "driver-models"]),
        ("tractrix-j1939", vec!["tractrix-core"]),
        ("recording", vec!["tractrix-core", "road"]),
        ("ros2", vec!["recording"]),
        ("sim", plant.clone()),
        ("diagnosis", vec!["tractrix-core", "road", "dynamics", "tractrix-j1939"]),
        ("shell", vec!["diagnosis"]),
        ("truck-node", vec!["tractrix-core", "road", "planner", "tractrix-j1939", "recording"]),
        ("tractrix-python", [&plant[..], &["sim", "diagnosis", "shell"]].concat()),
        ("sim-server", [plant, vec!["sim", "diagnosis", "shell", "recording", "ros2"]].concat()),
    ])
}

/// Third-party crates that only one room may know.
const ONLY: [(&str, &[&str]); 8] = [
    ("tokio", &["sim-server"]),
    ("axum", &["sim-server"]),
    ("foxglove", &["sim-server"]),
    ("mcap", &["recording"]),
    ("ros2-client", &["ros2"]),
    ("pyo3", &["tractrix-python"]),
    ("clarabel", &["planner"]),
    ("socketcan", &["tractrix-j1939"]),
];

#[test]
fn the_import_graph_is_the_one_of_architecture_md() {
    let metadata = cargo_metadata::MetadataCommand::new().no_deps().exec().unwrap();
    let members: BTreeSet<_> = metadata.packages.iter().map(|p| p.name.to_string()).collect();
    let allowed = allowed();
    let mut wrong = Vec::new();
    for package in &metadata.packages {
        let name = package.name.as_str();
        if name == "tractrix-tests" {
            continue;
        }
        let Some(may) = allowed.get(name) else {
            wrong.push(format!("{name} is not in the drawing"));
            continue;
        };
        for dependency in &package.dependencies {
            if dependency.kind != cargo_metadata::DependencyKind::Normal {
                continue;
            }
            let to = dependency.name.as_str();
            if members.contains(to) && !may.contains(&to) {
                wrong.push(format!("{name} imports {to}"));
            }
            if ONLY.iter().any(|(only, rooms)| *only == to && !rooms.contains(&name)) {
                wrong.push(format!("{name} links {to}, which is another room's"));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// Also through others: the program on the truck links neither the plant nor an async runtime.
#[test]
fn the_program_on_the_truck_is_without_simulation_and_tokio() {
    let metadata = cargo_metadata::MetadataCommand::new().exec().unwrap();
    let resolve = metadata.resolve.as_ref().unwrap();
    let name = |id: &cargo_metadata::PackageId| metadata[id].name.to_string();
    let mut linked = BTreeSet::new();
    let mut open: Vec<_> =
        metadata.packages.iter().filter(|p| p.name == "truck-node").map(|p| &p.id).collect();
    while let Some(id) = open.pop() {
        let node = resolve.nodes.iter().find(|node| node.id == *id).unwrap();
        for dependency in &node.deps {
            let kinds = &dependency.dep_kinds;
            let is_linked = kinds.iter().any(|k| k.kind == cargo_metadata::DependencyKind::Normal);
            if is_linked && linked.insert(name(&dependency.pkg)) {
                open.push(&dependency.pkg);
            }
        }
    }
    assert!(linked.contains("mcap") && linked.contains("planner"), "{linked:?}");
    for never in ["tokio", "axum", "sim", "dynamics", "traffic-client", "diagnosis", "pyo3"] {
        assert!(!linked.contains(never), "truck-node links {never}");
    }
}
