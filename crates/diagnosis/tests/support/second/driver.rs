//! A driver who moves the foot now and then, takes the engine brake in stages, brakes in long
//! applications, and steers by what lies far and near.

use rand_chacha::ChaCha8Rng;

use super::super::random::{between, normal};

use super::Trip;
use super::colour::towards;
use super::road::Route;

/// Commands and memory.
pub(crate) struct Driver {
    pub(crate) pedal: f64,
    pub(crate) stage: f64,
    pub(crate) xbr: f64,
    /// Hand-wheel angle, rad.
    pub(crate) wheel: f64,
    most_stage: f64,
    decel: f64,
    patience_s: f64,
    next_s: f64,
    wanted: f64,
    surplus: f64,
    foot: f64,
    braking: bool,
    look_s: f64,
    aim: f64,
    place_in_lane: f64,
    trim: f64,
}

/// What the driver sees and feels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sight {
    pub(crate) time_s: f64,
    pub(crate) place_m: f64,
    pub(crate) v: f64,
    pub(crate) mass_kg: f64,
    pub(crate) grade: f64,
    /// Heading against the road, rad, positive left.
    pub(crate) aside: f64,
    /// Distance to the left of the middle of the lane, m.
    pub(crate) offset: f64,
}

impl Driver {
    pub(crate) fn new(trip: &Trip, rng: &mut ChaCha8Rng) -> Self {
        Self {
            pedal: 0.0,
            stage: 0.0,
            xbr: 0.0,
            wheel: 0.0,
            most_stage: trip.most_stage,
            decel: between(rng, 0.4, 0.8),
            patience_s: between(rng, 0.5, 1.4),
            next_s: 0.0,
            wanted: 6.0,
            surplus: 0.0,
            foot: 0.0,
            braking: false,
            look_s: 0.0,
            aim: 0.0,
            place_in_lane: 0.0,
            trim: 0.0,
        }
    }

    pub(crate) fn act(&mut self, route: &Route, s: &Sight, rng: &mut ChaCha8Rng, dt: f64) {
        self.along(route, s, rng, dt);
        self.across(route, s, rng, dt);
    }

    fn along(&mut self, route: &Route, s: &Sight, rng: &mut ChaCha8Rng, dt: f64) {
        if s.time_s >= self.next_s {
            self.next_s = s.time_s + self.patience_s * between(rng, 0.6, 1.4);
            self.wanted = route.speed(s.place_m, self.decel);
            let error = self.wanted - s.v;
            self.surplus = (self.surplus + 0.015 * error * self.patience_s).clamp(-0.15, 0.25);
            let accel = (0.35 * error).clamp(-1.2, 0.6);
            let road_n = 0.006 * s.mass_kg * 9.81 + 3.9 * s.v * s.v;
            let force = s.mass_kg * (accel + 9.81 * s.grade) + road_n;
            let foot = force * s.v.max(3.0) / 340e3 + self.surplus;
            // The foot moves where it is worth it.
            if (foot - self.foot).abs() > 0.04 || foot < 0.02 {
                self.foot = if error < -1.0 { 0.0 } else { foot.clamp(0.0, 1.0) };
            }
            let hold = (-force / (0.22 * s.mass_kg.max(25e3))).clamp(0.0, self.most_stage);
            let step = (5.0 * hold).round() / 5.0;
            let idle = self.foot <= 0.0 && s.v > 5.0;
            if !idle {
                self.stage = 0.0;
            } else if (step - self.stage).abs() > 0.15 || step == 0.0 {
                self.stage = step;
            }
        }
        let rate = if self.foot > self.pedal { 1.0 } else { 2.2 };
        self.pedal += (self.foot - self.pedal).clamp(-rate * dt, rate * dt);
        if self.pedal < 1e-9 {
            self.pedal = 0.0;
        }
        let over = s.v - self.wanted;
        self.braking = if self.braking { over > 0.25 } else { over > 1.1 };
        let push = if self.braking { (0.25 + 0.35 * over).min(1.7) } else { 0.0 };
        self.xbr += (push - self.xbr).clamp(-2.5 * dt, 1.3 * dt);
        if self.xbr < 0.01 && push <= 0.0 {
            self.xbr = 0.0;
        }
    }

    fn across(&mut self, route: &Route, s: &Sight, rng: &mut ChaCha8Rng, dt: f64) {
        self.place_in_lane += -dt * self.place_in_lane / 12.0 + 0.11 * dt.sqrt() * normal(rng);
        if s.time_s >= self.look_s {
            self.look_s = s.time_s + between(rng, 0.15, 0.35);
            let gap = s.offset - self.place_in_lane;
            let seen = if gap.abs() < 0.06 { 0.0 } else { gap };
            self.trim = (self.trim - 0.001 * gap).clamp(-0.2, 0.2);
            let far = 0.5
                * (route.curvature(s.place_m + 0.35 * s.v)
                    + route.curvature(s.place_m + 0.6 * s.v));
            let hand = 0.012 * normal(rng);
            self.aim = 24.0 * (4.4 * far - 0.0019 * seen - 0.08 * s.aside) + self.trim + hand;
        }
        towards(&mut self.wheel, self.aim, dt, 0.18);
    }
}
