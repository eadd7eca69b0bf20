//! Bad input gives a clear error or a finding, never a panic.

use std::path::Path;

use diagnosis::{
    Action, Channel, DiagnosisError, DriveSet, Executor, FindingKind, read_drives, read_drives_with,
};

fn folder(rows: impl Iterator<Item = (f64, f64, String)>) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let mut csv = "time_s,speed_m_s,gps_speed_m_s,accelerator_pedal_frac\n".to_owned();
    for (t, v, pedal) in rows {
        csv += &format!("{t},{v},{},{pedal}\n", v + 0.01);
    }
    write(dir.path(), "d.csv", &csv);
    write(
        dir.path(),
        "drives.toml",
        "schema = 1\ntruck = \"reference\"\n[[drive]]\nname = \"d\"\nfile = \"d.csv\"\n",
    );
    dir
}

fn write(dir: &Path, name: &str, text: &str) {
    std::fs::write(dir.join(name), text).unwrap();
}

fn speed(t: f64) -> f64 {
    15.0 + 5.0 * (0.1 * t).sin()
}

fn drive(pedal: impl Fn(usize) -> String) -> Result<DriveSet, DiagnosisError> {
    let dir = folder((0..2400).map(|i| (i as f64 * 0.05, speed(i as f64 * 0.05), pedal(i))));
    read_drives(dir.path())
}

#[test]
fn a_pedal_in_percent_is_converted_and_said_so() {
    let set = drive(|_| "40".to_owned()).unwrap();
    let pedal = set.drives[0].get(Channel::AcceleratorPedalFrac).unwrap();
    assert!((pedal[100] - 0.4).abs() < 1e-12);
    assert!(set.findings.iter().any(|f| matches!(f.kind, FindingKind::WrongUnit { .. })));
}

#[test]
fn a_wheel_speed_in_km_h_and_a_torque_as_a_fraction_are_converted_and_said_so() {
    let dir = folder(std::iter::empty());
    let mut csv = "time_s,speed_m_s,engine_torque_percent\n".to_owned();
    for t in (0..2400).map(|i| f64::from(i) * 0.05) {
        csv += &format!("{t},{},{}\n", 3.6 * speed(t), 0.4 + 0.3 * (0.2 * t).sin());
    }
    write(dir.path(), "d.csv", &csv);
    let set = read_drives(dir.path()).unwrap();
    let drive = &set.drives[0];
    assert!((drive.get(Channel::SpeedMS).unwrap()[100] - speed(5.0)).abs() < 1e-9);
    assert!((drive.get(Channel::EngineTorquePercent).unwrap()[0] - 40.0).abs() < 1e-9);
    let units = set.findings.iter().filter(|f| matches!(f.kind, FindingKind::WrongUnit { .. }));
    assert!(units.clone().count() == 2 && units.clone().all(|f| f.action == Action::Corrected));
}

#[test]
fn a_channel_that_is_mostly_missing_is_dropped_with_a_finding() {
    let set = drive(|i| if i % 3 == 0 { "0.4".to_owned() } else { String::new() }).unwrap();
    assert!(!set.drives[0].has(Channel::AcceleratorPedalFrac));
    assert!(set.findings.iter().any(|f| f.action == Action::ChannelDropped));
}

#[test]
fn shuffled_rows_are_refused_with_the_row() {
    let dir = folder((0..2400).map(|i| {
        let t = if i == 700 { 3.0 } else { i as f64 * 0.05 };
        (t, speed(t), "0.4".to_owned())
    }));
    let e = read_drives(dir.path()).unwrap_err();
    assert!(matches!(e, DiagnosisError::ShuffledTime { row: 700, .. }), "{e}");
}

#[test]
fn one_sample_is_too_short() {
    let dir = folder(std::iter::once((0.0, 10.0, "0.1".to_owned())));
    assert!(matches!(read_drives(dir.path()), Err(DiagnosisError::TooShort { .. })));
}

#[test]
fn an_empty_table_and_a_missing_index_are_errors() {
    assert!(read_drives(folder(std::iter::empty()).path()).is_err());
    assert!(matches!(
        read_drives(tempfile::tempdir().unwrap().path()),
        Err(DiagnosisError::Io { .. })
    ));
}

