//! What can go wrong with SUMO, and what that means for the caller.

use super::codec::ProtocolError;

/// Errors of the SUMO backend.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum SumoError {
    /// No SUMO on this machine.
    #[error(
        "SUMO was not found (tried {tried}); get it with `pip install eclipse-sumo` or \
         `apt-get install sumo`, or set SUMO_BINARY to the native `sumo` program"
    )]
    NotFound {
        /// Where it was looked for.
        tried: String,
    },
    /// SUMO speaks a TraCI version that this client was not checked with.
    #[error("{name} speaks TraCI {api}; versions 20 to 22 are supported (SUMO 1.8 to 1.28)")]
    Version {
        /// TraCI API version.
        api: i32,
        /// What SUMO calls itself.
        name: String,
    },
    /// SUMO ended before it answered the first question.
    #[error("SUMO did not start ({exit}): {stderr}")]
    Startup {
        /// Exit code or signal.
        exit: String,
        /// Last lines of its error output.
        stderr: String,
    },
    /// The road cannot be brought into SUMO.
    #[error("map for SUMO: {why}")]
    Map {
        /// What is wrong.
        why: String,
    },
    /// `netconvert` failed.
    #[error("netconvert ({exit}): {stderr}")]
    NetConvert {
        /// Exit code or signal.
        exit: String,
        /// Last lines of its error output.
        stderr: String,
    },
    /// SUMO went away.
    #[error("SUMO went away at {time_s} s ({exit}): {stderr}")]
    Disconnected {
        /// Exit code or signal, if it has ended.
        exit: String,
        /// Last lines of its error output.
        stderr: String,
        /// Simulation time reached, s.
        time_s: f64,
    },
    /// SUMO did not answer in time.
    #[error("SUMO did not answer {operation} within {after_s} s")]
    Timeout {
        /// What was asked.
        operation: &'static str,
        /// How long was waited, s.
        after_s: f64,
    },
    /// The answer does not follow the protocol.
    #[error(transparent)]
    Protocol(#[from] ProtocolError),
    /// SUMO refused one command; the connection is fine.
    #[error(
        "SUMO refused command 0x{command:02x}, variable 0x{variable:02x} of `{object}`: {text}"
    )]
    Refused {
        /// Command id.
        command: u8,
        /// Variable id.
        variable: u8,
        /// Object id.
        object: String,
        /// SUMO's words.
        text: String,
    },
    /// A number that would corrupt SUMO's state was held back.
    #[error("{field} is not finite: {value}; not sent to SUMO")]
    NonFinite {
        /// Name with unit.
        field: &'static str,
        /// The value.
        value: f64,
    },
    /// The ego could not be put into SUMO.
    #[error("ego not inserted into SUMO: {why}")]
    EgoNotInserted {
        /// Why.
        why: String,
    },
    /// An earlier failure: everything after it is refused with its cause.
    #[error("SUMO session is unusable since: {cause}")]
    Poisoned {
        /// The first failure.
        cause: String,
    },
    /// SUMO was restarted too often.
    #[error("SUMO failed {restarts} times; given up. Last: {cause}")]
    TooManyRestarts {
        /// Restarts so far.
        restarts: u32,
        /// The last failure.
        cause: String,
    },
    /// A file could not be read or written.
    #[error("{path}: {why}")]
    File {
        /// The file.
        path: String,
        /// What the system says.
        why: String,
    },
}

impl SumoError {
    /// May the same call succeed after a restart of SUMO?
    #[must_use]
    pub fn is_retryable(&self) -> bool {
        matches!(
            self,
            Self::Disconnected { .. }
                | Self::Timeout { .. }
                | Self::Protocol(_)
                | Self::Poisoned { .. }
        )
    }

    /// Is the connection unusable after this?
    #[must_use]
    pub fn is_fatal(&self) -> bool {
        !matches!(self, Self::Refused { .. } | Self::NonFinite { .. })
    }
}
