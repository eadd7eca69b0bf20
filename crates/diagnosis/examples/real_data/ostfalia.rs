//! Car in the Harz (Ostfalia): CAN and GPS were logged by two devices with clocks of their own.
//!
//! Every `NAME_can_parsed.csv` (`stamp_s`, `v_kmh`, ...) is joined with `NAME_gps_parsed.csv`
//! (`time` of day, `v_kmh`, `slope_pct`) as if both had started together, written as a folder of
//! measured drives, and read by the same stage that every diagnosis begins with. Every trip is
//! written twice: with the receiver's time of day, and as `NAME_rows` with its rows counted as
//! seconds, which is wrong where the receiver lost rows; the time of day says where and how many.

use std::path::Path;

use diagnosis::clock::{ClockTrack, Kind, Rates, Signal, track};
use diagnosis::{Channel, Drive, Finding, RawTable, read_drives, read_table};

use crate::plot::{Panel, Series, write};
use crate::table::{at, column, files, read, stem};

/// Name of a trip and the lag along it.
pub(crate) type Trip = (String, ClockTrack);

/// What the reading stage found, and the lag of every trip.
pub(crate) fn study(dir: &Path, out: Option<&Path>) -> crate::Outcome<(Vec<Finding>, Vec<Trip>)> {
    let folder = std::env::temp_dir().join(format!("real_data_{}", std::process::id()));
    let folder = out.map_or(folder, |o| o.join("drives"));
    std::fs::create_dir_all(&folder)?;
    let mut index = "schema = 1\ntruck = \"reference\"\n".to_owned();
    for can in files(dir, &["_can_parsed.csv"])? {
        let name = stem(&can).trim_end_matches("_can_parsed").to_owned();
        let gps = can.with_file_name(format!("{name}_gps_parsed.csv"));
        for (drive, by_rows) in [(name.clone(), false), (format!("{name}_rows"), true)] {
            std::fs::write(folder.join(format!("{drive}.csv")), join(&can, &gps, by_rows)?)?;
            index += &format!("[[drive]]\nname = \"{drive}\"\nfile = \"{drive}.csv\"\n");
        }
    }
    std::fs::write(folder.join("drives.toml"), index)?;
    let set = read_drives(&folder)?;
    for f in &set.findings {
        println!("{}", serde_json::to_string(f)?);
    }
    let mut tracks = Vec::new();
    for drive in &set.drives {
        // the drive has been moved to one clock, its table has not
        let table = read_table(&folder.join(format!("{}.csv", drive.name)))?;
        if let Some(found) = report(&drive.name, &table, out)? {
            tracks.push((drive.name.clone(), found));
        }
    }
    Ok((set.findings, tracks))
}

/// Both loggers on one table of 20 Hz.
fn join(
    can_path: &Path,
    gps_path: &Path,
    by_rows: bool,
) -> Result<String, Box<dyn std::error::Error>> {
    let (can, gps) = (read(can_path)?, read(gps_path)?);
    let can_time = column(&can, can_path, "stamp_s")?;
    let clock = column(&gps, gps_path, "time")?;
    let start = clock.first().copied().unwrap_or(0.0);
    let gps_time: Vec<f64> = clock
        .iter()
        .enumerate()
        .map(|(row, t)| if by_rows { row as f64 } else { t - start })
        .collect();
    if by_rows {
        for (row, w) in clock.windows(2).enumerate().filter(|(_, w)| w[1] - w[0] > 1.0) {
            println!(
                "{}: {} rows are missing after row {row}",
                stem(gps_path).trim_end_matches("_parsed"),
                w[1] - w[0] - 1.0
            );
        }
    }
    let (v, v_gps) = (column(&can, can_path, "v_kmh")?, column(&gps, gps_path, "v_kmh")?);
    let rpm = column(&can, can_path, "rpm")?;
    let end = can_time.last().unwrap_or(&0.0).min(*gps_time.last().unwrap_or(&0.0));
    let mut csv = "time_s,speed_m_s,gps_speed_m_s,engine_speed_rpm\n".to_owned();
    for k in 0..(end / Drive::STEP_S) as usize {
        let t = k as f64 * Drive::STEP_S;
        csv += &format!(
            "{t:.2},{:.4},{:.4},{:.1}\n",
            at(can_time, v, t) / 3.6,
            at(&gps_time, v_gps, t) / 3.6,
            at(can_time, rpm, t)
        );
    }
    Ok(csv)
}

fn report(name: &str, table: &RawTable, out: Option<&Path>) -> crate::Outcome<Option<ClockTrack>> {
    let speed = |c: Channel| table.column(c.name());
    let (Some(wheel), Some(gps)) = (speed(Channel::SpeedMS), speed(Channel::GpsSpeedMS)) else {
        return Err(format!("{name}: a speed is missing").into());
    };
    let signal = |samples| Signal { samples, kind: Kind::Value };
    let Some(found) = track(&Rates::new(signal(gps), signal(wheel), Drive::STEP_S)) else {
        println!("{name}: the two speeds do not move together anywhere");
        return Ok(None);
    };
    println!("{name}: correlation as recorded {:.3}", found.correlation_as_recorded);
    for s in &found.stretches {
        println!(
            "  {:6.0} to {:6.0} s: GPS behind CAN by {:7.2} +- {:.2} s, drift {:6.2} +- {:.2} ms/s, correlation {:.3}",
            s.from_s,
            s.to_s,
            s.lag_s,
            s.lag_sigma_s,
            1e3 * s.drift_s_s,
            1e3 * s.drift_sigma_s_s,
            s.correlation
        );
    }
    let aligned = found.aligned(gps, Drive::STEP_S);
    let rms = |g: &[f64]| {
        (g.iter().zip(wheel).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / wheel.len() as f64).sqrt()
    };
    println!(
        "  rms of GPS minus wheel speed: {:.2} m/s as recorded, {:.2} m/s aligned",
        rms(gps),
        rms(&aligned)
    );
    if let Some(out) = out {
        let line = |name, y: &[f64]| Series {
            name,
            points: y
                .iter()
                .enumerate()
                .step_by(20)
                .map(|(i, v)| (i as f64 * Drive::STEP_S, *v))
                .collect(),
            line: true,
        };
        let lag = (0..gps.len()).step_by(20).map(|i| i as f64 * Drive::STEP_S);
        write(
            &out.join(format!("clock-{name}.svg")),
            &[
                Panel {
                    title: &format!("{name}: speed, as recorded"),
                    x: "time, s",
                    y: "m/s",
                    series: vec![line("CAN", wheel), line("GPS", gps)],
                },
                Panel {
                    title: "speed, aligned",
                    x: "time, s",
                    y: "m/s",
                    series: vec![line("CAN", wheel), line("GPS", &aligned)],
                },
                Panel {
                    title: "lag of GPS behind CAN",
                    x: "time, s",
                    y: "s",
                    series: vec![Series {
                        name: "",
                        points: lag.map(|t| (t, found.lag_at_s(t))).collect(),
                        line: true,
                    }],
                },
            ],
        )?;
    }
    Ok(Some(found))
}
