//! What is wrong with a measurement itself, by drive, channel and time.

use serde::Serialize;

/// One defect of the data.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// Name of the drive.
    pub drive: String,
    /// Column, if the defect belongs to one.
    pub channel: Option<String>,
    /// When it begins, s in the drive's time, if it has a time.
    pub time_s: Option<f64>,
    /// What kind of defect.
    #[serde(flatten)]
    pub kind: FindingKind,
    /// What was done about it.
    pub action: Action,
}

/// Kinds of defects.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[non_exhaustive]
pub enum FindingKind {
    /// A column that the contract does not know.
    UnknownColumn,
    /// Samples that are NaN, infinite or null.
    NonFinite {
        /// How many.
        samples: usize,
    },
    /// Values outside what any highway truck can show.
    Implausible {
        /// How many.
        samples: usize,
        /// The first such value.
        value: f64,
    },
    /// The values fit the column after a change of unit.
    WrongUnit {
        /// The unit that it seems to be in.
        suspected: &'static str,
    },
    /// A channel that must move stands still.
    Stuck {
        /// For how long, s.
        seconds: f64,
    },
    /// No rows for longer than ten sample times.
    Gap {
        /// For how long, s.
        seconds: f64,
    },
    /// Rows with the time of the row before.
    DuplicateTime {
        /// How many.
        rows: usize,
    },
    /// Two channels that measure the same run apart in time.
    ClockOffset {
        /// The channel that it was compared with.
        against: String,
        /// Lag of the channel behind the other, s, beyond the delay of a held signal.
        seconds: f64,
        /// Standard deviation of the lag, s.
        sigma_s: f64,
        /// End of the stretch with this lag, s in the drive's time.
        until_s: f64,
    },
    /// The lag between two channels changes steadily along a stretch of the drive.
    ClockDrift {
        /// The channel that it was compared with.
        against: String,
        /// Lag at the begin of the stretch, s.
        first_s: f64,
        /// Lag at its end, s.
        last_s: f64,
        /// Standard deviation of the change, s.
        sigma_s: f64,
    },
    /// The lag between two channels jumps.
    ClockJump {
        /// The channel that it was compared with.
        against: String,
        /// Lag before, s.
        before_s: f64,
        /// Lag after, s.
        after_s: f64,
        /// Standard deviation of the jump, s.
        sigma_s: f64,
    },
    /// The index names another truck than the truck file.
    TruckName {
        /// Name in the index.
        index: String,
    },
}

/// What the reader did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Action {
    /// Noted only.
    Kept,
    /// Interpolated over the samples.
    Interpolated,
    /// The channel is not used; causes that need it are reported as not observable.
    ChannelDropped,
    /// The rows are not used.
    RowsDropped,
    /// Converted to the column's unit, or shifted to the common clock.
    Corrected,
}
