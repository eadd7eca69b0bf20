//! Time of whole-trip plans and of 4 km replans, with the structured solver and with Clarabel.
//! `cargo bench -p planner --bench pcc`
#![allow(missing_docs, clippy::unwrap_used)]

#[allow(dead_code)]
#[path = "../tests/support/pcc/corpus.rs"]
mod corpus;
#[path = "../tests/support/data_sheet.rs"]
mod data_sheet;
#[path = "../tests/support/pcc/replan.rs"]
mod replan;

use criterion::{Criterion, criterion_group, criterion_main};
use planner::pcc::solve::{Clarabel, DefaultSolver, Solution, Structured, Subproblem, clarabel};
use planner::pcc::trip::{Trip, TripRequest, plan_trip_with};
use planner::pcc::{SpeedBand, Tuning};
use std::hint::black_box;

const ROADS: [&str; 3] = ["rolling2", "hilly5", "test_site"];

fn each_trip(mut run: impl FnMut(&str, &TripRequest<'_>)) {
    for (name, profile) in corpus::roads() {
        if !ROADS.contains(&name) {
            continue;
        }
        for mass in [19_000.0, 55_000.0] {
            let mut limits = data_sheet::reference_limits();
            limits.road_load.mass_kg = mass;
            let request = TripRequest {
                profile: &profile,
                truck: &limits,
                band: SpeedBand { set_m_s: 20.0, min_m_s: 60.0 / 3.6, max_m_s: 85.0 / 3.6 },
                trip_time_s: None,
                eco_roll: false,
                tuning: Tuning::default(),
            };
            run(&format!("{name}_{:.0}t", mass / 1e3), &request);
        }
    }
}

fn trips(c: &mut Criterion) {
    let mut group = c.benchmark_group("trip_15_km");
    group.sample_size(10);
    each_trip(|name, request| {
        let mut solver = DefaultSolver::default();
        group.bench_function(format!("{name}/structured"), |b| {
            b.iter(|| {
                let mut solve = |a: &_, b, c, d: Option<&[f64]>| solver.solve(a, b, c, d);
                black_box(plan_trip_with(request, &mut solve))
            });
        });
        group.bench_function(format!("{name}/clarabel"), |b| {
            let mut library = Clarabel::default();
            b.iter(|| {
                let mut solve = |a: &_, b, c, d: Option<&[f64]>| library.solve(a, b, c, d);
                black_box(plan_trip_with(request, &mut solve))
            });
        });
    });
    group.finish();
}

fn replans(c: &mut Criterion) {
    let mut group = c.benchmark_group("replan_4_km");
    group.sample_size(20);
    each_trip(|name, request| {
        let trip = Trip::new(request).unwrap();
        let end = *trip.cruise.e_j_kg.last().unwrap();
        let (driven, plan) = trip.solve(trip.cruise.trip_time_s(), end, &mut clarabel::solve);
        let windows = replan::windows(&trip, &driven, plan.beta_g_s, 40);
        let mut fast = Structured::default();
        let mut at = 0;
        group.bench_function(format!("{name}/structured"), |b| {
            b.iter(|| {
                at = (at + 1) % windows.len();
                let mut solve = |sub: &Subproblem, end, time, _: Option<&[f64]>| {
                    let mut found = Solution::default();
                    fast.solve_into(sub, end, time, &mut found);
                    found
                };
                black_box(windows[at].replan(&trip, &mut solve))
            });
        });
        group.bench_function(format!("{name}/clarabel"), |b| {
            let mut library = Clarabel::default();
            b.iter(|| {
                at = (at + 1) % windows.len();
                let mut solve = |a: &_, b, c, d: Option<&[f64]>| library.solve(a, b, c, d);
                black_box(windows[at].replan(&trip, &mut solve))
            });
        });
    });
    group.finish();
}

criterion_group!(benches, trips, replans);
criterion_main!(benches);
