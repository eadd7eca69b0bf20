//! Vehicle updates per second of native traffic, and what a snapshot costs.
//!
//! `cargo bench -p traffic-client --bench native`: divide the reported elements per second by one:
//! an element is one vehicle moved by one tick of 0.1 s.

#![allow(clippy::panic, missing_docs, reason = "bench")]

use std::hint::black_box;
use std::sync::Arc;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use road::builtin;
use tractrix_core::{EgoState, Geometry, Time, TrafficSource};
use traffic_client::native::{NativeTraffic, TrafficConfig};

fn traffic(per_km: f64) -> NativeTraffic {
    let config = TrafficConfig {
        spawn_probability: per_km * 15.0 / 10_000.0,
        scene_radius_m: 300.0,
        ..TrafficConfig::default()
    };
    let geometry =
        Geometry { front_m: 4.8, trailer_rear_m: 11.5, width_m: 2.55, ..Geometry::default() };
    NativeTraffic::new(Arc::new(builtin::flat(5_000.0)), geometry, config)
        .unwrap_or_else(|e| panic!("{e}"))
}

fn bench(c: &mut Criterion) {
    let mut group = c.benchmark_group("native");
    for per_km in [5.0, 20.0, 40.0] {
        let mut t = traffic(per_km);
        let ego = EgoState { s_m: 2500.0, d_m: 1.8, speed_m_s: 15.0, ..EgoState::default() };
        let _ = t.advance(Time(0), &ego);
        let start = t.snapshot();
        let vehicles = t.counts().vehicles;
        group.throughput(Throughput::Elements(100 * vehicles as u64));
        group.bench_function(BenchmarkId::new("100_ticks_and_scenes", vehicles), |b| {
            b.iter(|| {
                t.restore(&start);
                for k in 1..=100 {
                    black_box(t.advance(Time(k * 100_000_000), &ego).is_ok());
                }
            });
        });
        let mut saved = t.snapshot();
        group.throughput(Throughput::Elements(vehicles as u64));
        group.bench_function(BenchmarkId::new("snapshot", vehicles), |b| {
            b.iter(|| t.save_to(black_box(&mut saved)));
        });
    }
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
