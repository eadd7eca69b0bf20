//! The generator's drives look like drives.

#[allow(dead_code, reason = "each user of the generator needs a part of it")]
mod support;

use diagnosis::Channel as C;
use dynamics::TruckParameters;
use support::{Campaign, generate};

#[test]
fn a_generated_drive_keeps_the_road_and_uses_the_whole_truck() {
    let base = TruckParameters::load("reference").unwrap();
    let short = Campaign { drives: 2, duration_s: 600.0, tolerance: 1.0 };
    let set = generate(&base, &[], &short, 3).unwrap();
    for d in &set.drives {
        let get = |c: C| d.get(c).unwrap();
        let mean = get(C::SpeedMS).iter().sum::<f64>() / d.len as f64;
        assert!((10.0..24.0).contains(&mean), "mean speed {mean}");
        let shifts = get(C::ShiftInProcess).windows(2).filter(|w| w[1] > w[0]).count();
        assert!((8..120).contains(&shifts), "{shifts} shifts");
        let braking = get(C::BrakePressureKpa).iter().filter(|p| **p > 20.0).count();
        assert!(braking > 100, "{braking} samples with brakes");
        let yaw = get(C::YawRateRadS);
        let path = get(C::Curvature1M).iter().zip(get(C::SpeedMS));
        let wrong: f64 = yaw.iter().zip(path).map(|(w, (k, v))| (w - k * v).powi(2)).sum();
        let all: f64 = yaw.iter().map(|w| w * w).sum();
        assert!(wrong < 0.15 * all, "the truck leaves the road: {}", wrong / all);
    }
}
