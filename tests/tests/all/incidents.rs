//! The truck meets what changes: a closed lane, a vehicle that stopped, a limit for a time, an
//! emergency vehicle; in native traffic always, in SUMO's where one is installed.

use planner::{DeciderKind, LaneChoice};
use sim::{Scenario, TrafficKind, World};
use tractrix_core::{Recorder, Tick, VehicleClass};
use traffic_client::schedule::{DemandStep, EmergencyVehicle, Incident, IncidentKind};
use traffic_client::sumo::Programs;

fn scenario(source: TrafficKind) -> Scenario {
    let mut s = Scenario::builtin("medium-15").unwrap();
    (s.road, s.traffic.source) = ("builtin:flat".to_owned(), source);
    s.ego.speed_m_s = 14.0;
    s.traffic.native.initial_density_1_km = Some(6.0);
    s.traffic.family = None;
    (s.traffic.native.spawn_probability, s.traffic.native.max_speed_m_s) = (0.008, 15.0);
    s.run.duration_s = 150.0;
    s
}

/// What the truck did.
#[derive(Default)]
struct Way {
    lanes: Vec<u16>,
    speeds_m_s: Vec<f64>,
    stations_m: Vec<f64>,
    seen_from_m: Option<f64>,
    emergency: usize,
    /// While an emergency vehicle comes from behind in the left lane: ticks, those in which a change
    /// was refused, and whether the truck went there.
    coming: usize,
    refused: usize,
    in_its_way: bool,
}

impl Recorder for Way {
    fn record(&mut self, tick: &Tick<'_>) {
        self.speeds_m_s.push(tick.ego.speed_m_s);
        self.stations_m.push(tick.ego.s_m);
        self.lanes.push(u16::from(tick.ego.d_m > 0.0));
        for n in &tick.scene.neighbours {
            if n.class == VehicleClass::Barrier || n.speed_m_s < 0.1 {
                self.seen_from_m.get_or_insert(n.rear_s_m - tick.ego.s_m);
            }
            self.emergency += usize::from(n.class == VehicleClass::Emergency);
            let behind_m = tick.ego.s_m - 15.0 - n.front_s_m;
            if n.class == VehicleClass::Emergency && n.lane == 1 && (0.0..185.0).contains(&behind_m)
            {
                self.coming += 1;
                self.refused += usize::from(tick.plan.refusal.is_some());
                self.in_its_way |= tick.ego.d_m > -1.0;
            }
        }
    }
}

fn drive(scenario: &Scenario, seed: u64) -> (Way, sim::Summary) {
    let mut way = Way::default();
    let summary = World::new(scenario, seed).unwrap().run(&mut way).unwrap();
    (way, summary)
}

#[test]
fn the_truck_passes_or_stops_before_a_closed_lane_and_a_stopped_vehicle() {
    meets_incidents(TrafficKind::Native);
}

#[test]
fn the_truck_keeps_clear_of_an_emergency_vehicle_and_changes_lanes_behind_it() {
    meets_an_emergency_vehicle(TrafficKind::Native);
}

#[test]
fn in_sumos_traffic_it_does_the_same() {
    if let Err(e) = Programs::find(None) {
        eprintln!("skipped: {e}");
        return;
    }
    meets_incidents(TrafficKind::Sumo);
    meets_an_emergency_vehicle(TrafficKind::Sumo);
}

fn meets_incidents(source: TrafficKind) {
    for kind in [IncidentKind::ClosedLane, IncidentKind::StoppedVehicle] {
        for (seed, from_s) in [(1, 0.0), (2, 0.0), (3, 25.0)] {
            let mut s = scenario(source);
            s.traffic.incident =
                vec![Incident { kind, s_m: 900.0, length_m: 300.0, lane: 0, from_s, to_s: None }];
            let (way, summary) = drive(&s, seed);
            let last_m = *way.stations_m.last().unwrap();
            let name = format!("{source:?} {kind:?}, seed {seed}: at {last_m:.0} m");
            assert_eq!(summary.collisions, 0, "{name}");
            let seen_m = way.seen_from_m.unwrap_or_else(|| panic!("{name}: not seen"));
            assert!(seen_m > 100.0, "{name}: seen from {seen_m} m");
            let is_past = last_m > 1250.0;
            let stands = last_m < 900.0 && *way.speeds_m_s.last().unwrap() < 0.5;
            assert!(is_past || stands || last_m > 700.0, "{name}");
        }
    }
}

