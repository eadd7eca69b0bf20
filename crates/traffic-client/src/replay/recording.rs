//! Recorded trajectories, whatever file they come from: rows in, evenly sampled tracks out.

use std::collections::BTreeMap;

use tractrix_core::VehicleClass;

use super::ReplayError;

/// What the coordinates of a recording mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Frame {
    /// Map x, y of the body's centre, heading from map x.
    #[default]
    Map,
    /// Station and offset of the body's centre (x = s, y = d), heading against the road.
    Road,
}

/// One observation of one vehicle, as files have it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Row {
    /// Vehicle.
    pub id: u64,
    /// Time, s.
    pub time_s: f64,
    /// Centre of the body, m.
    pub x_m: f64,
    /// Centre of the body, m.
    pub y_m: f64,
    /// Heading, rad; `None`: from the motion.
    pub yaw_rad: Option<f64>,
    /// Speed, m/s; `None`: from the motion.
    pub speed_m_s: Option<f64>,
    /// Length, m.
    pub length_m: Option<f64>,
    /// Width, m.
    pub width_m: Option<f64>,
    /// Class; `None`: from the length.
    pub class: Option<VehicleClass>,
}

/// One sample of a track.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sample {
    /// Centre of the body, m.
    pub x_m: f64,
    /// Centre of the body, m.
    pub y_m: f64,
    /// Heading, rad, continuous.
    pub yaw_rad: f64,
    /// Speed, m/s.
    pub speed_m_s: f64,
}

/// One vehicle, evenly sampled.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// Vehicle.
    pub id: u64,
    /// Class.
    pub class: VehicleClass,
    /// Length, m.
    pub length_m: f64,
    /// Width, m.
    pub width_m: f64,
    /// Number of the first sample, in steps since the start of the recording.
    pub first: usize,
    /// Samples, one per step.
    pub samples: Vec<Sample>,
}

/// A recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// Where it comes from.
    pub name: String,
    /// Meaning of the coordinates.
    pub frame: Frame,
    /// Step, s.
    pub step_s: f64,
    /// Number of steps.
    pub steps: usize,
    /// Tracks, in order of their vehicle and first sample.
    pub tracks: Vec<Track>,
}

/// A gap in the observations longer than this ends a track, s.
const GAP_S: f64 = 1.0;
/// Length of a vehicle whose file has none, m.
const LENGTH_M: f64 = 4.8;
/// Width of a vehicle whose file has none, m.
const WIDTH_M: f64 = 1.9;
/// From this length on a vehicle of unknown class is a truck, or a van, m.
const TRUCK_M: f64 = 7.5;
const VAN_M: f64 = 5.6;
/// Most samples in a recording.
const MOST_SAMPLES: f64 = 2e8;

impl Recording {
    /// Builds a recording: rows are grouped by vehicle, sorted by time and resampled linearly every
    /// `step_s`.
    ///
    /// # Errors
    /// [`ReplayError::Format`] for an empty or non-finite recording, or one that is absurdly long.
    pub fn from_rows(
        name: &str,
        frame: Frame,
        rows: Vec<Row>,
        step_s: f64,
    ) -> Result<Self, ReplayError> {
        let bad = |why: String| ReplayError::Format { name: name.to_owned(), why };
        if !(step_s >= 0.001 && step_s <= 10.0) {
            return Err(bad(format!("step {step_s} s is outside [0.001, 10]")));
        }
        for (k, row) in rows.iter().enumerate() {
            if !(row.time_s.is_finite() && row.x_m.is_finite() && row.y_m.is_finite()) {
                return Err(bad(format!("row {}: time or position is not finite", k + 1)));
            }
        }
        let start = rows.iter().map(|row| row.time_s).fold(f64::INFINITY, f64::min);
        let end = rows.iter().map(|row| row.time_s).fold(f64::NEG_INFINITY, f64::max);
        if rows.is_empty() {
            return Err(bad("no observations".to_owned()));
        }
        let mut by_vehicle: BTreeMap<u64, Vec<Row>> = BTreeMap::new();
        for mut row in rows {
            row.time_s -= start;
            by_vehicle.entry(row.id).or_default().push(row);
        }
        if (end - start) / step_s * by_vehicle.len() as f64 > MOST_SAMPLES {
            return Err(bad(format!(
                "{} s of {} vehicles is too much",
                end - start,
                by_vehicle.len()
            )));
        }
        let mut tracks = Vec::new();
        for (_, mut rows) in by_vehicle {
            rows.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
            rows.dedup_by(|b, a| b.time_s - a.time_s < 1e-6);
            for part in rows.chunk_by(|a, b| b.time_s - a.time_s <= GAP_S) {
                tracks.extend(track(part, step_s));
            }
        }
        let steps = tracks.iter().map(|t: &Track| t.first + t.samples.len()).max().unwrap_or(0);
        Ok(Self { name: name.to_owned(), frame, step_s, steps, tracks })
    }

    /// All speeds of all samples, m/s.
    pub fn speeds_m_s(&self) -> impl Iterator<Item = f64> {
        self.tracks.iter().flat_map(|t| t.samples.iter().map(|s| s.speed_m_s))
    }

    /// Length, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.steps as f64 * self.step_s
    }
}

