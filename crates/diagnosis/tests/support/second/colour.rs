//! Noise with a colour: a stationary process over time or over the road.

use rand_chacha::ChaCha8Rng;

use super::super::random::normal;

/// First-order process of standard deviation one.
pub(crate) struct Colour {
    scale: f64,
    x: f64,
}

impl Colour {
    /// `scale`: length or time over which it forgets, in the unit of [`Self::step`].
    pub(crate) fn new(scale: f64, rng: &mut ChaCha8Rng) -> Self {
        Self { scale, x: normal(rng) }
    }

    /// Goes on by `d`.
    pub(crate) fn step(&mut self, d: f64, rng: &mut ChaCha8Rng) -> f64 {
        let keep = (-d / self.scale).exp();
        self.x = keep * self.x + (1.0 - keep * keep).sqrt() * normal(rng);
        self.x
    }

    /// Its value now.
    pub(crate) fn now(&self) -> f64 {
        self.x
    }
}

/// A knee without a corner: `x` above zero, nothing below, rounded over `width`.
pub(crate) fn knee(x: f64, width: f64) -> f64 {
    let z = x / width;
    if z > 30.0 { x } else { width * z.exp().ln_1p() }
}

/// First-order lag of `tau_s` for a step of `dt`.
pub(crate) fn towards(x: &mut f64, goal: f64, dt: f64, tau_s: f64) {
    *x += (goal - *x) * (1.0 - (-dt / tau_s.max(1e-3)).exp());
}
