//! From the hand wheel to the road wheels: column, play between friction and self-alignment, ratio,
//! booster.

use rand_chacha::ChaCha8Rng;

use super::super::effects::Shape;
use super::super::sheet::Figures;

use super::colour::{Colour, towards};
use super::faults::Faults;

/// Steering of one drive.
pub(crate) struct Steering {
    behind_play: f64,
    angle: f64,
    rate: f64,
    road_rad: f64,
    slow: Colour,
    ratio: Option<(f64, Shape)>,
    offset: Option<(f64, Shape)>,
    play: Option<(f64, Shape)>,
    lag: Option<(f64, Shape)>,
}

impl Steering {
    pub(crate) fn new(faults: &Faults, rng: &mut ChaCha8Rng) -> Self {
        Self {
            behind_play: 0.0,
            angle: 0.0,
            rate: 0.0,
            road_rad: 0.0,
            slow: Colour::new(300.0, rng),
            ratio: faults.get("steering_ratio"),
            offset: faults.get("steering_offset"),
            play: faults.get("steering_free_play"),
            lag: faults.get("steering_lag"),
        }
    }

    /// Road-wheel angle, rad, for a hand-wheel angle.
    pub(crate) fn turn(&mut self, f: &Figures, wheel: f64, rng: &mut ChaCha8Rng, dt: f64) -> f64 {
        let slow = self.slow.step(dt, rng);
        if let Some((x, shape)) = self.play {
            // Friction holds the gear within the play; alignment pulls it to the edge of the middle.
            let half = 0.5 * x;
            self.behind_play = self.behind_play.clamp(wheel - half, wheel + half);
            let rest = 0.0_f64.clamp(wheel - half, wheel + half);
            towards(&mut self.behind_play, rest, dt, shape.at(0, 2.0, 20.0));
        } else {
            self.behind_play = wheel;
        }
        if let Some((x, shape)) = self.lag {
            // A booster of second order: twice its damping over its frequency is the delay.
            let damping = shape.at(0, 0.7, 1.1);
            let omega = 2.0 * damping / x.max(0.01);
            let parts = 8;
            for _ in 0..parts {
                let accel = omega * omega * (self.behind_play - self.angle)
                    - 2.0 * damping * omega * self.rate;
                self.rate += dt / f64::from(parts) * accel;
                self.angle += dt / f64::from(parts) * self.rate;
            }
        } else {
            self.angle = self.behind_play;
        }
        let mut offset = f.steer_offset_rad;
        if let Some((x, shape)) = self.offset {
            offset += x * (1.0 + shape.at(0, 0.0, 0.15) * slow);
        }
        let mut ratio = f.steer_ratio;
        if let Some((x, shape)) = self.ratio {
            // Another gear: its error is not the same about the middle and beyond.
            let out = (self.angle.abs() / 0.4 - 1.0).clamp(-1.0, 1.0);
            ratio *= 1.0 + x * (1.0 + shape.at(0, -0.25, 0.25) * out);
        }
        towards(&mut self.road_rad, (self.angle - offset) / ratio, dt, f.steer_lag_s);
        self.road_rad
    }
}
