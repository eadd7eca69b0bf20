//! Time of the queries that run in every tick.
#![allow(missing_docs, reason = "criterion's macros")]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use road::opendrive::Network;
use road::{ProfilePoint, Road, builtin};

/// Stations all over a road, in an order that no cache foresees.
fn stations(road: &Road) -> Vec<f64> {
    (0..1_000_u32).map(|i| f64::from(i * 7_919 % 1_000) * 1e-3 * road.length_m()).collect()
}

fn queries(c: &mut Criterion) {
    let road = builtin::highway();
    let stations = stations(&road);
    let points: Vec<_> = stations.iter().map(|&s| (s, road.at(s, -1.9))).collect();
    let mut i = 0;
    let mut next = move || {
        i = (i + 1) % 1_000;
        i
    };
    let mut s = 0.0;
    c.bench_function("at_along_the_road", |b| {
        b.iter(|| {
            s = if s < 14_999.0 { s + 0.1 } else { 0.0 };
            road.at(black_box(s), -1.9)
        });
    });
    c.bench_function("at", |b| b.iter(|| road.at(black_box(stations[next()]), -1.9)));
    c.bench_function("lane_at", |b| b.iter(|| road.lane_at(black_box(stations[next()]), -1.9)));
    c.bench_function("project_near_hint", |b| {
        b.iter(|| {
            let (s, p) = points[next()];
            road.project(black_box(p.x_m), p.y_m, Some(s + 0.5))
        });
    });
    c.bench_function("project_without_hint", |b| {
        b.iter(|| {
            let (_, p) = points[next()];
            road.project(black_box(p.x_m), p.y_m, None)
        });
    });
    let mut out = [ProfilePoint::default(); 200];
    c.bench_function("profile_of_200_points", |b| {
        b.iter(|| road.profile(black_box(stations[next()]), 10.0, &mut out));
    });
    c.bench_function("build_the_highway", |b| b.iter(builtin::highway));
    let text = road.write_opendrive();
    c.bench_function("read_the_highway_as_opendrive", |b| {
        b.iter(|| Network::parse("highway.xodr", black_box(&text)));
    });
}

criterion_group!(benches, queries);
criterion_main!(benches);
