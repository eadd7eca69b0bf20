//! The studies of measured data, where these data lie beside the workspace.
#![expect(clippy::disallowed_macros, reason = "the studies print")]
#![allow(clippy::unwrap_used, reason = "helpers of tests")]

#[path = "../examples/real_data/bosch.rs"]
mod bosch;
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

use std::path::PathBuf;

use diagnosis::FindingKind;
use diagnosis::coast_down::place;
use dynamics::effects::fuel::CO2_PER_FUEL;
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

#[test]
fn coast_downs_give_drag_and_rolling_resistance_within_their_intervals() {
    let Some(dir) = folder("isuzu_npr_nrel") else { return };
    let truck = truck(include_str!("../examples/real_data/trucks/isuzu_npr.toml"));
    let (fit, reference) = isuzu::study(&dir, None, &truck).unwrap();
    let [_, drag_area, rolling] = reference.unwrap();
    for (k, truth) in [(place::DRAG_AREA, drag_area), (place::ROLLING, rolling)] {
        let z = (fit.value[k] - truth) / fit.sigma(k);
        assert!(z.abs() < 1.96 && fit.sigma(k) < 0.2 * truth, "{k}: {z} sigma");
    }
}

#[test]
fn fuel_and_carbon_of_a_truck_disagree_with_load() {
    let Some(dir) = folder("vt_ucr_hddt") else { return };
    let truck = truck(include_str!("../examples/real_data/trucks/vt_ucr.toml"));
    for (bins, consumption) in vt_ucr::study(&dir, None, &truck).unwrap() {
        let (first, last) = (bins.first().unwrap(), bins.last().unwrap());
        assert!(first.ratio - last.ratio > 4.0 * first.sigma.hypot(last.sigma));
        assert!(last.ratio < CO2_PER_FUEL - 4.0 * last.sigma);
        let c = consumption.unwrap();
        assert!(c.fuel_g_kwh > 1.15 * c.carbon_g_kwh);
    }
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
