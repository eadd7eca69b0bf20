//! Air: the day's wind over the map, gusts that lie along the road, drag and side force with points
//! of attack on the two bodies.

use rand_chacha::ChaCha8Rng;

use super::super::sheet::Figures;

use super::chassis::Push;
use super::colour::Colour;
use super::faults::Faults;

/// Length of a gust along the road, m, and standard deviation along and across, m/s.
const GUST_M: f64 = 140.0;
const GUST_M_S: [f64; 2] = [0.30, 0.25];
/// Part of the side force on the tractor, where it acts ahead of the tractor's CG and where the
/// trailer's acts behind the kingpin (the box begins 1.6 m ahead of it and is 13.6 m long), m.
const ON_TRACTOR: f64 = 0.30;
const AHEAD_M: f64 = 0.5;
const BEHIND_M: f64 = 4.7;

/// The air of one drive.
pub(crate) struct Air {
    mean: [f64; 2],
    headwind: f64,
    crosswind: f64,
    gusts: [Colour; 2],
    slow: Colour,
    share: f64,
    ahead_m: f64,
    behind_m: f64,
    /// Extra drag of the cause, and how much of it needs side wind.
    drag: (f64, f64),
    /// Hidden head wind, crosswind, wind over the map; how far the wind veers, rad.
    hidden: [f64; 2],
    blowing: [f64; 2],
    veer: f64,
}

/// What the air does now.
pub(crate) struct Blow {
    pub(crate) drag_n: f64,
    pub(crate) pushes: [Push; 2],
}

impl Air {
    pub(crate) fn new(f: &Figures, faults: &Faults, rng: &mut ChaCha8Rng) -> Self {
        let mut air = Self {
            mean: f.wind,
            headwind: f.headwind,
            crosswind: f.crosswind,
            gusts: [Colour::new(GUST_M, rng), Colour::new(GUST_M, rng)],
            slow: Colour::new(240.0, rng),
            share: ON_TRACTOR,
            ahead_m: AHEAD_M,
            behind_m: BEHIND_M,
            drag: (0.0, 0.0),
            hidden: [faults.size("headwind"), 0.0],
            blowing: [0.0; 2],
            veer: 0.0,
        };
        if let Some((x, shape)) = faults.get("air_drag") {
            air.drag = (x, shape.at(0, 0.0, 0.5));
        }
        if let Some((x, shape)) = faults.get("crosswind") {
            air.hidden[1] = x;
            air.attack(shape.at(0, -1.0, 1.0), shape.at(1, -1.0, 1.0));
        }
        if let Some((x, shape)) = faults.get("wind") {
            let (sin, cos) = shape.at(0, 0.0, core::f64::consts::TAU).sin_cos();
            air.blowing = [x * cos, x * sin];
            air.veer = shape.at(1, 0.0, 0.25);
            air.attack(shape.at(2, -1.0, 1.0), shape.at(3, -1.0, 1.0));
        }
        air
    }

    /// Another body: more or less force on the tractor, further forward or back.
    fn attack(&mut self, share: f64, place: f64) {
        self.share += 0.08 * share;
        self.ahead_m += 0.5 * place;
        self.behind_m -= 0.7 * place;
    }

    /// The forces at `v` with the truck pointing to `heading`; advances the gusts by `dt`.
    pub(crate) fn act(
        &mut self,
        f: &Figures,
        (v, heading, density): (f64, f64, f64),
        rng: &mut ChaCha8Rng,
        dt: f64,
    ) -> Blow {
        let along = GUST_M_S[0] * self.gusts[0].step(v * dt, rng);
        let across = GUST_M_S[1] * self.gusts[1].step(v * dt, rng);
        let slow = self.slow.step(dt, rng);
        let (sin, cos) = (self.veer * slow).sin_cos();
        let [bx, by] = self.blowing;
        let x = self.mean[0] + bx * cos - by * sin;
        let y = self.mean[1] + bx * sin + by * cos;
        // A hidden wind swells and falls about its mean.
        let swell = 1.0 + 0.2 * slow;
        let (sin, cos) = heading.sin_cos();
        let against = v + self.headwind + self.hidden[0] * swell + along - x * cos - y * sin;
        let aside = self.crosswind + self.hidden[1] * swell + across + y * cos - x * sin;
        let yaw = (aside / against.abs().max(1.0)).atan();
        let yaw_deg = yaw.to_degrees();
        let stream2 = against * against + aside * aside;
        let more = self.drag.0 * (1.0 + self.drag.1 * (0.4 * yaw_deg.abs() - 1.0).clamp(-1.0, 2.0));
        let area = f.drag_area * (1.0 + more) * (1.0 + 0.018 * (yaw_deg.hypot(0.5) - 0.5));
        let side = 0.5 * density * stream2 * 0.7 * (0.5 * (2.0 * yaw).sin()).to_degrees();
        Blow {
            drag_n: 0.5 * density * area * stream2.sqrt() * against,
            pushes: [
                Push::Tractor { force_n: self.share * side, behind_m: -self.ahead_m },
                Push::Trailer { force_n: (1.0 - self.share) * side, behind_m: self.behind_m },
            ],
        }
    }
}
