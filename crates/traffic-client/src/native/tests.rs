//! Behaviour of the engine on roads made for the purpose.

use std::sync::Arc;

use driver_models::{Idm, ballistic};
use tractrix_core::{EgoState, Geometry, Time, TrafficSource};

use super::config::{Density, TrafficConfig};
use super::driver::Driver;
use super::engine::{Engine, TICK_S};
use super::fleet::Fleet;
use super::lanes::{LaneMap, LaneSource, LaneUse, NO_LANE};
use super::source::NativeTraffic;

fn engine(config: TrafficConfig, map: LaneMap) -> Engine {
    let mut e = Engine::new(Arc::new(config), Arc::new(map));
    e.fill();
    e
}

fn run(e: &mut Engine, seconds: f64) -> f64 {
    let mut gap = f64::INFINITY;
    for _ in 0..(seconds / TICK_S) as usize {
        e.decide();
        gap = gap.min(e.min_gap_m());
        e.commit();
    }
    gap
}

/// Largest deviation from the equilibrium speed of the first and the last of 100 followers, after
/// the leader has slowed down briefly by 1 m/s.
fn string_of_100(idm: &Idm, v_m_s: f64) -> (f64, f64) {
    let gap = idm.equilibrium_gap_m(v_m_s);
    let n = 100;
    let mut s: Vec<f64> = (0..=n).map(|i| -(i as f64) * (gap + 5.0)).collect();
    let mut v = vec![v_m_s; n + 1];
    let mut worst = vec![0.0f64; n + 1];
    let dt = 0.05;
    for k in 0..24_000 {
        let t = k as f64 * dt;
        let mut a = vec![0.0; n + 1];
        a[0] = if t < 5.0 {
            -0.2
        } else if t < 10.0 {
            0.2
        } else {
            0.0
        };
        for i in 1..=n {
            a[i] = idm.accel_m_s2(v[i], 99.0, s[i - 1] - 5.0 - s[i], v[i] - v[i - 1]);
        }
        for i in 0..=n {
            let (speed, distance) = ballistic(v[i], a[i], dt);
            v[i] = speed;
            s[i] += distance;
            worst[i] = worst[i].max((v[i] - v_m_s).abs());
        }
    }
    (worst[1], worst[n])
}

/// Linear string stability of a car-following law (Treiber & Kesting 2013, Sec. 15.4): stable if
/// f_v² - f_l² >= 2 f_s at equilibrium, with the derivatives by gap, own and leader's speed.
fn is_string_stable(idm: &Idm, v: f64) -> bool {
    let s = idm.equilibrium_gap_m(v);
    let f = |s: f64, v: f64, vl: f64| idm.accel_m_s2(v, 99.0, s, v - vl);
    let h = 1e-5;
    let f_s = (f(s + h, v, v) - f(s - h, v, v)) / (2.0 * h);
    let f_v = (f(s, v + h, v) - f(s, v - h, v)) / (2.0 * h);
    let f_l = (f(s, v, v + h) - f(s, v, v - h)) / (2.0 * h);
    f_v * f_v - f_l * f_l >= 2.0 * f_s
}

#[test]
fn a_string_of_100_cars_is_stable_exactly_where_theory_says_so() {
    let lively = Idm::new(33.3, 1.5, 2.0, 2.5, 1.5, 9.0);
    let lazy = Idm::new(33.3, 1.0, 2.0, 0.5, 1.5, 9.0);
    for (idm, v, stable) in
        [(lively, 20.0, true), (lively, 10.0, true), (lazy, 15.0, false), (lazy, 8.0, false)]
    {
        assert_eq!(is_string_stable(&idm, v), stable, "theory at {v}");
        let (first, last) = string_of_100(&idm, v);
        if stable {
            assert!(last <= first, "{v} m/s: {first} grew to {last}");
        } else {
            assert!(last > 2.0 * first, "{v} m/s: {first} did not grow: {last}");
        }
    }
}

