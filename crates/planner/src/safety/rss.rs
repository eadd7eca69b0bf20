//! Responsibility-sensitive safe gap for heavy trucks (Shalev-Shwartz et al. 2017, rule 1), with
//! reaction time, pneumatic build-up and grade.
//!
//! | symbol | unit | meaning |
//! |---|---|---|
//! | `v_r`, `v_f` | m/s | speed of the rear and of the front vehicle |
//! | `rho` | s | reaction time of the rear vehicle, dead time and half the build-up included |
//! | `a` | m/s² | its largest acceleration during `rho` |
//! | `b_r` | m/s² | deceleration that the rear vehicle reaches for certain |
//! | `b_f` | m/s² | hardest deceleration of the front vehicle |
//!
//! `d = v_r rho + a rho²/2 + (v_r + rho a)²/(2 b_r) - v_f²/(2 b_f)`, not below zero. It is exact for
//! `b_r <= b_f`, which [`RssConfig::check`] demands: then the gap is smallest at standstill.

use crate::PlannerError;
use crate::error::config_in;
use serde::{Deserialize, Serialize};
use tractrix_core::{GRAVITY_M_S2, VehicleClass, VehicleLimits};

/// How a vehicle behind responds to the one ahead.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RearResponse {
    /// Reaction time until the full deceleration, s.
    pub reaction_s: f64,
    /// Largest acceleration during the reaction time, m/s².
    pub accel_max_m_s2: f64,
    /// Deceleration that is reached for certain on the level, m/s².
    pub brake_min_m_s2: f64,
}

/// Assumptions of the safe gaps, by vehicle class.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RssConfig {
    /// Decision and computing time of the ego, s; dead time and half the build-up of its brakes are added.
    pub ego_processing_s: f64,
    /// Largest acceleration of the ego during its reaction, m/s².
    pub ego_accel_max_m_s2: f64,
    /// Share of the ego's largest deceleration that is counted on, 0 to 1. The rest is the margin for
    /// what a planner does not see: hot linings, worn tyres, an axle out of adjustment. It is no
    /// margin for a wet or icy road: the largest deceleration is the one of a dry road.
    pub ego_brake_use_frac: f64,
    /// Hardest deceleration of the ego as seen by a vehicle behind it, m/s².
    pub ego_brake_max_m_s2: f64,
    /// Hardest deceleration of a car or van ahead, m/s².
    pub car_brake_max_m_s2: f64,
    /// Hardest deceleration of a truck ahead, m/s².
    pub truck_brake_max_m_s2: f64,
    /// Response of a car or van behind the ego.
    pub car_behind: RearResponse,
    /// Response of a truck behind the ego.
    pub truck_behind: RearResponse,
}

impl Default for RssConfig {
    /// Ego: 0.3 s processing (three 0.1 s cycles of prediction and gate), 80 % of its braking; cars ahead brake with 8 m/s², trucks with 6;
    /// cars behind react in 1.2 s and brake with 4 m/s², trucks in 1.3 s with 3.5.
    fn default() -> Self {
        Self {
            ego_processing_s: 0.3,
            ego_accel_max_m_s2: 0.3,
            ego_brake_use_frac: 0.8,
            ego_brake_max_m_s2: 6.0,
            car_brake_max_m_s2: 8.0,
            truck_brake_max_m_s2: 6.0,
            car_behind: RearResponse { reaction_s: 1.2, accel_max_m_s2: 1.5, brake_min_m_s2: 4.0 },
            truck_behind: RearResponse {
                reaction_s: 1.3,
                accel_max_m_s2: 0.4,
                brake_min_m_s2: 3.5,
            },
        }
    }
}

impl RssConfig {
    /// Checks ranges, and that nobody behind is assumed to brake harder than those ahead.
    ///
    /// # Errors
    /// [`PlannerError::Config`] names the key.
    pub fn check(&self) -> Result<(), PlannerError> {
        config_in("rss.ego_processing_s", self.ego_processing_s, 0.0, 3.0)?;
        config_in("rss.ego_accel_max_m_s2", self.ego_accel_max_m_s2, 0.0, 3.0)?;
        config_in("rss.ego_brake_use_frac", self.ego_brake_use_frac, 0.1, 1.0)?;
        config_in("rss.ego_brake_max_m_s2", self.ego_brake_max_m_s2, 4.0, 12.0)?;
        config_in("rss.car_brake_max_m_s2", self.car_brake_max_m_s2, 4.0, 12.0)?;
        config_in("rss.truck_brake_max_m_s2", self.truck_brake_max_m_s2, 4.0, 12.0)?;
        for behind in [&self.car_behind, &self.truck_behind] {
            config_in("rss.*_behind.reaction_s", behind.reaction_s, 0.0, 5.0)?;
            config_in("rss.*_behind.accel_max_m_s2", behind.accel_max_m_s2, 0.0, 5.0)?;
            let hardest = self.ego_brake_max_m_s2;
            config_in("rss.*_behind.brake_min_m_s2", behind.brake_min_m_s2, 1.0, hardest)?;
        }
        Ok(())
    }

    /// Response of the ego with its brakes at their present mass; the assured deceleration stays
    /// below what any vehicle ahead is assumed to reach.
    #[must_use]
    pub fn ego_response(&self, limits: &VehicleLimits) -> RearResponse {
        let b = &limits.brakes;
        let softest_ahead = self.car_brake_max_m_s2.min(self.truck_brake_max_m_s2);
        RearResponse {
            reaction_s: self.ego_processing_s + b.dead_time_s + 0.5 * b.build_up_s,
            accel_max_m_s2: self.ego_accel_max_m_s2,
            brake_min_m_s2: (self.ego_brake_use_frac * b.max_decel_m_s2).clamp(0.5, softest_ahead),
        }
    }