/// The class of a vehicle that is known by its length only.
pub(crate) fn class_of_length(length_m: f64) -> VehicleClass {
    match length_m {
        l if l >= TRUCK_M => VehicleClass::Truck,
        l if l >= VAN_M => VehicleClass::Van,
        _ => VehicleClass::Car,
    }
}

/// Resamples the observations of one vehicle; `None` if they do not reach over one step.
fn track(rows: &[Row], step_s: f64) -> Option<Track> {
    let (head, tail) = (rows.first()?, rows.last()?);
    let first = libm::ceil(head.time_s / step_s - 1e-6) as usize;
    let last = libm::floor(tail.time_s / step_s + 1e-6) as usize;
    if last < first + 1 {
        return None;
    }
    let mut k = 0;
    let places: Vec<(f64, f64, Option<f64>, Option<f64>)> = (first..=last)
        .map(|n| {
            let t = n as f64 * step_s;
            while k + 2 < rows.len() && rows[k + 1].time_s <= t {
                k += 1;
            }
            let (a, b) = (&rows[k], &rows[(k + 1).min(rows.len() - 1)]);
            let f = ((t - a.time_s) / (b.time_s - a.time_s).max(1e-9)).clamp(0.0, 1.0);
            let mix = |a: f64, b: f64| a + f * (b - a);
            let yaw = a.yaw_rad.zip(b.yaw_rad).map(|(p, q)| p + f * turn(p, q));
            let speed = a.speed_m_s.zip(b.speed_m_s).map(|(p, q)| mix(p, q));
            (mix(a.x_m, b.x_m), mix(a.y_m, b.y_m), yaw, speed)
        })
        .collect();
    let mut samples = Vec::with_capacity(places.len());
    let mut yaw_before = None;
    for (n, &(x_m, y_m, yaw, speed)) in places.iter().enumerate() {
        let (p, q) = (&places[n.saturating_sub(1)], &places[(n + 1).min(places.len() - 1)]);
        let dt = step_s * ((n + 1).min(places.len() - 1) - n.saturating_sub(1)) as f64;
        let (dx, dy) = (q.0 - p.0, q.1 - p.1);
        let moved = libm::sqrt(dx * dx + dy * dy);
        let raw =
            yaw.or((moved > 0.05).then(|| libm::atan2(dy, dx))).or(yaw_before).unwrap_or_default();
        let yaw_rad = yaw_before.map_or(raw, |before: f64| before + turn(before, raw));
        yaw_before = Some(yaw_rad);
        samples.push(Sample { x_m, y_m, yaw_rad, speed_m_s: speed.unwrap_or(moved / dt) });
    }
    let length_m = head.length_m.filter(|l| *l > 0.5).unwrap_or(LENGTH_M);
    let class = head.class.unwrap_or_else(|| class_of_length(length_m));
    let width_m = head.width_m.filter(|w| *w > 0.2).unwrap_or(WIDTH_M);
    Some(Track { id: head.id, class, length_m, width_m, first, samples })
}

/// The shortest turn from heading `p` to heading `q`, rad.
fn turn(p: f64, q: f64) -> f64 {
    let d = q - p;
    d - core::f64::consts::TAU * libm::round(d / core::f64::consts::TAU)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(id: u64, time_s: f64, x_m: f64) -> Row {
        Row { id, time_s, x_m, ..Row::default() }
    }

    #[test]
    fn rows_at_25_hz_become_tracks_at_10_hz_with_speed_and_heading_of_the_motion() {
        let rows = (0..=100).map(|k| {
            let t = 5.0 + 0.04 * f64::from(k);
            Row { y_m: 3.0 * (t - 5.0), ..row(7, t, 4.0 * (t - 5.0)) }
        });
        let r = Recording::from_rows("t", Frame::Map, rows.collect(), 0.1).unwrap();
        assert_eq!((r.tracks.len(), r.steps), (1, 41));
        for (k, s) in r.tracks[0].samples.iter().enumerate() {
            assert!((s.x_m - 0.4 * k as f64).abs() < 1e-9);
            assert!((s.speed_m_s - 5.0).abs() < 1e-9);
            assert!((s.yaw_rad - 0.6435).abs() < 1e-4);
        }
    }

    #[test]
    fn a_gap_in_the_observations_splits_the_track() {
        let rows = (0..40)
            .filter(|k| !(10..25).contains(k))
            .map(|k| row(1, 0.1 * f64::from(k), f64::from(k)));
        let r = Recording::from_rows("t", Frame::Map, rows.collect(), 0.1).unwrap();
        let firsts: Vec<usize> = r.tracks.iter().map(|t| t.first).collect();
        assert_eq!(firsts, [0, 25]);
    }

    #[test]
    fn what_is_not_a_number_is_refused_by_its_row() {
        let e =
            Recording::from_rows("t", Frame::Map, vec![row(1, 0.0, f64::NAN)], 0.1).unwrap_err();
        assert!(e.to_string().contains("row 1"), "{e}");
        assert!(Recording::from_rows("t", Frame::Map, Vec::new(), 0.1).is_err());
    }

    #[test]
    fn headings_take_the_short_way_round() {
        assert!((turn(3.1, -3.1) - 0.0832).abs() < 1e-3);
        assert!((turn(-3.1, 3.1) + 0.0832).abs() < 1e-3);
    }
}