#[test]
fn dense_medium_and_sparse_traffic_flows_without_a_collision() {
    let mut km = 0.0;
    for density in Density::ALL {
        for v in [12.5, 15.0, 30.0] {
            let config = TrafficConfig::family(density, v, 11);
            let mut e = engine(config, LaneMap::straight(3, 5_000.0, 3.75, 33.3));
            let gap = run(&mut e, 300.0);
            assert!(gap > 0.0, "{density:?} {v}: gap {gap}");
            km += e.state.driven_m / 1000.0;
            assert!(e.state.lane_changes > 0);
        }
    }
    assert!(km > 5_000.0, "{km}");
}

#[test]
fn outflow_balances_inflow_in_a_steady_state() {
    let config = TrafficConfig::family(Density::Medium, 15.0, 5);
    let mut e = engine(config, LaneMap::straight(2, 3_000.0, 3.75, 33.3));
    run(&mut e, 400.0);
    let before = e.state.next_id;
    run(&mut e, 1000.0);
    let per_hour_and_lane = (e.state.next_id - before) as f64 * 3.6 / 2.0;
    assert!((per_hour_and_lane - 720.0).abs() < 80.0, "{per_hour_and_lane}");
    let density = e.state.fleet.len() as f64 / 6.0;
    assert!((10.0..25.0).contains(&density), "{density} vehicles per km and lane");
}

/// A two-lane road with an on-ramp (500 to 900 m) and an off-ramp (1500 to 1900 m) on its right.
fn road_with_ramps() -> LaneMap {
    let lane = |usage, s0: f64, s1: f64, d: f64, beside: &dyn Fn(f64) -> (u16, u16)| {
        LaneSource {
            usage,
            drops: usage == LaneUse::Entry,
            leaves: usage == LaneUse::Exit,
            s_start_m: s0,
            s_end_m: s1,
            center_d_m: &|_| d,
            width_m: &|_| 3.75,
            limit_m_s: &|_| 25.0,
            beside,
        }
        .sample()
    };
    let by_the_right_lane = |s: f64| {
        let ramp = match s {
            500.0..900.0 => 2,
            1500.0..1900.0 => 3,
            _ => NO_LANE,
        };
        (1, ramp)
    };
    let lanes = vec![
        lane(LaneUse::Through, 0.0, 3000.0, 0.0, &by_the_right_lane),
        lane(LaneUse::Through, 0.0, 3000.0, 3.75, &|_| (NO_LANE, 0)),
        lane(LaneUse::Entry, 500.0, 900.0, -3.75, &|_| (0, NO_LANE)),
        lane(LaneUse::Exit, 1500.0, 1900.0, -3.75, &|_| (0, NO_LANE)),
    ];
    LaneMap::new(lanes, 0.0, 3000.0, &|_| 0.0)
}

#[test]
fn ramp_traffic_merges_and_leaving_traffic_gets_out() {
    for density in [Density::Dense, Density::Medium] {
        let config = TrafficConfig {
            ramp_spawn_probability: 0.01,
            spawn_probability: density.spawn_probability() * 0.7,
            exit_share_frac: 0.3,
            max_speed_m_s: 22.0,
            ..TrafficConfig::default()
        };
        let mut e = engine(config, road_with_ramps());
        let (mut merged, mut left, mut on_ramp) = (0, 0, 0);
        let mut gap = f64::INFINITY;
        for _ in 0..18_000 {
            let before: Vec<(u64, u16)> =
                e.state.fleet.id.iter().copied().zip(e.state.fleet.lane.iter().copied()).collect();
            e.decide();
            gap = gap.min(e.min_gap_m());
            e.commit();
            let now: std::collections::BTreeMap<u64, u16> =
                e.state.fleet.id.iter().copied().zip(e.state.fleet.lane.iter().copied()).collect();
            for (id, lane) in before {
                match (lane, now.get(&id)) {
                    (2, Some(0)) => merged += 1,
                    (3, None) => left += 1,
                    _ => {}
                }
            }
            on_ramp = now.values().filter(|&&l| l == 2).count();
        }
        assert!(gap > 0.0, "{density:?}: gap {gap}");
        // 0.1/s for 1800 s arrive on the ramp.
        assert!(merged > 120, "{density:?}: {merged} merged, {on_ramp} still on the ramp");
        assert!(left > 100, "{density:?}: {left} left");
    }
}

