//! Time of a frame: to its typed message in SI, and signal by signal from the table.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a bench may stop")]

#[path = "../tests/typed/mod.rs"]
mod typed;

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use j1939::{Frame, MessageTable};

fn decode(c: &mut Criterion) {
    let mut group = c.benchmark_group("decode");
    for log in ["t270_normal", "uthp_modern_parked"] {
        let known = |frame: &Frame| MessageTable::of(frame.id().pgn()).is_some();
        let frames: Vec<Frame> = typed::frames(log).into_iter().filter(known).collect();
        group.throughput(Throughput::Elements(frames.len() as u64));
        group.bench_function(format!("{log} typed"), |b| {
            b.iter(|| frames.iter().filter(|frame| typed::decode(black_box(frame))).count());
        });
        group.bench_function(format!("{log} by the table"), |b| {
            b.iter(|| {
                for frame in &frames {
                    let frame = black_box(frame);
                    let table = MessageTable::of(frame.id().pgn());
                    for signal in table.map_or(&[][..], |table| table.signals) {
                        black_box(signal.decode(frame.bytes()));
                    }
                }
            });
        });
    }
    group.finish();
}

criterion_group!(benches, decode);
criterion_main!(benches);
