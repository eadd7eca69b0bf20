//! The deciders against their published rules, written out independently.

use super::{LaneChoice, MobilConfig, View, mobil, rules};
use crate::testing::reference_geometry;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use road::{Road, builtin};
use tractrix_core::{EgoState, Neighbour, Scene, VehicleClass};

/// Random vehicles on two lanes, none overlapping the ego.
fn scene(rng: &mut ChaCha8Rng, road: &Road, ego: &EgoState) -> Scene {
    let count = rng.random_range(0..7);
    let neighbours = (0..count)
        .map(|id| {
            let lane: u16 = rng.random_range(0..2);
            let s = ego.s_m + rng.random_range(-250.0..250.0);
            Neighbour {
                id,
                class: VehicleClass::Car,
                front_s_m: s,
                rear_s_m: s - 4.5,
                d_m: road.lanes()[usize::from(lane)].center_d_m(s),
                width_m: 1.8,
                speed_m_s: rng.random_range(10.0..30.0),
                lane,
                ..Neighbour::default()
            }
        })
        .collect();
    Scene { neighbours, ..Scene::default() }
}

fn ego_in(road: &Road, lane: u16) -> EgoState {
    let d_m = road.lanes()[usize::from(lane)].center_d_m(0.0);
    EgoState { s_m: 1000.0, d_m, speed_m_s: 20.0, ..EgoState::default() }
}

#[test]
fn the_rule_based_driver_equals_the_papers_sentence_in_every_random_scene() {
    let road = builtin::flat(3_000.0);
    let g = reference_geometry();
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut changes = 0;
    for _ in 0..4000 {
        let lane: u16 = rng.random_range(0..2);
        let ego = ego_in(&road, lane);
        let scene = scene(&mut rng, &road, &ego);
        let (front, rear) = (ego.s_m + g.front_m, ego.s_m - g.rear_m());
        for d in [50.0, 100.0, 150.0] {
            // "When the ego-truck detects obstacles d m ahead of it, we will check whether there is
            // no traffic in the neighbor lane with d m ahead of it and d m back of it."
            let obstacle = scene
                .neighbours
                .iter()
                .any(|n| n.lane == lane && n.front_s_m > front && n.rear_s_m - front < d);
            let other = 1 - lane;
            let empty = !scene
                .neighbours
                .iter()
                .any(|n| n.lane == other && n.front_s_m > rear - d && n.rear_s_m < front + d);
            let side = if lane == 0 { LaneChoice::Left } else { LaneChoice::Right };
            let expected = if obstacle && empty { side } else { LaneChoice::Keep };
            let view = View::new(&ego, &g, &scene, &road, lane, 22.0);
            assert_eq!(rules(&view, d), expected, "d {d} lane {lane} {scene:?}");
            changes += u32::from(expected != LaneChoice::Keep);
        }
    }
    assert!(changes > 300, "{changes}");
}

/// IDM as published, with the parameters that the decider documents for trucks and cars.
fn idm(truck: bool, v: f64, v0: f64, ahead: Option<(f64, f64)>) -> f64 {
    let (a, b, t, s0) = if truck { (0.6, 1.2, 1.6, 3.0) } else { (1.4, 2.0, 1.2, 2.0) };
    let mut dv = 1.0 - (v / v0).powf(4.0);
    if let Some((gap, va)) = ahead {
        let star = s0 + f64::max(0.0, v * t + v * (v - va) / (2.0 * f64::sqrt(a * b)));
        dv -= (star / f64::max(gap, 0.5)).powf(2.0);
    }
    a * dv
}

#[test]
fn mobil_equals_its_published_criterion_in_every_random_scene() {
    let road = builtin::flat(3_000.0);
    let g = reference_geometry();
    let c = MobilConfig::default();
    let v_ref = 23.0;
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut changes = 0;
    for _ in 0..4000 {
        let lane: u16 = rng.random_range(0..2);
        let ego = ego_in(&road, lane);
        let scene = scene(&mut rng, &road, &ego);
        let (front, rear) = (ego.s_m + g.front_m, ego.s_m - g.rear_m());
        let lead = |l: u16| {
            let ahead = scene.neighbours.iter().filter(|n| n.lane == l && n.front_s_m > front);
            ahead.min_by(|a, b| a.rear_s_m.total_cmp(&b.rear_s_m))
        };
        let lag = |l: u16| {
            let behind = scene.neighbours.iter().filter(|n| n.lane == l && n.front_s_m <= front);
            behind.max_by(|a, b| a.front_s_m.total_cmp(&b.front_s_m))
        };
        let seen = |n: Option<&Neighbour>| n.map(|n| (n.rear_s_m - front, n.speed_m_s));
        let between = |back: &Neighbour, lead: Option<&Neighbour>| {
            lead.map(|n| (n.rear_s_m - back.front_s_m, n.speed_m_s))
        };
        let wish = |n: &Neighbour| n.speed_m_s.max(15.0) * 1.05;
        let other = 1 - lane;
        let expected = (|| {
            if seen(lead(other)).is_some_and(|(gap, _)| gap <= 0.0) {
                return LaneChoice::Keep;
            }
            let mut others = 0.0;
            if let Some(n) = lag(other) {
                let gap = rear - n.front_s_m;
                if gap <= 0.0 {
                    return LaneChoice::Keep;
                }
                let after = idm(false, n.speed_m_s, wish(n), Some((gap, 20.0)));
                if after < -c.safe_decel_m_s2 {
                    return LaneChoice::Keep;
                }
                others += after - idm(false, n.speed_m_s, wish(n), between(n, lead(other)));
            }
            if let Some(o) = lag(lane) {
                let gap = rear - o.front_s_m;
                others += idm(false, o.speed_m_s, wish(o), between(o, lead(lane)))
                    - idm(false, o.speed_m_s, wish(o), Some((gap, 20.0)));
            }
            let own = idm(true, 20.0, v_ref, seen(lead(other)))
                - idm(true, 20.0, v_ref, seen(lead(lane)));
            let (side, bias) = if lane == 0 {
                (LaneChoice::Left, -c.bias_right_m_s2)
            } else {
                (LaneChoice::Right, c.bias_right_m_s2)
            };
            let gain = own + c.politeness_frac * others + bias;
            if gain > c.threshold_m_s2 { side } else { LaneChoice::Keep }
        })();
        let view = View::new(&ego, &g, &scene, &road, lane, v_ref);
        assert_eq!(mobil(&view, &c), expected, "lane {lane} {scene:?}");
        changes += u32::from(expected != LaneChoice::Keep);
    }
    assert!(changes > 300, "{changes}");
}
