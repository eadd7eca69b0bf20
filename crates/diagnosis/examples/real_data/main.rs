//! Studies of measured data that the project did not make: one command per data set.
//!
//! `real_data SET DIR [OUT]`, SET one of `findings`, `ostfalia`, `isuzu`, `vt_ucr`, `revs`,
//! `bosch`. DIR is the data folder (or one file of it); pictures and figures go to OUT, if given.
//! `findings` reads any folder of measured drives. What the data can and cannot decide is written
//! in docs/real-data.md.
#![expect(clippy::disallowed_macros, reason = "an example prints")]

mod ostfalia;
mod plot;
mod table;

use std::path::{Path, PathBuf};

type Outcome = Result<(), Box<dyn std::error::Error>>;

fn main() -> Outcome {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [set, dir, rest @ ..] = arguments.as_slice() else {
        return Err("usage: real_data findings|ostfalia|isuzu|vt_ucr|revs|bosch DIR [OUT]".into());
    };
    let dir = Path::new(dir);
    let out = rest.first().map(PathBuf::from);
    if let Some(out) = &out {
        std::fs::create_dir_all(out)?;
    }
    match set.as_str() {
        "findings" => findings(dir),
        "ostfalia" => ostfalia::study(dir, out.as_deref()),
        other => Err(format!("{other:?} is no data set of this program").into()),
    }
}

/// Defects of any folder of measured drives.
fn findings(dir: &Path) -> Outcome {
    let set = diagnosis::read_drives(dir)?;
    for f in &set.findings {
        println!("{}", serde_json::to_string(f)?);
    }
    println!("{} drives, {} findings", set.drives.len(), set.findings.len());
    Ok(())
}
