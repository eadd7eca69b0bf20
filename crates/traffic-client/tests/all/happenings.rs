//! What changes while traffic runs, in the native engine: flows, shares and limits by time, lanes
//! that are closed, vehicles that stop, vehicles with right of way.

use std::collections::BTreeMap;
use std::sync::Arc;

use road::builtin;
use tractrix_core::{EgoState, Geometry, Neighbour, Scene, Time, TrafficSource, VehicleClass};
use traffic_client::native::{NativeTraffic, TrafficConfig};
use traffic_client::schedule::{DemandStep, EmergencyVehicle, Incident, IncidentKind, Schedule};

const ROAD_M: f64 = 3000.0;

/// Drives over a level road of two lanes without an ego, and shows every second.
fn drive(config: TrafficConfig, seconds: i64, mut see: impl FnMut(i64, &Scene)) -> NativeTraffic {
    let road = Arc::new(builtin::flat(ROAD_M));
    let config = TrafficConfig { sees_ego: false, scene_radius_m: ROAD_M, ..config };
    let mut traffic = NativeTraffic::new(road, Geometry::default(), config).unwrap();
    let ego = EgoState { s_m: 0.5 * ROAD_M, ..EgoState::default() };
    for k in 0..=seconds {
        see(k, traffic.advance(Time::from_seconds(k as f64), &ego).unwrap());
        assert!(traffic.min_gap_m() > 0.0, "a collision at {k} s");
    }
    traffic
}

fn config(schedule: Schedule) -> TrafficConfig {
    TrafficConfig { max_speed_m_s: 22.0, schedule, ..TrafficConfig::default() }
}

fn vehicles(scene: &Scene) -> impl Iterator<Item = &Neighbour> {
    scene.neighbours.iter().filter(|n| n.class != VehicleClass::Barrier)
}

#[test]
fn flows_shares_of_trucks_and_limits_change_at_their_times() {
    let step = |from_s, flow: f64, trucks: f64, limit: f64| DemandStep {
        from_s,
        flow_veh_h_lane: Some(flow),
        truck_share_frac: Some(trucks),
        speed_limit_m_s: Some(limit),
        ..DemandStep::default()
    };
    let demand = vec![step(0.0, 300.0, 0.0, 70.0), step(600.0, 900.0, 0.5, 12.0)];
    let schedule = Schedule { demand, ..Schedule::default() };
    // When each vehicle was first seen, and whether it is a truck.
    let mut came: BTreeMap<u64, (i64, bool)> = BTreeMap::new();
    let mut fastest = [0.0f64; 2];
    let base =
        TrafficConfig { initial_density_1_km: Some(0.0), warm_up_s: 0.0, ..config(schedule) };
    drive(base, 1200, |k, scene| {
        for n in vehicles(scene) {
            came.entry(n.id).or_insert((k, n.class == VehicleClass::Truck));
            let part = usize::from(k > 640);
            fastest[part] = fastest[part].max(n.speed_m_s);
        }
    });
    let between = |from: i64, to: i64| {
        let those: Vec<bool> = came
            .values()
            .filter(|(k, _)| (from..to).contains(k))
            .map(|(_, truck)| *truck)
            .collect();
        let trucks = those.iter().filter(|truck| **truck).count();
        (those.len() as f64, trucks as f64 / those.len().max(1) as f64)
    };
    let (before, after) = (between(0, 600), between(600, 1200));
    // 100 and 300 are expected; three standard deviations.
    assert!(
        (before.0 - 100.0).abs() < 30.0 && (after.0 - 300.0).abs() < 52.0,
        "{before:?} {after:?}"
    );
    assert!(before.1 == 0.0 && (after.1 - 0.5).abs() < 0.1, "{before:?} {after:?}");
    assert!(fastest[0] > 18.0 && fastest[1] < 17.0, "{fastest:?}");
}

#[test]
fn traffic_leaves_a_lane_that_is_closed_and_comes_back_when_it_opens() {
    for seed in 1..=3 {
        let closed = Incident {
            kind: IncidentKind::ClosedLane,
            s_m: 1500.0,
            length_m: 400.0,
            lane: 0,
            from_s: 60.0,
            to_s: Some(400.0),
        };
        let schedule = Schedule { incidents: vec![closed], ..Schedule::default() };
        let mut inside = [0; 3];
        let mut barriers = 0;
        drive(TrafficConfig { seed, ..config(schedule) }, 600, |k, scene| {
            let in_it = vehicles(scene).filter(|n| {
                n.lane == 0
                    && n.target_lane.is_none()
                    && n.rear_s_m > 1510.0
                    && n.front_s_m < 1880.0
            });
            match k {
                0..60 => inside[0] += in_it.count(),
                120..400 => inside[1] += in_it.count(),
                460.. => inside[2] += in_it.count(),
                _ => {}
            }
            if k == 300 {
                barriers =
                    scene.neighbours.iter().filter(|n| n.class == VehicleClass::Barrier).count();
            }
        });
        assert!(inside[0] > 0 && inside[1] == 0 && inside[2] > 0, "seed {seed}: {inside:?}");
        assert_eq!(barriers, 21, "one every 20 m");
    }
}

