//! Traffic with a window is that of the whole road: density, mean speed, gaps and what they leave
//! the truck, within the scatter of seeds.

use std::sync::Arc;

use crate::measure::{Family, Run, compare, families, run};
use road::builtin;
use tractrix_core::{EgoState, Geometry, Time, TrafficSource};
use traffic_client::TrafficError;
use traffic_client::native::{NativeTraffic, TrafficConfig, WindowConfig};

const SEEDS: u64 = 8;
const DURATION_S: f64 = 240.0;

#[test]
fn around_the_truck_traffic_is_that_of_the_whole_road() {
    is_that_of_the_whole_road(&families(), WindowConfig::default(), DURATION_S);
}

#[test]
fn so_it_is_where_those_far_away_sleep_in_free_traffic() {
    // Twice as long, so that who slept comes near: at 800 m the density would be 0.7 ± 0.4 too low.
    let mut free = families();
    free.retain(|family| family.name.starts_with("table2"));
    assert_eq!(free.len(), 6);
    let window = WindowConfig { awake_m: Some(1500.0), ..WindowConfig::default() };
    is_that_of_the_whole_road(&free, window, 2.0 * DURATION_S);
}

fn is_that_of_the_whole_road(families: &[Family], window: WindowConfig, duration_s: f64) {
    for family in families {
        let runs = |window: Option<WindowConfig>| -> Vec<Run> {
            (0..SEEDS).map(|seed| run(family, window, seed, duration_s)).collect()
        };
        let (whole, window) = (runs(None), runs(Some(window)));
        let both = compare(&whole, &window);
        // Of some thirty intervals of 95 % one or two miss: half as wide again.
        for (name, (difference, half_width)) in
            ["density", "speed", "delta speed"].into_iter().zip(both.differences)
        {
            assert!(
                difference.abs() <= 1.5 * half_width,
                "{}: {name} {difference} +- {half_width}",
                family.name
            );
        }
        let (ks, of_chance) = both.ks;
        assert!(ks <= 1.5 * of_chance, "{}: KS {ks}, of chance {of_chance}", family.name);
        for run in &window {
            assert!(run.least_gap_m > 0.0, "{}: {} m", family.name, run.least_gap_m);
        }
    }
}

#[test]
fn a_window_that_scenes_reach_beyond_is_refused() {
    let window = Some(WindowConfig { behind_m: 100.0, ahead_m: f64::NAN, awake_m: None });
    let config = TrafficConfig { window, ..TrafficConfig::default() };
    let road = Arc::new(builtin::flat(2000.0));
    let refused = NativeTraffic::new(road, Geometry::default(), config).unwrap_err();
    assert!(matches!(refused, TrafficError::Config { .. }));
    let text = refused.to_string();
    assert!(text.contains("window.behind_m = 100") && text.contains("window.ahead_m = NaN"));
}

#[test]
fn those_far_away_sleep_on_an_even_road_alone_and_beyond_the_window() {
    let config = |awake_m| {
        let window = WindowConfig { awake_m: Some(awake_m), ..WindowConfig::default() };
        TrafficConfig { window: Some(window), ..TrafficConfig::default() }
    };
    let on =
        |road, awake_m| NativeTraffic::new(Arc::new(road), Geometry::default(), config(awake_m));
    assert!(on(builtin::flat(2000.0), 400.0).is_ok());
    let text = on(builtin::flat(2000.0), 399.0).unwrap_err().to_string();
    assert!(text.contains("window.awake_m = 399"), "{text}");
    let text = on(builtin::highway(), 1500.0).unwrap_err().to_string();
    assert!(text.contains("window.awake_m") && text.contains("highway"), "{text}");
}

#[test]
fn a_snapshot_between_two_looks_of_the_others_goes_on_with_the_same_bits() {
    for awake_m in [None, Some(600.0)] {
        goes_on_with_the_same_bits(awake_m);
    }
}

fn goes_on_with_the_same_bits(awake_m: Option<f64>) {
    let window = WindowConfig { awake_m, ..WindowConfig::default() };
    let config = TrafficConfig { window: Some(window), ..TrafficConfig::default() };
    let road = Arc::new(builtin::flat(3000.0));
    let mut traffic = NativeTraffic::new(road, Geometry::default(), config).unwrap();
    let drive = |traffic: &mut NativeTraffic, from: i64, to: i64| {
        for k in from..to {
            let s_m = 1000.0 + 1.3 * k as f64;
            let ego = EgoState { s_m, d_m: 2.0, speed_m_s: 13.0, ..EgoState::default() };
            traffic.advance(Time(k * 100_000_000), &ego).unwrap();
        }
        traffic.fingerprint()
    };
    drive(&mut traffic, 0, 107);
    let kept = traffic.snapshot();
    let once = drive(&mut traffic, 107, 400);
    traffic.restore(&kept);
    assert_eq!(drive(&mut traffic, 107, 400), once);
}