#[test]
fn trucks_slow_down_on_a_4_percent_climb_to_the_speed_that_their_power_gives() {
    let config = TrafficConfig {
        truck_share_frac: 1.0,
        van_share_frac: 0.0,
        spawn_probability: 0.0,
        max_speed_m_s: 25.0,
        ..TrafficConfig::default()
    };
    let flat = LaneMap::straight(1, 6000.0, 3.75, 30.0);
    let grade = libm::atan(0.04);
    let climb =
        LaneMap::new(flat.lanes.clone(), 0.0, 6000.0, &|s| if s > 2000.0 { grade } else { 0.0 });
    let mut e = engine(config, climb);
    for number in 0..8 {
        let driver = Driver::draw(&e.config, e.config.truck_share_frac, number, std::iter::empty());
        e.state.fleet = Fleet::default();
        e.state.fleet.insert(100.0, 20.0, 0, number, driver);
        let mut at_the_foot = 0.0;
        while e.state.fleet.s_m[0] < 5900.0 {
            run(&mut e, TICK_S);
            if e.state.fleet.s_m[0] < 2000.0 {
                at_the_foot = e.state.fleet.v_m_s[0];
            }
        }
        // Terminal speed: P/m = v (g (sin + f) + k v²), by bisection.
        let needed = |v: f64| v * (9.80665 * (libm::sin(grade) + 0.0055) + 9.5e-5 * v * v);
        let (mut lo, mut hi) = (1.0, 40.0);
        for _ in 0..60 {
            let mid = 0.5 * (lo + hi);
            if needed(mid) < driver.power_w_kg { lo = mid } else { hi = mid }
        }
        let v = e.state.fleet.v_m_s[0];
        assert!(at_the_foot > 20.0 && lo < at_the_foot);
        assert!((v - lo).abs() < 0.3, "{v} instead of {lo}");
    }
}

/// An ego of fixed rectangle, driven along a lane by the test.
fn put_ego(e: &mut Engine, s_m: f64, d_m: f64, speed_m_s: f64) {
    let geometry = Geometry {
        front_m: 4.8,
        hitch_ahead_m: 0.3,
        trailer_front_m: 1.5,
        trailer_rear_m: 11.5,
        tractor_rear_m: 1.0,
        width_m: 2.55,
        ..Geometry::default()
    };
    let state = EgoState { s_m, d_m, speed_m_s, ..EgoState::default() };
    let map = e.map.clone();
    e.ego.update(&state, &geometry, &map, 0.0, 0.0);
}

#[test]
fn the_ego_is_never_hit_from_behind_when_it_brakes_as_hard_as_a_truck_can() {
    for seed in 0..20 {
        let config = TrafficConfig {
            max_speed_m_s: 30.0,
            spawn_probability: 0.04,
            ..TrafficConfig::family(Density::Dense, 30.0, seed)
        };
        let mut e = engine(config, LaneMap::straight(2, 3000.0, 3.75, 33.3));
        e.state.fleet.retain(|f, i| f.lane[i] != 0 || f.s_m[i] < 1400.0 || f.rear_m(i) > 1700.0);
        let (mut s, mut v) = (1500.0, 20.0);
        let mut followers = Vec::new();
        for k in 0..600 {
            put_ego(&mut e, s, 1.875, v);
            e.decide();
            let span = *e.ego.in_lane(0).unwrap();
            let f = &e.state.fleet;
            for i in 0..f.len() {
                let hit =
                    f.occupies(i, 0) && followers.contains(&f.id[i]) && f.s_m[i] >= span.rear_m;
                assert!(!hit, "seed {seed}: hit at tick {k} by vehicle {}", f.id[i]);
            }
            followers.clear();
            followers.extend(
                (0..f.len())
                    .filter(|&i| f.occupies(i, 0) && f.s_m[i] < span.rear_m)
                    .map(|i| f.id[i]),
            );
            e.commit();
            let a = if k > 100 { -5.5 } else { 0.0 };
            let (speed, distance) = ballistic(v, a, TICK_S);
            (s, v) = (s + distance, speed);
        }
        assert_eq!(v, 0.0);
    }
}