#[test]
fn a_receiver_whose_clock_is_late_is_reported_with_its_lag_and_corrected() {
    let dir = tempfile::tempdir().unwrap();
    let v =
        |t: f64| 18.0 + 3.0 * (0.21 * t).sin() + 1.3 * (0.057 * t).cos() + 2.0 * (0.013 * t).sin();
    let mut csv = "time_s,speed_m_s,gps_speed_m_s\n".to_owned();
    for t in (0..12_000).map(|i| f64::from(i) * 0.05) {
        csv += &format!("{t},{:.3},{:.3}\n", v(t), v(t - 2.4));
    }
    write(dir.path(), "d.csv", &csv);
    write(
        dir.path(),
        "drives.toml",
        "schema = 1\ntruck = \"reference\"\n[[drive]]\nname = \"d\"\nfile = \"d.csv\"\n",
    );
    let set = read_drives(dir.path()).unwrap();
    let found = &set.findings;
    let lag = found.iter().find_map(|f| match &f.kind {
        FindingKind::ClockOffset { against, seconds, .. } if against == "speed_m_s" => {
            Some(*seconds)
        }
        _ => None,
    });
    assert!((lag.unwrap() - 2.4).abs() < 0.05, "{found:?}");
    assert!(found.iter().all(|f| f.action == Action::Corrected), "{found:?}");
    let gps = set.drives[0].get(Channel::GpsSpeedMS).unwrap();
    for i in (0..11_900).step_by(100) {
        let t = i as f64 * 0.05;
        assert!((gps[i] - v(t)).abs() < 0.03, "{t} s: {} m/s, {} m/s", gps[i], v(t));
    }
}

/// An executor that does the last job first.
struct Backwards;

impl Executor for Backwards {
    fn run(&self, count: usize, job: &(dyn Fn(usize) + Sync)) {
        (0..count).rev().for_each(job);
    }
}

#[test]
fn drives_come_in_the_order_of_the_index_however_they_are_read() {
    let pedal = |i: usize| if i.is_multiple_of(7) { "NaN".to_owned() } else { "0.4".to_owned() };
    let dir = folder((0..2400).map(|i| (i as f64 * 0.05, speed(i as f64 * 0.05), pedal(i))));
    let index = |files: [&str; 3]| {
        let entry = |(i, f): (usize, &str)| format!("[[drive]]\nname = \"d{i}\"\nfile = {f:?}\n");
        let drives: String = files.into_iter().enumerate().map(entry).collect();
        write(dir.path(), "drives.toml", &format!("schema = 1\ntruck = \"reference\"\n{drives}"));
    };
    index(["d.csv", "d.csv", "d.csv"]);
    let forwards = read_drives(dir.path()).unwrap();
    assert!(!forwards.findings.is_empty());
    assert_eq!(read_drives_with(dir.path(), &Backwards).unwrap(), forwards);
    index(["d.csv", "second.csv", "third.csv"]);
    let error = read_drives_with(dir.path(), &Backwards).unwrap_err().to_string();
    assert!(error.contains("second.csv"), "{error}");
}

/// Times in milliseconds were laid on a grid of seconds: 6.6 GB and minutes for an hour's drive.
#[test]
fn times_that_are_not_seconds_are_refused_with_the_file_and_what_they_look_like() {
    let refusal = |per_second: f64, step_s: f64| {
        let rows = (0..7200).map(|i| {
            let t = f64::from(i) * step_s;
            (t * per_second, speed(t), "0.4".to_owned())
        });
        read_drives(folder(rows).path()).unwrap_err().to_string()
    };
    for (per_second, step_s, unit) in [
        (1e3, 0.05, "milliseconds"),
        (1e3, 1.0, "milliseconds"),
        (1e6, 0.05, "microseconds"),
        (1e9, 0.05, "nanoseconds"),
    ] {
        let line = refusal(per_second, step_s);
        for part in ["d.csv", "time_s steps by", "taken as seconds", unit] {
            assert!(line.contains(part), "{part}: {line}");
        }
    }
    let line = refusal(1.0, 20.0);
    assert!(line.contains("steps by 20 "), "{line}");
    // at 1 kHz the step says nothing, the length does: 7200 h
    let dir = folder((0..100_000).map(|i| (f64::from(i), 20.0, "0.4".to_owned())));
    let line = read_drives(dir.path()).unwrap_err().to_string();
    assert!(line.contains("spans 99999") && line.contains("milliseconds"), "{line}");
}

#[test]
fn a_parquet_file_that_is_compressed_otherwise_says_with_what() {
    let gzip = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/gzip.parquet");
    let line = diagnosis::read_table(&gzip).unwrap_err().to_string();
    assert!(line.contains("gzip.parquet: column time_s is compressed with GZIP"), "{line}");

    let dir = tempfile::tempdir().unwrap();
    let whole = dir.path().join("d.parquet");
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut packed, &std::fs::read(gzip).unwrap()).unwrap();
    std::fs::write(&whole, packed.finish().unwrap()).unwrap();
    let line = diagnosis::read_table(&whole).unwrap_err().to_string();
    assert!(line.contains("compressed with gzip; unpack it"), "{line}");
}

#[test]
fn an_unknown_key_of_the_index_comes_with_its_line_and_the_nearest() {
    let dir = folder(std::iter::empty());
    let text = "schema = 1\ntruck = \"reference\"\n[[drive]]\nname = \"d\"\nfile = \"d.csv\"\nmass_kg = 3.0\n";
    write(dir.path(), "drives.toml", text);
    let line = read_drives(dir.path()).unwrap_err().to_string();
    assert!(line.contains("line 6: unknown key \"mass_kg\""), "{line}");
    assert!(line.contains("reported_mass_kg"), "{line}");
}
