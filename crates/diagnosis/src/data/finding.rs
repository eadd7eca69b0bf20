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
    /// Values that are too far from those before for a truck to have moved there.
    Jump {
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
    /// There is no gear: the ratio of engine and road speed is taken, whatever slips.
    RatioMeasured {
        /// Part of the driving in which it is that of a gear of the truck file.
        fits_frac: f64,
    },
    /// There is no grade; it was worked out from altitude.
    GradeFromAltitude {
        /// Its standard deviation, rise over run.
        sigma_frac: f64,
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

impl core::fmt::Display for FindingKind {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::UnknownColumn => write!(f, "the contract does not know this column"),
            Self::NonFinite { samples } => write!(f, "{samples} samples are no numbers"),
            Self::Implausible { samples, value } => {
                write!(f, "{samples} samples that no highway truck shows, the first is {value}")
            }
            Self::Jump { samples, value } => {
                write!(f, "{samples} samples jump away from those before, the first to {value}")
            }
            Self::WrongUnit { suspected } => write!(f, "it seems to be in {suspected}"),
            Self::Stuck { seconds } => write!(f, "it stands still for {seconds:.1} s"),
            Self::Gap { seconds } => write!(f, "no rows for {seconds:.1} s"),
            Self::DuplicateTime { rows } => write!(f, "{rows} rows repeat the time before"),
            Self::ClockOffset { against, seconds, sigma_s, until_s } => {
                write!(f, "{seconds:.2} ± {sigma_s:.2} s behind {against} until {until_s:.0} s")
            }
            Self::ClockDrift { against, first_s, last_s, sigma_s } => write!(
                f,
                "its lag behind {against} drifts from {first_s:.2} to {last_s:.2} ± {sigma_s:.2} s"
            ),
            Self::ClockJump { against, before_s, after_s, sigma_s } => write!(
                f,
                "its lag behind {against} jumps from {before_s:.2} to {after_s:.2} ± {sigma_s:.2} s"
            ),
            Self::RatioMeasured { fits_frac } => write!(
                f,
                "there is none; engine over road speed is taken as the ratio, which is that of a gear \
                 of the truck file in {:.0} % of the driving",
                100.0 * fits_frac
            ),
            Self::GradeFromAltitude { sigma_frac } => {
                write!(f, "there is none; worked out from altitude, to {:.2} %", 100.0 * sigma_frac)
            }
            Self::TruckName { index } => write!(f, "the index names the truck {index:?}"),
        }
    }
}

impl core::fmt::Display for Action {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Kept => "noted only",
            Self::Interpolated => "interpolated",
            Self::ChannelDropped => "the channel is not used",
            Self::RowsDropped => "these rows are not used",
            Self::Corrected => "corrected",
        })
    }
}
