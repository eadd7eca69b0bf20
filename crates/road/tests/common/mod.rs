//! Where the maps lie that are used but not distributed with the project.

use std::path::PathBuf;

/// (name, path) of the OpenDRIVE maps beside the workspace; empty, with a note, if there are none.
#[expect(clippy::disallowed_macros, reason = "a skipped test says so")]
pub(crate) fn maps() -> Vec<(String, String)> {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let folders = [
        "../../../shared/data/opendrive_maps",
        "../../shared/data/opendrive_maps",
        "../../../../shared/data/opendrive_maps",
    ];
    let found = folders.iter().find_map(|f| std::fs::read_dir(root.join(f)).ok());
    let Some(entries) = found else {
        println!("skipped: no ../shared/data/opendrive_maps beside the workspace");
        return Vec::new();
    };
    let mut out: Vec<(String, String)> = entries
        .filter_map(Result::ok)
        .map(|e| e.path())
        .filter(|p| p.extension().is_some_and(|e| e == "xodr"))
        .map(|p| {
            (
                p.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
                p.to_string_lossy().into_owned(),
            )
        })
        .collect();
    out.sort();
    out
}
