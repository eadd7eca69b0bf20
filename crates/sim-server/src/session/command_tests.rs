//! Commands in words.

use super::Pace;
use super::command::*;
use planner::SpeedPlannerKind;
use planner::decider::{DeciderKind, LaneChoice};
use sim::{Fault, StackChange};

fn read(text: &str) -> Result<Wish, CommandError> {
    Wish::from_json(text.as_bytes())
}

#[test]
fn commands_are_read_from_json() {
    use Command as C;
    type Is = fn(&Wish) -> bool;
    use Wish as W;
    let cases: [(&str, Is); 22] = [
        (r#"{"action":"set_decider","decider":"rules:50"}"#, |c| {
            let rules = DeciderKind::Rules { distance_m: 50.0 };
            let none = StackChange::Decider { kind: rules, policy_file: None };
            matches!(c, W::Command(C::Change(change)) if *change == none)
        }),
        (r#"{"action":"set_speed_planner","speed_planner":"predictive"}"#, |c| {
            let kind = SpeedPlannerKind::Predictive;
            let wanted = StackChange::SpeedPlanner { kind };
            matches!(c, W::Command(C::Change(change)) if *change == wanted)
        }),
        (r#"{"action":"external","accel_m_s2":-1.5,"road_wheel_rad":0.01}"#, |c| {
            matches!(c, W::Command(C::External { accel_m_s2: -1.5, road_wheel_rad: 0.01 }))
        }),
        (r#"{"action":"release"}"#, |c| matches!(c, W::Command(C::Release))),
        (r#"{"action":"fault","fault":"perception","on":true}"#, |c| {
            matches!(c, W::Command(C::Fault(Fault::Perception, true)))
        }),
        (r#"{"action":"pause_at","time_s":4}"#, |c| matches!(c, W::Command(C::PauseAt(4.0)))),
        (
            r#"{"action":"snapshot","name":"a-1"}"#,
            |c| matches!(c, W::Command(C::Snapshot(name)) if name == "a-1"),
        ),
        (
            r#"{"action":"restore","name":"a-1"}"#,
            |c| matches!(c, W::Restore(name) if name == "a-1"),
        ),
        (r#"{"action":"play"}"#, |c| matches!(c, W::Command(C::Play))),
        (r#"{"action":"pause"}"#, |c| matches!(c, W::Command(C::Pause))),
        (r#"{"action":"stop"}"#, |c| matches!(c, W::Stop)),
        (r#"{"action":"quit"}"#, |c| matches!(c, W::Command(C::Quit))),
        (r#"{"action":"step","ticks":3}"#, |c| {
            matches!(c, W::Command(C::Step { ticks: 3, wait: false }))
        }),
        (r#"{"action":"step","ticks":3,"wait":true}"#, |c| {
            matches!(c, W::Command(C::Step { ticks: 3, wait: true }))
        }),
        (r#"{"action":"step_until","time_s":2.5}"#, |c| {
            matches!(c, W::Command(C::StepUntil { time_s: 2.5, wait: false }))
        }),
        (r#"{"action":"reset"}"#, |c| matches!(c, W::Reset { seed: None })),
        (r#"{"action":"reset","seed":18446744073709551615}"#, |c| {
            matches!(c, W::Reset { seed: Some(u64::MAX) })
        }),
        (r#"{"action":"set_speed","speed_m_s":20}"#, |c| {
            matches!(c, W::Command(C::SetSpeed(20.0)))
        }),
        (r#"{"action":"pace","pace":"max"}"#, |c| matches!(c, W::Command(C::Pace(Pace::Max)))),
        (r#"{"action":"pace","pace":0.5}"#, |c| {
            matches!(c, W::Command(C::Pace(Pace::Factor(0.5))))
        }),
        (r#"{"pace":"2","action":"pace"}"#, |c| {
            matches!(c, W::Command(C::Pace(Pace::Factor(2.0))))
        }),
        (r#"{"action":"lane_change","to":"left"}"#, |c| {
            matches!(c, W::Command(C::LaneChange { to: LaneChoice::Left }))
        }),
    ];
    for (text, is) in cases {
        assert!(read(text).is_ok_and(|command| is(&command)), "{text}");
    }
}

#[test]
fn what_is_no_command_is_refused_with_a_code_and_in_our_own_words() {
    for (text, code, words) in [
        ("", "not_an_object", "JSON object"),
        ("[1]", "not_an_object", "JSON object"),
        ("{}", "not_an_object", "action"),
        (r#"{"action":"fly"}"#, "unknown_action", "\"fly\"; there are play"),
        (r#"{"action":7}"#, "unknown_action", "7"),
        (r#"{"action":"step"}"#, "missing_key", "step needs ticks"),
        (r#"{"action":"step","ticks":-1}"#, "wrong_value", "ticks = -1"),
        (r#"{"action":"step","ticks":0}"#, "wrong_value", "ticks = 0"),
        (r#"{"action":"step","ticks":1000001}"#, "wrong_value", "1 to 1000000"),
        (r#"{"action":"step","ticks":1,"wait":1}"#, "wrong_value", "wait = 1"),
        (r#"{"action":"step_until","time_s":-1}"#, "wrong_value", "time_s = -1"),
        (r#"{"action":"reset","seed":18446744073709551616}"#, "wrong_value", "seed = "),
        (r#"{"action":"snapshot","name":"../a"}"#, "wrong_value", "lower-case letters"),
        (r#"{"action":"restore"}"#, "missing_key", "restore needs name"),
        (r#"{"action":"set_speed","speed_m_s":41}"#, "wrong_value", "0 to 40"),
        (r#"{"action":"pace","pace":"NaN"}"#, "wrong_value", "realtime, max or a factor"),
        (r#"{"action":"pace","pace":0}"#, "wrong_value", "pace = 0"),
        (r#"{"action":"pace","pace":true}"#, "wrong_value", "pace = true"),
        (r#"{"action":"set_decider","decider":"fly"}"#, "wrong_value", "rules:50"),
        (r#"{"action":"set_decider","decider":"dqn:/etc/x"}"#, "wrong_value", "built-in policy"),
        (r#"{"action":"set_speed_planner"}"#, "missing_key", "cruise or predictive"),
        (r#"{"action":"external","accel_m_s2":-1}"#, "missing_key", "road_wheel_rad"),
        (r#"{"action":"external","accel_m_s2":6,"road_wheel_rad":0}"#, "wrong_value", "-10 to 5"),
        (r#"{"action":"fault","fault":"wings","on":true}"#, "wrong_value", "localisation"),
        (r#"{"action":"fault","fault":"radar"}"#, "missing_key", "true or false"),
        (r#"{"action":"lane_change","to":"up"}"#, "wrong_value", "left, right or keep"),
        (r#"{"action":"play","extra":1}"#, "unknown_key", "extra"),
    ] {
        let error = read(text).err().unwrap();
        assert_eq!(error.code(), code, "{text}");
        assert!(error.to_string().contains(words), "{text}: {error}");
    }
}

/// The words stand in the refusal and on the page too.
#[test]
fn every_fault_is_named_where_it_can_be_chosen() {
    let refusal = read(r#"{"action":"fault","fault":"wings","on":true}"#).err().unwrap();
    let (refusal, page) = (refusal.to_string(), include_str!("../dashboard/page/index.html"));
    for fault in Fault::ALL {
        let word = fault.word();
        assert!(refusal.contains(word), "{refusal}");
        assert!(page.contains(&format!("<option value=\"{word}\">")), "{word} is not on the page");
    }
}
