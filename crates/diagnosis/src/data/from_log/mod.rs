//! From a log of a truck's bus to measured drives.
//!
//! A [`Log`] hears every message; [`Log::convert`] chooses who fills each column, finds the trips,
//! and lays a table of each on a grid. A value holds until the next one comes, three periods at most;
//! after that it is missing and not guessed.
//!
//! | file | what |
//! |---|---|
//! | `signals` | which message fills which column |
//! | `collect` | what was said, by whom |
//! | `choose` | who is believed |
//! | `trips` | where a drive begins and ends |
//! | `place` | where on a map it was |
//! | `dbc` | signals of the truck's maker, by a file of the user |
//! | `folder` | logs and a map into a folder of drives: all of it for a shell |
//! | `map` | the road and where a fix lies on it |
//! | `report` | what was chosen, in words |
//! | `grade` | its grade where there is no map |

mod choose;
mod collect;
mod dbc;
mod folder;
pub(crate) mod grade;
mod map;
mod observable;
mod place;
mod report;
mod signals;
mod trips;

use serde::Serialize;

pub use choose::{Choice, Unfilled};
pub use collect::Log;
pub use dbc::{Assigned, Dbc};
pub use folder::{DriveFolder, Job, LogFile, open};
pub use map::{Map, Project};
pub use place::{Locate, OnRoad};
pub use report::Report;
pub use trips::Span;

use crate::{Channel, DiagnosisError, Drive};
use choose::{Chosen, choose, why_not};
use signals::What;

/// Step of the tables, s: that of the diagnosis.
const STEP_S: f64 = Drive::STEP_S;
/// Rows between two altitudes that the grade is made of.
const GRADE_ROWS: usize = 20;

/// How a log is converted.
#[derive(Clone, Copy)]
pub struct Conversion<'a> {
    /// Density of the fuel, kg/m³.
    pub fuel_density_kg_m3: f64,
    /// A standstill of so long ends a drive, s.
    pub standstill_s: f64,
    /// Shorter drives are left out, s.
    pub least_s: f64,
    /// Where on the road that was driven it is, if there is a map of it.
    pub road: Option<OnRoad<'a>>,
}

/// A drive out of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct LoggedDrive {
    /// Where in the log it was.
    pub span: Span,
    /// Columns by name, of equal length; the first is `time_s`. `NaN` where nothing was said.
    pub columns: Vec<(&'static str, Vec<f64>)>,
    /// Distance by the wheels, m.
    pub distance_m: f64,
    /// What could not be done, in words.
    pub notes: Vec<String>,
    /// Whether its rows have a station on the map.
    pub on_map: bool,
}

/// A part of the log that is no drive.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LeftOut {
    /// Where in the log it was.
    #[serde(flatten)]
    pub span: Span,
    /// Why.
    pub why: String,
}

/// What came out of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct Converted {
    /// The drives, in order.
    pub drives: Vec<LoggedDrive>,
    /// Who fills each column.
    pub choices: Vec<Choice>,
    /// Columns that nobody fills.
    pub unfilled: Vec<Unfilled>,
    /// Parts that were left out.
    pub left_out: Vec<LeftOut>,
    /// Mass that the bus says, kg.
    pub mass_kg: Option<f64>,
    /// Length of the log, s.
    pub duration_s: f64,
    /// Messages in it.
    pub messages: u64,
}

/// Columns that come from the map or from what is computed here, not from a message.
const COMPUTED: [Channel; 3] = [Channel::SMapM, Channel::GradeFrac, Channel::Curvature1M];

