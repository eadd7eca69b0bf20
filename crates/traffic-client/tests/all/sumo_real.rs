//! Against a real SUMO, if there is one; otherwise each test prints why it is skipped.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use driver_models::Idm;
use road::{Road, builtin};
use tractrix_core::{EgoState, Geometry, Neighbour, Scene, Time, TrafficSource};
use traffic_client::TrafficError;
use traffic_client::native::{Density, TrafficConfig};
use traffic_client::sumo::codec::Value;
use traffic_client::sumo::session::{id, var};
use traffic_client::sumo::{Programs, SumoConfig, SumoError, SumoTraffic};

/// A working folder that goes away with the test.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("tractrix-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn sumo_is_here() -> bool {
    match Programs::find(None) {
        Ok(_) => true,
        Err(e) => {
            eprintln!("skipped: {e}");
            false
        }
    }
}

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

fn flat_traffic(folder: &Folder, traffic: TrafficConfig) -> (Arc<Road>, SumoTraffic) {
    traffic_over(4000.0, folder, traffic)
}

fn traffic_over(
    length_m: f64,
    folder: &Folder,
    traffic: TrafficConfig,
) -> (Arc<Road>, SumoTraffic) {
    let road = Arc::new(builtin::flat(length_m));
    let config = SumoConfig { traffic, ..SumoConfig::default() };
    let sumo = SumoTraffic::new(road.clone(), truck(), config, &folder.0).unwrap();
    (road, sumo)
}

fn ego_at(road: &Road, s_m: f64, d_m: f64, speed_m_s: f64) -> EgoState {
    let p = road.at(s_m, d_m);
    EgoState {
        s_m,
        d_m,
        x_m: p.x_m,
        y_m: p.y_m,
        yaw_rad: p.heading_rad,
        speed_m_s,
        ..EgoState::default()
    }
}

/// Drives the ego in the right lane at 15 m/s; hashes every scene.
fn drive(sumo: &mut SumoTraffic, road: &Road, steps: i64, mut see: impl FnMut(i64, &Scene)) -> u64 {
    let d = road.lanes()[0].center_d_m(0.0);
    let mut hash = 0xcbf2_9ce4_8422_2325u64;
    for k in 0..steps {
        let ego = ego_at(road, 1000.0 + 1.5 * k as f64, d, 15.0);
        let scene = sumo.advance(Time(k * 100_000_000), &ego).unwrap();
        for n in &scene.neighbours {
            for x in [n.front_s_m, n.d_m, n.speed_m_s] {
                hash = (hash ^ x.to_bits()).wrapping_mul(0x0100_0000_01b3);
            }
        }
        see(k, scene);
    }
    hash
}

#[test]
fn sumo_traffic_drives_around_the_ego_on_our_road() {
    if !sumo_is_here() {
        return;
    }
    let folder = Folder::new("drives");
    let (road, mut sumo) = flat_traffic(&folder, TrafficConfig::family(Density::Medium, 15.0, 3));
    assert!(sumo.import().worst_m < 0.01, "{:?}", sumo.import());
    assert_eq!(sumo.import().lanes, 8, "four edges of two lanes");
    let mut seen = std::collections::BTreeSet::new();
    let mut last: std::collections::BTreeMap<u64, f64> = Default::default();
    drive(&mut sumo, &road, 600, |_, scene| {
        for n in &scene.neighbours {
            seen.insert(n.id);
            let centre = road.lanes()[usize::from(n.lane)].center_d_m(n.front_s_m);
            assert!((n.d_m - centre).abs() < 2.0 && n.length_m() > 3.0, "{n:?}");
            if let Some(front) = last.get(&n.id) {
                let moved = n.front_s_m - front;
                assert!(
                    (moved - 0.1 * n.speed_m_s).abs() < 0.15,
                    "{moved} m at {} m/s",
                    n.speed_m_s
                );
            }
        }
        last = scene.neighbours.iter().map(|n| (n.id, n.front_s_m)).collect();
    });
    assert!(seen.len() > 10, "{} vehicles", seen.len());
    assert!(sumo.version().unwrap().0.contains("SUMO"));
}

