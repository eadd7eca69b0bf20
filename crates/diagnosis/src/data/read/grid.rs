//! From a raw table to channels on the uniform grid, with every defect noted.

use std::path::Path;

use tractrix_core::words::Short;

use crate::data::drive::{CoastDown, Drive};
use crate::data::finding::{Action, Finding, FindingKind};
use crate::{Channel, DiagnosisError};

use super::RawTable;
use super::clean::clean;
use super::stuck::stuck;

/// Shortest drive that is read, s.
const MIN_DRIVE_S: f64 = 60.0;
/// Shortest coast-down that is read, s.
const MIN_COAST_DOWN_S: f64 = 20.0;
/// Most that two readings of a coast-down are apart, s.
const SLOWEST_READING_S: f64 = 60.0;
/// Longest drive that is read, s: a day.
const LONGEST_DRIVE_S: f64 = 86_400.0;
/// No log of a truck is as slow as this, s from row to row.
const SLOWEST_STEP_S: f64 = 5.0;

pub(super) fn to_grid(
    name: &str,
    path: &Path,
    table: &RawTable,
    findings: &mut Vec<Finding>,
) -> Result<Drive, DiagnosisError> {
    let column = |column, why: &str| DiagnosisError::Column {
        drive: name.to_owned(),
        column,
        why: why.to_owned(),
    };
    let mut note = |channel: Option<&str>, time_s, kind, action| {
        findings.push(Finding {
            drive: name.to_owned(),
            channel: channel.map(str::to_owned),
            time_s,
            kind,
            action,
        });
    };
    let time = table.column("time_s").ok_or_else(|| column("time_s", "missing"))?;
    let keep = usable_rows(name, time, &mut note)?;
    let t: Vec<f64> = keep.iter().map(|&i| time[i]).collect();
    let seconds = t.last().unwrap_or(&0.0) - t.first().unwrap_or(&0.0);
    let coasts = table.column("gear").is_some_and(|g| keep.iter().all(|&i| g.get(i) == Some(&0.0)));
    let (needed_s, slowest_s) =
        if coasts { (MIN_COAST_DOWN_S, SLOWEST_READING_S) } else { (MIN_DRIVE_S, SLOWEST_STEP_S) };
    if t.len() < 2 || seconds < needed_s {
        return Err(DiagnosisError::TooShort { drive: name.to_owned(), seconds, needed_s });
    }
    let typical_s = typical_step(&t);
    in_seconds(path, typical_s, slowest_s, seconds)?;
    let len = (seconds / Drive::STEP_S + 1e-6).floor() as usize + 1;
    note_gaps(&t, typical_s, &mut note);
    let mut drive = Drive::new(name, t[0], len);
    for (label, values) in &table.columns {
        if label == "time_s" {
            continue;
        }
        let Some(channel) = Channel::of(label) else {
            note(Some(label), None, FindingKind::UnknownColumn, Action::Kept);
            continue;
        };
        if values.len() != time.len() {
            return Err(column(channel.name(), "shorter than time_s"));
        }
        let mut v: Vec<f64> = keep.iter().map(|&i| values[i]).collect();
        if clean(channel, &t, &mut v, &mut note) {
            if coasts && channel == Channel::SpeedMS {
                drive.coast_down = Some(readings(&t, &v, typical_s));
            }
            drive.set(channel, resample(&t, &v, t[0], len, channel.is_discrete()));
        }
    }
    let speed = drive.get(Channel::SpeedMS).map(<[f64]>::to_vec);
    let Some(mut speed) = speed else {
        return Err(column("speed_m_s", "missing or unusable"));
    };
    speed_unit(&mut drive, &mut speed, &mut note);
    super::units::compare(&mut drive, &mut note);
    stuck(&mut drive, &speed, &mut note);
    Ok(drive)
}

pub(super) type Note<'a> = dyn FnMut(Option<&str>, Option<f64>, FindingKind, Action) + 'a;

/// Rows with finite, increasing time.
fn usable_rows(
    name: &str,
    time: &[f64],
    note: &mut Note<'_>,
) -> Result<Vec<usize>, DiagnosisError> {
    let (mut keep, mut bad, mut twice) = (Vec::with_capacity(time.len()), 0, 0);
    let (mut first_bad, mut first_twice) = (None, None);
    let mut last = f64::NEG_INFINITY;
    for (row, &t) in time.iter().enumerate() {
        if !t.is_finite() {
            bad += 1;
            first_bad = first_bad.or(Some(last));
        } else if t == last {
            twice += 1;
            first_twice = first_twice.or(Some(t));
        } else if t < last {
            return Err(DiagnosisError::ShuffledTime {
                drive: name.to_owned(),
                row,
                before_s: last,
                after_s: t,
            });
        } else {
            keep.push(row);
            last = t;
        }
    }
    if bad > 0 {
        let kind = FindingKind::NonFinite { samples: bad };
        note(Some("time_s"), first_bad.filter(|t| t.is_finite()), kind, Action::RowsDropped);
    }
    if twice > 0 {
        let kind = FindingKind::DuplicateTime { rows: twice };
        note(Some("time_s"), first_twice, kind, Action::RowsDropped);
    }
    Ok(keep)
}

/// Median step of the time column; it has two rows at least.
fn typical_step(t: &[f64]) -> f64 {
    let mut steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps[steps.len() / 2]
}

