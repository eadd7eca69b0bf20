//! Measured data that the project did not make, one command per data set: as drives for `sim-server
//! identify` (`isuzu`) and `diagnose` (`vt_ucr`), or studied here, for want of drives.
//!
//! `real_data SET DIR [OUT [TRUCK.toml]]`, SET one of `findings`, `ostfalia`, `isuzu`, `vt_ucr`,
//! `revs`, `bosch`. DIR is the data folder (or one file of it); drives go to OUT/drives with the truck
//! file OUT/truck.toml beside them, pictures to OUT. TRUCK.toml is the truck file or overlay of the
//! vehicle; without it the one beside this program is taken. `findings` reads any folder of measured
//! drives. What the data can and cannot decide is written in docs/real-data.md.
#![expect(clippy::disallowed_macros, reason = "an example prints")]

mod bosch;
mod drives;
mod isuzu;
mod ostfalia;
mod plot;
mod revs;
mod table;
mod vt_ucr;

use std::path::{Path, PathBuf};

use dynamics::{Overlay, TruckParameters};

type Outcome<T = ()> = Result<T, Box<dyn std::error::Error>>;

fn main() -> Outcome {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [set, dir, rest @ ..] = arguments.as_slice() else {
        return Err(
            "usage: real_data findings|bosch|ostfalia|isuzu|vt_ucr|revs DIR [OUT [TRUCK.toml]]"
                .into(),
        );
    };
    let dir = Path::new(dir);
    let out = rest.first().map(PathBuf::from);
    if let Some(out) = &out {
        std::fs::create_dir_all(out)?;
    }
    let out = out.as_deref();
    match set.as_str() {
        "findings" => findings(dir),
        "bosch" => bosch::study(dir).map(drop),
        "isuzu" => prepared(rest, include_str!("trucks/isuzu_npr.toml"), |out, truck| {
            isuzu::prepare(dir, out, truck)
        }),
        "revs" => {
            revs::study(dir, out, &truck(rest, include_str!("trucks/ferrari250lm.toml"))?).map(drop)
        }
        "vt_ucr" => prepared(rest, include_str!("trucks/vt_ucr.toml"), |out, truck| {
            vt_ucr::prepare(dir, out, truck)
        }),
        "ostfalia" => ostfalia::study(dir, out).map(drop),
        other => Err(format!("{other:?} is no data set of this program").into()),
    }
}

/// The vehicle: the file that was named, or the one that comes with the data set.
fn truck(rest: &[String], own: &str) -> Result<TruckParameters, Box<dyn std::error::Error>> {
    if let Some(file) = rest.get(1) {
        return Ok(TruckParameters::load(file)?);
    }
    vehicle(own)
}

/// A truck file or an overlay on a built-in truck.
fn vehicle(text: &str) -> Result<TruckParameters, Box<dyn std::error::Error>> {
    match toml::from_str::<Overlay>(text) {
        Ok(overlay) => Ok(TruckParameters::load(&overlay.base)?.with_overlay(&overlay)?),
        Err(_) => Ok(TruckParameters::from_toml_str("truck", text)?),
    }
}

/// Writes drives into `OUT/drives` and their truck file beside them.
fn prepared(
    rest: &[String],
    own: &str,
    prepare: impl Fn(&Path, &TruckParameters) -> Outcome,
) -> Outcome {
    let out = Path::new(rest.first().ok_or("this data set becomes drives: name a folder, OUT")?);
    prepare(&out.join("drives"), &truck(rest, own)?)?;
    if rest.get(1).is_none() {
        std::fs::write(out.join("truck.toml"), own)?;
    }
    Ok(())
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