/// A run of so many steps, again after a reset, with another seed, and in a new process.
fn check_exactness(name: &str, steps: i64) {
    let folder = Folder::new(name);
    let length_m = 3000.0 + 1.5 * steps as f64;
    let config = TrafficConfig::family(Density::Dense, 15.0, 5);
    let (road, mut first) = traffic_over(length_m, &folder, config.clone());
    let once = drive(&mut first, &road, steps, |_, _| {});
    first.reset(5).unwrap();
    assert_eq!(drive(&mut first, &road, steps, |_, _| {}), once, "after a reset");
    first.reset(6).unwrap();
    assert_ne!(drive(&mut first, &road, steps, |_, _| {}), once, "with another seed");
    let other = Folder::new(&format!("{name}-fresh"));
    let (_, mut fresh) = traffic_over(length_m, &other, config);
    assert_eq!(drive(&mut fresh, &road, steps, |_, _| {}), once, "in a new process");
}

#[test]
fn sumo_is_bit_exact_for_a_seed_and_a_reset_equals_a_fresh_start() {
    if sumo_is_here() {
        check_exactness("exact", 400);
    }
}

#[test]
#[ignore = "campaign: ten minutes of traffic, four times; see docs/results/traffic.md"]
fn sumo_is_bit_exact_and_a_reset_equals_a_fresh_start_over_ten_minutes() {
    if sumo_is_here() {
        check_exactness("exact-long", 6000);
    }
}

#[test]
fn the_ghost_makes_a_follower_brake_before_the_centre_of_the_ego_crosses_the_line() {
    if !sumo_is_here() {
        return;
    }
    let folder = Folder::new("ghost");
    let empty = TrafficConfig {
        initial_density_1_km: Some(3.0),
        spawn_probability: 0.03,
        truck_share_frac: 0.0,
        max_speed_m_s: 25.0,
        ..TrafficConfig::family(Density::Medium, 25.0, 8)
    };
    let (road, mut sumo) = flat_traffic(&folder, empty);
    let (right, left) = (road.lanes()[0].center_d_m(0.0), road.lanes()[1].center_d_m(0.0));
    let mut reacted = None;
    for k in 0..600 {
        let t = k as f64 * 0.1;
        // From 20 s on, drift over in 8 s, at 12 m/s among faster cars; stop short of the centre
        // crossing, so that only the overlap can be what they see.
        let part = ((t - 20.0) / 8.0).clamp(0.0, 0.45);
        let ego = ego_at(&road, 800.0 + 1.2 * k as f64, right + part * (left - right), 12.0);
        let scene = sumo.advance(Time(k * 100_000_000), &ego).unwrap();
        let rear = ego.s_m - 11.2;
        for n in &scene.neighbours {
            let behind_left = n.lane == 1 && n.front_s_m < rear && n.front_s_m > rear - 60.0;
            if t > 24.0 && behind_left && n.speed_m_s < 14.0 && reacted.is_none() {
                reacted = Some((t, n.accel_m_s2));
            }
            let overlap = n.lane == 1 && n.front_s_m > rear + 1.0 && n.rear_s_m < rear + 10.0;
            assert!(
                !(t > 30.0 && overlap),
                "a car drives through the overlapping trailer at {t} s"
            );
        }
    }
    let (_, accel) = reacted.expect("nobody slowed down behind the overlapping ego");
    assert!(accel > -8.0, "emergency braking: {accel}");
}

