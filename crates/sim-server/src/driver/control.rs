//! What a user may ask of a run under way. Controls act between two ticks.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use planner::decider::LaneChoice;
use serde::Deserialize;

use super::Pace;

/// A control. As JSON: `{"action": "step", "ticks": 10}`, `{"action": "pace", "pace": "max"}`.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(tag = "action", rename_all = "snake_case", deny_unknown_fields)]
pub(crate) enum Control {
    /// Goes on at the present pace.
    Play {},
    /// Stands still between two ticks.
    Pause {},
    /// Pauses, and drives this many ticks.
    Step {
        /// Number of ticks.
        ticks: u32,
    },
    /// Changes the pace.
    Pace {
        /// The new pace.
        #[serde(deserialize_with = "pace")]
        pace: Pace,
    },
    /// Wishes a lane change (decider `external`); the safety gate decides.
    LaneChange {
        /// Which way.
        to: LaneChoice,
    },
}

/// Where controls are sent.
pub(crate) type ControlSender = SyncSender<Control>;

/// The queue from the API to the world's thread; a full one refuses.
pub(crate) fn channel() -> (ControlSender, Receiver<Control>) {
    sync_channel(64)
}

fn pace<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Pace, D::Error> {
    String::deserialize(deserializer)?.parse().map_err(serde::de::Error::custom)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn controls_are_read_from_json_and_unknown_keys_are_refused() {
        let read = |text: &str| serde_json::from_str::<Control>(text);
        assert_eq!(read(r#"{"action":"play"}"#).unwrap(), Control::Play {});
        assert_eq!(read(r#"{"action":"step","ticks":3}"#).unwrap(), Control::Step { ticks: 3 });
        assert_eq!(
            read(r#"{"action":"pace","pace":"max"}"#).unwrap(),
            Control::Pace { pace: Pace::Max }
        );
        assert_eq!(
            read(r#"{"action":"lane_change","to":"left"}"#).unwrap(),
            Control::LaneChange { to: LaneChoice::Left }
        );
        for bad in [
            r#"{"action":"lane_change","to":"up"}"#,
            r#"{"action":"fly"}"#,
            r#"{"action":"step"}"#,
            r#"{"action":"step","ticks":-1}"#,
            r#"{"action":"pace","pace":"NaN"}"#,
            r#"{"action":"play","extra":1}"#,
        ] {
            assert!(read(bad).is_err(), "{bad}");
        }
    }
}
