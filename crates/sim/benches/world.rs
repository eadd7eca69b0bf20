//! World ticks per second, with and without traffic.
#![allow(missing_docs, reason = "criterion's macros")]
#![allow(clippy::unwrap_used, reason = "a bench may stop")]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use sim::{Scenario, World};

fn ticks(c: &mut Criterion) {
    let mut group = c.benchmark_group("world_tick");
    group.throughput(Throughput::Elements(1_000));
    for name in ["highway", "highway-empty"] {
        let mut start = World::new(&Scenario::builtin(name).unwrap(), 1).unwrap();
        for _ in 0..2_000 {
            start.tick(&mut ()).unwrap();
        }
        group.bench_function(name, |b| {
            b.iter_batched_ref(
                || start.clone(),
                |world| {
                    for _ in 0..1_000 {
                        world.tick(&mut ()).unwrap();
                    }
                },
                criterion::BatchSize::LargeInput,
            );
        });
    }
    group.finish();
}

criterion_group!(benches, ticks);
criterion_main!(benches);