/// A truck that was put in stood still for its first step as SUMO had it: followers at 47 to 64 m
/// braked with 8 m/s², where the law of car following asks for 2.5.
#[test]
fn who_stands_in_for_the_ego_has_its_speed_from_the_first_step() {
    if !sumo_is_here() {
        return;
    }
    let folder = Folder::new("first-step");
    let mut followers = 0;
    let traffic = TrafficConfig::family(Density::Dense, 25.0, 1);
    let (road, mut sumo) = flat_traffic(&folder, traffic.clone());
    let (right, left) = (road.lanes()[0].center_d_m(0.0), road.lanes()[1].center_d_m(0.0));
    for seed in 1..=12 {
        sumo.reset(seed).unwrap();
        for k in 0..60 {
            // From the fourth second on it reaches into the left lane: the ghost comes in, too.
            let d = right + if k > 40 { 0.4 * (left - right) } else { 0.0 };
            let ego = ego_at(&road, 1000.0 + 2.0 * f64::from(k), d, 20.0);
            let lanes = if k > 40 { 2 } else { 1 };
            let scene = sumo.advance(Time(i64::from(k) * 100_000_000), &ego).unwrap();
            if !(k < 5 || (41..46).contains(&k)) {
                continue;
            }
            let rear_m = ego.s_m - 11.2;
            for lane in 0..lanes {
                let behind = scene.neighbours.iter().rev();
                let mut behind = behind.filter(|n| n.lane == lane && n.front_s_m < rear_m);
                let Some(n) = behind.next().filter(|n| rear_m - n.front_s_m < 100.0) else {
                    continue;
                };
                let c = traffic.class(n.class);
                let idm = Idm::new(25.0, c.headway_s, c.min_gap_m, c.accel_m_s2, c.decel_m_s2, 9.0);
                let law = idm.accel_m_s2(
                    n.speed_m_s - n.accel_m_s2 * 0.1,
                    25.0,
                    rear_m - n.front_s_m,
                    n.speed_m_s - 20.0,
                );
                // SUMO puts the lower of several laws in force: a driver above the limit slows, too.
                assert!(n.accel_m_s2 > law.min(0.0) - 2.0, "seed {seed}, step {k}: {n:?}, {law}");
                followers += 1;
            }
        }
    }
    assert!(followers > 10, "{followers}");
}

#[test]
fn pure_mode_shows_traffic_and_takes_no_notice_of_the_ego() {
    if !sumo_is_here() {
        return;
    }
    let folder = Folder::new("pure");
    let config =
        TrafficConfig { sees_ego: false, ..TrafficConfig::family(Density::Medium, 15.0, 2) };
    let (road, mut sumo) = flat_traffic(&folder, config);
    let ego = ego_at(&road, 2000.0, road.lanes()[0].center_d_m(0.0), 0.0);
    let mut through = 0;
    for k in 0..600 {
        let scene = sumo.advance(Time(k * 100_000_000), &ego).unwrap();
        through += scene
            .neighbours
            .iter()
            .filter(|n| n.lane == 0 && n.front_s_m > 1990.0 && n.rear_s_m < 2003.0)
            .count();
    }
    assert!(through > 10, "{through}");
}

#[test]
fn a_killed_sumo_is_a_typed_error_and_a_reset_brings_a_new_one() {
    if !sumo_is_here() {
        return;
    }
    let folder = Folder::new("killed");
    let (road, mut sumo) = flat_traffic(&folder, TrafficConfig::family(Density::Sparse, 15.0, 1));
    drive(&mut sumo, &road, 20, |_, _| {});
    let pid = sumo.pid().unwrap();
    assert!(
        std::process::Command::new("kill")
            .args(["-9", &pid.to_string()])
            .status()
            .unwrap()
            .success()
    );
    let ego = ego_at(&road, 1100.0, -1.9, 15.0);
    let e = sumo.advance(Time(5_000_000_000), &ego).unwrap_err();
    assert!(
        matches!(&e, TrafficError::Sumo(SumoError::Disconnected { exit, .. }) if exit.contains('9')),
        "{e}"
    );
    let e = sumo.advance(Time(5_100_000_000), &ego).unwrap_err();
    assert!(e.to_string().contains("unusable since: SUMO went away"), "{e}");
    sumo.reset(1).unwrap();
    drive(&mut sumo, &road, 20, |_, _| {});
    assert_ne!(sumo.pid().unwrap(), pid);
}

