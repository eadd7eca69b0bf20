//! The corpus of the fuzz targets and arbitrary bytes, a bounded number of each.

use crate::fuzzed;
use proptest::prelude::*;

/// Runs a target on the files that belong to it.
fn corpus(name: &str, target: fn(&[u8])) {
    let folder = format!("{}/fuzz/corpus/{name}", env!("CARGO_MANIFEST_DIR"));
    let mut files = 0;
    for entry in std::fs::read_dir(&folder).unwrap() {
        target(&std::fs::read(entry.unwrap().path()).unwrap());
        files += 1;
    }
    assert!(files > 0, "{folder} is empty");
}

#[test]
fn the_corpus_of_every_target_runs() {
    corpus("frames", fuzzed::frames);
    corpus("messages", fuzzed::messages);
    corpus("candump", fuzzed::candump);
    corpus("socketcand", fuzzed::socketcand);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_bytes_run(data in prop::collection::vec(any::<u8>(), 0..2_000)) {
        fuzzed::frames(&data);
        fuzzed::messages(&data);
        fuzzed::candump(&data);
        fuzzed::socketcand(&data);
    }
}
