//! Plans against dynamic programming at equal trip time, on the corpus of roads, with two engines.
//!
//! The reference (`support/pcc/dp.rs`) shares no code with the planner. It solves Eq. 18 with the
//! map's jump at fuel cut-off charged (else the optimum on a flat road is full power and cut-off by
//! turns, a profile that no plan should ask for), so on rolling roads a plan may beat it.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::disallowed_macros)]

#[path = "support/pcc/mod.rs"]
mod support;

use planner::pcc::trip::{Trip, TripStatus, plan_trip};
use road::ProfilePoint;
use support::{
    Audit, BANDS_KM_H, Engine, MASSES_KG, audited, corpus, dp, planned, request, task, truck,
};
use tractrix_core::VehicleLimits;

struct Row {
    fuel_g: f64,
    time_s: f64,
    shifts: usize,
    reference: dp::Trip,
    ratio: f64,
}

/// Plans, audits and compares one row.
fn row(
    name: &str,
    profile: &[ProfilePoint],
    limits: &VehicleLimits,
    speeds: (f64, f64),
    r: dp::Resolution,
) -> Row {
    let trip = Trip::new(&request(profile, limits, speeds)).unwrap();
    let (driven, beta) = planned(&trip);
    let task = task(&trip, limits);
    let Audit { fuel_g, time_s, violation } = audited(&task, &driven);
    let mass = limits.road_load.mass_kg / 1e3;
    assert!((fuel_g / driven.total_fuel_g() - 1.0).abs() < 1e-6, "{name} {mass} t: {fuel_g} g");
    assert!((time_s / driven.trip_time_s() - 1.0).abs() < 1e-9, "{name} {mass} t: {time_s} s");
    assert!(violation < 1e-3, "{name} {mass} t {speeds:?}: violation {violation}");
    let goal = trip.cruise.trip_time_s();
    assert!(time_s < 1.002 * goal, "{name} {mass} t {speeds:?}: {time_s} s for {goal} s");
    let reference = dp::reference(&task, time_s, beta, r);
    let ratio = fuel_g / reference.fuel_at(time_s);
    Row { fuel_g, time_s, shifts: driven.shifts(), reference, ratio }
}

#[test]
fn plans_are_as_good_as_dynamic_programming_on_a_few_short_roads() {
    for (name, profile) in corpus::roads() {
        let (length_m, mass) = match name {
            "rolling4" => (4_000.0, 19_000.0),
            "hilly5" => (4_000.0, 55_000.0),
            "test_site" => (5_000.0, 55_000.0),
            _ => continue,
        };
        let start = profile[0].s_m;
        let profile: Vec<ProfilePoint> =
            profile.into_iter().take_while(|p| p.s_m <= start + length_m).collect();
        for engine in [Engine::Continuous, Engine::BenchMap] {
            let limits = truck(mass, engine);
            let r = row(name, &profile, &limits, BANDS_KM_H[1], dp::QUICK);
            let bar = if r.reference.shifts == 0 { 1.003 } else { 1.01 };
            assert!(r.ratio < bar, "{name} {mass}: {:.5} of the reference", r.ratio);
            // The reference has to be one: a plan that beats it by more shows a weak reference.
            assert!(r.ratio > 0.98, "{name} {mass}: {:.5} of the reference", r.ratio);
        }
    }
}