#[test]
fn types_routes_and_traffic_lights_are_reachable() {
    if !sumo_is_here() {
        return;
    }
    let folder = Folder::new("meta");
    let (road, mut sumo) = flat_traffic(&folder, TrafficConfig::family(Density::Sparse, 15.0, 1));
    drive(&mut sumo, &road, 3, |_, _| {});
    let Value::Texts(types) = sumo.get(id::VEHICLE_TYPE, var::ID_LIST, "").unwrap() else {
        panic!()
    };
    assert!(types.iter().any(|t| t == "truck"), "{types:?}");
    let Value::Texts(routes) = sumo.get(id::ROUTE, var::ID_LIST, "").unwrap() else { panic!() };
    assert!(routes.iter().any(|r| r == "through"));
    assert_eq!(sumo.get(id::TRAFFIC_LIGHT, var::COUNT, "").unwrap(), Value::Int(0));
    sumo.set(id::VEHICLE_TYPE, var::MAX_SPEED, "truck", &Value::Double(20.0)).unwrap();
    assert_eq!(sumo.get(id::VEHICLE_TYPE, var::MAX_SPEED, "truck").unwrap(), Value::Double(20.0));
    let e = sumo.get(id::VEHICLE, var::SPEED, "nobody").unwrap_err();
    assert!(matches!(e, TrafficError::Sumo(SumoError::Refused { .. })), "{e}");
}

/// The example of the documentation was refused: SUMO takes `--lateral-resolution` or the
/// `--lanechange.duration` that we set, not both.
#[test]
fn the_sublane_model_and_another_car_following_model_can_be_chosen() {
    if !sumo_is_here() {
        return;
    }
    let folder = Folder::new("sublane");
    let road = Arc::new(builtin::flat(4000.0));
    let attributes = [("carFollowModel", "Krauss"), ("lcAssertive", "2")];
    let attributes = attributes.map(|(k, v)| (k.to_owned(), v.to_owned())).into();
    let config = SumoConfig {
        traffic: TrafficConfig::family(Density::Medium, 15.0, 4),
        options: ["--lateral-resolution", "0.8"].map(str::to_owned).to_vec(),
        type_attributes: [("car".to_owned(), attributes)].into(),
        ..SumoConfig::default()
    };
    let mut sumo = SumoTraffic::new(road.clone(), truck(), config, &folder.0).unwrap();
    let mut beside_the_middle = 0;
    drive(&mut sumo, &road, 300, |_, scene| {
        let off = |n: &&Neighbour| {
            let middle = road.lanes()[usize::from(n.lane)].center_d_m(0.0);
            (n.d_m - middle).abs() > 0.05
        };
        beside_the_middle += scene.neighbours.iter().filter(off).count();
    });
    assert!(beside_the_middle > 0, "nobody uses the width of the lane");
}

#[test]
fn an_absent_sumo_is_named_with_how_to_get_it() {
    let e = Programs::find(Some(Path::new("/nowhere/sumo"))).unwrap_err().to_string();
    assert!(e.contains("/nowhere/sumo") && e.contains("pip install eclipse-sumo"), "{e}");
}

#[test]
fn the_highway_with_its_ramps_is_imported_within_a_decimetre_and_traffic_uses_all_lanes() {
    if !sumo_is_here() {
        return;
    }
    let folder = Folder::new("highway");
    let road = Arc::new(builtin::highway());
    let traffic = TrafficConfig {
        ramp_spawn_probability: 0.03,
        scene_radius_m: 2000.0,
        ..TrafficConfig::family(Density::Medium, 25.0, 4)
    };
    let config = SumoConfig { traffic, ..SumoConfig::default() };
    let mut sumo = SumoTraffic::new(road.clone(), truck(), config, &folder.0).unwrap();
    let import = sumo.import().clone();
    assert!(import.worst_m < 0.05 && import.points > 1000, "{import:?}");
    let mut lanes = std::collections::BTreeSet::new();
    for k in 0..300 {
        let s_m = 3200.0 + 2.0 * k as f64;
        let right = road.lanes().iter().find(|l| l.s_start_m == 0.0).unwrap();
        let ego = ego_at(&road, s_m, right.center_d_m(s_m), 20.0);
        let scene = sumo.advance(Time(k * 100_000_000), &ego).unwrap();
        lanes.extend(scene.neighbours.iter().map(|n| n.lane));
    }
    assert!(lanes.len() >= 3, "{lanes:?}");
}
