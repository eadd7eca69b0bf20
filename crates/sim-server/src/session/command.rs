//! What a user may ask of a session. Commands act between two ticks.

use planner::decider::LaneChoice;
use serde_json::{Map, Value};
use sim::{Fault, StackChange};

use super::{Next, Pace};

/// A command. As JSON: `{"action": "step", "ticks": 10}`, `{"action": "pace", "pace": "max"}`.
pub(crate) enum Command {
    /// Goes on at the present pace.
    Play,
    /// Stands still between two ticks.
    Pause,
    /// From pause to pause.
    Step {
        /// Number of ticks, 1 to [`MAX_TICKS`].
        ticks: u32,
        /// The answer comes when they are driven, not when they begin.
        wait: bool,
    },
    /// From pause to pause, to the first tick at or behind a time.
    StepUntil {
        /// Simulation time, s.
        time_s: f64,
        /// As with [`Self::Step`].
        wait: bool,
    },
    /// Stands still at the first tick at or behind a simulation time, s, when it comes there.
    PauseAt(f64),
    /// Keeps the world as it is now, under a name.
    Snapshot(String),
    /// Changes the pace.
    Pace(Pace),
    /// Wishes a lane change (decider `external`); the safety gate decides.
    LaneChange {
        /// Which way.
        to: LaneChoice,
    },
    /// The driver's set speed, m/s, 0 to 40.
    SetSpeed(f64),
    /// Another decider or speed planner.
    Change(StackChange),
    /// Somebody else drives: acceleration along the road, m/s², and angle of the front wheels, rad,
    /// from now on. Without another one within 0.2 s the truck stops in its lane.
    External {
        /// Acceleration, m/s², -10 to 5.
        accel_m_s2: f64,
        /// Angle of the front wheels, rad, -1 to 1; positive: to the left.
        road_wheel_rad: f64,
    },
    /// Nobody else drives any more.
    Release,
    /// Breaks something, or mends it.
    Fault(Fault, bool),
    /// Ends the run and the session.
    Quit,
    /// Ends the run and begins another one.
    Begin(Box<Next>),
}

/// What a text asks for: a command, or another world, which must be built first
/// ([`super::Handle::reset`]).
pub(crate) enum Wish {
    /// To be sent as it is.
    Command(Command),
    /// Back to the start.
    Reset {
        /// Another seed.
        seed: Option<u64>,
    },
    /// Back to the start, standing still.
    Stop,
    /// Back to where the world was kept under this name.
    Restore(String),
}

/// Ticks of one command, at most.
pub(crate) const MAX_TICKS: u32 = 1_000_000;

/// Why a text is no command, in words that name the key and its values.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(crate) enum CommandError {
    #[error("the body is not a JSON object like {{\"action\": \"pause\"}}")]
    NotAnObject,
    #[error(
        "unknown action {0}; there are play, pause, step, step_until, pause_at, reset, stop, \
         snapshot, restore, pace, lane_change, set_speed, set_decider, set_speed_planner, external, \
         release, fault and quit"
    )]
    UnknownAction(String),
    #[error("{action} needs {key}: {values}")]
    MissingKey { action: &'static str, key: &'static str, values: &'static str },
    #[error("{key} = {value}: expected {values}")]
    WrongValue { key: &'static str, value: String, values: &'static str },
    #[error("{action} has no key {key:?}")]
    UnknownKey { action: String, key: String },
    #[error("{0}")]
    Decider(String),
}

impl CommandError {
    /// A word for programs.
    pub(crate) const fn code(&self) -> &'static str {
        match self {
            Self::NotAnObject => "not_an_object",
            Self::UnknownAction(_) => "unknown_action",
            Self::MissingKey { .. } => "missing_key",
            Self::WrongValue { .. } | Self::Decider(_) => "wrong_value",
            Self::UnknownKey { .. } => "unknown_key",
        }
    }
}

