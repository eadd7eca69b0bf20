//! Table of the speed planner against both cruise controls, and on request against a reference that
//! may switch the injection on and off at every step.
//!
//! `cargo run --release -p planner --example pcc_table [-- ROAD] [--map] [--pulses]`: `--map` takes
//! the bench map's engine, `--pulses` adds the reference (seconds per row).
#![allow(clippy::disallowed_macros, clippy::disallowed_methods, clippy::unwrap_used)]

#[path = "../tests/support/pcc/mod.rs"]
mod support;

use planner::pcc::trip::{Trip, TripRequest, plan_trip};
use support::{BANDS_KM_H, Engine, MASSES_KG, corpus, dp, planned, request, task, truck};

/// Difference to the fuel of a reference that pays nothing at fuel cut-off, %.
fn against_pulses(request: &TripRequest<'_>) -> f64 {
    let trip = Trip::new(request).unwrap();
    let (driven, beta_g_s) = planned(&trip);
    let task = dp::Task { charge_cut: false, ..task(&trip, request.truck) };
    let r = dp::reference(&task, driven.trip_time_s(), beta_g_s, dp::QUICK);
    100.0 * (driven.total_fuel_g() / r.fuel_at(driven.trip_time_s()) - 1.0)
}

fn main() {
    let has = |name: &str| std::env::args().any(|a| a == name);
    let only = std::env::args().nth(1).filter(|a| !a.starts_with("--"));
    println!(
        "| road | mass, t | band, km/h | time, s | plan, g | shifts | saved against brake at set speed, % | against +5 km/h, % | above pulsing reference, % |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for (name, profile) in corpus::roads() {
        if only.as_ref().is_some_and(|o| !name.contains(o.as_str())) {
            continue;
        }
        for mass in MASSES_KG {
            for (lo, hi) in BANDS_KM_H {
                let engine = if has("--map") { Engine::BenchMap } else { Engine::Willans };
                let limits = truck(mass, engine);
                let request = request(&profile, &limits, (lo, hi));
                let r = plan_trip(&request).unwrap();
                let pulses = if has("--pulses") {
                    format!("{:+.2}", against_pulses(&request))
                } else {
                    String::from("-")
                };
                println!(
                    "| {name} | {:.0} | {lo:.0}-{hi:.0} | {:.1} | {:.0} | {} | {:.2} | {:.2} | {pulses} |",
                    mass / 1e3,
                    r.plan.trip_time_s,
                    r.plan.fuel_g,
                    r.plan.shifts,
                    100.0 * r.saving_vs_set_speed_frac,
                    100.0 * r.saving_vs_overspeed_frac,
                );
            }
        }
    }
}
