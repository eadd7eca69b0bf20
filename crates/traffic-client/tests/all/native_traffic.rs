//! Native traffic through its public face: scenes at 100 Hz on the built-in roads.

use std::sync::Arc;

use road::builtin;
use tractrix_core::{EgoState, Geometry, Scene, Time, TrafficSource};
use traffic_client::native::{Density, NativeTraffic, TrafficConfig};
use traffic_client::{Hashed, Manifest, TrafficError};

fn truck() -> Geometry {
    Geometry {
        front_m: 4.8,
        wheelbase_m: 3.4,
        hitch_ahead_m: 0.3,
        hitch_to_trailer_axle_m: 7.7,
        trailer_front_m: 1.5,
        trailer_rear_m: 11.5,
        tractor_rear_m: 1.0,
        width_m: 2.55,
        ..Geometry::default()
    }
}

fn ego_at(road: &road::Road, s_m: f64, speed_m_s: f64) -> EgoState {
    let d_m = road.lanes()[0].center_d_m(s_m);
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

/// Runs at 100 Hz, the ego keeping the right lane; calls `see` with every scene.
fn drive(
    traffic: &mut NativeTraffic,
    road: &road::Road,
    from: i64,
    to: i64,
    mut see: impl FnMut(i64, &EgoState, &Scene),
) {
    for k in from..to {
        let ego = ego_at(road, 500.0 + 0.2 * k as f64, 20.0);
        let scene = traffic.advance(Time(k * 10_000_000), &ego).unwrap();
        see(k, &ego, scene);
    }
}

#[test]
fn vehicles_move_smoothly_at_100_hz_and_stand_where_the_road_says() {
    let road = Arc::new(builtin::highway());
    let config = TrafficConfig::family(Density::Medium, 15.0, 2);
    let mut traffic = NativeTraffic::new(road.clone(), truck(), config).unwrap();
    let mut last: std::collections::BTreeMap<u64, (f64, f64, f64)> = Default::default();
    let mut seen = 0;
    drive(&mut traffic, &road, 0, 3000, |_, ego, scene| {
        let fronts: Vec<f64> = scene.neighbours.iter().map(|n| n.front_s_m).collect();
        assert!(fronts.is_sorted());
        for n in &scene.neighbours {
            assert!((n.front_s_m - ego.s_m).abs() < 330.0);
            let middle = 0.5 * (n.front_s_m + n.rear_s_m);
            let at = road.at(middle, n.d_m);
            assert!((at.x_m - n.x_m).abs() + (at.y_m - n.y_m).abs() < 1e-9);
            if let Some((s, d, v)) = last.get(&n.id) {
                assert!((n.front_s_m - s - 0.01 * 0.5 * (v + n.speed_m_s)).abs() < 2e-3);
                assert!((n.d_m - d).abs() < 0.04, "{} m sideways in 10 ms", n.d_m - d);
                assert!((n.speed_m_s - v).abs() < 0.09);
            }
            seen += 1;
        }
        last = scene.neighbours.iter().map(|n| (n.id, (n.front_s_m, n.d_m, n.speed_m_s))).collect();
    });
    assert!(seen > 10_000, "{seen}");
    assert!(traffic.min_gap_m() > 0.0);
}

#[test]
fn the_same_seed_gives_the_same_bits_and_another_seed_does_not() {
    let road = Arc::new(builtin::highway());
    let run = |seed| {
        let config = TrafficConfig::family(Density::Dense, 15.0, seed);
        let mut t = NativeTraffic::new(road.clone(), truck(), config).unwrap();
        drive(&mut t, &road, 0, 2000, |_, _, _| {});
        t.fingerprint()
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}

#[test]
fn the_bits_do_not_depend_on_how_often_scenes_are_asked_for() {
    let road = Arc::new(builtin::flat(5000.0));
    let config =
        TrafficConfig { sees_ego: false, ..TrafficConfig::family(Density::Medium, 15.0, 7) };
    let run = |step: i64| {
        let mut t = NativeTraffic::new(road.clone(), truck(), config.clone()).unwrap();
        let ego = ego_at(&road, 2500.0, 0.0);
        for k in (0..=60_000).step_by(step as usize) {
            t.advance(Time(k * 1_000_000), &ego).unwrap();
        }
        t.fingerprint()
    };
    assert_eq!(run(10), run(100));
    assert_eq!(run(10), run(20_000));
}

#[test]
fn a_restored_snapshot_publishes_the_same_scenes_again() {
    let road = Arc::new(builtin::highway());
    let config = TrafficConfig::family(Density::Dense, 12.5, 3);
    let mut t = NativeTraffic::new(road.clone(), truck(), config).unwrap();
    drive(&mut t, &road, 0, 505, |_, _, _| {});
    let saved = t.snapshot();
    let mut first = Vec::new();
    drive(&mut t, &road, 505, 1500, |_, _, scene| first.push(scene.clone()));
    t.restore(&saved);
    let mut k = 0;
    drive(&mut t, &road, 505, 1500, |_, _, scene| {
        assert_eq!(*scene, first[k]);
        k += 1;
    });
}

#[test]
fn an_ego_that_stands_still_is_not_hit_and_traffic_goes_round_it() {
    let road = Arc::new(builtin::flat(3000.0));
    let config = TrafficConfig::family(Density::Medium, 15.0, 9);
    let mut t = NativeTraffic::new(road.clone(), truck(), config).unwrap();
    let ego = ego_at(&road, 1500.0, 0.0);
    let mut passed = std::collections::BTreeSet::new();
    for k in 0..2400 {
        let scene = t.advance(Time(k * 100_000_000), &ego).unwrap();
        for n in &scene.neighbours {
            let beside = n.rear_s_m < 1504.8 && n.front_s_m > 1488.8;
            let apart = (n.d_m - ego.d_m).abs() > 0.5 * (n.width_m + 2.55);
            assert!(!beside || apart, "vehicle {} in the ego at {} s", n.id, k / 10);
            if n.rear_s_m > 1510.0 {
                passed.insert(n.id);
            }
        }
    }
    assert!(passed.len() > 40, "{}", passed.len());
}

#[test]
fn bad_input_is_refused_by_name() {
    let road = Arc::new(builtin::flat(1000.0));
    let mut t = NativeTraffic::new(road.clone(), truck(), TrafficConfig::default()).unwrap();
    let ego = ego_at(&road, 100.0, 0.0);
    let e = t.advance(Time(0), &EgoState { s_m: f64::NAN, ..ego }).unwrap_err();
    assert!(e.to_string().contains("s_m"));
    t.advance(Time(1_000_000_000), &ego).unwrap();
    assert!(t.advance(Time(0), &ego).unwrap_err().to_string().contains("after it had reached"));
    assert!(t.advance(Time(i64::MAX), &ego).unwrap_err().to_string().contains("at most 600 s"));
    let config = TrafficConfig { max_speed_m_s: -1.0, ..TrafficConfig::default() };
    assert!(
        NativeTraffic::new(road, truck(), config)
            .unwrap_err()
            .to_string()
            .contains("max_speed_m_s = -1")
    );
}

#[test]
fn resim_repeats_every_bit_and_names_the_tick_of_a_difference() {
    let road = Arc::new(builtin::highway());
    let native = |seed| {
        let config = TrafficConfig::family(Density::Medium, 15.0, seed);
        NativeTraffic::new(road.clone(), truck(), config).unwrap()
    };
    let inputs = Manifest { engine: "native".into(), seed: 3, ..Manifest::default() };
    let run = |source: &mut Hashed<NativeTraffic>, disturbed_at: i64| -> Result<(), TrafficError> {
        for k in 0..2000 {
            let mut ego = ego_at(&road, 500.0 + 0.2 * k as f64, 20.0);
            ego.s_m += if k >= disturbed_at { 0.5 } else { 0.0 };
            source.advance(Time(k * 10_000_000), &ego)?;
        }
        Ok(())
    };
    let mut first = Hashed::record(native(3), inputs.clone());
    run(&mut first, i64::MAX).unwrap();
    let manifest = Manifest::from_toml(&first.manifest().to_toml().unwrap()).unwrap();
    assert_eq!((manifest.ticks, manifest.hashes.len()), (2000, 20));
    let again = || Hashed::verify(native(3), inputs.clone(), manifest.clone()).unwrap();
    run(&mut again(), i64::MAX).unwrap();
    let e = run(&mut again(), 850).unwrap_err();
    assert!(matches!(e, TrafficError::Diverged { tick: 900.., .. }), "{e}");
    let other = Manifest { seed: 4, ..inputs.clone() };
    assert!(
        Hashed::verify(native(4), other, manifest.clone())
            .unwrap_err()
            .to_string()
            .contains("seed")
    );
}
