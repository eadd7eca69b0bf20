//! How a tactical plan is driven: pedal, retarder, brakes, gear and hand wheel.

use super::StackConfig;
use super::gear::{Doing, PlannedGear};
use super::tactics::{TacticalPlan, Tactics};
use crate::speed::{KeptGear, LongitudinalController, SpeedTarget};
use crate::steering::{
    LOWEST_SPEED_M_S, LateralController, LateralPath, PREVIEW_POINTS, PREVIEW_STEP_S, PathError,
};
use crate::{PlannerError, Situation, wrapped};
use tractrix_core::{Command, GearRequest, VehicleLimits};

/// Both controllers and the choice of a gear.
#[derive(Debug, Clone)]
pub(super) struct Control {
    pub(super) lateral: LateralController,
    longitudinal: LongitudinalController,
    planned_gear: PlannedGear,
    kept_gear: KeptGear,
}

/// What a control step came to.
pub(super) struct Controlled {
    pub(super) command: Command,
    /// Acceleration that is asked for, m/s².
    pub(super) accel_m_s2: f64,
    /// Traffic sets it, not the reference.
    pub(super) traffic_rules: bool,
    /// Lateral error from the path, m, positive left.
    pub(super) offset_m: f64,
}

impl Control {
    pub(super) fn new(config: &StackConfig, limits: &VehicleLimits) -> Result<Self, PlannerError> {
        Ok(Self {
            lateral: LateralController::new(config.lateral, limits, config.rates.control_s())?,
            longitudinal: LongitudinalController::new(config.longitudinal),
            planned_gear: PlannedGear::default(),
            kept_gear: KeptGear::default(),
        })
    }

    /// One step behind `sent`, the command before.
    pub(super) fn step(
        &mut self,
        tactics: &Tactics,
        plan: &TacticalPlan,
        at: &Situation<'_>,
        sent: &Command,
    ) -> Controlled {
        let Situation { ego, limits, .. } = *at;
        let config = tactics.config();
        let dt_s = config.rates.control_s();
        let speed = self.longitudinal.step(dt_s, ego, &plan.target, limits);
        let planned = if tactics.plans_ahead() {
            let doing = Doing {
                free: plan.free && !speed.traffic_rules,
                braking: sent.retarder_frac > 0.3 || sent.xbr_decel_m_s2 > 0.0,
                pedal_frac: sent.accelerator_pedal_frac,
            };
            let ask = config.speed_plan.request_gears;
            self.planned_gear.choose(dt_s, ask, ego, limits, &doing, |s_m| tactics.planned(s_m))
        } else {
            GearRequest::Automatic
        };
        let pedal_frac = speed.accelerator_pedal_frac;
        let kept = self.kept_gear.choose(dt_s, plan.jam, ego, limits, pedal_frac);
        let gear = if planned == GearRequest::Automatic { kept } else { planned };
        let (error, wheel_rad) = self.steer(at, &plan.path);
        Controlled {
            command: Command {
                // An open driveline has no use for the pedal.
                accelerator_pedal_frac: if gear == GearRequest::Neutral { 0.0 } else { pedal_frac },
                xbr_decel_m_s2: speed.xbr_decel_m_s2,
                brake_mode: speed.brake_mode,
                steering_wheel_rad: wheel_rad * limits.lateral.steering_ratio,
                retarder_frac: speed.retarder_frac,
                gear,
            },
            accel_m_s2: speed.accel_m_s2,
            traffic_rules: speed.traffic_rules,
            offset_m: error.offset_m,
        }
    }

    /// One step of a demand from outside.
    pub(super) fn obey(
        &mut self,
        dt_s: f64,
        road_wheel_rad: f64,
        target: &SpeedTarget,
        at: &Situation<'_>,
    ) -> Command {
        let Situation { ego, limits, .. } = *at;
        let speed = self.longitudinal.step(dt_s, ego, target, limits);
        Command {
            accelerator_pedal_frac: speed.accelerator_pedal_frac,
            xbr_decel_m_s2: speed.xbr_decel_m_s2,
            brake_mode: speed.brake_mode,
            steering_wheel_rad: road_wheel_rad * limits.lateral.steering_ratio,
            retarder_frac: speed.retarder_frac,
            gear: GearRequest::Automatic,
        }
    }

    fn steer(&mut self, at: &Situation<'_>, path: &LateralPath) -> (PathError, f64) {
        let Situation { ego, road, limits, .. } = *at;
        let here = path.at(road, ego.s_m);
        let (angle, here_1_m) = here.direction(road.line().curvature_1_m(ego.s_m).1);
        let heading = road.line().heading_rad(ego.s_m) + angle;
        let error =
            PathError { offset_m: ego.d_m - here.d_m, heading_rad: wrapped(ego.yaw_rad - heading) };
        let step_m = ego.speed_m_s.max(LOWEST_SPEED_M_S) * PREVIEW_STEP_S;
        let mut curvature = [here_1_m; PREVIEW_POINTS];
        // a step farther, so that no rounding of stations leaves it
        let seen_m = ego.s_m + PREVIEW_POINTS as f64 * step_m;
        let is_straight = path.offset.is_none()
            && road
                .lanes()
                .get(usize::from(path.lane))
                .is_some_and(|l| l.center.as_constant().is_some())
            && road.line().curved_at_most_1_m(ego.s_m, seen_m) == 0.0;
        if !is_straight {
            for (i, k) in curvature.iter_mut().enumerate().skip(1) {
                *k = path.curvature_1_m(road, ego.s_m + i as f64 * step_m);
            }
        }
        (error, self.lateral.step(ego, error, &curvature, limits))
    }
}