    /// Hardest deceleration of a vehicle of this class ahead, m/s².
    #[must_use]
    pub fn brake_max_m_s2(&self, class: VehicleClass) -> f64 {
        match class {
            VehicleClass::Truck => self.truck_brake_max_m_s2,
            _ => self.car_brake_max_m_s2,
        }
    }

    /// Response of a vehicle of this class behind.
    #[must_use]
    pub fn behind(&self, class: VehicleClass) -> RearResponse {
        match class {
            VehicleClass::Truck => self.truck_behind,
            _ => self.car_behind,
        }
    }
}

/// Braking on a grade: gravity helps uphill and hinders downhill. Not below 0.3 m/s².
#[must_use]
pub(super) fn brake_on_grade_m_s2(brake_m_s2: f64, grade_rad: f64) -> f64 {
    (brake_m_s2 + GRAVITY_M_S2 * libm::sin(grade_rad)).max(0.3)
}

/// Safe gap between one rear and one front vehicle on one grade.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SafeGap {
    reaction_s: f64,
    accel_m_s2: f64,
    rear_brake_m_s2: f64,
    front_brake_m_s2: f64,
}

impl SafeGap {
    /// For a rear vehicle that responds so, behind a front vehicle whose hardest deceleration on
    /// the level is `front_brake_m_s2`; the grade (rad, uphill positive) acts on both.
    #[must_use]
    pub fn new(rear: &RearResponse, front_brake_m_s2: f64, grade_rad: f64) -> Self {
        Self {
            reaction_s: rear.reaction_s,
            accel_m_s2: rear.accel_max_m_s2,
            rear_brake_m_s2: brake_on_grade_m_s2(rear.brake_min_m_s2, grade_rad),
            front_brake_m_s2: brake_on_grade_m_s2(front_brake_m_s2, grade_rad),
        }
    }

    /// Deceleration of the rear vehicle on this grade, m/s².
    #[must_use]
    pub fn rear_brake_m_s2(&self) -> f64 {
        self.rear_brake_m_s2
    }

    /// The safe gap, m, for these speeds in m/s.
    #[must_use]
    pub fn gap_m(&self, rear_speed_m_s: f64, front_speed_m_s: f64) -> f64 {
        let (v_r, v_f) = (rear_speed_m_s.max(0.0), front_speed_m_s.max(0.0));
        let (rho, a) = (self.reaction_s, self.accel_m_s2);
        let w = v_r + rho * a;
        let d = v_r * rho + 0.5 * a * rho * rho + w * w / (2.0 * self.rear_brake_m_s2)
            - v_f * v_f / (2.0 * self.front_brake_m_s2);
        d.max(0.0)
    }

    /// The largest rear speed, m/s, for which `gap_m` is safe: [`Self::gap_m`] solved for its first
    /// argument; zero when no speed is safe.
    #[must_use]
    pub fn rear_speed_m_s(&self, gap_m: f64, front_speed_m_s: f64) -> f64 {
        let v_f = front_speed_m_s.max(0.0);
        let (rho, a, b_r) = (self.reaction_s, self.accel_m_s2, self.rear_brake_m_s2);
        // w = v_r + rho a solves w²/(2 b_r) + rho w = gap + a rho²/2 + v_f²/(2 b_f)
        let room = gap_m + 0.5 * a * rho * rho + v_f * v_f / (2.0 * self.front_brake_m_s2);
        if room <= 0.0 {
            return 0.0;
        }
        let w = b_r * (libm::sqrt(rho * rho + 2.0 * room / b_r) - rho);
        (w - rho * a).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn loaded() -> RearResponse {
        RearResponse { reaction_s: 1.0, accel_max_m_s2: 0.3, brake_min_m_s2: 3.5 }
    }

    #[test]
    fn the_gaps_equal_the_published_figures_for_a_loaded_truck_behind_a_car() {
        for (v_r, v_f, gap) in [
            (16.7, 12.5, 48.0),
            (16.7, 16.7, 41.0),
            (20.0, 15.0, 65.0),
            (20.0, 20.0, 54.0),
            (25.0, 20.0, 92.0),
        ] {
            let d = SafeGap::new(&loaded(), 8.0, 0.0).gap_m(v_r, v_f);
            assert!((d - gap).abs() < 1.0, "{v_r}/{v_f}: {d}");
        }
    }

    #[test]
    fn a_descent_and_a_faster_rear_vehicle_need_more_room_and_a_faster_front_vehicle_less() {
        let d = |v_r, v_f, grade| SafeGap::new(&loaded(), 8.0, grade).gap_m(v_r, v_f);
        assert!(d(20.0, 15.0, -0.05) > d(20.0, 15.0, 0.0));
        assert!(d(21.0, 15.0, 0.0) > d(20.0, 15.0, 0.0));
        assert!(d(20.0, 16.0, 0.0) < d(20.0, 15.0, 0.0));
        assert_eq!(d(5.0, 30.0, 0.0), 0.0);
    }

    #[test]
    fn safe_speed_is_the_inverse_of_safe_gap() {
        for (v_r, v_f, grade) in [(20.0, 15.0, -0.04), (25.0, 0.0, 0.0), (12.0, 10.0, 0.05)] {
            let safe = SafeGap::new(&loaded(), 8.0, grade);
            let back = safe.rear_speed_m_s(safe.gap_m(v_r, v_f), v_f);
            assert!((back - v_r).abs() < 1e-9, "{v_r} came back as {back}");
        }
    }

    #[test]
    fn a_rear_vehicle_assumed_to_outbrake_the_front_one_is_refused() {
        let mut c = RssConfig::default();
        c.car_behind.brake_min_m_s2 = 7.0;
        assert!(c.check().unwrap_err().to_string().contains("brake_min_m_s2"));
    }
}
