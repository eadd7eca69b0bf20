//! What traffic looks like in numbers: samples from scenes, and how far two sets of samples lie
//! apart.
//!
//! [`Observer`] looks at scenes of any source, measured or computed, and takes the same samples from
//! all of them; [`kolmogorov_smirnov`] and [`wasserstein`] compare two sets.

mod distance;
mod observer;

pub use distance::{
    Moments, kolmogorov_smirnov, kolmogorov_smirnov_by_chance, moments, wasserstein,
};
pub use observer::{Observer, QUANTITIES, Quantity, Samples, observe_recording};
