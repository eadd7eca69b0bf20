//! Demands of who drives in the stack's place: an external controller.

use super::Stack;
use crate::Situation;
use crate::speed::SpeedTarget;
use serde::{Deserialize, Serialize};
use tractrix_core::{Command, Maneuver, PlanStatus, Time};

/// What somebody else asks of the truck.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutsideDemand {
    /// When it was asked.
    pub time: Time,
    /// Acceleration along the road, m/s²; positive: faster.
    pub accel_m_s2: f64,
    /// Angle of the front wheels, rad; positive: to the left.
    pub road_wheel_rad: f64,
}

impl Stack {
    /// The command that a demand comes to. The tactics let go: they begin anew where the truck is
    /// when it is theirs again.
    ///
    /// Braking is not held to what is comfortable, and nothing is smoothed; but nobody drives closer
    /// to a vehicle ahead than car following would.
    pub(super) fn obey(&mut self, demand: &OutsideDemand, at: &Situation<'_>) -> Command {
        self.tactics.release();
        let following = self.tactics.following_of_others(at);
        let asked_m_s2 = if demand.accel_m_s2 < 0.0 { demand.accel_m_s2 } else { f64::INFINITY };
        let held_back = following.filter(|(_, f)| f.accel_m_s2 < demand.accel_m_s2);
        let target = SpeedTarget {
            speed_m_s: at.ego.speed_m_s,
            accel_m_s2: demand.accel_m_s2,
            traffic_accel_m_s2: held_back.map_or(asked_m_s2, |(_, f)| f.accel_m_s2),
            haste: held_back.map_or(f64::INFINITY, |(_, f)| f.haste),
            grade_rad: at.grade_rad(),
            ..SpeedTarget::default()
        };
        let config = self.tactics.config();
        let dt_s = config.rates.control_s();
        let plan = &mut self.plan;
        plan.maneuver = Maneuver::KeepLane;
        plan.speed_status = PlanStatus::Cruise;
        (plan.reason, plan.held_up) = (None, held_back.is_some());
        plan.following = held_back.map(|(id, _)| id);
        plan.speed.clear();
        plan.path.clear();
        plan.target_speed_m_s = at.ego.speed_m_s;
        plan.target_accel_m_s2 = demand.accel_m_s2;
        plan.target_d_m = at.ego.d_m;
        plan.lateral_error_m = 0.0;
        if !self.ticks.is_multiple_of(u64::from(config.rates.control_ticks)) {
            return *self.guard.sent();
        }
        self.control.obey(dt_s, demand.road_wheel_rad, &target, at)
    }
}
