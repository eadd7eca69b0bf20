//! Drives that cannot be judged: a clear error or a stated verdict, never a panic and never a
//! confident cause.
#![allow(clippy::unwrap_used, reason = "helpers of tests are tests")]

#[allow(dead_code, reason = "each user of the generator needs a part of it")]
mod support;

use diagnosis::{
    Channel as C, Drive, DriveSet, Finding, FindingKind, Options, Plant, Serial, Verdict, diagnose,
};
use dynamics::TruckParameters;
use support::{Campaign, generate};

fn set(drives: Vec<Drive>) -> DriveSet {
    DriveSet { truck: "reference".into(), drives, findings: Vec::new() }
}

/// Error text, or whether a cause is stated as sure.
fn judge(set: &DriveSet) -> Result<bool, String> {
    let plant = Plant::of_truck(&TruckParameters::load("reference").unwrap()).unwrap();
    diagnose(&plant, set, None, &Options::default(), &Serial, &mut |_| {})
        .map(|d| d.verdict == Verdict::Explained)
        .map_err(|e| e.to_string())
}

fn flat(name: &str, samples: usize) -> Drive {
    let mut d = Drive::new(name, 0.0, samples);
    for c in C::all() {
        let value = match c {
            C::SpeedMS | C::GpsSpeedMS => 20.0,
            C::EngineSpeedRpm => 20.0 / 0.53 * 2.85 * 9.549_296_6,
            C::Gear => 12.0,
            C::BaroPressurePa => 1e5,
            _ => 0.0,
        };
        d.set(c, vec![value; samples]);
    }
    d
}

fn short() -> DriveSet {
    let campaign = Campaign { drives: 2, duration_s: 200.0, tolerance: 1.0 };
    generate(&[], &campaign, 5)
}

#[test]
fn no_drive_an_empty_drive_and_one_sample_are_refused_with_the_drive_s_name() {
    assert!(judge(&set(Vec::new())).is_err());
    for samples in [0, 1, 2, 5, 100] {
        let error = judge(&set(vec![flat("stub", samples)])).unwrap_err();
        assert!(error.contains("stub") && error.contains(&samples.to_string()), "{error}");
    }
}

#[test]
fn a_drive_at_constant_speed_names_no_cause() {
    assert_ne!(judge(&set(vec![flat("a", 6000), flat("b", 6000)])), Ok(true));
}

#[test]
fn a_drive_without_any_channel_names_no_cause() {
    assert_ne!(judge(&set(vec![Drive::new("bare", 0.0, 6000)])), Ok(true));
}

#[test]
fn numbers_that_are_none_are_refused_with_channel_and_sample() {
    let mut drives = short();
    let mut speed = drives.drives[1].get(C::SpeedMS).unwrap().to_vec();
    speed[77] = f64::NAN;
    drives.drives[1].set(C::SpeedMS, speed);
    let error = judge(&drives).unwrap_err();
    assert!(error.contains("speed_m_s") && error.contains("77"), "{error}");
}

#[test]
fn speed_in_km_h_does_not_fit_the_gears_of_the_truck() {
    let mut drives = short();
    for d in &mut drives.drives {
        let speed = d.get(C::SpeedMS).unwrap().iter().map(|v| 3.6 * v).collect();
        d.set(C::SpeedMS, speed);
    }
    assert!(judge(&drives).is_err());
}

#[test]
fn drives_of_a_truck_with_another_axle_are_refused() {
    let other = TruckParameters::load("reference")
        .unwrap()
        .with_parameter("driveline.final_drive_ratio", 3.7)
        .unwrap();
    let plant = Plant::of_truck(&other).unwrap();
    let options = Options::default();
    assert!(diagnose(&plant, &short(), None, &options, &Serial, &mut |_| {}).is_err());
}

#[test]
fn an_index_that_names_another_truck_is_a_finding() {
    let mut drives = short();
    drives.truck = "another".into();
    let plant = Plant::of_truck(&TruckParameters::load("reference").unwrap()).unwrap();
    let options = Options::default();
    let d = diagnose(&plant, &drives, None, &options, &Serial, &mut |_| {}).unwrap();
    let named =
        |f: &Finding| matches!(&f.kind, FindingKind::TruckName { index } if index == "another");
    assert!(d.findings.iter().any(named), "{:?}", d.findings);
}

#[test]
fn rows_in_random_order_name_no_cause() {
    let mut drives = short();
    for d in &mut drives.drives {
        for c in C::all() {
            let x: Vec<f64> = d.get(c).unwrap().to_vec();
            let n = x.len();
            d.set(c, (0..n).map(|i| x[i * 1_009 % n]).collect());
        }
    }
    assert_ne!(judge(&drives), Ok(true));
}
