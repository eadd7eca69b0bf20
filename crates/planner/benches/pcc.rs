//! Time of whole-trip plans and of 4 km replans, with the structured solver and with Clarabel.
//! `cargo bench -p planner --bench pcc`
#![allow(missing_docs, clippy::unwrap_used)]

#[path = "../tests/support/pcc/mod.rs"]
mod support;

use criterion::{Criterion, criterion_group, criterion_main};
use planner::pcc::solve::{Clarabel, DefaultSolver, Solution, Structured, Subproblem, clarabel};
use planner::pcc::trip::{Trip, TripRequest, plan_trip_with};
use std::hint::black_box;
use support::{BANDS_KM_H, Engine, MASSES_KG, corpus, replan, request, truck};

const ROADS: [&str; 3] = ["rolling2", "hilly5", "test_site"];

fn each_trip(mut run: impl FnMut(&str, &TripRequest<'_>)) {
    for (name, profile) in corpus::roads() {
        if !ROADS.contains(&name) {
            continue;
        }
        for mass in MASSES_KG {
            let limits = truck(mass, Engine::Willans);
            let request = request(&profile, &limits, BANDS_KM_H[1]);
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