/// Seconds over which a logger's samples of a coast-down make one reading: gusts last as long.
const READING_S: f64 = 5.0;
/// Standard deviation of such a reading, m/s.
const READING_SIGMA_M_S: f64 = 0.03;

/// The readings of a coast-down: its rows, or the means of a logger's.
fn readings(t: &[f64], v: &[f64], step_s: f64) -> CoastDown {
    let mut out = CoastDown {
        time_s: Vec::new(),
        speed_m_s: Vec::new(),
        step_s,
        time_sigma_s: 0.0,
        speed_sigma_m_s: READING_SIGMA_M_S,
    };
    let first = t.first().copied().unwrap_or(0.0);
    let rows: Vec<(f64, f64)> = t.iter().map(|t| t - first).zip(v.iter().copied()).collect();
    for one in rows.chunk_by(|a, b| (a.0 / READING_S).floor() == (b.0 / READING_S).floor()) {
        let mean = |of: fn(&(f64, f64)) -> f64| one.iter().map(of).sum::<f64>() / one.len() as f64;
        out.time_s.push(mean(|r| r.0));
        out.speed_m_s.push(mean(|r| r.1));
    }
    out
}

/// Refuses times that are not seconds, before they are laid on a grid of seconds.
fn in_seconds(
    path: &Path,
    typical_s: f64,
    slowest_s: f64,
    seconds: f64,
) -> Result<(), DiagnosisError> {
    let what = if typical_s >= slowest_s {
        format!("steps by {} from row to row", Short(typical_s))
    } else if seconds > LONGEST_DRIVE_S {
        format!(
            "spans {} ({:.1} days, a drive is a day at most)",
            Short(seconds),
            seconds / LONGEST_DRIVE_S
        )
    } else {
        return Ok(());
    };
    // The largest unit with which steps and length are those of a drive.
    let fits =
        |divisor: f64| typical_s / divisor < SLOWEST_STEP_S && seconds / divisor < LONGEST_DRIVE_S;
    let units = [("milliseconds", 1e3), ("microseconds", 1e6), ("nanoseconds", 1e9)];
    let (suspected, divisor) = units.into_iter().find(|u| fits(u.1)).unwrap_or(units[2]);
    Err(DiagnosisError::NotSeconds { path: path.to_owned(), what, suspected, divisor })
}

fn note_gaps(t: &[f64], typical: f64, note: &mut Note<'_>) {
    for w in t.windows(2) {
        let seconds = w[1] - w[0];
        if seconds > 10.0 * typical {
            let kind = FindingKind::Gap { seconds };
            note(None, Some(w[0]), kind, Action::Interpolated);
        }
    }
}

/// Linear interpolation to the grid; the previous value for discrete channels.
fn resample(t: &[f64], v: &[f64], start: f64, len: usize, discrete: bool) -> Vec<f64> {
    let mut out = Vec::with_capacity(len);
    let mut i = 0;
    for k in 0..len {
        let x = start + k as f64 * Drive::STEP_S;
        while i + 1 < t.len() && t[i + 1] <= x + 1e-9 {
            i += 1;
        }
        let at = if i + 1 < t.len() && x > t[i] + 1e-9 && !discrete {
            v[i] + (v[i + 1] - v[i]) * (x - t[i]) / (t[i + 1] - t[i])
        } else {
            v[i]
        };
        out.push(at);
    }
    out
}

/// A wheel speed in km/h or mph shows against the GPS or in the engine's gearing only; against the
/// GPS it is certain.
fn speed_unit(drive: &mut Drive, speed: &mut Vec<f64>, note: &mut Note<'_>) {
    let Some(gps) = drive.get(Channel::GpsSpeedMS) else { return };
    let mut ratios: Vec<f64> =
        speed.iter().zip(gps).filter(|p| *p.1 > 3.0).map(|p| p.0 / p.1).collect();
    if ratios.len() < 100 {
        return;
    }
    ratios.sort_by(f64::total_cmp);
    let ratio = ratios[ratios.len() / 2];
    let of = |c: Channel, f: f64, d: &Drive| {
        d.get(c).map(|x| x.iter().map(|y| y * f).collect::<Vec<f64>>())
    };
    for (unit, factor) in [("km/h", 3.6), ("mph", 2.236_936)] {
        for (channel, scale) in
            [(Channel::SpeedMS, ratio / factor), (Channel::GpsSpeedMS, 1.0 / (ratio * factor))]
        {
            if (scale - 1.0).abs() < 0.1
                && let Some(x) = of(channel, 1.0 / factor, drive)
            {
                let kind = FindingKind::WrongUnit { suspected: unit };
                note(Some(channel.name()), None, kind, Action::Corrected);
                if channel == Channel::SpeedMS {
                    speed.clone_from(&x);
                }
                drive.set(channel, x);
                return;
            }
        }
    }
}

/// Grade and curvature at the map position, where the table does not carry them.
pub(super) fn fill_from_map(drive: &mut Drive) {
    let (Some(s), Some(map)) = (drive.get(Channel::SMapM).map(<[f64]>::to_vec), drive.map.clone())
    else {
        return;
    };
    for (channel, y) in
        [(Channel::GradeFrac, &map.grade_frac), (Channel::Curvature1M, &map.curvature_1_m)]
    {
        if !drive.has(channel)
            && let Ok(curve) = tractrix_core::Curve::new(channel.name(), map.s_m.clone(), y.clone())
        {
            let v = s.iter().map(|s| curve.at(*s)).collect();
            drive.set(channel, v);
        }
    }
}
