//! The generator's drives look like drives.

use crate::support::bodies::Bodies;
use crate::support::effects::{Effect, SIZES, Shape};
use crate::support::second::chassis::Chassis;
use crate::support::second::faults::Faults;
use crate::support::second::outside::SECOND_OUTSIDE;
use crate::support::sheet::Figures;
use crate::support::{Campaign, generate, second};
use diagnosis::{Channel, Channel as C, Drive};

#[test]
fn a_generated_drive_keeps_the_road_and_uses_the_whole_truck() {
    let two = Campaign { drives: 2, ..Campaign::FULL };
    let set = generate(&[], &two, 3);
    for d in &set.drives {
        let get = |c: C| d.get(c).unwrap();
        let mean = get(C::SpeedMS).iter().sum::<f64>() / d.len as f64;
        assert!((10.0..24.0).contains(&mean), "mean speed {mean}");
        let shifts = get(C::ShiftInProcess).windows(2).filter(|w| w[1] > w[0]).count();
        assert!((20..300).contains(&shifts), "{shifts} shifts");
        let braking = get(C::BrakePressureKpa).iter().filter(|p| **p > 20.0).count();
        assert!(braking > 100, "{braking} samples with brakes");
        let yaw = get(C::YawRateRadS);
        let path = get(C::Curvature1M).iter().zip(get(C::SpeedMS));
        let wrong: f64 = yaw.iter().zip(path).map(|(w, (k, v))| (w - k * v).powi(2)).sum();
        let all: f64 = yaw.iter().map(|w| w * w).sum();
        assert!(wrong < 0.25 * all, "the truck leaves the road: {}", wrong / all);
    }
}

#[test]
fn the_generator_s_truck_turns_as_the_reference_truck_does() {
    // Steady yaw rate per road-wheel angle at 80 km/h, 1/s: 55 t and 19 t.
    for (total_kg, gain) in [(55_000.0, 5.035), (19_000.0, 4.887)] {
        let bodies = Bodies::new(total_kg, total_kg - 19_000.0, &Figures::SHEET);
        let mut s = [0.0; 4];
        for _ in 0..3000 {
            s = bodies.step(&s, 80.0 / 3.6, 0.01, [0.0; 3], 0.01);
        }
        assert!((s[1] / 0.01 - gain).abs() < 0.01, "{}", s[1] / 0.01);
        assert!((s[1] - s[2]).abs() < 1e-6);
    }
}

/// Speeds, shifts and the lane of the second family, and that what is hidden is all that differs.
#[test]
fn the_second_family_s_drives_keep_the_road_and_differ_by_what_is_hidden() {
    let two = Campaign { drives: 2, ..Campaign::FULL };
    let set = second::generate(&[], &two, 3);
    for d in &set.drives {
        let get = |c: C| d.get(c).unwrap();
        let mean = get(C::SpeedMS).iter().sum::<f64>() / d.len as f64;
        assert!((10.0..24.0).contains(&mean), "mean speed {mean}");
        let shifts = get(C::ShiftInProcess).windows(2).filter(|w| w[1] > w[0]).count();
        assert!((20..300).contains(&shifts), "{shifts} shifts");
        let braking = get(C::BrakePressureKpa).iter().filter(|p| **p > 20.0).count();
        assert!(braking > 100, "{braking} samples with brakes");
        let path = get(C::Curvature1M).iter().zip(get(C::SpeedMS));
        let yaw = get(C::YawRateRadS);
        let wrong: f64 = yaw.iter().zip(path).map(|(w, (k, v))| (w - k * v).powi(2)).sum();
        let all: f64 = yaw.iter().map(|w| w * w).sum();
        assert!(wrong < 0.25 * all, "the truck leaves the road: {}", wrong / all);
    }
    let same = second::generate(&[], &two, 3);
    assert_eq!(set.drives[1].get(C::SpeedMS), same.drives[1].get(C::SpeedMS));
    let short = Campaign { duration_s: 500.0, ..two };
    let clean = second::generate(&[], &short, 3);
    // A drive is the same however many follow it: the second is made where the first says nothing.
    let changes = |hidden: &[Effect]| {
        [1, 2].into_iter().any(|drives| {
            let other = second::generate(hidden, &Campaign { drives, ..short }, 3);
            let differ = |(a, b): (&Drive, &Drive)| Channel::all().any(|c| a.get(c) != b.get(c));
            clean.drives.iter().zip(&other.drives).any(differ)
        })
    };
    let shape = Shape([0.2; 4]);
    for (id, size, _) in SIZES {
        assert!(changes(&[Effect::Cause { id, size, shape }]), "{id} changes nothing");
    }
    for &(kind, size, _, _) in SECOND_OUTSIDE {
        let hidden = [Effect::SecondOutside { kind, size, shape }];
        assert!(changes(&hidden), "{kind:?} changes nothing");
    }
}

#[test]
fn the_second_family_s_truck_turns_as_the_reference_truck_does() {
    for (total_kg, gain) in [(55_000.0, 5.035), (19_000.0, 4.887)] {
        let faults = Faults::of(&[]);
        let mut c = Chassis::new(total_kg, total_kg - 19_000.0, &Figures::SHEET, &faults);
        for _ in 0..3000 {
            c.step(80.0 / 3.6, 0.01, [1.0; 3], &[], 0.01);
        }
        let [yaw, trailer] = c.yaw();
        assert!((yaw / 0.01 - gain).abs() < 0.01, "{}", yaw / 0.01);
        assert!((yaw - trailer).abs() < 1e-6);
    }
}
