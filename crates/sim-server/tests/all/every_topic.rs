//! Every topic that the recording knows is in a run's file and in one made of a torn file.

use std::collections::BTreeMap;
use std::path::Path;

use crate::support::server;
use recording::TOPICS;

/// Messages of each topic; one that is only opened has none.
fn messages_by_topic(file: &Path) -> BTreeMap<String, usize> {
    let bytes = std::fs::read(file).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let channels = summary.channels.values().map(|channel| (channel.topic.clone(), 0));
    let mut counts: BTreeMap<String, usize> = channels.collect();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        *counts.get_mut(&message.unwrap().channel.topic).unwrap() += 1;
    }
    counts
}

/// A topic that is added to the recording and that a run does not write, or `recover` does not
/// keep, fails here.
#[test]
fn a_run_writes_and_recover_keeps_every_topic() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let run = ["run", "--headless", "--vehicle", "bus", "--duration", "5", "--out"];
    assert!(server(&[&run[..], &[out.to_str().unwrap()]].concat()).status.success());
    // Nobody changes this run under way: tests/all/changed_run.rs
    let names = TOPICS.iter().map(|topic| topic.name).filter(|name| *name != "/stack/change");
    let mut expected: Vec<&str> = names.collect();
    expected.extend(["/can/bus/frames", "/can/bus/ticks"]);
    expected.sort_unstable();
    let whole = out.join("run.mcap");
    let bytes = std::fs::read(&whole).unwrap();
    let torn = out.join("torn.mcap");
    std::fs::write(&torn, &bytes[..bytes.len() * 3 / 4]).unwrap();
    assert!(server(&["recover", torn.to_str().unwrap()]).status.success());
    for file in [whole, out.join("torn.recovered.mcap")] {
        let mut counts = messages_by_topic(&file);
        counts.remove("/stack/change");
        assert_eq!(counts.keys().map(String::as_str).collect::<Vec<_>>(), expected);
        for (topic, count) in counts {
            assert!(count > 0, "{}: nothing on {topic}", file.display());
        }
    }
}
