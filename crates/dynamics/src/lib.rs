//! The truck: a list of effects, an integrator and truck files.

pub mod lateral;
