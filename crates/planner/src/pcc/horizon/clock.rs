//! Trip-time controller of the receding horizon: the price of time that makes the trip take as
//! long as with cruise control.
//!
//! A shadow truck drives the same road with power-limited cruise control at the set speed. It moves
//! along with the real one, so its clock at the real truck's station is the trip time to be met, on
//! any road and without a timetable. The price of a second, β, follows
//! `ln(β/β₀) = K_p L/T + K_i Σ L/T`, `T` the duration of the last plan and `L` the lateness that it
//! expects at its end: what the truck is late now, and what the plan takes longer than the shadow. β₀ is the multiplier of the
//! trip time in the first plan. One price for a whole trip is optimal (β is a costate of a state
//! that enters no dynamics), so the gains are low. They have to be: the speed grows with the cube
//! root of β, so a plan answers with `dL = -(T/3) d ln β`, and from `K_p = 3` on the price would
//! swing from plan to plan.
//!
//! Time lost behind traffic is not made up for: while traffic rules, the clocks run alike.

use alloc::vec::Vec;

use crate::pcc::model::duration_s;

/// `K_p`: relative lateness to logarithm of the price.
const PROPORTIONAL: f64 = 1.0;
/// `K_i`: the same per plan, summed.
const INTEGRAL: f64 = 0.3;
/// Largest logarithm of the relative price, down and up.
const RANGE: (f64, f64) = (-2.5, 0.4);

/// The shadow's drive over the horizon of one plan.
#[derive(Debug, Clone, Default)]
struct Shadow {
    start_s_m: f64,
    h_m: f64,
    e_j_kg: Vec<f64>,
    time_s: Vec<f64>,
}

impl Shadow {
    /// Energy, J/kg, and time since its start, s, at a station within the horizon.
    fn at(&self, s_m: f64) -> Option<(f64, f64)> {
        let x = (s_m - self.start_s_m) / self.h_m;
        if !(x >= 0.0 && x <= (self.e_j_kg.len() as f64) - 1.0) {
            return None;
        }
        let k = (x as usize).min(self.e_j_kg.len() - 2);
        let f = x - k as f64;
        let e = self.e_j_kg[k] + f * (self.e_j_kg[k + 1] - self.e_j_kg[k]);
        Some((e, self.time_s[k] + duration_s(f * self.h_m, self.e_j_kg[k], e)))
    }
}

/// Lateness and price of time.
#[derive(Debug, Clone, Default)]
pub struct TripClock {
    shadow: Option<Shadow>,
    plan_time_s: f64,
    late_s: f64,
    expected_frac: f64,
    sum_frac: f64,
    first_g_s: Option<f64>,
}

impl TripClock {
    /// Moves the shadow to `s_m` at time `now_s`; `held_up`: traffic ruled since the last plan.
    /// Returns the shadow's energy there, J/kg; `None` if there is no shadow yet or the truck has
    /// jumped.
    pub fn advance(&mut self, s_m: f64, now_s: f64, held_up: bool) -> Option<f64> {
        let (e, shadow_s) = self.shadow.take().and_then(|shadow| shadow.at(s_m))?;
        if !held_up {
            self.late_s += (now_s - self.plan_time_s) - shadow_s;
        }
        Some(e)
    }

    /// The shadow's drive from `s_m` on, as planned at `now_s`.
    pub fn set_shadow(&mut self, s_m: f64, h_m: f64, now_s: f64, e_j_kg: Vec<f64>) {
        let mut time_s = Vec::with_capacity(e_j_kg.len());
        let mut t = 0.0;
        time_s.push(t);
        for w in e_j_kg.windows(2) {
            t += duration_s(h_m, w[0], w[1]);
            time_s.push(t);
        }
        self.shadow = Some(Shadow { start_s_m: s_m, h_m, e_j_kg, time_s });
        self.plan_time_s = now_s;
    }

    /// Time that the shadow takes to node `k`, s.
    #[must_use]
    pub fn shadow_time_s(&self, k: usize) -> Option<f64> {
        self.shadow.as_ref().and_then(|shadow| shadow.time_s.get(k)).copied()
    }

    /// Takes the durations of a plan and of the shadow over the same road, s.
    pub fn expect(&mut self, plan_s: f64, shadow_s: f64) {
        self.expected_frac = (self.late_s + plan_s - shadow_s) / plan_s.max(1.0);
        let room = RANGE.1 / INTEGRAL;
        self.sum_frac = (self.sum_frac + self.expected_frac).clamp(-room, room);
    }

    /// Lateness now, s, time behind traffic not counted.
    #[must_use]
    pub fn late_s(&self) -> f64 {
        self.late_s
    }

    /// Price of time, g/s; `None` before [`Self::begin`].
    #[must_use]
    pub fn price_g_s(&self) -> Option<f64> {
        let log = PROPORTIONAL * self.expected_frac + INTEGRAL * self.sum_frac;
        self.first_g_s.map(|beta| beta * libm::exp(log.clamp(RANGE.0, RANGE.1)))
    }

    /// The price to begin with, g/s.
    pub fn begin(&mut self, beta_g_s: f64) {
        self.first_g_s = Some(beta_g_s);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_late_truck_pays_more_for_a_second_and_an_early_one_less() {
        let mut clock = TripClock::default();
        clock.begin(3.0);
        clock.set_shadow(0.0, 100.0, 0.0, alloc::vec![200.0; 11]);
        // 100 m at 20 m/s are 5 s: 7 s are 2 s late
        assert_eq!(clock.advance(100.0, 7.0, false), Some(200.0));
        assert!((clock.late_s() - 2.0).abs() < 1e-12);
        clock.expect(101.0, 100.0);
        assert!(clock.price_g_s().unwrap() > 3.0);
        clock.expect(100.0, 160.0);
        assert!(clock.price_g_s().unwrap() < 3.0);
    }

    #[test]
    fn the_price_settles_although_every_plan_answers_it() {
        let mut clock = TripClock::default();
        clock.begin(3.0);
        let duration_s = 10_000.0 / 20.0;
        let (mut last, mut swings) = (0.0_f64, 0);
        for _ in 0..400 {
            let beta = clock.price_g_s().unwrap();
            // The plan's duration against the shadow's, v ~ β^(1/3); equal at 2.5 g/s
            let plan_s = duration_s * (2.5 / beta).cbrt();
            let late = plan_s - duration_s;
            clock.expect(plan_s, duration_s);
            swings += i32::from(late * last < 0.0);
            last = late;
        }
        assert!(last.abs() < 0.1 && swings <= 4, "{last} s after {swings} swings");
    }

    #[test]
    fn time_lost_behind_traffic_is_not_made_up_for() {
        let mut clock = TripClock::default();
        clock.set_shadow(0.0, 100.0, 0.0, alloc::vec![200.0; 11]);
        assert!(clock.advance(500.0, 60.0, true).is_some());
        assert_eq!(clock.late_s(), 0.0);
    }
}
