//! MOBIL (Kesting, Treiber, Helbing 2007) over the intelligent driver model.
//!
//! With accelerations before and after the change (`~`), of the ego `e`, the new follower `n` and
//! the old follower `o`: change if `a~_n >= -b_safe` and
//! `a~_e - a_e + p (a~_n - a_n + a~_o - a_o) > threshold`, plus `bias_right` for the right lane and
//! minus it for the left one.

use super::{LaneChoice, View};
use crate::PlannerError;
use crate::error::config_in;
use serde::{Deserialize, Serialize};
use tractrix_core::{Neighbour, VehicleClass};

/// MOBIL parameters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MobilConfig {
    /// Politeness `p`, 0 to 1.
    pub politeness_frac: f64,
    /// Advantage needed, m/s².
    pub threshold_m_s2: f64,
    /// Hardest braking that the new follower may be put to, m/s².
    pub safe_decel_m_s2: f64,
    /// Preference for the right lane, m/s².
    pub bias_right_m_s2: f64,
}

impl Default for MobilConfig {
    fn default() -> Self {
        Self {
            politeness_frac: 0.3,
            threshold_m_s2: 0.1,
            safe_decel_m_s2: 2.0,
            bias_right_m_s2: 0.05,
        }
    }
}

impl MobilConfig {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`PlannerError::Config`] names the key.
    pub fn check(&self) -> Result<(), PlannerError> {
        config_in("decider.mobil.politeness_frac", self.politeness_frac, 0.0, 1.0)?;
        config_in("decider.mobil.threshold_m_s2", self.threshold_m_s2, 0.0, 2.0)?;
        config_in("decider.mobil.safe_decel_m_s2", self.safe_decel_m_s2, 0.1, 8.0)?;
        config_in("decider.mobil.bias_right_m_s2", self.bias_right_m_s2, -1.0, 1.0)
    }
}

/// Intelligent driver model of one class.
struct Driver {
    accel_m_s2: f64,
    decel_m_s2: f64,
    headway_s: f64,
    standstill_m: f64,
}

impl Driver {
    fn of(class: VehicleClass) -> Self {
        match class {
            VehicleClass::Truck => {
                Self { accel_m_s2: 0.6, decel_m_s2: 1.2, headway_s: 1.6, standstill_m: 3.0 }
            }
            _ => Self { accel_m_s2: 1.4, decel_m_s2: 2.0, headway_s: 1.2, standstill_m: 2.0 },
        }
    }

    /// Gap that IDM wants behind a vehicle, m.
    fn wanted_gap_m(&self, v: f64, ahead_m_s: f64) -> f64 {
        let closing = v * (v - ahead_m_s) / (2.0 * libm::sqrt(self.accel_m_s2 * self.decel_m_s2));
        self.standstill_m + (v * self.headway_s + closing).max(0.0)
    }

    /// IDM acceleration behind a vehicle at `gap_m` with speed `ahead_m_s`, or freely.
    fn accel(&self, v: f64, wanted_m_s: f64, ahead: Option<(f64, f64)>) -> f64 {
        let ratio = v / wanted_m_s.max(1.0);
        let free = 1.0 - ratio * ratio * ratio * ratio;
        let interaction = ahead.map_or(0.0, |(gap_m, ahead_m_s)| {
            let r = self.wanted_gap_m(v, ahead_m_s) / gap_m.max(0.5);
            r * r
        });
        self.accel_m_s2 * (free - interaction)
    }
}

/// A vehicle's acceleration when it follows something at a gap; it wishes at least its own speed.
fn follower(n: &Neighbour, ahead: Option<(f64, f64)>) -> f64 {
    Driver::of(n.class).accel(n.speed_m_s, n.speed_m_s.max(15.0) * 1.05, ahead)
}

/// Gap to a slower vehicle ahead at which the truck's own braking would be worth a change to a free
/// left lane, m; others' accelerations left out.
#[must_use]
pub(crate) fn leaving_gap_m(view: &View<'_>, config: &MobilConfig, lead_m_s: f64) -> f64 {
    let ego = Driver::of(VehicleClass::Truck);
    let v = view.reference_speed_m_s.max(view.ego.speed_m_s);
    let worth = (config.threshold_m_s2 + config.bias_right_m_s2).max(0.01);
    ego.wanted_gap_m(v, lead_m_s) * libm::sqrt(ego.accel_m_s2 / worth)
}

/// The wish of MOBIL.
#[must_use]
pub(crate) fn mobil(view: &View<'_>, config: &MobilConfig) -> LaneChoice {
    let v = view.ego.speed_m_s;
    let ego = Driver::of(VehicleClass::Truck);
    let length_m = view.extent.front_s_m - view.extent.rear_s_m;
    let lead = |lane: u16| view.ahead(lane).map(|(n, gap_m)| (gap_m, n.speed_m_s));
    let now = ego.accel(v, view.reference_speed_m_s, lead(view.lane));
    // The old follower gets what is ahead of the ego; the ego's length opens.
    let old = view.behind(view.lane).map_or(0.0, |(n, gap_m)| {
        let opened = lead(view.lane).map(|(ahead_m, v_a)| (gap_m + length_m + ahead_m, v_a));
        follower(n, opened) - follower(n, Some((gap_m, v)))
    });
    let advantage = |choice: LaneChoice| -> Option<f64> {
        let lane = view.beside(choice)?;
        let after = ego.accel(v, view.reference_speed_m_s, lead(lane));
        let new = match view.behind(lane) {
            None => 0.0,
            Some((_, gap_m)) if gap_m <= 0.0 => return None,
            Some((n, gap_m)) => {
                let then = follower(n, Some((gap_m, v)));
                if then < -config.safe_decel_m_s2 {
                    return None;
                }
                let before = lead(lane).map(|(ahead_m, v_a)| (gap_m + length_m + ahead_m, v_a));
                then - follower(n, before)
            }
        };
        if lead(lane).is_some_and(|(gap_m, _)| gap_m <= 0.0) {
            return None;
        }
        let bias = match choice {
            LaneChoice::Right => config.bias_right_m_s2,
            _ => -config.bias_right_m_s2,
        };
        Some(after - now + config.politeness_frac * (new + old) + bias)
    };
    [LaneChoice::Left, LaneChoice::Right]
        .into_iter()
        .filter_map(|choice| advantage(choice).map(|a| (choice, a)))
        .filter(|&(_, a)| a > config.threshold_m_s2)
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map_or(LaneChoice::Keep, |(choice, _)| choice)
}