#[test]
fn a_follower_reacts_as_soon_as_the_flank_of_the_ego_enters_its_lane() {
    // The story: with SUMO, a truck that drifts into the next lane is noticed when its centre
    // crosses the line, 3.1 s after the drift began, and then with emergency braking.
    let mut e = engine(
        TrafficConfig {
            initial_density_1_km: Some(0.0),
            spawn_probability: 0.0,
            ..TrafficConfig::default()
        },
        LaneMap::straight(2, 3000.0, 3.75, 36.0),
    );
    let mut driver = Driver::draw(&e.config, e.config.truck_share_frac, 0, std::iter::empty());
    driver.idm = Idm::new(34.0, 1.4, 2.0, 1.4, 2.0, 8.0);
    driver.class = tractrix_core::VehicleClass::Car;
    driver.power_w_kg = 60.0;
    e.state.fleet.insert(1000.0 - 11.2 - 85.0, 34.0, 1, 0, driver);
    let (mut hardest, mut first) = (0.0f64, None);
    for k in 0..200 {
        let t = k as f64 * TICK_S;
        put_ego(&mut e, 1000.0 + 22.0 * t, 1.875 + 3.75 * (t / 4.0).min(1.0), 22.0);
        e.decide();
        let a = e.state.fleet.a_m_s2[0];
        if a < -0.5 && first.is_none() {
            first = Some(t);
        }
        hardest = hardest.min(a);
        let rear_m = e.ego.in_lane(1).map_or(f64::INFINITY, |x| x.rear_m);
        assert!(!e.state.fleet.occupies(0, 1) || e.state.fleet.s_m[0] < rear_m);
        e.commit();
    }
    // The flank enters at 0.85 s (with the 0.2 m margin), the centre crosses at 2 s.
    assert!((first.unwrap() - 0.85).abs() < 0.1, "{first:?}");
    assert!(hardest > -8.0, "{hardest}");
}

#[test]
fn a_restored_snapshot_goes_on_with_the_same_bits() {
    let mut e = engine(TrafficConfig::family(Density::Dense, 15.0, 4), road_with_ramps());
    run(&mut e, 60.0);
    let saved = e.state.clone();
    run(&mut e, 60.0);
    let once = e.state.clone();
    e.state.clone_from(&saved);
    run(&mut e, 60.0);
    assert!(e.state == once);
    assert!(e.state != saved);
}

#[test]
fn a_restored_state_with_another_seed_goes_on_as_that_seed_says() {
    let road = Arc::new(road::builtin::flat(2_000.0));
    let config = TrafficConfig { spawn_probability: 0.05, warm_up_s: 20.0, ..Default::default() };
    let geometry = Geometry::default();
    let first = NativeTraffic::new(Arc::clone(&road), geometry, config.clone()).unwrap();
    let mut other = NativeTraffic::with_map(first.map(), road, geometry, config).unwrap();
    assert_eq!(first.fingerprint(), other.fingerprint(), "the same tables, the same traffic");
    let ego = EgoState { s_m: 1_000.0, d_m: 1.875, speed_m_s: 14.0, ..EgoState::default() };
    let mut drive = |seed: Option<u64>| {
        other.restore(&first.snapshot());
        seed.into_iter().for_each(|seed| other.reseed(seed));
        other.set_map_poses_within_m(if seed.is_none() { f64::INFINITY } else { -1.0 });
        let scene = other.advance(Time(0), &ego).unwrap();
        assert!(scene.neighbours.iter().all(|n| n.x_m.is_finite() == seed.is_none()));
        for k in 1..300 {
            other.advance(Time(k * 100_000_000), &ego).unwrap();
        }
        other.fingerprint()
    };
    let (own, nine, nine_again, ten) =
        (drive(None), drive(Some(9)), drive(Some(9)), drive(Some(10)));
    assert_eq!(nine, nine_again);
    assert!(own != nine && nine != ten);
}
