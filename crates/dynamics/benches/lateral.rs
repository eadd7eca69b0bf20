//! Cost of one lateral step and of its outputs.
#![allow(missing_docs, reason = "criterion's macros generate undocumented items")]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use dynamics::lateral::{LateralInputs, LateralModel, LateralState, TyreLaw};

#[allow(dead_code, reason = "the bench drives one of the trucks")]
#[path = "../tests/multibody/trucks.rs"]
mod trucks;

fn lateral(c: &mut Criterion) {
    let linear = trucks::loaded_55t();
    let mut saturating = linear;
    saturating.tyres.law = TyreLaw::Saturating { friction_coeff: 0.8 };
    for (name, p, speed_m_s) in [
        ("linear, 80 km/h", linear, 22.2),
        ("saturating, 80 km/h", saturating, 22.2),
        ("linear, in the blend", linear, 2.0),
    ] {
        let Ok(m) = LateralModel::new(&p) else { return };
        let mut inputs = LateralInputs { speed_m_s, ..Default::default() };
        let mut s = LateralState::default();
        let mut k = 0_u32;
        c.bench_function(&format!("lateral step 5 ms, {name}"), |b| {
            b.iter(|| {
                k = k.wrapping_add(1);
                inputs.steering_wheel_rad = if k & 512 == 0 { 0.2 } else { -0.2 };
                s = m.step(black_box(&s), black_box(&inputs), 0.005);
            });
        });
        c.bench_function(&format!("lateral outputs, {name}"), |b| {
            b.iter(|| m.outputs(black_box(&s), black_box(&inputs)));
        });
    }
}

criterion_group!(benches, lateral);
criterion_main!(benches);
