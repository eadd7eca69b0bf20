//! From the hand wheel to the road wheels.
//!
//! Order of the parts: angle and rate limit of the hand wheel, free play (backlash) of the steering
//! gear, offset, ratio, first-order lag. The wheel goes to its demand at the full rate and waits there;
//! the lag's response to that ramp is exact, so that the result does not depend on the step length.
//!
//! Within the play the road wheels' self-alignment may pull the gear to where they roll straight, against
//! its friction: first order in time, our stand-in for the torque of pneumatic and caster trail.
//!
//! Left out: steering compliance under aligning moment, left-right (Ackermann) difference.

use serde::{Deserialize, Serialize};

/// Steering gear.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SteeringParameters {
    /// Hand-wheel angle per road-wheel angle.
    pub ratio: f64,
    /// Time constant of the first-order lag, s; 0 for none.
    pub lag_s: f64,
    /// Hand-wheel angle through which the road wheels do not move on reversal, rad, lock to lock of
    /// the play.
    pub free_play_rad: f64,
    /// How fast the wheels' self-alignment pulls the gear within its play to where they roll straight,
    /// per s; 0: its friction holds it.
    #[serde(default)]
    pub free_play_centring_1_s: f64,
    /// Hand-wheel angle that must be added to the true one to drive straight, rad: the wheels stand
    /// at `(hand wheel - offset) / ratio`.
    pub offset_rad: f64,
    /// Largest hand-wheel angle, rad.
    pub max_wheel_rad: f64,
    /// Largest hand-wheel rate, rad/s.
    pub max_wheel_rate_rad_s: f64,
}

/// State of the steering gear.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct SteeringState {
    /// Hand-wheel angle after its limits, rad, positive left.
    pub wheel_rad: f64,
    /// Hand-wheel side of the steering gear behind the free play, rad.
    pub gear_rad: f64,
    /// Road-wheel angle, rad, positive left.
    pub road_wheel_rad: f64,
}

impl SteeringParameters {
    pub(super) fn check(&self, check: &mut impl FnMut(&str, f64, f64, f64)) {
        check("steering.ratio", self.ratio, 1.0, 60.0);
        check("steering.lag_s", self.lag_s, 0.0, 5.0);
        check("steering.free_play_rad", self.free_play_rad, 0.0, 1.0);
        check("steering.free_play_centring_1_s", self.free_play_centring_1_s, 0.0, 100.0);
        check("steering.offset_rad", self.offset_rad, -2.0, 2.0);
        check("steering.max_wheel_rad", self.max_wheel_rad, 0.1, 40.0);
        check("steering.max_wheel_rate_rad_s", self.max_wheel_rate_rad_s, 0.1, 1e3);
    }

    /// State after `dt_s` with the demanded hand-wheel angle, rad.
    #[must_use]
    pub fn step(&self, state: &SteeringState, wheel_demand_rad: f64, dt_s: f64) -> SteeringState {
        let reach = self.max_wheel_rate_rad_s * dt_s;
        let demand = wheel_demand_rad.clamp(-self.max_wheel_rad, self.max_wheel_rad);
        let wheel = demand.clamp(state.wheel_rad - reach, state.wheel_rad + reach);
        let play = 0.5 * self.free_play_rad;
        let gear = state.gear_rad.clamp(wheel - play, wheel + play);
        let target = (gear - self.offset_rad) / self.ratio;
        let road_wheel = if self.lag_s > 0.0 {
            let after = |t: f64| libm::exp(-t / self.lag_s);
            let from = (state.gear_rad - self.offset_rad) / self.ratio;
            let held = target + (state.road_wheel_rad - from) * after(dt_s);
            let moved = gear - state.gear_rad;
            if moved == 0.0 {
                held
            } else {
                // The wheel turns at its full rate, takes up the play, then moves the gear.
                let end = (wheel - state.wheel_rad).abs() / self.max_wheel_rate_rad_s;
                let start = end - moved.abs() / self.max_wheel_rate_rad_s;
                let rate = moved.signum() * self.max_wheel_rate_rad_s / self.ratio;
                held - rate * self.lag_s * (after(dt_s - end) - after(dt_s - start))
            }
        } else {
            target
        };
        let mut next =
            SteeringState { wheel_rad: wheel, gear_rad: gear, road_wheel_rad: road_wheel };
        if play > 0.0 && self.free_play_centring_1_s > 0.0 {
            let part = 1.0 - libm::exp(-self.free_play_centring_1_s * dt_s);
            next.gear_rad =
                Self::centred_rad(gear, self.offset_rad, (wheel - play, wheel + play), part);
            if self.lag_s <= 0.0 {
                next.road_wheel_rad = (next.gear_rad - self.offset_rad) / self.ratio;
            }
        }
        next
    }