impl Log {
    /// Makes drives of the log.
    ///
    /// # Errors
    /// [`DiagnosisError::NoDrive`] when nobody says a speed or the truck never drives.
    pub fn convert(mut self, how: &Conversion<'_>) -> Result<Converted, DiagnosisError> {
        self.settle();
        let log = &self;
        let (mut columns, mut choices, mut unfilled) = (Vec::new(), Vec::new(), Vec::new());
        for channel in Channel::all().filter(|c| !COMPUTED.contains(c)) {
            let what = What::Column(channel);
            match choose(log, what) {
                Some(chosen) => {
                    choices.push(chosen.said(log, channel));
                    columns.push((channel, chosen));
                }
                None => unfilled.push(Unfilled { column: channel.name(), why: why_not(log, what) }),
            }
        }
        let speed = columns.iter().find(|(channel, _)| *channel == Channel::SpeedMS);
        let no_drive = |why: String| DiagnosisError::NoDrive { why };
        let (_, speed) =
            speed.ok_or_else(|| no_drive(why_not(log, What::Column(Channel::SpeedMS))))?;
        let spans = trips::trips(speed.series, how.standstill_s);
        if spans.is_empty() {
            return Err(no_drive(format!("the truck stands for all of {:.0} s", log.duration_s)));
        }
        let others = Others {
            torque_mode: choose(log, What::TorqueMode),
            latitude: choose(log, What::Latitude),
            longitude: choose(log, What::Longitude),
        };
        let (mut drives, mut left_out) = (Vec::new(), Vec::new());
        let mut road = how.road;
        for span in spans {
            let driven = drive(span, &columns, &others, how.fuel_density_kg_m3, road);
            if let Some(OnRoad::From { start_m, .. }) = &mut road {
                *start_m += driven.distance_m;
            }
            if span.duration_s() < how.least_s {
                let why = format!(
                    "{:.0} s of driving, shorter than {} s",
                    span.duration_s(),
                    how.least_s
                );
                left_out.push(LeftOut { span, why });
            } else {
                drives.push(driven);
            }
        }
        Ok(Converted {
            drives,
            choices,
            unfilled,
            left_out,
            mass_kg: log.median(What::Mass),
            duration_s: log.duration_s,
            messages: log.messages,
        })
    }
}

/// Signals that are no columns.
struct Others<'a> {
    torque_mode: Option<Chosen<'a>>,
    latitude: Option<Chosen<'a>>,
    longitude: Option<Chosen<'a>>,
}

