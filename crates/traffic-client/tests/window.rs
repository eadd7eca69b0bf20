//! Traffic with a window is that of the whole road: density, mean speed, gaps and what they leave
//! the truck, within the scatter of seeds.

#[path = "../examples/window/measure.rs"]
mod measure;

use std::sync::Arc;

use measure::{Run, compare, families, run};
use road::builtin;
use tractrix_core::{EgoState, Geometry, Time, TrafficSource};
use traffic_client::TrafficError;
use traffic_client::native::{NativeTraffic, TrafficConfig, WindowConfig};

const SEEDS: u64 = 8;
const DURATION_S: f64 = 240.0;

#[test]
fn around_the_truck_traffic_is_that_of_the_whole_road() {
    for family in families() {
        let runs = |window: Option<WindowConfig>| -> Vec<Run> {
            (0..SEEDS).map(|seed| run(&family, window, seed, DURATION_S)).collect()
        };
        let (whole, window) = (runs(None), runs(Some(WindowConfig::default())));
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
    let window = Some(WindowConfig { behind_m: 100.0, ahead_m: f64::NAN });
    let config = TrafficConfig { window, ..TrafficConfig::default() };
    let road = Arc::new(builtin::flat(2000.0));
    let refused = NativeTraffic::new(road, Geometry::default(), config).unwrap_err();
    assert!(matches!(refused, TrafficError::Config { .. }));
    let text = refused.to_string();
    assert!(text.contains("window.behind_m = 100") && text.contains("window.ahead_m = NaN"));
}

#[test]
fn a_snapshot_between_two_looks_of_the_others_goes_on_with_the_same_bits() {
    let config =
        TrafficConfig { window: Some(WindowConfig::default()), ..TrafficConfig::default() };
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
