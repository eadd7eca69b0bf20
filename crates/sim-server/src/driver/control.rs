//! What a user may ask of a run under way. Controls act between two ticks.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use planner::decider::LaneChoice;
use serde_json::{Map, Value};

use super::Pace;

/// A control. As JSON: `{"action": "step", "ticks": 10}`, `{"action": "pace", "pace": "max"}`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Control {
    /// Goes on at the present pace.
    Play,
    /// Stands still between two ticks.
    Pause,
    /// Pauses, and drives this many ticks.
    Step {
        /// Number of ticks.
        ticks: u32,
    },
    /// Changes the pace.
    Pace(Pace),
    /// Wishes a lane change (decider `external`); the safety gate decides.
    LaneChange {
        /// Which way.
        to: LaneChoice,
    },
}

/// Why a text is no control, in words that name the key and its values.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(crate) enum ControlError {
    #[error("the body is not a JSON object like {{\"action\": \"pause\"}}")]
    NotAnObject,
    #[error("unknown action {0}; there are play, pause, step, pace and lane_change")]
    UnknownAction(String),
    #[error("{action} needs {key}: {values}")]
    MissingKey { action: &'static str, key: &'static str, values: &'static str },
    #[error("{key} = {value}: expected {values}")]
    WrongValue { key: &'static str, value: String, values: &'static str },
    #[error("{action} has no key {key:?}")]
    UnknownKey { action: String, key: String },
}

impl ControlError {
    /// A word for programs.
    pub(crate) const fn code(&self) -> &'static str {
        match self {
            Self::NotAnObject => "not_an_object",
            Self::UnknownAction(_) => "unknown_action",
            Self::MissingKey { .. } => "missing_key",
            Self::WrongValue { .. } => "wrong_value",
            Self::UnknownKey { .. } => "unknown_key",
        }
    }
}

impl Control {
    /// Reads a control from JSON.
    ///
    /// # Errors
    /// [`ControlError`].
    pub(crate) fn from_json(text: &[u8]) -> Result<Self, ControlError> {
        let value: Value = serde_json::from_slice(text).map_err(|_| ControlError::NotAnObject)?;
        let Value::Object(mut keys) = value else { return Err(ControlError::NotAnObject) };
        let Some(action) = keys.remove("action") else { return Err(ControlError::NotAnObject) };
        let control = match action.as_str() {
            Some("play") => Self::Play,
            Some("pause") => Self::Pause,
            Some("step") => {
                let values = "a number of ticks from 1 to 4294967295";
                let ticks = |v: &Value| v.as_u64().and_then(|n| u32::try_from(n).ok());
                let ticks = |v: &Value| ticks(v).filter(|n| *n > 0);
                Self::Step { ticks: take(&mut keys, "step", "ticks", values, ticks)? }
            }
            Some("pace") => {
                Self::Pace(take(&mut keys, "pace", "pace", Pace::VALUES, |v| match v {
                    Value::String(text) => text.parse().ok(),
                    Value::Number(factor) => factor.to_string().parse().ok(),
                    _ => None,
                })?)
            }
            Some("lane_change") => {
                let to = |v: &Value| serde_json::from_value(v.clone()).ok();
                let values = "left, right or keep";
                Self::LaneChange { to: take(&mut keys, "lane_change", "to", values, to)? }
            }
            _ => return Err(ControlError::UnknownAction(action.to_string())),
        };
        match keys.into_iter().next() {
            Some((key, _)) => Err(ControlError::UnknownKey { action: action.to_string(), key }),
            None => Ok(control),
        }
    }
}

/// Takes the value of a key out of a control.
fn take<T>(
    keys: &mut Map<String, Value>,
    action: &'static str,
    key: &'static str,
    values: &'static str,
    read: impl FnOnce(&Value) -> Option<T>,
) -> Result<T, ControlError> {
    let value = keys.remove(key).ok_or(ControlError::MissingKey { action, key, values })?;
    read(&value).ok_or_else(|| ControlError::WrongValue { key, value: value.to_string(), values })
}

/// Where controls are sent.
pub(crate) type ControlSender = SyncSender<Control>;

/// The queue from the API to the world's thread; a full one refuses.
pub(crate) fn channel() -> (ControlSender, Receiver<Control>) {
    sync_channel(64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Control, ControlError> {
        Control::from_json(text.as_bytes())
    }

    #[test]
    fn controls_are_read_from_json() {
        for (text, control) in [
            (r#"{"action":"play"}"#, Control::Play),
            (r#"{"action":"pause"}"#, Control::Pause),
            (r#"{"action":"step","ticks":3}"#, Control::Step { ticks: 3 }),
            (r#"{"action":"pace","pace":"max"}"#, Control::Pace(Pace::Max)),
            (r#"{"action":"pace","pace":5}"#, Control::Pace(Pace::Factor(5.0))),
            (r#"{"action":"pace","pace":0.5}"#, Control::Pace(Pace::Factor(0.5))),
            (r#"{"pace":"2","action":"pace"}"#, Control::Pace(Pace::Factor(2.0))),
            (
                r#"{"action":"lane_change","to":"left"}"#,
                Control::LaneChange { to: LaneChoice::Left },
            ),
        ] {
            assert_eq!(read(text), Ok(control), "{text}");
        }
    }

    #[test]
    fn what_is_no_control_is_refused_with_a_code_and_in_our_own_words() {
        for (text, code, words) in [
            ("", "not_an_object", "JSON object"),
            ("[1]", "not_an_object", "JSON object"),
            ("{}", "not_an_object", "action"),
            (r#"{"action":"fly"}"#, "unknown_action", "\"fly\"; there are play"),
            (r#"{"action":7}"#, "unknown_action", "7"),
            (r#"{"action":"step"}"#, "missing_key", "step needs ticks"),
            (r#"{"action":"step","ticks":-1}"#, "wrong_value", "ticks = -1"),
            (r#"{"action":"step","ticks":0}"#, "wrong_value", "ticks = 0"),
            (r#"{"action":"pace","pace":"NaN"}"#, "wrong_value", "realtime, max or a factor"),
            (r#"{"action":"pace","pace":0}"#, "wrong_value", "pace = 0"),
            (r#"{"action":"pace","pace":true}"#, "wrong_value", "pace = true"),
            (r#"{"action":"lane_change","to":"up"}"#, "wrong_value", "left, right or keep"),
            (r#"{"action":"play","extra":1}"#, "unknown_key", "extra"),
        ] {
            let error = read(text).unwrap_err();
            assert_eq!(error.code(), code, "{text}");
            assert!(error.to_string().contains(words), "{text}: {error}");
        }
    }
}
