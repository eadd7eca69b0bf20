//! Words of a command line, of a message and of a scenario that comes from a network.

use planner::{OutsideDemand, SpeedPlannerKind};
use sim::{Overrides, Scenario, StackChange};
use tractrix_core::Time;
use traffic_client::Mode;

#[test]
fn built_in_scenarios_stay_inside_and_each_way_out_is_named() {
    for name in Scenario::names() {
        assert!(Scenario::builtin(name).unwrap().reaches_out().is_empty(), "{name}");
    }
    type Change = fn(&mut Scenario);
    let ways: [(&str, Change); 8] = [
        ("road", |s| s.road = "/etc/map.xodr".to_owned()),
        ("truck.file", |s| s.truck.file = "../truck.toml".to_owned()),
        ("policy_file", |s| s.policy_file = Some("p.safetensors".to_owned())),
        ("traffic.manifest", |s| s.traffic.manifest = Some("m.toml".to_owned())),
        ("traffic.detectors", |s| s.traffic.detectors = Some("d.csv".to_owned())),
        ("traffic.replay.file", |s| s.traffic.replay.file = Some("r.csv".to_owned())),
        ("traffic.sumo", |s| s.traffic.sumo.binary = Some("/bin/sh".to_owned())),
        ("traffic.sumo", |s| s.traffic.sumo.options = vec!["--save-state".to_owned()]),
    ];
    for (key, change) in ways {
        let mut scenario = Scenario::builtin("highway").unwrap();
        change(&mut scenario);
        assert_eq!(scenario.reaches_out(), [key]);
    }
}

fn refusal(overrides: Overrides<'_>) -> String {
    let mut scenario = Scenario::builtin("highway").unwrap();
    overrides.apply(&mut scenario).unwrap_err().to_string()
}

#[test]
fn words_that_cannot_be_used_are_named_with_those_that_can() {
    let none = Overrides::default();
    for (overrides, named) in [
        (Overrides { traffic: Some("trains"), ..none }, "traffic trains: expected native"),
        (Overrides { traffic: Some("replay:"), ..none }, "replay:FILE"),
        (Overrides { mode: Some("all"), ..none }, "mode all: expected pure, inter, re or rep"),
        (Overrides { mode: Some("re"), ..none }, "manifest"),
        (Overrides { mode: Some("rep"), ..none }, "replay:FILE"),
        (Overrides { decider: Some("rules:near"), ..none }, "decider rules:near"),
        (Overrides { decider: Some("rules:nan"), ..none }, "rules:nan"),
        (Overrides { speed_planner: Some("fast"), ..none }, "speed_planner fast"),
        (Overrides { on_traffic_failure: Some("pray"), ..none }, "pray"),
        (Overrides { payload_kg: Some(f64::NAN), ..none }, "truck.payload_kg = NaN"),
        (Overrides { duration_s: Some(-1.0), ..none }, "run.duration_s = -1"),
    ] {
        let text = refusal(overrides);
        assert!(text.contains(named), "{text}");
    }
}

#[test]
fn recorded_traffic_is_driven_in_mode_rep_without_saying_so() {
    let mut scenario = Scenario::builtin("dense-15").unwrap();
    let overrides = Overrides { traffic: Some("replay:a.csv"), ..Overrides::default() };
    overrides.apply(&mut scenario).unwrap();
    assert_eq!(scenario.traffic.mode(), Mode::Rep);
    assert_eq!(scenario.traffic.replay.file.as_deref(), Some("a.csv"));
}

#[test]
fn a_change_comes_back_from_its_words_bit_for_bit() {
    let demand = OutsideDemand {
        time: Time(12_345_678_901),
        accel_m_s2: -(0.1 + 0.2),
        road_wheel_rad: 1e-17,
    };
    for change in [
        StackChange::decider("rules:72.5").unwrap(),
        StackChange::decider("mobil").unwrap(),
        StackChange::decider("rollout").unwrap(),
        StackChange::decider("dqn").unwrap(),
        StackChange::decider("keep").unwrap(),
        StackChange::SpeedPlanner { kind: SpeedPlannerKind::Predictive },
        StackChange::Outside { demand: Some(demand) },
        StackChange::Outside { demand: None },
    ] {
        let words = change.to_toml().unwrap();
        assert_eq!(StackChange::from_toml(&words).unwrap(), change, "{words}");
    }
    let wrong = StackChange::from_toml("[decider]\nkind = \"fly\"\n").unwrap_err();
    assert!(wrong.to_string().contains("fly"), "{wrong}");
    let wrong = StackChange::decider("dqn:../weights.safetensors").unwrap_err();
    assert!(wrong.to_string().contains("dqn:../weights"), "{wrong}");
}
