//! Table of the speed planner against dynamic programming and both cruise controls.
//!
//! `cargo run --release -p planner --example pcc_table [-- ROAD]`
#![allow(clippy::disallowed_macros, clippy::disallowed_methods, clippy::unwrap_used)]

#[path = "../tests/support/pcc/corpus.rs"]
mod corpus;
#[path = "../tests/support/data_sheet.rs"]
mod data_sheet;
#[path = "../tests/support/pcc/dp.rs"]
mod dp;

use planner::pcc::course::{SpeedBand, Tuning};
use planner::pcc::solver::DefaultSolver;
use planner::pcc::trip::{Trip, TripRequest};
use std::time::Instant;

fn main() {
    let mut solver = DefaultSolver::default();
    let mut solve = |a: &_, b, c, d: Option<&[f64]>| solver.solve(a, b, c, d);
    let only = std::env::args().nth(1).filter(|a| !a.starts_with("--"));
    println!(
        "road mass band | T cc0 | fuel cc0 cc5 | plan fuel time shifts brk | dp fuel time shifts | gap % | sqp it ms | dp s"
    );
    for (name, profile) in corpus::roads() {
        if only.as_ref().is_some_and(|o| !name.contains(o.as_str())) {
            continue;
        }
        for mass in [19_000.0, 55_000.0] {
            for (lo, hi) in [(65.0, 79.0), (60.0, 85.0), (50.0, 90.0)] {
                let mut limits = data_sheet::reference_limits();
                limits.road_load.mass_kg = mass;
                if std::env::args().any(|a| a == "--linear") {
                    limits.powertrain.fuel = tractrix_core::FuelModel::Willans {
                        constant_g_s: 0.0,
                        per_rpm_g_s: 0.0,
                        per_kw_g_s: 0.052,
                    };
                }
                let request = TripRequest {
                    profile: &profile,
                    truck: &limits,
                    band: SpeedBand { set_m_s: 20.0, min_m_s: lo / 3.6, max_m_s: hi / 3.6 },
                    trip_time_s: None,
                    eco_roll: false,
                    tuning: Tuning::default(),
                };
                let trip = Trip::new(&request).unwrap();
                let time = trip.cruise.trip_time_s();
                let t0 = Instant::now();
                let end = *trip.cruise.e_j_kg.last().unwrap();
                let reference = dp::reference(
                    &trip,
                    time,
                    end,
                    if std::env::args().any(|a| a == "--fine") { dp::FINE } else { dp::QUICK },
                );
                let dp_s = t0.elapsed().as_secs_f64();
                let (goal, end) = reference.as_ref().map_or((time, end), |r| {
                    (r.driven.trip_time_s(), *r.driven.e_j_kg.last().unwrap())
                });
                let cc = (trip.cruise.total_fuel_g(), trip.overspeed.total_fuel_g());
                let over = &trip.overspeed;
                let (vs5, _) =
                    trip.solve(over.trip_time_s(), *over.e_j_kg.last().unwrap(), &mut solve);
                let (vs0, _) = trip.solve(time, end, &mut solve);
                let savings = format!(
                    "saves {:.2}/{:.2}",
                    100.0 * (1.0 - vs0.total_fuel_g() / cc.0),
                    100.0 * (1.0 - vs5.total_fuel_g() / cc.1)
                );
                let t0 = Instant::now();
                let (d, profile) = trip.solve(goal, end, &mut solve);
                let ms = t0.elapsed().as_secs_f64() * 1e3;
                let (rf, rt, rs) = reference.as_ref().map_or((0.0, 0.0, 0), |r| {
                    (r.driven.total_fuel_g(), r.driven.trip_time_s(), r.driven.shifts())
                });
                println!(
                    "{name:9} {:2.0} {lo}-{hi} | {time:7.2} | {:7.1} {:7.1} | {:7.1} {:7.2} {:2} {:5.2} | {rf:7.1} {rt:7.2} {rs:2} b{:.2}/{:.2} | {:+.3} dt {:+.4} % | {savings} | {:?} {} {} {ms:.1} viol {:.1e} | {dp_s:.2}",
                    mass / 1e3,
                    trip.cruise.total_fuel_g(),
                    trip.overspeed.total_fuel_g(),
                    d.total_fuel_g(),
                    d.trip_time_s(),
                    d.shifts(),
                    d.brake_energy_j(mass, trip.course.h_m) / 1e6,
                    profile.beta_g_s,
                    reference.as_ref().map_or(0.0, |r| r.beta_g_s),
                    100.0 * (d.total_fuel_g() / rf - 1.0),
                    100.0 * (d.trip_time_s() / goal - 1.0),
                    profile.status,
                    profile.subproblems,
                    profile.iterations,
                    trip.violation(&d),
                );
            }
        }
    }
}
