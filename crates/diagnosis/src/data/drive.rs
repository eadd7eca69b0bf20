//! Measured drives in memory, on a uniform time grid.

use crate::data::channel::CHANNELS;
use crate::{Channel, Finding};

/// One drive on a uniform grid of [`Drive::STEP_S`].
#[derive(Debug, Clone, PartialEq)]
pub struct Drive {
    /// Name, from `drives.toml`.
    pub name: String,
    /// Time of the first sample in the file, s.
    pub start_s: f64,
    /// Number of samples.
    pub len: usize,
    /// Mass from the load sheet, kg.
    pub reported_mass_kg: Option<f64>,
    /// Tyres were warm at the start; unknown if the index does not say.
    pub tyres_warm_at_start: Option<bool>,
    /// Nobody logged the gear: it is the nearest to engine over road speed, and a converter may slip.
    pub gear_derived: bool,
    /// Road map by position, if the index names one.
    pub map: Option<RoadMap>,
    /// The readings of a drive that is in neutral from begin to end.
    pub coast_down: Option<CoastDown>,
    channels: [Option<Vec<f64>>; CHANNELS],
}

/// A coast-down as it was read: a truck in neutral that nobody brakes.
#[derive(Debug, Clone, PartialEq)]
pub struct CoastDown {
    /// Times, s from the first reading on.
    pub time_s: Vec<f64>,
    /// Speeds, m/s.
    pub speed_m_s: Vec<f64>,
    /// Time between two rows of its table, s; a reading is the mean of those of five seconds.
    pub step_s: f64,
    /// Standard deviation of the times, s.
    pub time_sigma_s: f64,
    /// Standard deviation of the speeds, m/s.
    pub speed_sigma_m_s: f64,
}

/// Grade and curvature over the position on the map.
#[derive(Debug, Clone, PartialEq)]
pub struct RoadMap {
    /// Position, m, increasing.
    pub s_m: Vec<f64>,
    /// Rise over run.
    pub grade_frac: Vec<f64>,
    /// Curvature, 1/m, positive left.
    pub curvature_1_m: Vec<f64>,
}

impl Drive {
    /// Grid step, s (20 Hz).
    pub const STEP_S: f64 = 0.05;

    /// An empty drive of `len` samples.
    #[must_use]
    pub fn new(name: &str, start_s: f64, len: usize) -> Self {
        Self {
            name: name.to_owned(),
            start_s,
            len,
            reported_mass_kg: None,
            tyres_warm_at_start: None,
            gear_derived: false,
            map: None,
            coast_down: None,
            channels: Default::default(),
        }
    }

    /// Samples of a channel, if the drive has it.
    #[must_use]
    pub fn get(&self, channel: Channel) -> Option<&[f64]> {
        self.channels[channel as usize].as_deref()
    }

    /// Whether the drive has the channel.
    #[must_use]
    pub fn has(&self, channel: Channel) -> bool {
        self.channels[channel as usize].is_some()
    }

    /// Sets a channel. Samples of another length than the drive's are not accepted and leave the
    /// channel absent.
    pub fn set(&mut self, channel: Channel, samples: Vec<f64>) {
        self.channels[channel as usize] = (samples.len() == self.len).then_some(samples);
    }

    /// Removes a channel.
    pub fn remove(&mut self, channel: Channel) {
        self.channels[channel as usize] = None;
    }

    /// Duration, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.len as f64 * Self::STEP_S
    }
}

/// A folder of drives.
#[derive(Debug, Clone, PartialEq)]
pub struct DriveSet {
    /// The truck file that the measurement was made with, as the index names it.
    pub truck: String,
    /// The drives, in the index's order.
    pub drives: Vec<Drive>,
    /// What was found while reading: gaps, stuck sensors, wrong units, clock offsets.
    pub findings: Vec<Finding>,
}
