//! Drives of the generator's truck lead a truck file that is off back to it.

use crate::support::nominal::{Off, off};
use crate::support::{Campaign, generate};
use diagnosis::identify::identify;
use diagnosis::{Channel as C, DiagnosisError, FindingKind, Serial};
use dynamics::{KnownBy, TruckParameters};

const SHORT: Campaign = Campaign { drives: 3, duration_s: 420.0, tolerance: 1.0 };

/// Twenty draws with longer drives are `examples/identify.rs`.
#[test]
fn a_truck_file_that_is_off_is_led_back_to_the_truck_and_says_how_well() {
    let Off { truck, truth, common } = off(4);
    let found = identify(&truck, &generate(&common, &SHORT, 61), &Serial).unwrap();
    let (mut inside, mut nearer, mut off_by_much, mut all) = (0, 0, 0, 0);
    for f in &found.figures {
        let true_value = truth[&f.path];
        let [low, high] = f.interval_90;
        inside += usize::from((low..=high).contains(&true_value));
        let (was, is) = ((f.nominal - true_value).abs(), (f.value - true_value).abs());
        if was > high - low {
            off_by_much += 1;
            nearer += usize::from(is < 0.5 * was);
        }
        all += 1;
    }
    assert!(all >= 20, "{all} figures of {}", found.not_told.len() + all);
    assert!(inside * 10 >= all * 7, "{inside} of {all} inside: {:#?}", found.figures);
    assert!(off_by_much >= 5 && nearer == off_by_much, "{nearer} of {off_by_much} nearer");
    let text = found.truck_file("found", "three drives").unwrap();
    let again = TruckParameters::from_toml_str("found", &text).unwrap();
    assert_eq!(again.provenance["resistance.drag_area_m2"].known_by, KnownBy::Drives);
    assert!(again.provenance["engine.full_load_torque_nm"].source.contains("times"));
}

/// A file whose truck is driven above its critical speed came back as what the drives say, with narrow
/// intervals: 40 % too stiff steer tyres and 27 % too soft drive tyres, give or take 2 %.
#[test]
fn a_truck_file_that_is_unstable_at_speed_is_led_back_too() {
    let mut truck = TruckParameters::load("reference").unwrap();
    let scales = [1.6, 0.65, 1.0];
    truck.lateral.tyres.stiffness_scale = scales;
    let found = identify(&truck, &generate(&[], &SHORT, 63), &Serial).unwrap();
    for (axle, scale) in scales.iter().enumerate() {
        let path = format!("lateral.tyres.stiffness_scale[{axle}]");
        let f = found.figures.iter().find(|f| f.path == path).unwrap();
        assert_eq!(f.nominal, *scale);
        assert!((f.value - 1.0).abs() < 3.0 * f.sigma && f.sigma < 0.08, "{f:?}");
    }
}

/// A fuel map that just spans the sheet's full load, and drives that ask for a per cent more: every
/// figure but those of the engine was one "which no truck has".
#[test]
fn a_fuel_map_ends_below_the_full_load_that_drives_tell() {
    let mut truck = TruckParameters::load("reference").unwrap();
    truck.engine.full_load_torque_nm.iter_mut().for_each(|nm| *nm *= 0.97);
    let longhaul = TruckParameters::load("longhaul").unwrap().engine;
    let mut map = longhaul.fuel_map.unwrap();
    *map.torque_nm.last_mut().unwrap() = truck.engine.peak_torque_nm();
    assert!(!map.extrapolate);
    (truck.engine.fuel, truck.engine.fuel_map) = (longhaul.fuel, Some(map));
    let found = identify(&truck, &generate(&[], &SHORT, 64), &Serial).unwrap();
    let full_load = found.figures.iter().find(|f| f.path == "engine.full_load_torque_nm").unwrap();
    assert!(full_load.value > 1.01, "{full_load:?}");
    assert!(found.figures.iter().any(|f| f.path == "resistance.drag_area_m2"));
    assert!(found.truck_file("found", "three drives").is_ok());
}

#[test]
fn what_no_channel_shows_keeps_its_figure_and_says_which_channels_are_missing() {
    let mut set = generate(&[], &SHORT, 62);
    for d in &mut set.drives {
        for c in [C::FuelRateGS, C::SteeringWheelRad, C::BrakePressureKpa] {
            d.remove(c);
        }
    }
    let truck = TruckParameters::load("reference").unwrap();
    let found = identify(&truck, &set, &Serial).unwrap();
    for (path, channel) in [
        ("engine.fuel.per_kw_g_s", "fuel_rate_g_s"),
        ("lateral.steering.ratio", "steering_wheel_rad"),
        ("brake.gain_scale_coeff", "brake_pressure_kpa"),
    ] {
        let why = &found.not_told.iter().find(|n| n.path == path).unwrap().why;
        assert!(why.contains(channel), "{path}: {why}");
        assert_eq!(found.truck.parameter(path), truck.parameter(path), "{path}");
    }
    assert!(found.figures.iter().any(|f| f.path == "resistance.drag_area_m2"));
}

/// A bus of many trucks has no gear, and a converter slips: the ratio is engine over road speed.
#[test]
fn without_a_gear_the_ratio_is_measured_and_says_so() {
    let Off { truck, truth, common } = off(4);
    let mut set = generate(&common, &SHORT, 61);
    for d in &mut set.drives {
        d.remove(C::Gear);
        d.remove(C::ShiftInProcess);
    }
    let found = identify(&truck, &set, &Serial).unwrap();
    let fits = found.findings.iter().find_map(|f| match f.kind {
        FindingKind::RatioMeasured { fits_frac } => Some(fits_frac),
        _ => None,
    });
    assert!(fits.is_some_and(|f| f > 0.8), "{fits:?}");
    let told = |path: &str| found.figures.iter().find(|f| f.path == path);
    let drag = told("resistance.drag_area_m2").unwrap();
    let rolling = told("resistance.rolling_coeff").unwrap();
    for f in [drag, rolling] {
        let off = (f.value - truth[&f.path]).abs();
        assert!(off < 2.5 * f.sigma && f.sigma < 0.08 * f.value, "{f:?}");
    }
    let why = &found.not_told.iter().find(|n| n.path == "driveline.wheel_radius_m").unwrap().why;
    assert!(why.contains("gear is missing"), "{why}");
}

#[test]
fn another_gearbox_is_refused_with_both_figures() {
    let mut truck = TruckParameters::load("reference").unwrap();
    truck.driveline.final_drive_ratio *= 1.3;
    let said = identify(&truck, &generate(&[], &SHORT, 62), &Serial).unwrap_err();
    assert!(matches!(said, DiagnosisError::Truck(_)));
    assert!(said.to_string().contains("another gearbox"), "{said}");
}
