//! A truck whose lane ends: it merges, also from standstill, and nobody brakes hard for it.
//!
//! Two of four runs of the main job never arrived without the duty to keep right: the truck had
//! overtaken into the climbing lane, stood at its end, and at standstill no gap was long enough.

use planner::{DeciderKind, SpeedPlannerKind};
use sim::{Drivability, Family, Scenario, Status, World};
use tractrix_core::{Recorder, Tick, Vehicle};
use traffic_client::native::Density;

/// Where the climbing lane of the built-in highway ends, m.
const END_M: f64 = 8_500.0;
/// So far beyond it the truck is watched, m: 18 s or more.
const PAST_IT_M: f64 = 400.0;

/// How the truck got out of its lane.
#[derive(Default)]
struct Way {
    /// Longest standstill, s.
    stood_s: f64,
    stands_since_s: Option<f64>,
    held_up: bool,
    /// How far it got beyond the lane's end, m.
    passed_m: f64,
}

impl Recorder for Way {
    fn record(&mut self, tick: &Tick<'_>) {
        let (now_s, ego) = (tick.now.seconds(), tick.ego);
        if ego.speed_m_s < 0.1 {
            let since_s = *self.stands_since_s.get_or_insert(now_s);
            self.stood_s = self.stood_s.max(now_s - since_s);
        } else {
            self.stands_since_s = None;
        }
        self.held_up |= tick.plan.held_up;
        self.passed_m = ego.s_m - END_M;
    }
}

/// Starts in the climbing lane, with nothing but the lane's end to make it change.
fn drive(density: Density, max_speed_m_s: f64, s_m: f64, speed_m_s: f64, seed: u64) -> Vec<String> {
    let mut s = Scenario::builtin("highway").unwrap();
    s.traffic.family = Some(Family { density, max_speed_m_s, spawn_interval_s: None });
    s.ego.s_m = s_m;
    s.ego.lane = Some(2);
    s.ego.speed_m_s = speed_m_s;
    s.stack.decider = DeciderKind::KeepLane;
    s.stack.keep_right = false;
    s.stack.speed_planner = SpeedPlannerKind::Cruise;
    s.run.duration_s = 150.0;
    let mut world = World::new(&s, seed).unwrap();
    let mut way = Way { passed_m: s_m - END_M, ..Way::default() };
    let mut watch = Drivability::new(world.truck().limits(), &s.stack.rss);
    while way.passed_m < PAST_IT_M
        && world.tick(&mut (&mut way, &mut watch)).unwrap() == Status::Running
    {}
    let summary = world.summary();
    let caused = watch.figures().hard_braking_caused;
    let case = format!("{density:?} from {s_m} m with {speed_m_s} m/s, seed {seed}");
    let bars = [
        ("s of standing", way.stood_s, 60.0),
        ("m short of the lane's end", -way.passed_m, 0.0),
        ("collisions", f64::from(summary.collisions), 0.0),
        ("others made to brake hard", f64::from(caused), 0.0),
        ("wheels off the road", f64::from(summary.off_road_events), 0.0),
        (
            "times free although it stood",
            f64::from(u8::from(way.stood_s > 0.0 && !way.held_up)),
            0.0,
        ),
    ];
    let missed = bars.iter().filter(|(_, value, bar)| value > bar);
    missed.map(|(what, value, bar)| format!("{case}: {value:.1} {what}, bar {bar}")).collect()
}

#[test]
fn a_truck_that_stands_at_its_lanes_end_gets_in() {
    let wrong: Vec<String> = (1..=10)
        .flat_map(|seed| {
            let mut wrong = drive(Density::Dense, 12.5, END_M - 60.0, 0.0, seed);
            wrong.extend(drive(Density::Medium, 22.0, END_M - 60.0, 0.0, seed));
            wrong
        })
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_truck_whose_lane_ends_ahead_gets_in() {
    let wrong: Vec<String> = (1..=5)
        .flat_map(|seed| {
            let mut wrong = drive(Density::Dense, 12.5, END_M - 600.0, 12.0, seed);
            wrong.extend(drive(Density::Medium, 22.0, END_M - 600.0, 20.0, seed));
            wrong
        })
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
