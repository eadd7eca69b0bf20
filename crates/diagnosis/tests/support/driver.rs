//! The driver: speed by pedal, engine brake and service brake, lane by hand wheel.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::random::{between, normal};
use super::road::Road;

/// Commands and what the driver remembers.
pub(crate) struct Driver {
    pub(crate) pedal: f64,
    pub(crate) stage: f64,
    pub(crate) xbr: f64,
    /// Hand-wheel angle, rad.
    pub(crate) wheel: f64,
    tick: usize,
    foot: f64,
    wanted: f64,
    integral: f64,
    tremor: f64,
    wander: f64,
    goal: f64,
    wheel_trim: f64,
    most_stage: f64,
    decel: f64,
    gain: f64,
}

/// What a driver sees: the truck is at `place` with speed `v`, `climb_n` pulls it back, it points
/// `aside` of the road's direction and is `offset` to the left of the lane's middle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct View {
    pub(crate) place: f64,
    pub(crate) v: f64,
    pub(crate) climb_n: f64,
    pub(crate) aside: f64,
    pub(crate) offset: f64,
}

impl Driver {
    /// A driver who uses the engine brake up to `most_stage`.
    pub(crate) fn new(most_stage: f64, rng: &mut ChaCha8Rng) -> Self {
        Self {
            pedal: 0.0,
            stage: 0.0,
            xbr: 0.0,
            wheel: 0.0,
            tick: 0,
            foot: 0.0,
            wanted: 5.0,
            integral: 0.0,
            tremor: 0.0,
            wander: 0.0,
            goal: 0.0,
            wheel_trim: 0.0,
            most_stage,
            decel: between(rng, 0.45, 0.9),
            gain: between(rng, 0.35, 0.6),
        }
    }

    /// One step with what the driver sees.
    pub(crate) fn act(&mut self, road: &Road, view: &View, rng: &mut ChaCha8Rng, dt: f64) {
        let View { place, v, climb_n, aside, offset } = *view;
        if self.tick.is_multiple_of(20) {
            self.wanted = road.wanted(place, self.decel);
        }
        let error = self.wanted - v;
        let need = climb_n * v / 350e3;
        self.integral = (self.integral + 0.05 * error * dt).clamp(-0.2, 0.4);
        let wish = need + self.integral + self.gain * error;
        let brake = (-need - self.integral).max(0.0) - self.gain * error;
        let goal = if error < -1.2 { 0.0 } else { wish.clamp(0.0, 1.0) };
        self.foot += (goal - self.foot).clamp(-1.6 * dt, 0.8 * dt);
        if self.tick.is_multiple_of(5) {
            self.pedal = self.foot;
            let over = if goal > 0.02 { 0.0 } else { brake };
            let stage = if over > 0.1 && v > 4.0 { over.clamp(0.12, self.most_stage) } else { 0.0 };
            self.stage = (stage * 100.0).round() / 100.0;
        }
        let hard = if error < -0.7 { (0.45 * (-error - 0.7)).min(1.5) } else { 0.0 };
        self.xbr += (hard - self.xbr) * dt / 0.06;
        if self.xbr < 0.01 {
            self.xbr = 0.0;
        }
        // Lane.
        if rng.random::<f64>() < dt / 20.0 {
            self.goal = between(rng, -0.7, 0.7);
        }
        self.wander += (self.goal - self.wander) * dt / 1.8;
        self.tremor += -dt * self.tremor / 0.9 + 0.03 * dt.sqrt() * normal(rng);
        let ahead = road.curvature(place + 0.4 * v);
        let gap = offset - self.wander;
        self.wheel_trim = (self.wheel_trim - 0.004 * gap * dt).clamp(-0.2, 0.2);
        let angle = 24.0 * (4.4 * ahead - 0.0022 * gap - 0.085 * aside) + self.wheel_trim;
        self.wheel += (angle + self.tremor - self.wheel) * dt / 0.14;
        self.tick += 1;
    }
}
