//! The studies of measured data, where these data lie beside the workspace.
#![expect(clippy::disallowed_macros, reason = "the studies print")]
#![allow(clippy::unwrap_used, reason = "helpers of tests")]

#[path = "../examples/real_data/bosch.rs"]
mod bosch;
#[path = "../examples/real_data/drives.rs"]
mod drives;
#[path = "../examples/real_data/isuzu.rs"]
mod isuzu;
#[path = "../examples/real_data/ostfalia.rs"]
mod ostfalia;
#[path = "../examples/real_data/plot.rs"]
mod plot;
#[path = "../examples/real_data/revs.rs"]
mod revs;
#[path = "../examples/real_data/table.rs"]
mod table;
#[path = "../examples/real_data/vt_ucr.rs"]
mod vt_ucr;

use std::path::{Path, PathBuf};

use diagnosis::identify::identify;
use diagnosis::{FindingKind, Options, Plant, Serial, Verdict, diagnose, read_drives};
use dynamics::{Overlay, TruckParameters};

type Outcome<T = ()> = Result<T, Box<dyn std::error::Error>>;

fn folder(name: &str) -> Option<PathBuf> {
    let dir = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(name);
    let dir = if dir.is_dir() {
        dir
    } else {
        PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../../shared/data").join(name)
    };
    if !dir.is_dir() {
        println!("skipped: {name} is not there; it may not be redistributed");
        return None;
    }
    Some(dir)
}

fn truck(overlay: &str) -> TruckParameters {
    let overlay: Overlay = toml::from_str(overlay).unwrap();
    TruckParameters::load(&overlay.base).unwrap().with_overlay(&overlay).unwrap()
}

#[test]
fn lost_rows_of_a_receiver_show_as_jumps_of_its_clock_of_their_size() {
    let Some(dir) = folder("ostfalia_car_harz") else { return };
    let (findings, tracks) = ostfalia::study(&dir, None).unwrap();
    // By its time of day the receiver keeps one lag on each trip.
    for (name, track) in tracks.iter().filter(|t| !t.0.ends_with("_rows")) {
        assert_eq!(track.stretches.len(), 1, "{name}");
        assert!(track.stretches[0].lag_s < -2.0, "{name}: the bus is late");
    }
    // By its rows, four and ten seconds are missing at 712 and 1274 s of one trip.
    let jumps: Vec<(f64, f64, f64)> = findings
        .iter()
        .filter(|f| f.drive == "Torfhaus_rows")
        .filter_map(|f| match f.kind {
            FindingKind::ClockJump { before_s, after_s, sigma_s, .. } => {
                Some((f.time_s?, before_s - after_s, sigma_s))
            }
            _ => None,
        })
        .collect();
    for (at, lost) in [(712.0, 4.0), (1274.0, 10.0)] {
        let found = jumps
            .iter()
            .any(|j| (j.0 - at).abs() < 10.0 && (j.1 - lost).abs() < (3.0 * j.2).max(0.5));
        assert!(found, "{lost} s at {at} s: {jumps:?}");
    }
}

/// Mass, drag area and rolling resistance of the FASTSim vehicle file, if there is one.
fn reference(dir: &Path) -> Option<[f64; 3]> {
    let text = std::fs::read_to_string(dir.join("vehicle_params_fastsim.csv")).ok()?;
    let value = |key: &str| {
        text.lines().find_map(|l| {
            let mut f = l.split(',').skip(1);
            (f.next() == Some(key)).then(|| f.next()?.parse::<f64>().ok()).flatten()
        })
    };
    Some([
        value("veh_override_kg")?,
        value("drag_coef")? * value("frontal_area_m2")?,
        value("wheel_rr_coef")?,
    ])
}

/// The coast-downs and the log through `identify`: every interval holds what NREL says.
#[test]
fn coast_downs_and_a_log_without_gears_give_the_road_load_within_its_intervals() {
    let Some(dir) = folder("isuzu_npr_nrel") else { return };
    let text = include_str!("../examples/real_data/trucks/isuzu_npr.toml");
    let truck = TruckParameters::from_toml_str("isuzu_npr", text).unwrap();
    let [mass_kg, drag_area, rolling] = reference(&dir).unwrap();
    let out = tempfile::tempdir().unwrap();
    isuzu::prepare(&dir, out.path(), &truck).unwrap();
    let found = identify(&truck, &read_drives(out.path()).unwrap(), &Serial).unwrap();
    for (path, true_value, most_frac) in [
        ("resistance.drag_area_m2", drag_area, 0.11),
        ("resistance.rolling_coeff", rolling, 0.05),
        ("instruments.mass_scale_coeff", mass_kg / 6590.0, 0.12),
    ] {
        let f = found.figures.iter().find(|f| f.path == path).unwrap();
        println!("{path}: {} +- {}, 90 % interval {:?}", f.value, f.sigma, f.interval_90);
        let z = (f.value - true_value) / f.sigma;
        assert!(z.abs() < 1.96 && f.sigma < most_frac * true_value, "{path}: {z} sigma, {f:?}");
    }
}

/// A truck whose fuel and CO2 disagree, without its engine's torque: both meters are rivals.
#[test]
fn fuel_and_carbon_of_a_truck_disagree_and_nothing_says_which_is_wrong() {
    let Some(dir) = folder("vt_ucr_hddt") else { return };
    let truck = truck(include_str!("../examples/real_data/trucks/vt_ucr.toml"));
    let out = tempfile::tempdir().unwrap();
    vt_ucr::prepare(&dir, out.path(), &truck).unwrap();
    let drives = read_drives(out.path()).unwrap();
    let plant = Plant::of_truck(&truck).unwrap();
    let options = Options::default();
    let found = diagnose(&plant, &drives, None, &options, &Serial, &mut |_| {}).unwrap();
    assert_eq!(found.verdict, Verdict::Ambiguous, "{:?}", found.causes);
    let mut ids: Vec<&str> = found.causes.iter().map(|c| c.id).collect();
    ids.extend(found.causes[0].confused_with.iter().map(|c| c.id));
    ids.sort_unstable();
    assert_eq!(ids, ["co2_scale", "fuel_flow_scale"]);
    let scale = found.causes[0].parameters["scale"];
    assert!(((scale.value - 1.0).abs() - 0.2).abs() < 0.06 && scale.sigma < 0.03, "{scale:?}");
    assert!(found.gain.unwrap().significant);
}

#[test]
fn rows_without_time_bound_the_mass_but_do_not_tell_38_from_49_t() {
    let Some(dir) = folder("bosch_truck_mass_slope") else { return };
    for (label, _, direct, reverse) in bosch::study(&dir).unwrap() {
        assert!(direct < label && label < reverse, "{label} t: {direct} to {reverse}");
    }
}

#[test]
fn a_saturating_tyre_halves_the_yaw_error_on_unseen_parts_of_a_race() {
    let Some(dir) = folder("revs_ferrari250lm") else { return };
    let truck = truck(include_str!("../examples/real_data/trucks/ferrari250lm.toml"));
    let (gain, low, _) = revs::study(&dir, None, &truck).unwrap();
    assert!(gain > 0.4 && low > 0.3, "{gain} {low}");
}