    /// The gear, rad, once alignment has taken it this part of the way to where the wheels roll straight,
    /// rad, or to the edge of its play (low, high, rad) on that side.
    #[inline]
    #[must_use]
    pub fn centred_rad(
        gear_rad: f64,
        straight_rad: f64,
        (low, high): (f64, f64),
        part: f64,
    ) -> f64 {
        gear_rad + part * (straight_rad.max(low).min(high) - gear_rad)
    }

    /// Hand-wheel angle, rad, that holds this road-wheel angle, rad (free play at its middle).
    #[must_use]
    pub fn wheel_for_rad(&self, road_wheel_rad: f64) -> f64 {
        road_wheel_rad * self.ratio + self.offset_rad
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gear() -> SteeringParameters {
        SteeringParameters {
            ratio: 20.0,
            lag_s: 0.08,
            free_play_rad: 0.1,
            free_play_centring_1_s: 0.0,
            offset_rad: 0.0,
            max_wheel_rad: 10.0,
            max_wheel_rate_rad_s: 1e3,
        }
    }

    #[test]
    fn the_lag_is_exact_whatever_the_step_length() {
        let p = SteeringParameters { max_wheel_rate_rad_s: 10.0, ..gear() };
        let run = |n: usize| {
            let mut s = SteeringState::default();
            for _ in 0..n {
                s = p.step(&s, 1.0, 0.16 / n as f64);
            }
            s.road_wheel_rad
        };
        // A ramp of 0.1 s through the play, then hold.
        let ramp = |t: f64| 10.0 / 20.0 * (t - 0.08 * (1.0 - (-t / 0.08).exp()));
        let exact = ramp(0.16 - 0.005) - ramp(0.06);
        for n in [1, 7, 160] {
            assert!((run(n) - exact).abs() < 1e-14, "{n} steps: {}", run(n));
        }
    }

    #[test]
    fn free_play_loses_its_width_on_reversal_and_half_of_it_from_the_middle() {
        let p = SteeringParameters { lag_s: 0.0, ..gear() };
        let left = p.step(&SteeringState::default(), 1.0, 0.1);
        assert!((left.road_wheel_rad - 0.95 / 20.0).abs() < 1e-15);
        let within = p.step(&left, 0.91, 0.1);
        assert_eq!(within.road_wheel_rad, left.road_wheel_rad);
        let back = p.step(&within, 0.8, 0.1);
        assert!((back.road_wheel_rad - 0.85 / 20.0).abs() < 1e-15);
    }

    #[test]
    fn alignment_pulls_the_gear_to_the_middle_or_to_the_edge_of_its_play() {
        let p = SteeringParameters {
            lag_s: 0.0,
            offset_rad: 0.02,
            free_play_centring_1_s: 0.5,
            ..gear()
        };
        // Held left of the middle: e-fold in two seconds, to the edge that lies nearest to it.
        let held = |wheel: f64, end_s: f64| {
            let mut s = SteeringState { wheel_rad: wheel, gear_rad: wheel, road_wheel_rad: 0.0 };
            for _ in 0..(end_s * 100.0) as usize {
                s = p.step(&s, wheel, 0.01);
            }
            s
        };
        let edge = 0.2 - 0.05;
        assert!((held(0.2, 2.0).gear_rad - (edge + 0.05 * (-1.0_f64).exp())).abs() < 1e-12);
        assert!((held(0.2, 60.0).road_wheel_rad - (edge - 0.02) / 20.0).abs() < 1e-12);
        // Where the middle lies within the play the wheels end up rolling straight.
        assert!(held(0.05, 60.0).road_wheel_rad.abs() < 1e-12);
    }

    #[test]
    fn angle_and_rate_are_limited_and_the_offset_is_taken_off() {
        let p = SteeringParameters {
            lag_s: 0.0,
            free_play_rad: 0.0,
            offset_rad: 0.2,
            max_wheel_rad: 2.0,
            max_wheel_rate_rad_s: 4.0,
            ..gear()
        };
        let s = p.step(&SteeringState::default(), 9.0, 0.25);
        assert!((s.wheel_rad - 1.0).abs() < 1e-15);
        let s = p.step(&p.step(&s, 9.0, 0.25), 9.0, 0.25);
        assert!((s.wheel_rad - 2.0).abs() < 1e-15);
        assert!((s.road_wheel_rad - 1.8 / 20.0).abs() < 1e-15);
        assert!((p.wheel_for_rad(s.road_wheel_rad) - 2.0).abs() < 1e-12);
    }
}
