//! Car following for a heavy truck: the intelligent driver model (Treiber et al. 2000) with the
//! safe gap as its floor, and emergency braking.
//!
//! | symbol | unit | meaning |
//! |---|---|---|
//! | `s`, `s*` | m | gap and wanted gap to the vehicle ahead |
//! | `v`, `v_f` | m/s | own speed, speed ahead |
//! | `v_s` | m/s | largest speed for which `s` is a safe gap |
//!
//! Three requests, the lowest wins. (1) IDM with `s* = max(s_0 + v T, d_safe + margin)` and its
//! approach term; it brakes no harder than half as much again as meets the speed ahead in time. (2) Keep `v <= v_s`: `v_s` falls by `(v - v_f)/(rho + v/b)` per second, so that
//! deceleration is fed forward and the excess `v - v_s` is taken off gently: somebody who cuts in
//! ahead, and drives as fast, is given room without hard braking. (3) If even a vehicle ahead that
//! brakes only `emergency_extra_m_s2` harder than it does now would be hit, brake with all that is
//! there. The request may change with the comfortable jerk as long as a comfortable deceleration
//! suffices, faster with the square of what is needed beyond it, and freely in an emergency.
//! Nothing here brakes merely because a vehicle is in sight: the paper's Algorithm 1 does.

use crate::PlannerError;
use crate::error::config_in;
use crate::safety::{RearResponse, SafeGap};
use driver_models::Idm;
use serde::{Deserialize, Serialize};

/// Car-following parameters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FollowingConfig {
    /// Gap at standstill, m.
    pub standstill_gap_m: f64,
    /// Time headway, s.
    pub headway_s: f64,
    /// Wanted acceleration, m/s².
    pub accel_m_s2: f64,
    /// Comfortable deceleration, m/s².
    pub comfort_decel_m_s2: f64,
    /// Margin over the safe gap when following, m.
    pub safe_gap_margin_m: f64,
    /// Rate at which speed above the safe speed is taken off, 1/s.
    pub restore_1_s: f64,
    /// Largest deceleration for restoring a gap that somebody else has shortened, m/s².
    pub restore_decel_m_s2: f64,
    /// Emergency braking answers a vehicle ahead that may brake this much harder than now, m/s².
    pub emergency_extra_m_s2: f64,
}

impl Default for FollowingConfig {
    fn default() -> Self {
        Self {
            standstill_gap_m: 5.0,
            headway_s: 1.6,
            accel_m_s2: 0.6,
            comfort_decel_m_s2: 1.0,
            safe_gap_margin_m: 4.0,
            restore_1_s: 0.3,
            restore_decel_m_s2: 1.0,
            emergency_extra_m_s2: 2.0,
        }
    }
}

impl FollowingConfig {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`PlannerError::Config`] names the key.
    pub fn check(&self) -> Result<(), PlannerError> {
        config_in("following.standstill_gap_m", self.standstill_gap_m, 1.0, 20.0)?;
        config_in("following.headway_s", self.headway_s, 0.5, 5.0)?;
        config_in("following.accel_m_s2", self.accel_m_s2, 0.1, 2.0)?;
        config_in("following.comfort_decel_m_s2", self.comfort_decel_m_s2, 0.3, 3.0)?;
        config_in("following.safe_gap_margin_m", self.safe_gap_margin_m, 0.0, 50.0)?;
        config_in("following.restore_1_s", self.restore_1_s, 0.05, 3.0)?;
        config_in("following.restore_decel_m_s2", self.restore_decel_m_s2, 0.2, 6.0)?;
        config_in("following.emergency_extra_m_s2", self.emergency_extra_m_s2, 0.0, 8.0)
    }
}

/// The vehicle ahead as car following sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lead {
    /// Identifier.
    pub id: u64,
    /// Gap, front bumper to rear bumper, m.
    pub gap_m: f64,
    /// Its speed, m/s.
    pub speed_m_s: f64,
    /// Its acceleration, m/s².
    pub accel_m_s2: f64,
    /// Its hardest deceleration, m/s².
    pub brake_max_m_s2: f64,
    /// The ego is leaving its lane: the safe gap is kept, the comfortable one no longer.
    pub being_left: bool,
    /// Its body is in the ego's path, or about to be; otherwise it has only said that it will come.
    pub in_path: bool,
}

/// Car following's request.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Following {
    /// Acceleration not to be exceeded, m/s².
    pub accel_m_s2: f64,
    /// Factor on the comfortable jerk with which the truck may answer, from 1; infinite in an
    /// emergency.
    pub haste: f64,
    /// The gap is below the safe gap.
    pub below_safe_gap: bool,
    /// Emergency braking.
    pub emergency: bool,
}

