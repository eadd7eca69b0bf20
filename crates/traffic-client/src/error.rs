//! What can go wrong with traffic.

/// Errors of all traffic sources.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrafficError {
    /// A configuration value is out of its range; the text names every key and value.
    #[error("traffic configuration: {why}")]
    Config {
        /// What is wrong.
        why: String,
    },
    /// The road cannot carry traffic.
    #[error("road for traffic: {why}")]
    Road {
        /// What is wrong.
        why: String,
    },
    /// The ego state is unusable.
    #[error("ego state: {0}")]
    Ego(#[from] tractrix_core::CoreError),
    /// Time went backwards.
    #[error("traffic was asked for time {asked_s} s after it had reached {reached_s} s")]
    TimeBackwards {
        /// Time asked for, s.
        asked_s: f64,
        /// Time reached, s.
        reached_s: f64,
    },
    /// Time made a leap that cannot be meant.
    #[error("traffic at {reached_s} s was asked for {asked_s} s; at most 600 s in one step")]
    TimeJump {
        /// Time asked for, s.
        asked_s: f64,
        /// Time reached, s.
        reached_s: f64,
    },
    /// SUMO.
    #[error(transparent)]
    Sumo(#[from] crate::sumo::SumoError),
    /// A recording.
    #[error(transparent)]
    Replay(#[from] crate::replay::ReplayError),
    /// A manifest is unusable, or names other inputs.
    #[error("traffic manifest: {why}")]
    Manifest {
        /// What is wrong.
        why: String,
    },
    /// A repeated run is not the same.
    #[error("traffic differs from the manifest between ticks {from_tick} and {tick}")]
    Diverged {
        /// Last tick known to be equal.
        from_tick: u64,
        /// Tick at which the difference was seen.
        tick: u64,
    },
}
