//! Drives that cannot be judged: a clear error or a stated verdict, never a panic and never a
//! confident cause.

use crate::support::{Campaign, generate};
use diagnosis::{
    Action, Channel as C, Drive, DriveSet, Finding, FindingKind, Options, Plant, Serial, Table,
    Verdict, diagnose, drives_index, read_drives,
};
use dynamics::TruckParameters;

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

/// Generated drives written as tables, changed on the way, and read again.
fn read_again(change: &dyn Fn(usize, C, &mut Vec<f64>)) -> Result<DriveSet, String> {
    let folder = tempfile::tempdir().unwrap();
    let campaign = Campaign { drives: 2, duration_s: 400.0, tolerance: 1.0 };
    let mut tables = Vec::new();
    for (k, d) in generate(&[], &campaign, 5).drives.iter().enumerate() {
        let time = (0..d.len).map(|i| Drive::STEP_S * i as f64).collect();
        let mut columns = vec![("time_s", time)];
        for c in C::all().filter(|c| d.has(*c)) {
            let mut values = d.get(c).unwrap().to_vec();
            change(k, c, &mut values);
            if !values.is_empty() {
                columns.push((c.name(), values));
            }
        }
        let table = Table { name: format!("d{k}"), columns, ..Table::default() };
        std::fs::write(folder.path().join(format!("d{k}.csv")), table.csv()).unwrap();
        tables.push(table);
    }
    let index = drives_index("reference", &tables).unwrap();
    std::fs::write(folder.path().join("drives.toml"), index).unwrap();
    read_drives(folder.path()).map_err(|e| e.to_string())
}

/// One column of every drive times a factor.
fn scaled(channel: C, factor: f64) -> DriveSet {
    let change = |_, c: C, v: &mut Vec<f64>| {
        if c == channel {
            v.iter_mut().for_each(|x| *x *= factor);
        }
    };
    read_again(&change).unwrap()
}

/// Units and jumps that were found: column, unit, what was done.
fn suspected(set: &DriveSet) -> Vec<(String, String, Action)> {
    let of = |f: &Finding| {
        let what = match &f.kind {
            FindingKind::WrongUnit { suspected } => (*suspected).to_owned(),
            FindingKind::Jump { .. } => "jump".to_owned(),
            _ => return None,
        };
        Some((f.channel.clone().unwrap(), what, f.action))
    };
    set.findings.iter().filter_map(of).collect()
}

#[test]
fn drives_in_order_have_the_right_units() {
    let set = read_again(&|_, _, _| {}).unwrap();
    assert_eq!(suspected(&set), []);
}

#[test]
fn units_that_are_off_by_the_usual_factors_are_findings() {
    let degrees = 1.0_f64.to_degrees();
    let cases = [
        (C::SteeringWheelRad, degrees, "deg", Action::Corrected),
        (C::YawRateRadS, degrees, "deg/s", Action::Corrected),
        (C::BrakePressureKpa, 0.01, "bar", Action::Corrected),
        (C::BrakePressureKpa, 1.0 / 6.894_757, "psi", Action::ChannelDropped),
        (C::BrakePressureKpa, 1e3, "Pa", Action::Corrected),
        (C::AcceleratorPedalFrac, 100.0, "percent", Action::Corrected),
        (C::EngineTorquePercent, 0.01, "fraction", Action::Corrected),
        (C::SpeedMS, 2.236_936, "mph", Action::Corrected),
        (C::SpeedMS, 3.6, "km/h", Action::Corrected),
        (C::BaroPressurePa, 1e-3, "kPa", Action::Corrected),
    ];
    for (channel, factor, unit, action) in cases {
        let found = suspected(&scaled(channel, factor));
        let expected = (channel.name().to_owned(), unit.to_owned(), action);
        assert!(found.contains(&expected), "{channel:?} in {unit}: {found:?}");
        assert!(found.iter().all(|f| f.0 == expected.0), "{channel:?} in {unit}: {found:?}");
    }
}

