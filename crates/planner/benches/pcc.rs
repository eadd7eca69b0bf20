//! Time of a whole-trip plan. `cargo bench -p planner --bench pcc`
#![allow(missing_docs, clippy::unwrap_used)]

#[allow(dead_code)]
#[path = "../tests/support/pcc/corpus.rs"]
mod corpus;
#[path = "../tests/support/data_sheet.rs"]
mod data_sheet;

use criterion::{Criterion, criterion_group, criterion_main};
use planner::pcc::solver::DefaultSolver;
use planner::pcc::trip::{Trip, TripRequest};
use planner::pcc::{SpeedBand, Tuning};
use std::hint::black_box;

fn trips(c: &mut Criterion) {
    let mut group = c.benchmark_group("trip_15_km");
    group.sample_size(10);
    for (name, profile) in corpus::roads() {
        if !["rolling2", "hilly5", "test_site"].contains(&name) {
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
            let trip = Trip::new(&request).unwrap();
            let end = *trip.cruise.e_j_kg.last().unwrap();
            let mut solver = DefaultSolver::default();
            group.bench_function(format!("{name}_{:.0}t", mass / 1e3), |b| {
                b.iter(|| {
                    let mut solve = |a: &_, b, c, d: Option<&[f64]>| solver.solve(a, b, c, d);
                    black_box(trip.solve(trip.cruise.trip_time_s(), end, &mut solve))
                });
            });
        }
    }
    group.finish();
}

criterion_group!(benches, trips);
criterion_main!(benches);
