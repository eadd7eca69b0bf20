//! What `would_pass` says is what the next tick does, and what a learned decider sees of it.

use crate::support::data_sheet::reference_limits;
use crate::support::traffic::{Cars, EgoBody};
use planner::decider::observation::{ObservationSpec, Observer, SIZE, frame};
use planner::{DeciderKind, LaneChoice, RatesConfig, Situation, StackConfig, Tactics};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use road::builtin;
use tractrix_core::{EgoState, LaneChangeRefusal, Maneuver, Scene, Time};

const TICK_S: f64 = 0.1;

fn tactics() -> Tactics {
    let config = StackConfig {
        decider: DeciderKind::External,
        rates: RatesConfig::for_tick(TICK_S),
        set_speed_m_s: 22.0,
        ..StackConfig::default()
    };
    Tactics::new(config, None).unwrap()
}

#[test]
fn what_would_pass_is_driven_and_what_would_not_is_refused_for_the_same_reason() {
    // A point that follows the tactics exactly, among cars; the highway has limits and lane ends.
    let (road, limits) = (builtin::highway(), reference_limits());
    let g = limits.geometry;
    let (mut passed, mut refused) = (0, std::collections::HashMap::new());
    for seed in 0..4 {
        let mut tactics = tactics();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let d_m = road.lanes()[0].center_d_m(1_000.0);
        let mut ego = EgoState { s_m: 1_000.0, d_m, speed_m_s: 18.0, ..EgoState::default() };
        let mut cars = Cars::new(seed, &road, &ego, 9.0);
        for i in 0..4_000 {
            let now = Time::from_seconds(f64::from(i) * TICK_S);
            let scene = Scene { time: now, neighbours: cars.neighbours() };
            let at = Situation { now, ego: &ego, scene: &scene, road: &road, limits: &limits };
            assert!(tactics.foresee(&at));
            let mut foreseen = Ok(());
            if i % 10 == 0 {
                let wish = [LaneChoice::Left, LaneChoice::Right][rng.random_range(0..2)];
                foreseen = tactics.would_pass(wish, &at);
                tactics.request_lane_change(wish);
            }
            let plan = tactics.tick(&at).unwrap();
            if i % 10 == 0 {
                let changes = [Maneuver::ChangeLeft, Maneuver::ChangeRight];
                let driven = plan.refusal.is_none() && changes.contains(&plan.maneuver);
                match foreseen {
                    Ok(()) => passed += u32::from(driven),
                    Err(why) => *refused.entry(format!("{why:?}")).or_insert(0) += 1,
                }
                assert_eq!(foreseen.is_ok(), driven, "{foreseen:?} and {plan:?}");
                assert_eq!(foreseen.err(), plan.refusal);
            }
            let v = (ego.speed_m_s + plan.target_accel_m_s2 * TICK_S).max(0.0);
            ego.s_m += 0.5 * (ego.speed_m_s + v) * TICK_S;
            ego.speed_m_s = v;
            ego.d_m = plan.path.at(&road, ego.s_m).d_m;
            let (front_s_m, rear_s_m) = (ego.s_m + g.front_m, ego.s_m - g.rear_m());
            let target_d_m = plan.path.at(&road, ego.s_m + 300.0).d_m;
            let (d_m, width_m) = (ego.d_m, g.width_m);
            let body = EgoBody { front_s_m, rear_s_m, d_m, width_m, speed_m_s: v, target_d_m };
            cars.step(TICK_S, &body);
        }
    }
    let kinds = ["Busy", "NoTargetLane", "UnsafeFront", "UnsafeRear", "Occupied"];
    assert!(passed > 20, "{passed} {refused:?}");
    assert!(kinds.iter().all(|kind| refused.contains_key(*kind)), "{refused:?}");
}

#[test]
fn before_the_first_tick_and_after_a_driver_nothing_would_pass() {
    let (road, limits, scene) = (builtin::flat(3_000.0), reference_limits(), Scene::default());
    let d_m = road.lanes()[0].center_d_m(500.0);
    let ego = EgoState { s_m: 500.0, d_m, speed_m_s: 20.0, ..EgoState::default() };
    let at = Situation { now: Time::ZERO, ego: &ego, scene: &scene, road: &road, limits: &limits };
    let mut tactics = tactics();
    let passes = |tactics: &Tactics| tactics.would_pass(LaneChoice::Left, &at);
    assert_eq!(passes(&tactics), Err(LaneChangeRefusal::Busy));
    tactics.tick(&at).unwrap();
    assert_eq!(passes(&tactics), Ok(()));
    tactics.release();
    assert_eq!(passes(&tactics), Err(LaneChangeRefusal::Busy));
}

#[test]
fn an_observation_of_ours_equals_numbers_by_hand() {
    // On a flat road of two lanes, on the right, a car ahead on the left.
    let (road, limits) = (builtin::flat(3_000.0), reference_limits());
    let s_m = 500.0;
    let d_m = road.lanes()[0].center_d_m(s_m);
    let ego = EgoState { s_m, d_m, speed_m_s: 20.0, accel_x_m_s2: 0.3, ..EgoState::default() };
    let lead = tractrix_core::Neighbour {
        front_s_m: s_m + limits.geometry.front_m + 84.0,
        rear_s_m: s_m + limits.geometry.front_m + 80.0,
        d_m: road.lanes()[1].center_d_m(s_m),
        width_m: 1.8,
        speed_m_s: 24.0,
        lane: 1,
        ..tractrix_core::Neighbour::default()
    };
    let scene = Scene { neighbours: vec![lead], ..Scene::default() };
    let at = Situation { now: Time::ZERO, ego: &ego, scene: &scene, road: &road, limits: &limits };
    let mut tactics = tactics();
    tactics.tick(&at).unwrap();
    let mut frames = Observer::new(1.0);
    let reference = |s_m: f64| tactics.reference_speed_m_s(s_m).unwrap();
    let newest = frame(&ego, &scene, &road, reference);
    frames.push(newest);
    let spec = ObservationSpec::Tractrix1;
    let mut x = vec![f32::NAN; spec.size()];
    spec.write(&tactics.observed(&at, &frames, [true, false]).unwrap(), &mut x);
    assert_eq!(x[..newest.len()], newest);
    let load = &limits.road_load;
    let air_n = 0.5 * load.air_density_kg_m3 * load.cd_a_m2 * 400.0;
    let rolling_n = load.rolling_coeff * load.mass_kg * 9.80665;
    let p = &limits.powertrain;
    let engine_w = (0..=250).map(|i| f64::from(i) * p.full_load_nm.at(f64::from(i)));
    let reserve_w = engine_w.fold(0.0, f64::max) - p.auxiliary_power_w - 20.0 * (air_n + rolling_n);
    let by_hand = [
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
        1.0 / 3.0,
        0.1,
        1.0,
        0.0,
        1.0,
        0.0,
        0.4,
        0.1,
        1.0,
        0.0,
        0.55,
        load.mass_kg / 80_000.0,
        reserve_w / 500_000.0,
        0.55,
        0.55,
        0.55,
    ];
    for (i, (is, hand)) in x[SIZE..].iter().zip(by_hand).enumerate() {
        let within = if i == 17 { 0.02 } else { 1e-6 };
        assert!((f64::from(*is) - hand).abs() < within, "number {i}: {is}, by hand {hand}");
    }
}
