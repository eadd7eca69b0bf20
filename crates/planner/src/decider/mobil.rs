//! MOBIL over the intelligent driver model, both of `driver-models`: what the truck and those behind
//! it are thought to do, before and after a change. Whether the truck itself has room is for the
//! safety gate, with safe gaps.

use super::{LaneChoice, View};
use crate::PlannerError;
use crate::error::config_in;
use driver_models::{Change, Idm, Mobil};
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

    fn criterion(&self) -> Mobil {
        Mobil {
            politeness_frac: self.politeness_frac,
            safe_decel_m_s2: self.safe_decel_m_s2,
            threshold_m_s2: self.threshold_m_s2,
            right_bias_m_s2: self.bias_right_m_s2,
        }
    }
}

/// A driver of a class who wishes a speed, m/s. Tyres set no bound: how much too close a gap is
/// counts, also beyond what they can do.
pub(super) fn driver(class: VehicleClass, wish_m_s: f64) -> Idm {
    let (accel, decel, headway_s, standstill_m) = match class {
        VehicleClass::Truck => (0.6, 1.2, 1.6, 3.0),
        _ => (1.4, 2.0, 1.2, 2.0),
    };
    Idm::new(wish_m_s, headway_s, standstill_m, accel, decel, f64::INFINITY)
}

/// Smallest gap that is told apart, m: of vehicles that overlap, none may outweigh all else.
const TOUCH_M: f64 = 0.5;

/// A driver's acceleration, m/s², behind a vehicle at a gap, m, with a speed, m/s, or freely.
pub(super) fn accel_m_s2(driver: &Idm, speed_m_s: f64, ahead: Option<(f64, f64)>) -> f64 {
    let (gap_m, closing_m_s) =
        ahead.map_or((f64::INFINITY, 0.0), |(gap_m, ahead_m_s)| (gap_m, speed_m_s - ahead_m_s));
    driver.accel_m_s2(speed_m_s, f64::INFINITY, gap_m.max(TOUCH_M), closing_m_s)
}

/// A vehicle's acceleration when it follows something at a gap; it wishes at least its own speed.
fn follower_m_s2(n: &Neighbour, ahead: Option<(f64, f64)>) -> f64 {
    accel_m_s2(&driver(n.class, n.speed_m_s.max(15.0) * 1.05), n.speed_m_s, ahead)
}

/// Gap to a slower vehicle ahead at which the truck's own braking would be worth a change to a free
/// left lane, m; others' accelerations left out.
#[must_use]
pub(crate) fn leaving_gap_m(view: &View<'_>, config: &MobilConfig, lead_m_s: f64) -> f64 {
    let ego = driver(VehicleClass::Truck, view.wish_speed_m_s);
    let v = view.wish_speed_m_s.max(view.ego.speed_m_s);
    let worth = (config.threshold_m_s2 + config.bias_right_m_s2).max(0.01);
    ego.wanted_gap_m(v, v - lead_m_s) * libm::sqrt(ego.accel_m_s2 / worth)
}

/// The wish of MOBIL.
#[must_use]
pub(crate) fn mobil(view: &View<'_>, config: &MobilConfig) -> LaneChoice {
    let v = view.ego.speed_m_s;
    let ego = driver(VehicleClass::Truck, view.wish_speed_m_s);
    let length_m = view.extent.front_s_m - view.extent.rear_s_m;
    let lead = |lane: u16| view.ahead(lane).map(|(n, gap_m)| (gap_m, n.speed_m_s));
    // Whoever follows gets what is ahead of the ego where the ego is not; its length opens.
    let without_ego = |lane: u16, gap_m: f64| {
        lead(lane).map(|(ahead_m, ahead_m_s)| (gap_m + length_m + ahead_m, ahead_m_s))
    };
    let (old_before, old_after) = view.behind(view.lane).map_or((0.0, 0.0), |(n, gap_m)| {
        let opened = without_ego(view.lane, gap_m);
        (follower_m_s2(n, Some((gap_m, v))), follower_m_s2(n, opened))
    });
    let criterion = config.criterion();
    let incentive = |choice: LaneChoice| -> Option<f64> {
        let lane = view.lasting_beside(choice)?;
        if lead(lane).is_some_and(|(gap_m, _)| gap_m <= 0.0) {
            return None;
        }
        let (new_before, new_after) = match view.behind(lane) {
            None => (0.0, 0.0),
            Some((_, gap_m)) if gap_m <= 0.0 => return None,
            Some((n, gap_m)) => {
                (follower_m_s2(n, without_ego(lane, gap_m)), follower_m_s2(n, Some((gap_m, v))))
            }
        };
        let change = Change {
            own_before_m_s2: accel_m_s2(&ego, v, lead(view.lane)),
            own_after_m_s2: accel_m_s2(&ego, v, lead(lane)),
            new_follower_before_m_s2: new_before,
            new_follower_after_m_s2: new_after,
            old_follower_before_m_s2: old_before,
            old_follower_after_m_s2: old_after,
        };
        let to_the_right = choice == LaneChoice::Right;
        criterion
            .spares_new_follower(&change)
            .then(|| criterion.incentive_m_s2(&change, to_the_right))
    };
    [LaneChoice::Left, LaneChoice::Right]
        .into_iter()
        .filter_map(|choice| incentive(choice).map(|a| (choice, a)))
        .filter(|&(_, a)| a > 0.0)
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map_or(LaneChoice::Keep, |(choice, _)| choice)
}