#[test]
fn a_vehicle_stops_where_it_is_told_to_and_drives_on_in_time() {
    for (seed, from_s) in [(1, 0.0), (2, 100.0), (3, 100.0)] {
        let stop = Incident {
            kind: IncidentKind::StoppedVehicle,
            s_m: 1500.0,
            length_m: 1.0,
            lane: 0,
            from_s,
            to_s: Some(300.0),
        };
        let schedule = Schedule { incidents: vec![stop], ..Schedule::default() };
        let mut stands = Vec::new();
        drive(TrafficConfig { seed, ..config(schedule) }, 420, |k, scene| {
            let it = vehicles(scene)
                .find(|n| n.lane == 0 && (n.front_s_m - 1500.0).abs() < 3.0 && n.speed_m_s < 0.5);
            if it.is_some() {
                stands.push(k);
            }
        });
        let (first, last) = (stands[0], *stands.last().unwrap());
        let from = from_s as i64;
        assert!((from..from + 40).contains(&first), "seed {seed}: from {first} s");
        assert!((299..310).contains(&last), "seed {seed}: until {last} s");
        assert!(stands.len() as i64 > last - first - 3, "seed {seed}: it stays");
    }
}

#[test]
fn an_emergency_vehicle_is_faster_than_the_limit_and_others_make_way() {
    let coming = |from_s| EmergencyVehicle { from_s, speed_m_s: 33.0, lane: None };
    let schedule =
        Schedule { emergency_vehicles: vec![coming(60.0), coming(200.0)], ..Schedule::default() };
    let mut runs: BTreeMap<u64, (i64, i64)> = BTreeMap::new();
    let mut before_it = Vec::new();
    let base = TrafficConfig { spawn_probability: 0.02, ..config(schedule) };
    drive(base, 420, |k, scene| {
        for e in scene.neighbours.iter().filter(|n| n.class == VehicleClass::Emergency) {
            runs.entry(e.id).or_insert((k, k)).1 = k;
            let ahead = vehicles(scene).filter(|n| {
                n.lane == e.lane && n.rear_s_m > e.front_s_m && n.rear_s_m < e.front_s_m + 100.0
            });
            if e.lane == 1 {
                before_it.push(ahead.filter(|n| n.target_lane.is_none()).count());
            }
        }
    });
    assert_eq!(runs.len(), 2);
    for (from, to) in runs.values() {
        let mean_m_s = ROAD_M / (to - from) as f64;
        assert!(mean_m_s > 24.0, "{mean_m_s} m/s on average, where the others drive 22 at most");
    }
    let mean = before_it.iter().sum::<usize>() as f64 / before_it.len() as f64;
    assert!(mean < 0.8, "{mean} vehicles in the 100 m before it");
}

#[test]
fn the_same_seed_gives_the_same_bits_and_a_snapshot_goes_on() {
    let closed = Incident {
        kind: IncidentKind::ClosedLane,
        s_m: 1500.0,
        length_m: 200.0,
        lane: 1,
        from_s: 20.0,
        to_s: None,
    };
    let stopped = Incident { kind: IncidentKind::StoppedVehicle, lane: 0, s_m: 900.0, ..closed };
    let emergency_vehicles = vec![EmergencyVehicle { from_s: 30.0, speed_m_s: 30.0, lane: None }];
    let incidents = vec![closed, stopped];
    let schedule = Schedule { incidents, emergency_vehicles, ..Schedule::default() };
    let mut first = drive(config(schedule.clone()), 60, |_, _| {});
    let second = drive(config(schedule), 60, |_, _| {});
    assert_eq!(first.fingerprint(), second.fingerprint());
    let ego = EgoState { s_m: 0.5 * ROAD_M, ..EgoState::default() };
    let snapshot = first.snapshot();
    let go_on = |traffic: &mut NativeTraffic| {
        for k in 61..120 {
            traffic.advance(Time::from_seconds(f64::from(k)), &ego).unwrap();
        }
        traffic.fingerprint()
    };
    let once = go_on(&mut first);
    first.restore(&snapshot);
    assert_eq!(go_on(&mut first), once);
}