#[test]
fn fuel_per_hour_is_refused_with_drive_column_and_value() {
    // a drive in which the engine never works hard: peaks are no sign of the unit there
    let light = |_, c: C, v: &mut Vec<f64>| match c {
        C::FuelRateGS => v.iter_mut().for_each(|x| *x *= 3.6 * 0.6),
        C::EngineTorquePercent => v.iter_mut().for_each(|x| *x *= 0.6),
        _ => {}
    };
    let light = read_again(&light).unwrap();
    let error = judge(&light).expect_err(&format!("{:?}", light.findings));
    for part in ["drive d0", "fuel_rate_g_s", "taken as g/s", "l/h or kg/h"] {
        assert!(error.contains(part), "{error}");
    }
    // in litres the peaks are beyond any engine, and the column is not used
    let findings = scaled(C::FuelRateGS, 3.6 / 0.84).findings;
    let dropped = |f: &Finding| {
        matches!(f.kind, FindingKind::Implausible { value, .. } if value > 80.0)
            && f.action == Action::ChannelDropped
    };
    assert!(findings.iter().any(dropped), "{findings:?}");
}

/// Engineering bounds of the catalogue: nobody's fault may be taken for a wrong unit.
#[test]
fn fuel_that_a_cause_doubles_or_halves_is_never_a_wrong_unit() {
    // fuel's scale, torque's scale, extra fuel at low load
    let causes = [
        (0.6, 1.0, 0.0),
        (1.6, 1.0, 0.0),
        (1.0, 0.7, 0.0),
        (1.0, 1.4, 0.0),
        (1.0, 1.0, 2.0),
        (1.0, 1.0, -0.6),
    ];
    for (fuel_scale, torque_scale, low_load) in causes {
        let mut drives =
            generate(&[], &Campaign { drives: 4, duration_s: 300.0, tolerance: 1.0 }, 5);
        for d in &mut drives.drives {
            let torque = d.get(C::EngineTorquePercent).unwrap().to_vec();
            let fuel = d.get(C::FuelRateGS).unwrap().iter().zip(&torque).map(|(fuel, percent)| {
                fuel * fuel_scale * (1.0 + low_load * (1.0 - percent / 40.0).max(0.0))
            });
            d.set(C::FuelRateGS, fuel.collect());
            let torque = torque.iter().map(|percent| percent * torque_scale);
            d.set(C::EngineTorquePercent, torque.collect());
        }
        let said = judge(&drives);
        assert!(said.is_ok(), "{fuel_scale} {torque_scale} {low_load}: {said:?}");
    }
}

#[test]
fn a_speed_in_mph_without_a_receiver_is_refused_with_the_unit() {
    let change = |_, c: C, v: &mut Vec<f64>| match c {
        C::SpeedMS => v.iter_mut().for_each(|x| *x *= 2.236_936),
        C::GpsSpeedMS => v.clear(),
        _ => {}
    };
    let error = judge(&read_again(&change).unwrap()).unwrap_err();
    assert!(error.contains("seems to be in mph"), "{error}");
}

#[test]
fn of_two_trucks_in_one_folder_the_drive_of_the_other_is_named() {
    let change = |k: usize, c: C, v: &mut Vec<f64>| {
        if k == 1 && c == C::EngineSpeedRpm {
            v.iter_mut().for_each(|x| *x *= 1.3);
        }
    };
    let error = judge(&read_again(&change).unwrap()).unwrap_err();
    assert!(error.contains("drive d1 does not belong"), "{error}");
}

#[test]
fn a_receiver_that_jumps_is_a_finding_and_the_jump_is_bridged() {
    for (channel, by) in [(C::GpsAltitudeM, 250.0), (C::GpsSpeedMS, -9.0)] {
        let change = |_, c: C, v: &mut Vec<f64>| {
            if c == channel {
                v[3000..3020].iter_mut().for_each(|x| *x += by);
            }
        };
        let set = read_again(&change).unwrap();
        let expected = (channel.name().to_owned(), "jump".to_owned(), Action::Interpolated);
        assert!(suspected(&set).contains(&expected), "{:?}", set.findings);
        let clean = read_again(&|_, _, _| {}).unwrap();
        let [jumped, right] = [&set, &clean].map(|s| s.drives[0].get(channel).unwrap()[3010]);
        assert!((jumped - right).abs() < 3.0, "{channel:?}: {jumped} {right}");
    }
}