impl Wish {
    /// Reads a wish from JSON.
    ///
    /// # Errors
    /// [`CommandError`].
    pub(crate) fn from_json(text: &[u8]) -> Result<Self, CommandError> {
        let value: Value = serde_json::from_slice(text).map_err(|_| CommandError::NotAnObject)?;
        let Value::Object(mut keys) = value else { return Err(CommandError::NotAnObject) };
        let Some(action) = keys.remove("action") else { return Err(CommandError::NotAnObject) };
        let wish = match action.as_str() {
            Some("play") => Self::Command(Command::Play),
            Some("pause") => Self::Command(Command::Pause),
            Some("stop") => Self::Stop,
            Some("quit") => Self::Command(Command::Quit),
            Some("step") => {
                let values = "a number of ticks from 1 to 1000000";
                let ticks = |v: &Value| v.as_u64().and_then(|n| u32::try_from(n).ok());
                let ticks = |v: &Value| ticks(v).filter(|n| (1..=MAX_TICKS).contains(n));
                let ticks = take(&mut keys, "step", "ticks", values, ticks)?;
                Self::Command(Command::Step { ticks, wait: take_wait(&mut keys)? })
            }
            Some("step_until") => {
                let time_s = take(&mut keys, "step_until", "time_s", TIMES, time)?;
                Self::Command(Command::StepUntil { time_s, wait: take_wait(&mut keys)? })
            }
            Some("pause_at") => {
                let time_s = take(&mut keys, "pause_at", "time_s", TIMES, time)?;
                Self::Command(Command::PauseAt(time_s))
            }
            Some("snapshot") => {
                Self::Command(Command::Snapshot(take(&mut keys, "snapshot", "name", NAMES, name)?))
            }
            Some("restore") => Self::Restore(take(&mut keys, "restore", "name", NAMES, name)?),
            Some("reset") => {
                let seed = take_optional(&mut keys, "seed", SEEDS, Value::as_u64)?;
                Self::Reset { seed }
            }
            Some("set_speed") => {
                let values = "a speed in m/s from 0 to 40";
                let speed = |v: &Value| v.as_f64().filter(|v| (0.0..=40.0).contains(v));
                let speed_m_s = take(&mut keys, "set_speed", "speed_m_s", values, speed)?;
                Self::Command(Command::SetSpeed(speed_m_s))
            }
            Some("pace") => {
                let pace = take(&mut keys, "pace", "pace", Pace::VALUES, Pace::from_json)?;
                Self::Command(Command::Pace(pace))
            }
            Some("lane_change") => {
                let to = |v: &Value| serde_json::from_value(v.clone()).ok();
                let values = "left, right or keep";
                let to = take(&mut keys, "lane_change", "to", values, to)?;
                Self::Command(Command::LaneChange { to })
            }
            Some("set_decider") => {
                let text = |v: &Value| v.as_str().map(str::to_owned);
                let word = take(&mut keys, "set_decider", "decider", DECIDERS, text)?;
                let change = StackChange::decider(&word);
                Self::Command(Command::Change(
                    change.map_err(|e| CommandError::Decider(e.to_string()))?,
                ))
            }
            Some("set_speed_planner") => {
                let kind = |v: &Value| serde_json::from_value(v.clone()).ok();
                let (key, values) = ("speed_planner", "cruise or predictive");
                let kind = take(&mut keys, "set_speed_planner", key, values, kind)?;
                Self::Command(Command::Change(StackChange::SpeedPlanner { kind }))
            }
            Some("external") => Self::Command(Command::External {
                accel_m_s2: take(&mut keys, "external", "accel_m_s2", ACCELS, |v| {
                    v.as_f64().filter(|a| (-10.0..=5.0).contains(a))
                })?,
                road_wheel_rad: take(&mut keys, "external", "road_wheel_rad", WHEELS, |v| {
                    v.as_f64().filter(|a| (-1.0..=1.0).contains(a))
                })?,
            }),
            Some("release") => Self::Command(Command::Release),
            Some("fault") => {
                let fault = |v: &Value| v.as_str().and_then(|word| word.parse().ok());
                let fault = take(&mut keys, "fault", "fault", FAULTS, fault)?;
                let is_on = take(&mut keys, "fault", "on", "true or false", Value::as_bool)?;
                Self::Command(Command::Fault(fault, is_on))
            }
            _ => return Err(CommandError::UnknownAction(action.to_string())),
        };
        match keys.into_iter().next() {
            Some((key, _)) => Err(CommandError::UnknownKey { action: action.to_string(), key }),
            None => Ok(wish),
        }
    }
}

const TIMES: &str = "a simulation time in seconds, zero or more";
const DECIDERS: &str = "keep, rules:METRES, mobil, rollout, dqn or external";
const ACCELS: &str = "an acceleration in m/s2 from -10 to 5";
const WHEELS: &str = "an angle in rad from -1 to 1";
const FAULTS: &str = "localisation, perception, and over a bus wheel_speeds, engine, transmission, \
                      brakes, steering, retarder, radar or cab";
const NAMES: &str = "a name of 1 to 40 lower-case letters, digits and hyphens";

fn time(value: &Value) -> Option<f64> {
    value.as_f64().filter(|t| *t >= 0.0 && t.is_finite())
}

fn name(value: &Value) -> Option<String> {
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    let fits = |name: &&str| (1..=40).contains(&name.len()) && name.chars().all(plain);
    value.as_str().filter(fits).map(str::to_owned)
}

const SEEDS: &str = "a whole number from 0 to 18446744073709551615";

/// Takes the value of a key out of a command.
fn take<T>(
    keys: &mut Map<String, Value>,
    action: &'static str,
    key: &'static str,
    values: &'static str,
    read: impl FnOnce(&Value) -> Option<T>,
) -> Result<T, CommandError> {
    take_optional(keys, key, values, read)?.ok_or(CommandError::MissingKey { action, key, values })
}

/// As [`take`], of a key that may be missing.
fn take_optional<T>(
    keys: &mut Map<String, Value>,
    key: &'static str,
    values: &'static str,
    read: impl FnOnce(&Value) -> Option<T>,
) -> Result<Option<T>, CommandError> {
    let Some(value) = keys.remove(key) else { return Ok(None) };
    match read(&value) {
        Some(read) => Ok(Some(read)),
        None => Err(CommandError::WrongValue { key, value: value.to_string(), values }),
    }
}

/// Whether the answer waits for the end.
fn take_wait(keys: &mut Map<String, Value>) -> Result<bool, CommandError> {
    let wait = take_optional(keys, "wait", "true or false", Value::as_bool)?;
    Ok(wait.unwrap_or(false))
}
