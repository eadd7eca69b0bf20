//! Cost of one substep (5 ms, 200 Hz) of the full truck.
#![allow(missing_docs, reason = "criterion's macros generate undocumented items")]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use dynamics::{RoadPatch, SUBSTEP_S, TruckModel, TruckParameters};
use tractrix_core::{BrakeMode, Command};

/// Substeps before the truck is put back to its start, so that each case stays in its regime.
const SUBSTEPS: u32 = 2_000;

fn truck(c: &mut Criterion) {
    let Ok(parameters) = TruckParameters::load("reference") else { return };
    let Ok(model) = TruckModel::new(parameters, 36_000.0) else { return };
    let patch = RoadPatch::default();
    let driving = Command { accelerator_pedal_frac: 0.4, ..Command::default() };
    let steering = Command { steering_wheel_rad: 0.2, ..driving };
    let braking =
        Command { xbr_decel_m_s2: 1.0, brake_mode: BrakeMode::Maximum, ..Command::default() };
    for (name, command) in [("straight on", driving), ("steering", steering), ("braking", braking)]
    {
        let start = model.initial_state(0.0, 0.0, 0.0, 22.0);
        let mut s = start;
        let mut k = 0_u32;
        c.bench_function(&format!("truck substep 5 ms, {name}"), |b| {
            b.iter(|| {
                k += 1;
                if k == SUBSTEPS {
                    k = 0;
                    s = start;
                }
                if let Ok(next) = model.step(black_box(&s), black_box(&command), &patch, SUBSTEP_S)
                {
                    s = next;
                }
            });
        });
        let second = 1.0;
        c.bench_function(&format!("truck 1 s in one call, {name}"), |b| {
            b.iter(|| model.step(black_box(&start), black_box(&command), &patch, second));
        });
    }
}

criterion_group!(benches, truck);
criterion_main!(benches);