/// Lays one trip on the grid.
fn drive(
    span: Span,
    chosen: &[(Channel, Chosen<'_>)],
    others: &Others<'_>,
    fuel_density_kg_m3: f64,
    road: Option<OnRoad<'_>>,
) -> LoggedDrive {
    let rows = (span.duration_s() / STEP_S) as usize + 1;
    let times: Vec<f64> = (0..rows).map(|k| span.from_s + STEP_S * k as f64).collect();
    let mut columns: Vec<(&'static str, Vec<f64>)> =
        vec![("time_s", (0..rows).map(|k| STEP_S * k as f64).collect())];
    let mut notes = Vec::new();
    for (channel, source) in chosen {
        let mut values: Vec<f64> = times.iter().map(|&t| source.at(t)).collect();
        match channel {
            Channel::FuelRateGS if source.candidate.is_volume => {
                values.iter_mut().for_each(|v| *v *= 1e3 * fuel_density_kg_m3);
            }
            Channel::HeadingRad => unwrap(&mut values),
            Channel::AcceleratorPedalFrac => {
                if let Some(note) = without_others(&times, &mut values, others) {
                    notes.push(note);
                }
            }
            _ => {}
        }
        columns.push((channel.name(), values));
    }
    let column = |channel: Channel| columns.iter().find(|c| c.0 == channel.name()).map(|c| &c.1);
    let way_m = column(Channel::SpeedMS).map(|v| ways_m(v)).unwrap_or_default();
    let distance_m = way_m.last().copied().unwrap_or(0.0);
    let altitude = column(Channel::GpsAltitudeM).cloned();
    let mut on_map = false;
    if let Some(road) = road {
        let stations_m = match road {
            OnRoad::Fixes(locate) => place::stations_m(&way_m, &fixes(&times, others), locate),
            OnRoad::From { start_m, length_m } => place::by_wheels_m(&way_m, start_m, length_m),
        };
        match stations_m {
            Ok(stations_m) => {
                on_map = true;
                columns.push((Channel::SMapM.name(), stations_m));
            }
            Err(why) => notes.push(format!("not laid on the map: {why}")),
        }
    }
    if !on_map {
        match altitude {
            Some(altitude_m) => {
                let (grade_frac, sd_frac) = grades(&way_m, &altitude_m);
                notes.push(format!(
                    "grade from satellite altitude, within {:.2} %",
                    100.0 * sd_frac
                ));
                columns.push((Channel::GradeFrac.name(), grade_frac));
            }
            None => notes.push("no grade: neither a map nor an altitude".to_owned()),
        }
    }
    LoggedDrive { span, columns, distance_m, notes, on_map }
}

/// Takes away the pedal where another than the driver asks for torque (cruise control, a
/// transmission): it is not what the engine follows there.
fn without_others(times: &[f64], pedal: &mut [f64], others: &Others<'_>) -> Option<String> {
    let mode = others.torque_mode.as_ref()?;
    let mut taken = 0usize;
    for (t, pedal) in times.iter().zip(pedal.iter_mut()) {
        // 0: nobody asks for torque, 1: the pedal does
        if mode.at(*t) > 1.5 && pedal.is_finite() {
            *pedal = f64::NAN;
            taken += 1;
        }
    }
    let share = 100.0 * taken as f64 / times.len() as f64;
    (taken > 0).then(|| {
        format!("accelerator_pedal_frac: for {share:.0} % of the time another than the pedal asks for torque")
    })
}

/// Satellite fixes that came at a row: row, latitude, longitude, deg.
fn fixes(times: &[f64], others: &Others<'_>) -> Vec<(usize, f64, f64)> {
    let (Some(latitude), Some(longitude)) = (&others.latitude, &others.longitude) else {
        return Vec::new();
    };
    let mut found: Vec<(usize, f64, f64)> = Vec::new();
    for &(t, lat_deg) in &latitude.series.samples {
        let after = times.partition_point(|x| *x < t - 0.5 * STEP_S);
        let fits = times.get(after).is_some_and(|x| (x - t).abs() <= STEP_S);
        let lon_deg = longitude.at(t);
        if fits && lon_deg.is_finite() && found.last().is_none_or(|f| f.0 < after) {
            found.push((after, lat_deg, lon_deg));
        }
    }
    found
}

/// What the wheels count, m; nothing where the speed is missing.
fn ways_m(speed_m_s: &[f64]) -> Vec<f64> {
    let mut way_m = 0.0;
    let step = |&v: &f64| {
        let here_m = way_m;
        way_m += if v.is_finite() { STEP_S * v } else { 0.0 };
        here_m
    };
    speed_m_s.iter().map(step).collect()
}

/// Angles without jumps of a turn.
fn unwrap(angles_rad: &mut [f64]) {
    let mut last: Option<f64> = None;
    for angle in angles_rad.iter_mut().filter(|a| a.is_finite()) {
        if let Some(last) = last {
            *angle -= core::f64::consts::TAU * ((*angle - last) / core::f64::consts::TAU).round();
        }
        last = Some(*angle);
    }
}

/// Grade at every row, and its median standard deviation.
fn grades(way_m: &[f64], altitude_m: &[f64]) -> (Vec<f64>, f64) {
    let picked: Vec<usize> = (0..way_m.len()).step_by(GRADE_ROWS).collect();
    let at = |x: &[f64], k: usize| x.get(k).copied().unwrap_or(f64::NAN);
    let mut before_m = 0.0;
    let steps: Vec<f64> = picked
        .iter()
        .map(|&k| {
            let step = at(way_m, k) - before_m;
            before_m = at(way_m, k);
            step
        })
        .collect();
    let altitudes: Vec<f64> = picked.iter().map(|&k| at(altitude_m, k)).collect();
    let found = grade::from_altitude(&steps, &altitudes);
    let mut sds: Vec<f64> = found.iter().map(|g| g.1).collect();
    sds.sort_by(f64::total_cmp);
    let value = |k: usize| found.get(k.min(found.len().saturating_sub(1))).map_or(0.0, |g| g.0);
    let rows = (0..way_m.len()).map(|row| {
        let (k, f) = (row / GRADE_ROWS, (row % GRADE_ROWS) as f64 / GRADE_ROWS as f64);
        value(k) + f * (value(k + 1) - value(k))
    });
    (rows.collect(), sds.get(sds.len() / 2).copied().unwrap_or(f64::NAN))
}
