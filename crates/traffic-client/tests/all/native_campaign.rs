//! Long campaigns of native traffic; `cargo test --release -p traffic-client --test
//! native_campaign -- --ignored --nocapture`. Smaller versions are among the engine's own tests.

use std::sync::Arc;

use road::builtin;
use tractrix_core::{EgoState, Geometry, Time, TrafficSource};
use traffic_client::native::{Density, NativeTraffic, TrafficConfig};

const TICK_NS: i64 = 100_000_000;

fn truck() -> Geometry {
    Geometry {
        front_m: 4.8,
        hitch_ahead_m: 0.3,
        trailer_front_m: 1.5,
        trailer_rear_m: 11.5,
        tractor_rear_m: 1.0,
        width_m: 2.55,
        ..Geometry::default()
    }
}

/// Drives `km` vehicle-km on the built-in highway, its ramps, limits and grades included; every
/// gap of every tick is looked at.
fn drive_km(density: Density, max_speed_m_s: f64, km: f64) -> (f64, f64) {
    let road = Arc::new(builtin::highway());
    let config = TrafficConfig {
        sees_ego: false,
        scene_radius_m: 1.0,
        ramp_spawn_probability: 0.5 * density.spawn_probability(),
        ..TrafficConfig::family(density, max_speed_m_s, 4321)
    };
    let mut traffic = NativeTraffic::new(road, Geometry::default(), config).unwrap();
    let (mut least_m, ego) = (f64::INFINITY, EgoState::default());
    for k in 0.. {
        traffic.advance(Time(k * TICK_NS), &ego).unwrap();
        least_m = least_m.min(traffic.min_gap_m());
        assert!(least_m > 0.0, "{density:?}, {max_speed_m_s} m/s: collision in tick {k}");
        if k % 1000 == 0 && traffic.counts().driven_km >= km {
            break;
        }
    }
    (traffic.counts().driven_km, least_m)
}

#[test]
#[ignore = "campaign: a million vehicle-km; see docs/results/traffic.md"]
fn a_million_vehicle_km_pass_without_a_collision() {
    let speeds_m_s = [12.5, 15.0, 25.0, 35.0];
    let share_km = 1.0e6 / (Density::ALL.len() * speeds_m_s.len()) as f64;
    let mut all_km = 0.0;
    for density in Density::ALL {
        for max_speed_m_s in speeds_m_s {
            let (km, least_m) = drive_km(density, max_speed_m_s, share_km);
            all_km += km;
            eprintln!("{density:?}, {max_speed_m_s} m/s: {km:.0} km, smallest gap {least_m:.2} m");
        }
    }
    eprintln!("{all_km:.0} vehicle-km");
    assert!(all_km >= 1.0e6);
}

#[test]
fn the_highway_with_its_ramps_has_no_collision_in_ten_thousand_vehicle_km() {
    for (density, speed_m_s) in [(Density::Dense, 35.0), (Density::Medium, 15.0)] {
        let (km, least_m) = drive_km(density, speed_m_s, 5_000.0);
        assert!(km >= 5_000.0 && least_m > 0.3, "{km} km, {least_m} m");
    }
}

/// An ego that keeps its lane and brakes now and then, as hard as `decel_m_s2`, to a crawl: who
/// ran into it from behind, with the hardest braking of their class.
fn braking_ego(seed: u64, decel_m_s2: f64, seconds: i64) -> Vec<(u64, f64)> {
    let road = Arc::new(builtin::highway());
    let config = TrafficConfig::family(Density::Dense, 30.0, seed);
    let hardest = [config.car, config.van, config.truck].map(|c| c.max_decel_m_s2);
    let mut traffic = NativeTraffic::new(Arc::clone(&road), truck(), config).unwrap();
    let (mut s_m, mut v_m_s) = (600.0, 20.0);
    let lane = road.lanes_at(s_m).find(|l| l.kind == road::LaneKind::Driving).unwrap().id;
    let mut hits = Vec::new();
    let mut behind: Vec<u64> = Vec::new();
    for k in 0..seconds * 10 {
        // Phases of 12 s, shifted by the seed: drive, brake to a crawl, speed up again.
        let phase_s = (0.1 * k as f64 + seed as f64) % 12.0;
        let accel = if phase_s < 6.0 { 1.0 } else { -decel_m_s2 };
        let lane = road.lanes().get(usize::from(lane)).filter(|l| l.s_end_m > s_m + 50.0);
        let Some(lane) = lane else { break };
        let d_m = lane.center_d_m(s_m);
        let at = road.at(s_m, d_m);
        let ego = EgoState {
            s_m,
            d_m,
            x_m: at.x_m,
            y_m: at.y_m,
            yaw_rad: at.heading_rad,
            speed_m_s: v_m_s,
            ..EgoState::default()
        };
        let scene = traffic.advance(Time(k * TICK_NS), &ego).unwrap();
        let rear_m = s_m + truck().hitch_ahead_m - truck().trailer_rear_m;
        let in_path = |d: f64, width: f64| (d - d_m).abs() < 0.5 * (width + truck().width_m);
        for n in scene.neighbours.iter().filter(|n| in_path(n.d_m, n.width_m)) {
            if n.front_s_m > rear_m && behind.contains(&n.id) {
                hits.push((n.id, hardest[n.class as usize]));
            }
        }
        behind.clear();
        behind.extend(
            scene
                .neighbours
                .iter()
                .filter(|n| in_path(n.d_m, n.width_m) && n.front_s_m <= rear_m)
                .map(|n| n.id),
        );
        let next = (v_m_s + 0.1 * accel).clamp(2.0, 22.0);
        s_m += 0.05 * (v_m_s + next);
        v_m_s = next;
    }
    hits
}

#[test]
fn an_ego_that_brakes_no_harder_than_its_followers_can_is_not_hit_from_behind() {
    for seed in 0..10 {
        assert_eq!(braking_ego(seed, 6.0, 120), [], "seed {seed}");
    }
}

#[test]
#[ignore = "campaign: 500 egos that brake again and again; see docs/results/traffic.md"]
fn five_hundred_braking_egos_are_not_hit_from_behind_by_who_could_brake_as_hard() {
    let mut hit_by_weaker = 0;
    for seed in 0..500 {
        assert_eq!(braking_ego(seed, 6.0, 300), [], "seed {seed}");
        // Harder than a truck can: only those who cannot keep up may touch it.
        for (id, hardest_m_s2) in braking_ego(seed, 8.0, 300) {
            assert!(hardest_m_s2 < 8.0, "seed {seed}: vehicle {id} could brake as hard");
            hit_by_weaker += 1;
        }
    }
    eprintln!("500 egos at 6 m/s²: no hit; at 8 m/s²: {hit_by_weaker} hits by trucks");
}
