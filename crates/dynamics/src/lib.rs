//! The truck: a list of effects, an integrator and truck files.
