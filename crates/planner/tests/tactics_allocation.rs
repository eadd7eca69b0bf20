//! Whether a lane change would be driven, and what a policy makes of an observation, are told
//! without asking for memory.
#![allow(clippy::unwrap_used)]

#[path = "support/counting.rs"]
mod counting;
#[path = "support/data_sheet.rs"]
mod data_sheet;

use counting::requests_of;
use data_sheet::reference_limits;
use planner::decider::Policy;
use planner::decider::observation::{ObservationSpec, Observer, frame};
use planner::{DeciderKind, LaneChoice, Situation, StackConfig, Tactics};
use road::{Road, builtin};
use tractrix_core::{EgoState, LaneChangeRefusal, Neighbour, Scene, Time, VehicleClass};

/// Twenty vehicles in each lane, 25 m apart; `room_m` around the ego is empty in the left lane.
fn scene(road: &Road, s_m: f64, room_m: f64) -> Scene {
    let there = (0..40).filter_map(|i: u16| {
        let lane = i % 2;
        let off_m = -250.0 + 25.0 * f64::from(i / 2) + 12.0 * f64::from(lane);
        let kept = if lane == 0 { !(-30.0..=60.0).contains(&off_m) } else { off_m.abs() > room_m };
        let front_s_m = s_m + off_m;
        kept.then_some(Neighbour {
            id: u64::from(i),
            class: VehicleClass::Car,
            front_s_m,
            rear_s_m: front_s_m - 4.5,
            d_m: road.lanes()[usize::from(lane)].center_d_m(front_s_m),
            width_m: 1.8,
            speed_m_s: 20.0,
            lane,
            ..Neighbour::default()
        })
    });
    Scene { time: Time::ZERO, neighbours: there.collect() }
}

#[test]
fn gate_observation_and_policy_ask_for_no_memory() {
    let (road, limits) = (builtin::flat(9_000.0), reference_limits());
    let config = StackConfig { decider: DeciderKind::External, ..StackConfig::default() };
    let mut tactics = Tactics::new(config, None).unwrap();
    let s_m = 4_000.0;
    let d_m = road.lanes()[0].center_d_m(s_m);
    let ego = EgoState { s_m, d_m, speed_m_s: 20.0, ..EgoState::default() };
    let (free, taken) = (scene(&road, s_m, 240.0), scene(&road, s_m, 45.0));
    let at = |scene| Situation { now: Time::ZERO, ego: &ego, scene, road: &road, limits: &limits };
    let requests = requests_of(|| assert!(tactics.tick(&at(&free)).is_some()));
    assert!(requests > 0, "the first tick makes room, or this counts nothing");

    let spec = ObservationSpec::Tractrix1;
    let layers =
        [(vec![0.01; 32 * spec.size()], vec![0.1; 32]), (vec![0.02; 3 * 32], vec![0.0; 3])];
    let actions = [LaneChoice::Left, LaneChoice::Keep, LaneChoice::Right];
    let policy = Policy::new(spec, &layers, actions).unwrap();
    let (mut scratch, mut frames) = (policy.scratch(), Observer::new(1.0));
    let mut numbers = [0.0; ObservationSpec::Tractrix1.size()];
    let requests = requests_of(|| {
        assert_eq!(tactics.would_pass(LaneChoice::Left, &at(&free)), Ok(()));
        let refused = tactics.would_pass(LaneChoice::Left, &at(&taken)).unwrap_err();
        assert_ne!(refused, LaneChangeRefusal::Busy);
        assert!(tactics.tick(&at(&taken)).is_some());
        frames.push(frame(&ego, &free, &road, |_| 20.0));
        let observed = tactics.observed(&at(&free), &frames, [true, false]).unwrap();
        spec.write(&observed, &mut numbers);
        assert!(policy.values(&numbers, &mut scratch).iter().all(|v| v.is_finite()));
    });
    assert_eq!(requests, 0);
}
