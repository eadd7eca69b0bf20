//! A run that is changed while it drives: another decider, another speed planner, somebody else who
//! drives, something broken. What was changed is in the recording, and the drive comes out again.

use std::time::Duration;

use crate::support::run::Run;
use crate::support::serving::refusal;
use crate::support::{client, program};
use serde_json::{Value, json};

fn step(run: &Run, ticks: u32) -> Value {
    let acted = run.act(&json!({"action": "step", "ticks": ticks, "wait": true}).to_string());
    // What is seen trails the run by a frame
    for _ in 0..200 {
        let state = run.state();
        if state["time_s"].as_f64().unwrap() > acted["time_s"].as_f64().unwrap() - 0.015 {
            return state;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    panic!("{acted} is never seen")
}

#[test]
fn changes_act_are_seen_and_are_replayed_bit_for_bit() {
    let run = Run::start(&["--pace", "max", "--traffic", "native", "--seed", "3"]);
    run.act(r#"{"action": "pause"}"#);
    run.act(r#"{"action": "reset"}"#);
    let seen = step(&run, 500)["run"].clone();
    assert_eq!((&seen["decider"], &seen["speed_planner"]), (&"keep".into(), &"cruise".into()));
    for (decider, ticks) in [("mobil", 1500), ("dqn", 1000), ("rollout", 500), ("external", 100)] {
        run.act(&json!({"action": "set_decider", "decider": decider}).to_string());
        assert_eq!(step(&run, ticks)["run"]["decider"], decider);
    }
    run.act(r#"{"action": "lane_change", "to": "left"}"#);
    run.act(r#"{"action": "set_speed_planner", "speed_planner": "predictive"}"#);
    assert_eq!(step(&run, 1000)["run"]["speed_planner"], "predictive");
    let planned = run.state();
    assert!(planned["speed_ahead"]["plan"].is_object() || planned["plan"].is_object(), "{planned}");

    // Somebody else drives: half a metre per second squared down for two seconds
    let before = run.state()["ego"]["speed_m_s"].as_f64().unwrap();
    for _ in 0..100 {
        let demand = json!({"action": "external", "accel_m_s2": -0.5, "road_wheel_rad": 0.0});
        run.act(&demand.to_string());
        step(&run, 2);
    }
    let driven = run.state();
    assert_eq!(driven["run"]["driven_from_outside"], true);
    let slower = before - driven["ego"]["speed_m_s"].as_f64().unwrap();
    assert!((0.7..1.3).contains(&slower), "{slower} m/s in 2 s");
    // ... and is silent
    let silent = step(&run, 60);
    assert_eq!(silent["plan"]["maneuver"], "minimal_risk", "{silent}");
    assert_eq!(silent["plan"]["guard"], json!(["stale"]), "{silent}");
    run.act(r#"{"action": "release"}"#);
    assert_eq!(step(&run, 300)["plan"]["maneuver"], "keep_lane");

    run.act(r#"{"action": "fault", "fault": "perception", "on": true}"#);
    let blind = step(&run, 100);
    assert_eq!(blind["run"]["faults"], json!(["perception"]));
    assert_eq!(blind["plan"]["maneuver"], "minimal_risk", "{blind}");
    run.act(r#"{"action": "fault", "fault": "perception", "on": false}"#);
    assert_eq!(step(&run, 200)["plan"]["maneuver"], "keep_lane");
    let silent_engine = run.control(r#"{"action": "fault", "fault": "engine", "on": true}"#);
    refusal(&silent_engine, 409, "no_bus", "--vehicle bus");

    let (_, events) = run.ask("GET", "/api/v1/sessions/default/events", "", b"");
    let changed = events["events"].as_array().unwrap().iter();
    assert!(changed.filter(|e| e["event"] == "settings").count() >= 8, "{events}");

    run.act(r#"{"action": "quit"}"#);
    let folder = run.folder.path().to_owned();
    let mut run = run;
    assert_eq!(run.serving.wait(), Some(0));
    let file = folder.join("out/run-2/run.mcap");
    let again = program().arg("process-replay").arg(&file).arg("--json").output().unwrap();
    let report: Value = serde_json::from_slice(&again.stdout).unwrap();
    assert_eq!(report["ticks_different"], 0, "{report}");
    assert!(report["ticks_compared"].as_u64().unwrap() > 5_000, "{report}");
}

/// Over a bus every control unit can fall silent, and speaks again.
#[test]
fn a_control_unit_of_a_truck_on_a_bus_falls_silent_and_speaks_again() {
    let run = Run::start(&["--pace", "max", "--vehicle", "bus"]);
    run.act(r#"{"action": "pause"}"#);
    run.act(r#"{"action": "step", "ticks": 300, "wait": true}"#);
    step(&run, 1);
    let bus = || run.ask("GET", "/api/v1/sessions/default/bus", "", b"").1;
    let message = |bus: &Value, name: &str| {
        let messages = bus["messages"].as_array().unwrap();
        messages.iter().find(|m| m["name"] == name).unwrap_or_else(|| panic!("{bus}")).clone()
    };
    let seen = bus();
    assert_eq!((&seen["vehicle"], &seen["faults"]), (&"bus".into(), &json!([])), "{seen}");
    let engine = message(&seen, "EEC1");
    let rate_hz = engine["rate_hz"].as_f64().unwrap();
    assert!((45.0..110.0).contains(&rate_hz), "{engine}");
    let speed = engine["signals"].as_array().unwrap().iter();
    let speed = speed.filter(|s| s["name"].as_str().unwrap().contains("speed")).count();
    assert!(speed > 0 && engine["sent_by_the_stack"] == false, "{engine}");
    assert_eq!(message(&seen, "XBR")["sent_by_the_stack"], true);
    assert!(seen["claims"].as_array().unwrap().len() >= 8, "seven units and the stack: {seen}");
    run.act(r#"{"action": "fault", "fault": "engine", "on": true}"#);
    let silent = step(&run, 100);
    assert_eq!(silent["plan"]["maneuver"], "minimal_risk", "{silent}");
    assert_eq!(silent["plan"]["guard"], json!(["bus"]), "{silent}");
    let seen = bus();
    assert_eq!(seen["faults"][0]["fault"], "signal_lost", "{seen}");
    assert!(message(&seen, "EEC1")["age_s"].as_f64().unwrap() > 0.5);
    let metrics = client::text(&run.serving.address, "/api/v1/metrics");
    assert!(metrics.contains("tractrix_truck_faults{session=\"default\"} 1"), "{metrics}");
    run.act(r#"{"action": "fault", "fault": "engine", "on": false}"#);
    let speaks = step(&run, 300);
    assert_eq!(speaks["run"]["faults"], json!([]), "{speaks}");
}
