//! A SUMO that answers: process, socket and conversation together, and what a failure makes of it.
//!
//! After a failure of the connection or the protocol the link is *poisoned*: every later call gives
//! the first cause and sends nothing. Only a new link helps.

use std::time::Duration;

use super::error::SumoError;
use super::process::{Process, Programs};
use super::session::{Answer, Session};
use super::tcp::{Connection, LinkError, PortClaim};

/// TraCI versions that this client was checked with.
const VERSIONS: std::ops::RangeInclusive<i32> = 20..=22;
/// Attempts when another process takes the port between the choice and SUMO's start.
const PORT_ATTEMPTS: u32 = 3;

/// Waiting times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Timeouts {
    /// From the start of the process to the first answer, s.
    pub startup_s: f64,
    /// For one exchange, s.
    pub answer_s: f64,
}

impl Default for Timeouts {
    fn default() -> Self {
        Self { startup_s: 20.0, answer_s: 10.0 }
    }
}

/// A running SUMO and the conversation with it.
#[derive(Debug)]
pub struct Link {
    process: Option<Process>,
    connection: Connection,
    /// The conversation: write a request into it, then call [`Link::exchange`].
    pub session: Session,
    timeouts: Timeouts,
    port: u16,
    /// TraCI version.
    pub api: i32,
    /// What SUMO calls itself.
    pub name: String,
    /// Simulation time reached, s; kept by the caller for error messages.
    pub time_s: f64,
    poison: Option<String>,
}

impl Link {
    /// Starts SUMO on a free port with these options (port and client options are added).
    ///
    /// # Errors
    /// [`SumoError::Startup`] with SUMO's own words, [`SumoError::Version`].
    pub fn start(
        programs: &Programs,
        options: &[String],
        timeouts: Timeouts,
    ) -> Result<Self, SumoError> {
        let mut attempt = 0;
        loop {
            attempt += 1;
            match Self::start_once(programs, options, timeouts) {
                Err(SumoError::Startup { stderr, .. })
                    if stderr.contains("already in use") && attempt < PORT_ATTEMPTS => {}
                other => return other,
            }
        }
    }

    fn start_once(
        programs: &Programs,
        options: &[String],
        timeouts: Timeouts,
    ) -> Result<Self, SumoError> {
        // Kept until SUMO has answered: from then on its own connection holds the port.
        let claim = PortClaim::new()?;
        let port = claim.port;
        let mut process = Process::start(programs, &with_port(options, port))?;
        let wait = Duration::from_secs_f64(timeouts.startup_s);
        let opened = Connection::open(port, wait, || process.is_alive());
        let connection = match opened {
            Ok(connection) => connection,
            Err(LinkError::TimedOut) => {
                let after_s = timeouts.startup_s;
                return Err(SumoError::Timeout { operation: "connect", after_s });
            }
            Err(_) => {
                return Err(SumoError::Startup {
                    exit: process.ending(),
                    stderr: process.last_words(),
                });
            }
        };
        Self::greet(Some(process), connection, timeouts, port)
    }

    /// Takes over a connection to a SUMO that somebody else started.
    ///
    /// # Errors
    /// As [`Link::start`].
    pub fn attach(port: u16, timeouts: Timeouts) -> Result<Self, SumoError> {
        let wait = Duration::from_secs_f64(timeouts.startup_s);
        let connection = Connection::open(port, wait, || true).map_err(|_| SumoError::Timeout {
            operation: "connect",
            after_s: timeouts.startup_s,
        })?;
        Self::greet(None, connection, timeouts, port)
    }

    fn greet(
        process: Option<Process>,
        connection: Connection,
        timeouts: Timeouts,
        port: u16,
    ) -> Result<Self, SumoError> {
        let mut link = Self {
            port,
            process,
            connection,
            session: Session::default(),
            timeouts,
            api: 0,
            name: String::new(),
            time_s: 0.0,
            poison: None,
        };
        link.session.request().version();
        // A bad network lets SUMO open its port and crash only then: that is a failed start.
        link.exchange("version").map_err(|e| match e {
            SumoError::Disconnected { exit, stderr, .. } => SumoError::Startup { exit, stderr },
            other => other,
        })?;
        let Some(Answer::Version(api, name)) = link.session.answers.first().cloned() else {
            return Err(SumoError::Startup {
                exit: "running".to_owned(),
                stderr: "no version given".to_owned(),
            });
        };
        if !VERSIONS.contains(&api) {
            return Err(SumoError::Version { api, name });
        }
        (link.api, link.name) = (api, name);
        Ok(link)
    }

    /// Sends the session's request and reads the answers into the session. Refused commands are
    /// answers; see [`Session::refusal`].
    ///
    /// # Errors
    /// [`SumoError::Disconnected`], [`SumoError::Timeout`], [`SumoError::Protocol`]: the link is
    /// poisoned. [`SumoError::Poisoned`] afterwards.
    pub fn exchange(&mut self, operation: &'static str) -> Result<(), SumoError> {
        if let Some(cause) = &self.poison {
            return Err(SumoError::Poisoned { cause: cause.clone() });
        }
        let timeout = Duration::from_secs_f64(self.timeouts.answer_s);
        let result = match self.connection.exchange(self.session.message(), timeout) {
            Ok(body) => self.session.read(body).map_err(SumoError::from),
            Err(LinkError::Protocol(e)) => Err(e.into()),
            Err(LinkError::TimedOut) => {
                Err(SumoError::Timeout { operation, after_s: self.timeouts.answer_s })
            }
            Err(LinkError::Closed) => Err(SumoError::Disconnected {
                exit: self.process.as_mut().map_or("not ours".to_owned(), Process::ending),
                stderr: self.process.as_ref().map_or(String::new(), Process::last_words),
                time_s: self.time_s,
            }),
        };
        if let Err(cause) = &result {
            self.poison = Some(cause.to_string());
        }
        result
    }

    /// As [`Link::exchange`], and a refused command is an error.
    ///
    /// # Errors
    /// Those of [`Link::exchange`] and [`SumoError::Refused`].
    pub fn command(&mut self, operation: &'static str, object: &str) -> Result<(), SumoError> {
        self.exchange(operation)?;
        self.session.refusal(object).map_or(Ok(()), Err)
    }

    /// Loads a simulation into the running SUMO: the way back to the start, ten times quicker than a
    /// new process. Errors of the options show at the next exchange only.
    ///
    /// # Errors
    /// Those of [`Link::command`].
    pub fn load(&mut self, options: &[String]) -> Result<(), SumoError> {
        let options = with_port(options, self.port);
        self.session.request().load(&options);
        self.command("load", "")?;
        self.session.forget();
        self.time_s = 0.0;
        Ok(())
    }

    /// Is the link unusable?
    #[must_use]
    pub fn is_poisoned(&self) -> bool {
        self.poison.is_some()
    }

    /// Process id of our SUMO.
    #[must_use]
    pub fn pid(&self) -> Option<u32> {
        self.process.as_ref().map(Process::pid)
    }
}

fn with_port(options: &[String], port: u16) -> Vec<String> {
    let mut all = options.to_vec();
    all.extend(["--remote-port", &port.to_string(), "--num-clients", "1"].map(str::to_owned));
    all
}

impl Drop for Link {
    fn drop(&mut self) {
        if self.poison.is_none() {
            self.timeouts.answer_s = 1.0;
            self.session.request().close();
            let _ = self.exchange("close");
        }
    }
}
