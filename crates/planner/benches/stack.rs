//! Lane-change planning and one tick of the whole stack among 40 vehicles.
#![allow(clippy::unwrap_used, missing_docs)]

#[path = "../tests/support/data_sheet.rs"]
mod data_sheet;

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use planner::decider::Policy;
use planner::decider::observation::ObservationSpec;
use planner::safety::{Gate, GateView, RssConfig};
use planner::steering::{LaneChangeConfig, LateralPath, Start, plan_change};
use planner::{DeciderKind, LaneChoice, Stack, StackConfig};
use road::{Road, builtin};
use tractrix_core::{
    EgoState, Neighbour, PowertrainSignals, Scene, Stamped, Time, VehicleClass, VehicleStatus,
};

fn ego(road: &Road, s_m: f64) -> EgoState {
    let d_m = road.lanes()[0].center_d_m(s_m);
    let at = road.at(s_m, d_m);
    EgoState {
        x_m: at.x_m,
        y_m: at.y_m,
        yaw_rad: at.heading_rad,
        s_m,
        d_m,
        speed_m_s: 20.0,
        powertrain: PowertrainSignals { gear: 12, ..PowertrainSignals::default() },
        ..EgoState::default()
    }
}

/// 40 vehicles in two lanes, 25 m apart; `room_m` around the ego is empty in the left lane.
fn scene(road: &Road, s_m: f64, room_m: f64) -> Scene {
    let neighbours = (0..40)
        .filter_map(|i: u16| {
            let lane = i % 2;
            let front_s_m = s_m - 250.0 + 25.0 * f64::from(i / 2) + 12.0 * f64::from(lane);
            let off = front_s_m - s_m;
            let kept = if lane == 0 { !(-30.0..=60.0).contains(&off) } else { off.abs() > room_m };
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
        })
        .collect();
    Scene { time: Time::ZERO, neighbours }
}

fn planning(c: &mut Criterion) {
    let road = builtin::highway();
    let limits = data_sheet::reference_limits();
    let (config, rss) = (LaneChangeConfig::default(), RssConfig::default());
    let s_m = 6_000.0;
    let ego = ego(&road, s_m);
    let path = LateralPath::keep(0);
    let start = Start {
        ego: &ego,
        path: &path,
        reference_speed_m_s: 22.0,
        lane_ends_in_m: None,
        road: &road,
        limits: &limits,
    };
    // Free: the cheapest candidate passes. Vetoed: every candidate is planned and refused.
    for (name, room_m) in [("free", 240.0), ("vetoed", 45.0)] {
        let scene = scene(&road, s_m, room_m);
        c.bench_function(&format!("plan a lane change, {name}"), |b| {
            b.iter(|| {
                let (ego, scene, road, limits) = (&ego, &scene, &road, &limits);
                let view = GateView { rss: &rss, ego, scene, road, limits, grade_rad: 0.0 };
                let gate = Gate::new(&view, 0, 1);
                black_box(plan_change(&config, &start, 1, &gate))
            });
        });
    }
}

fn tick(c: &mut Criterion) {
    let road = builtin::highway();
    let limits = data_sheet::reference_limits();
    let s_m = 6_000.0;
    let scene = scene(&road, s_m, 45.0);
    let ego = ego(&road, s_m);
    let external = StackConfig { decider: DeciderKind::External, ..StackConfig::default() };
    let mut every_tick = external.clone();
    every_tick.rates.path_ticks = 1;
    every_tick.rates.decision_ticks = 1;
    for (name, config) in [
        ("100 Hz control, 10 Hz path and gate", external),
        ("worst tick: control, path and a vetoed change at once", every_tick),
    ] {
        let mut stack = Stack::new(config, &limits).unwrap();
        let mut now = Time::ZERO;
        c.bench_function(&format!("stack tick, 40 vehicles, {name}"), |b| {
            b.iter(|| {
                now = now.plus_nanos(10_000_000);
                let mut scene = black_box(&scene).clone();
                scene.time = now;
                // A real truck's numbers never repeat; the guard would call them frozen
                let mut ego = ego;
                ego.s_m += 1e-6 * (now.0 / 10_000_000 % 2) as f64;
                stack.request_lane_change(LaneChoice::Left);
                let ego = Stamped { time: now, value: ego };
                black_box(
                    stack
                        .tick(now, &ego, &VehicleStatus::default(), &scene, &road, &limits)
                        .command,
                )
            });
        });
        assert!(stack.plan().guard.is_empty(), "{:?}", stack.plan().guard);
    }
}

fn policy(c: &mut Criterion) {
    let mut state = 1_u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 16_777_216.0 - 0.5
    };
    let sizes = [216, 256, 512, 256, 3];
    let layers: Vec<_> = sizes
        .windows(2)
        .map(|w| {
            let weights = (0..w[0] * w[1]).map(|_| 0.1 * random()).collect();
            (weights, (0..w[1]).map(|_| 0.1 * random()).collect())
        })
        .collect();
    let actions = [LaneChoice::Left, LaneChoice::Keep, LaneChoice::Right];
    let policy = Policy::new(ObservationSpec::Paper216, &layers, actions).unwrap();
    let mut x = [0.0; 216];
    x.iter_mut().for_each(|v| *v = random());
    let mut scratch = policy.scratch();
    c.bench_function("policy 216-256-512-256-3", |b| {
        b.iter(|| policy.values(black_box(&x), &mut scratch));
    });
}

criterion_group!(benches, planning, tick, policy);
criterion_main!(benches);
