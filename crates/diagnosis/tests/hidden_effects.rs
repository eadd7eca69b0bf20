//! Effects hidden in short generated drives are found, and nothing is found where nothing is. The
//! full campaign (drives of 25 minutes, every cause) is `examples/campaign.rs`.
#![allow(clippy::unwrap_used, reason = "helpers of tests are tests")]

#[allow(dead_code, reason = "each user of the generator needs a part of it")]
mod support;

use diagnosis::{Diagnosis, DiagnosisError, DriveSet, Options, Plant, Serial, Verdict, diagnose};
use dynamics::TruckParameters;
use support::effects::{Effect, Shape};
use support::outside::Outside;
use support::{Campaign, generate};

const SHORT: Campaign = Campaign { drives: 3, duration_s: 420.0, tolerance: 1.0 };

fn drives(hidden: &[Effect], seed: u64) -> DriveSet {
    generate(hidden, &SHORT, seed)
}

fn judge(set: &DriveSet) -> Result<Diagnosis, DiagnosisError> {
    let plant = Plant::of_truck(&TruckParameters::load("reference").unwrap()).unwrap();
    let clean = drives(&[], 900);
    diagnose(&plant, set, Some(&clean), &Options::default(), &Serial, &mut |_| {})
}

fn cause(id: &'static str, size: f64) -> Effect {
    Effect::Cause { id, size, shape: Shape([0.5; 4]) }
}

#[test]
fn drives_in_order_leave_nothing_to_explain() {
    let d = judge(&drives(&[], 17)).unwrap();
    assert_eq!(d.verdict, Verdict::NothingToExplain, "{:?} {:?}", d.causes, d.unknown);
}

#[test]
fn slow_shifts_and_soft_trailer_tyres_are_named_together_with_their_sizes() {
    let hidden = [cause("shift_duration", 0.5), cause("cornering_stiffness_trailer", -0.35)];
    let d = judge(&drives(&hidden, 23)).unwrap();
    let mut ids: Vec<&str> = d.causes.iter().map(|c| c.id).collect();
    ids.sort_unstable();
    assert_eq!(ids, ["cornering_stiffness_trailer", "shift_duration"], "{:?}", d.verdict);
    for c in &d.causes {
        let (key, truth) = match c.id {
            "shift_duration" => ("extra_time_s", 0.5),
            _ => ("stiffness_scale", 0.65),
        };
        let p = c.parameters[key];
        assert!((p.value - truth).abs() < 4.0 * p.sigma, "{}: {p:?}", c.id);
    }
}

#[test]
fn an_effect_outside_the_catalogue_is_unknown_with_its_signal() {
    let hidden = [Effect::Outside { kind: Outside::FuelRpm, size: 0.2, shape: Shape([0.5; 4]) }];
    let d = judge(&drives(&hidden, 31)).unwrap();
    assert_eq!(d.verdict, Verdict::Unknown, "{:?}", d.causes);
    let unknown = d.unknown.unwrap();
    assert_eq!(unknown.quantity, "fuel_rate_g_s");
    assert_eq!(unknown.signals[0], "engine_speed_rpm");
}