/// Gap that is kept behind `lead` at its speed, m: headway, and the safe gap with its margin.
#[must_use]
pub(crate) fn steady_gap_m(config: &FollowingConfig, ego: &RearResponse, lead: &Lead) -> f64 {
    let v = lead.speed_m_s.max(0.0);
    let safe_m = SafeGap::new(ego, lead.brake_max_m_s2, 0.0).gap_m(v, v);
    (config.standstill_gap_m + v * config.headway_s).max(safe_m + config.safe_gap_margin_m)
}

/// Largest acceleration that keeps the gap to `lead`, at own `speed_m_s` on `grade_rad`.
#[must_use]
pub(crate) fn follow(
    config: &FollowingConfig,
    ego: &RearResponse,
    speed_m_s: f64,
    grade_rad: f64,
    lead: &Lead,
) -> Following {
    let (v, v_f, gap) = (speed_m_s.max(0.0), lead.speed_m_s.max(0.0), lead.gap_m);
    let safe = SafeGap::new(ego, lead.brake_max_m_s2, grade_rad);
    let hardest = safe.rear_brake_m_s2();
    let d_safe = safe.gap_m(v, v_f);

    let (a, b) = (config.accel_m_s2, config.comfort_decel_m_s2);
    let driver = Idm::new(f64::INFINITY, config.headway_s, config.standstill_gap_m, a, b, hardest);
    let wanted = driver.wanted_gap_m(v, v - v_f).max(d_safe + config.safe_gap_margin_m);
    let idm = a + driver.hindrance_m_s2(wanted, gap);

    let margin = if lead.being_left { 0.0 } else { 0.5 * config.safe_gap_margin_m };
    let room = gap - margin;
    let v_s = safe.rear_speed_m_s(room, v_f);
    let feed_forward = (v - v_f).max(0.0) / (ego.reaction_s + v / hardest);
    let restore = if v > v_s && !lead.in_path {
        -config.restore_decel_m_s2
    } else if v > v_s {
        let closing_is_safe = config.restore_1_s * (v - v_s);
        -feed_forward - closing_is_safe.min(config.restore_decel_m_s2)
    } else {
        a
    };

    let brakes_now = (-lead.accel_m_s2).max(0.0);
    let plausible = (brakes_now + config.emergency_extra_m_s2).min(lead.brake_max_m_s2);
    // The decision is made now and repeated: only the actuator's delay still counts.
    let acting = RearResponse { accel_max_m_s2: 0.0, ..*ego };
    let emergency =
        v > 0.1 && lead.in_path && gap < SafeGap::new(&acting, plausible, grade_rad).gap_m(v, v_f);
    // What meets the speed ahead, and its braking, before half the standstill gap is used up.
    let closing = (v - v_f).max(0.0);
    let room_to_close = (gap - 0.5 * config.standstill_gap_m).max(0.5);
    let needed = brakes_now.min(hardest) + closing * closing / (2.0 * room_to_close);
    let gentle = (0.5 * b).max(1.5 * needed).min(2.0 * b);
    let comfort = if lead.being_left { a } else { idm.max(-gentle) };
    let accel = if emergency { -hardest } else { comfort.min(restore) };
    let pressing = (needed / b).max(1.0);
    let haste = if emergency { f64::INFINITY } else { pressing * pressing };
    Following {
        accel_m_s2: accel.clamp(-hardest.max(b), a),
        haste,
        below_safe_gap: gap < d_safe,
        emergency,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EGO: RearResponse =
        RearResponse { reaction_s: 1.0, accel_max_m_s2: 0.3, brake_min_m_s2: 3.5 };

    fn lead(gap_m: f64, speed_m_s: f64) -> Lead {
        Lead {
            id: 1,
            gap_m,
            speed_m_s,
            accel_m_s2: 0.0,
            brake_max_m_s2: 8.0,
            being_left: false,
            in_path: true,
        }
    }

    #[test]
    fn a_car_far_ahead_at_the_same_speed_does_not_make_the_truck_brake() {
        let f = follow(&FollowingConfig::default(), &EGO, 20.0, 0.0, &lead(90.0, 20.0));
        assert!(f.accel_m_s2 > 0.0 && !f.below_safe_gap, "{f:?}");
    }

    #[test]
    fn a_faster_car_that_cuts_in_closely_is_met_without_hard_braking() {
        let f = follow(&FollowingConfig::default(), &EGO, 20.0, 0.0, &lead(30.0, 25.0));
        assert!(!f.emergency && f.accel_m_s2 > -1.1, "{f:?}");
    }

    #[test]
    fn a_stopped_vehicle_inside_the_stopping_distance_is_an_emergency() {
        let f = follow(&FollowingConfig::default(), &EGO, 20.0, 0.0, &lead(60.0, 0.0));
        assert!(f.emergency && f.accel_m_s2 == -3.5, "{f:?}");
    }
}
