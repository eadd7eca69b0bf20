//! Two meters of the same fuel, the control unit's rate and the carbon in the exhaust: which of them
//! is wrong, as far as anything says so.

use std::sync::LazyLock;

use crate::support::effects::{Effect, Shape};
use crate::support::{Campaign, generate_apart, second};
use diagnosis::{
    Baseline, Channel as C, Diagnosis, DriveSet, Options, Plant, Serial, Verdict, diagnose_with,
};
use dynamics::TruckParameters;

const SHORT: Campaign = Campaign { drives: 3, duration_s: 600.0, tolerance: 1.0 };

type Generate = fn(&[Effect], &Campaign, u64) -> DriveSet;

/// The first family in order, learned once for all tests here.
static IN_ORDER: LazyLock<Baseline> = LazyLock::new(|| learned(generate_apart));

fn learned(generate: Generate) -> Baseline {
    Baseline::learn(&plant(), &generate(&[], &SHORT, 900), &Serial).unwrap()
}

fn plant() -> Plant {
    Plant::of_truck(&TruckParameters::load("reference").unwrap()).unwrap()
}

fn judge(set: &DriveSet, clean: Option<&Baseline>) -> Diagnosis {
    diagnose_with(&plant(), set, clean, &Options::default(), &Serial, &mut |_| {}).unwrap()
}

fn named(d: &Diagnosis) -> Vec<&'static str> {
    d.causes.iter().map(|c| c.id).collect()
}

fn hidden(id: &'static str, size: f64) -> [Effect; 1] {
    [Effect::Cause { id, size, shape: Shape([0.4, 0.7, 0.5, 0.5]) }]
}

#[test]
fn either_meter_is_named_with_either_sign_on_drives_of_both_families() {
    let second_in_order = learned(second::generate);
    for (generate, clean) in
        [(generate_apart as Generate, &*IN_ORDER), (second::generate, &second_in_order)]
    {
        for (id, size) in [
            ("fuel_flow_scale", 0.1),
            ("fuel_flow_scale", -0.1),
            ("co2_scale", 0.12),
            ("co2_scale", -0.12),
        ] {
            let d = judge(&generate(&hidden(id, size), &SHORT, 71), Some(clean));
            assert_eq!(named(&d), [id], "{size}: {:?} {:?}", d.verdict, d.unknown);
            let found = d.causes[0].parameters["scale"].value - 1.0;
            assert!((found - size).abs() < 0.4 * size.abs(), "{id} {size}: {found}");
        }
    }
}

#[test]
fn drives_in_order_say_what_error_of_a_meter_they_would_have_shown() {
    let d = judge(&generate_apart(&[], &SHORT, 72), Some(&IN_ORDER));
    assert_eq!(d.verdict, Verdict::NothingToExplain, "{:?} {:?}", d.causes, d.unknown);
    for (id, most) in [("fuel_flow_scale", 0.06), ("co2_scale", 0.08)] {
        let smallest = d.detectable.iter().find(|x| x.id == id).unwrap().smallest;
        assert!((0.005..most).contains(&smallest), "{id}: {smallest}");
    }
}

#[test]
fn without_one_of_the_columns_neither_meter_is_judged() {
    for column in [C::Co2RateGS, C::FuelRateGS] {
        let mut set = generate_apart(&hidden("fuel_flow_scale", 0.1), &SHORT, 73);
        set.drives.iter_mut().for_each(|d| d.remove(column));
        let d = judge(&set, None);
        for id in ["fuel_flow_scale", "co2_scale"] {
            let not = d.not_observable.iter().find(|n| n.id == id).unwrap();
            assert_eq!(not.missing_channels, [column.name()], "{id}");
        }
    }
}

/// A laboratory's table: speed, fuel and CO2. Two meters that disagree are no reason to blame one.
#[test]
fn without_the_engines_torque_the_two_meters_are_rivals() {
    let set = generate_apart(&hidden("fuel_flow_scale", 0.2), &SHORT, 74);
    let mut bare = set.clone();
    for d in &mut bare.drives {
        let others = C::all().filter(|c| !matches!(c, C::SpeedMS | C::FuelRateGS | C::Co2RateGS));
        others.for_each(|c| d.remove(c));
    }
    let d = judge(&bare, None);
    assert_eq!(d.verdict, Verdict::Ambiguous, "{:?}", d.causes);
    let mut ids = named(&d);
    ids.extend(d.causes[0].confused_with.iter().map(|c| c.id));
    ids.sort_unstable();
    assert_eq!(ids, ["co2_scale", "fuel_flow_scale"]);
    let whole = judge(&set, Some(&IN_ORDER));
    assert_eq!(named(&whole), ["fuel_flow_scale"], "{:?}", whole.verdict);
}