/// Every road, mass and band with one engine, as a table, held against the bars.
fn campaign(engine: Engine) {
    let mut ratios = Vec::new();
    println!(
        "| road | mass, t | band, km/h | plan, g | time, s | shifts | reference, g | its shifts | plan / reference |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for (name, profile) in corpus::roads() {
        for mass in MASSES_KG {
            let limits = truck(mass, engine);
            for speeds in BANDS_KM_H {
                let r = row(name, &profile, &limits, speeds, dp::QUICK);
                println!(
                    "| {name} | {:.0} | {:.0}-{:.0} | {:.1} | {:.2} | {} | {:.1} | {} | {:.5} |",
                    mass / 1e3,
                    speeds.0,
                    speeds.1,
                    r.fuel_g,
                    r.time_s,
                    r.shifts,
                    r.reference.fuel_at(r.time_s),
                    r.reference.shifts,
                    r.ratio
                );
                let bar = if r.reference.shifts == 0 { 1.003 } else { 1.01 };
                ratios.push((r.ratio, bar, format!("{name} {mass} {speeds:?}")));
            }
        }
    }
    for (ratio, bar, name) in &ratios {
        assert!(ratio < bar, "{engine:?}, {name}: {ratio:.5} of the reference");
    }
    ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
    let median = ratios[ratios.len() / 2].0;
    assert!(median < 1.001, "{engine:?}: median {median:.5}");
}

#[test]
#[ignore = "campaign: cargo test --release -p planner --test pcc_reference -- --ignored --nocapture willans"]
fn campaign_against_dynamic_programming_willans_line() {
    campaign(Engine::Willans);
}

#[test]
#[ignore = "campaign: cargo test --release -p planner --test pcc_reference -- --ignored --nocapture continuous"]
fn campaign_against_dynamic_programming_continuous_line() {
    campaign(Engine::Continuous);
}

#[test]
#[ignore = "campaign: cargo test --release -p planner --test pcc_reference -- --ignored --nocapture bench_map"]
fn campaign_against_dynamic_programming_bench_map() {
    campaign(Engine::BenchMap);
}

#[test]
#[ignore = "campaign: cargo test --release -p planner --test pcc_reference -- --ignored --nocapture halving"]
fn campaign_halving_every_step_of_the_reference_changes_it_by_less_than_the_bar() {
    println!("| road | mass, t | coarse, g | half of every step, g | quarter, g |");
    println!("|---|---|---|---|---|");
    for (name, profile) in corpus::roads() {
        let mass = match name {
            "rolling4" => 19_000.0,
            "random25" | "hilly5" | "test_site" => 55_000.0,
            _ => continue,
        };
        let limits = truck(mass, Engine::Willans);
        let trip = Trip::new(&request(&profile, &limits, BANDS_KM_H[1])).unwrap();
        let (driven, beta) = planned(&trip);
        let task = task(&trip, &limits);
        let fuel = [dp::QUICK, dp::FINE, dp::FINEST].map(|r| {
            let found = dp::reference(&task, driven.trip_time_s(), beta, r);
            found.fuel_at(driven.trip_time_s())
        });
        println!(
            "| {name} | {:.0} | {:.1} | {:.1} | {:.1} |",
            mass / 1e3,
            fuel[0],
            fuel[1],
            fuel[2]
        );
        assert!((fuel[0] / fuel[2] - 1.0).abs() < 1e-3, "{name}: {fuel:?}");
    }
}

#[test]
fn a_flat_road_gives_exactly_constant_speed() {
    let (_, profile) = corpus::roads().swap_remove(0);
    for mass in MASSES_KG {
        for engine in [Engine::Willans, Engine::Continuous, Engine::BenchMap] {
            let limits = truck(mass, engine);
            let result = plan_trip(&request(&profile, &limits, BANDS_KM_H[1])).unwrap();
            assert_eq!(result.status, TripStatus::Solved);
            for row in &result.rows {
                assert!((row.v_m_s - 20.0).abs() < 1e-9, "{mass} at {}: {}", row.s_m, row.v_m_s);
            }
        }
    }
}

#[test]
fn a_wider_band_never_costs_fuel() {
    for (name, profile) in corpus::roads() {
        for mass in MASSES_KG {
            let limits = truck(mass, Engine::Willans);
            let fuel = BANDS_KM_H.map(|speeds| {
                let trip = Trip::new(&request(&profile, &limits, speeds)).unwrap();
                planned(&trip).0.total_fuel_g()
            });
            for w in fuel.windows(2) {
                assert!(w[1] <= w[0] * (1.0 + 2e-4), "{name} {mass}: {fuel:?}");
            }
        }
    }
}
