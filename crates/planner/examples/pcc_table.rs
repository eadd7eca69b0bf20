//! Table of the speed planner against both cruise controls, and on request against a reference that
//! may switch the injection on and off at every step.
//!
//! `cargo run --release -p planner --example pcc_table [-- ROAD] [--map] [--pulses]`: `--map` takes
//! the bench map's engine, `--pulses` adds the reference (seconds per row).
#![allow(clippy::disallowed_macros, clippy::disallowed_methods, clippy::unwrap_used)]

#[path = "../tests/support/pcc/corpus.rs"]
mod corpus;
#[path = "../tests/support/data_sheet.rs"]
mod data_sheet;
#[allow(dead_code)]
#[path = "../tests/support/pcc/dp.rs"]
mod dp;

use planner::pcc::solve::DefaultSolver;
use planner::pcc::trip::{Trip, TripRequest, plan_trip};
use planner::pcc::{SpeedBand, Tuning};

/// Difference to the fuel of a reference that pays nothing at fuel cut-off, %.
fn against_pulses(request: &TripRequest<'_>) -> f64 {
    let trip = Trip::new(request).unwrap();
    let end_e = *trip.cruise.e_j_kg.last().unwrap();
    let mut solver = DefaultSolver::default();
    let (d, profile) =
        trip.solve(trip.cruise.trip_time_s(), end_e, &mut |a, b, c, d| solver.solve(a, b, c, d));
    let task = dp::Task {
        limits: request.truck,
        h_m: trip.course.h_m,
        sin: &trip.course.sin,
        cos: &trip.course.cos,
        e_min: &trip.e_min,
        e_max: &trip.e_max,
        start_e: trip.cruise.e_j_kg[0],
        end_e,
        shift_g: trip.tuning.shift_fuel_g,
        accel_g: trip.tuning.accel_penalty_g_s3_m2,
        brake_m_s2: trip.course.brake_m_s2,
        charge_cut: false,
    };
    let r = dp::reference(&task, d.trip_time_s(), profile.beta_g_s, dp::QUICK);
    100.0 * (d.total_fuel_g() / r.fuel_at(d.trip_time_s()) - 1.0)
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
        for mass in [19_000.0, 55_000.0] {
            for (lo, hi) in [(65.0, 79.0), (60.0, 85.0), (50.0, 90.0)] {
                let mut limits = data_sheet::reference_limits();
                limits.road_load.mass_kg = mass;
                if has("--map") {
                    limits.powertrain.fuel = corpus::bench_map();
                }
                let request = TripRequest {
                    profile: &profile,
                    truck: &limits,
                    band: SpeedBand { set_m_s: 20.0, min_m_s: lo / 3.6, max_m_s: hi / 3.6 },
                    trip_time_s: None,
                    eco_roll: false,
                    tuning: Tuning::default(),
                };
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