#[test]
fn the_truck_keeps_a_limit_that_holds_for_a_time() {
    let mut s = scenario(TrafficKind::Native);
    s.traffic.native.spawn_probability = 0.0;
    s.traffic.native.initial_density_1_km = Some(0.0);
    let limit = |from_s, limit| DemandStep {
        from_s,
        speed_limit_m_s: Some(limit),
        ..DemandStep::default()
    };
    s.traffic.demand = vec![limit(40.0, 10.0), limit(100.0, 70.0)];
    let (way, _) = drive(&s, 1);
    let at = |t_s: f64| way.speeds_m_s[(t_s * 100.0) as usize];
    assert!(at(39.0) > 13.0, "{}", at(39.0));
    assert!(at(70.0) < 10.5 && at(99.0) < 10.5, "{} {}", at(70.0), at(99.0));
    assert!(at(149.0) > 13.0, "{}", at(149.0));
}

fn meets_an_emergency_vehicle(source: TrafficKind) {
    let mut s = scenario(source);
    s.ego.s_m = 400.0;
    s.stack.decider = DeciderKind::External;
    s.traffic.native.initial_density_1_km = Some(0.0);
    s.traffic.native.spawn_probability = 0.0;
    s.traffic.emergency_vehicle =
        vec![EmergencyVehicle { from_s: 10.0, speed_m_s: 30.0, lane: Some(1) }];
    let mut way = Way::default();
    let mut world = World::new(&s, 2).unwrap();
    while world.now().seconds() < 80.0 {
        if way.coming > 0 {
            world.stack_mut().request_lane_change(LaneChoice::Left);
        }
        world.tick(&mut way).unwrap();
    }
    let name = format!("{source:?}: {} of {} ticks", way.refused, way.coming);
    assert_eq!(world.summary().collisions, 0, "{name}");
    assert!(way.coming > 300 && way.emergency > way.coming, "{name}");
    assert!(way.refused > 100 && !way.in_its_way, "{name}");
    assert_eq!(*way.lanes.last().unwrap(), 1, "{name}: left once it has passed");
}

#[test]
fn what_cannot_change_is_refused_by_its_key() {
    let text = |lines: &str| {
        let base = Scenario::builtin_text("flat").unwrap().replace("source = \"none\"", lines);
        Scenario::from_toml_str("s.toml", &base).unwrap_err().to_string()
    };
    let incident =
        "[[traffic.incident]]\nkind = \"closed_lane\"\ns_m = 1.0\nlane = 0\nfrom_s = 0.0";
    let e = text(&format!("source = \"replay\"\nreplay = {{ file = \"x\" }}\n{incident}"));
    assert!(e.contains("traffic.incident is for an engine") && e.contains("replay"), "{e}");
    let e = text(&format!("source = \"native\"\n{}", incident.replace("closed_lane", "hole")));
    assert!(e.contains("hole"), "{e}");
    let e = text("source = \"replay\"\nreplay = { file = \"x\" }\ndetectors = \"a.csv\"");
    assert!(e.contains("traffic.detectors"), "{e}");

    let mut s = scenario(TrafficKind::Native);
    s.traffic.incident = vec![Incident {
        kind: IncidentKind::ClosedLane,
        s_m: 500.0,
        length_m: 100.0,
        lane: 9,
        from_s: 0.0,
        to_s: None,
    }];
    let e = World::new(&s, 1).err().unwrap().to_string();
    assert!(e.contains("incident[0].lane = 9: at 500 m there are 0, 1"), "{e}");
}

#[test]
fn counts_of_detectors_are_demand() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("counts.csv");
    std::fs::write(&file, "time_s,lane,count,speed_m_s\n0,0,2,12\n0,1,0,\n60,0,20,12\n60,1,0,\n")
        .unwrap();
    let mut s = scenario(TrafficKind::Native);
    s.traffic.detectors = Some(file.display().to_string());
    let schedule = s.traffic.schedule().unwrap();
    assert_eq!(schedule.demand.len(), 4);
    World::new(&s, 1).unwrap().tick(&mut ()).unwrap();
    std::fs::write(&file, "time_s,lane,count\n0,0,many\n").unwrap();
    let e = World::new(&s, 1).err().unwrap().to_string();
    assert!(e.contains("counts.csv") && e.contains("line 2: `many`"), "{e}");
}

#[test]
fn the_built_in_scenarios_of_what_changes_can_be_driven() {
    for name in ["incident", "rush-hour"] {
        let mut s = Scenario::builtin(name).unwrap();
        s.run.duration_s = 10.0;
        let (_, summary) = drive(&s, 1);
        assert!(summary.collisions == 0 && summary.distance_m > 100.0, "{name}: {summary:?}");
    }
}
