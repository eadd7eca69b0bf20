//! The planning stack: decide, plan speed, plan path, control, guard.
//!
//! | file | holds |
//! |---|---|
//! | `mod` | the stack of one truck, a tick with its guard |
//! | `config` | what a user may set |
//! | `settings` | what may be set while it drives |
//! | `outside` | demands of who drives in its place |
//! | `tactics` | what to drive: lane and lane changes, and the speed of `reference` |
//! | `reference` | how fast: plans, jams, car following |
//! | `decide` | the decision of a tick, and what a learned decider sees |
//! | `speed` | the predictive speed planner in the stack |
//! | `control` | how it is driven: both controllers and the gear |
//! | `gear` | the gear that the speed plan has |

mod config;
mod control;
mod decide;
mod gear;
mod outside;
mod reference;
mod settings;
mod speed;
mod tactics;

pub use config::{RatesConfig, SpeedPlannerKind, StackConfig};
pub use outside::OutsideDemand;
pub use tactics::{TacticalPlan, Tactics};

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;

use crate::decider::{DeciderKind, LaneChoice, Policy};
use crate::pcc::horizon::{HorizonFailure, HorizonPlan};
use crate::safety::{GuardInput, GuardMemory, Inputs, inspect, limit};
use crate::situation::grade_rad;
use crate::speed::{LoadEstimate, LoadEstimator};
use crate::steering::LateralPath;
use crate::{PlannerError, Situation};
use control::Control;
use road::Road;
use tractrix_core::{
    Command, EgoState, Maneuver, PathPoint, Plan, Scene, Stamped, Time, VehicleLimits,
    VehicleStatus,
};

/// Spacing of the published path, s, and its number of points.
const PATH_STEP_S: f64 = 0.2;
const PATH_POINTS: usize = 26;

/// The planning stack of one truck.
#[derive(Debug, Clone)]
pub struct Stack {
    tactics: Tactics,
    control: Control,
    guard: GuardMemory,
    ticks: u64,
    last_tick: Option<Time>,
    /// Last trustworthy state, moved on by dead reckoning while there is no other.
    believed: EgoState,
    estimator: LoadEstimator,
    /// The truck's limits with the estimated load, once there is a valid estimate.
    estimated: Option<Box<VehicleLimits>>,
    /// Who drives from outside has asked for this.
    demand: Option<OutsideDemand>,
    plan: Plan,
}

impl Stack {
    /// A stack for a truck.
    ///
    /// # Errors
    /// [`PlannerError`] names the configuration key or the vehicle's value that cannot be used;
    /// [`PlannerError::NoPolicy`] if the decider is the learned one.
    pub fn new(config: StackConfig, limits: &VehicleLimits) -> Result<Self, PlannerError> {
        Self::build(config, limits, None)
    }

    /// A stack whose decider is a learned policy.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn with_policy(
        config: StackConfig,
        limits: &VehicleLimits,
        policy: Arc<Policy>,
    ) -> Result<Self, PlannerError> {
        Self::build(StackConfig { decider: DeciderKind::Dqn, ..config }, limits, Some(policy))
    }

    fn build(
        config: StackConfig,
        limits: &VehicleLimits,
        policy: Option<Arc<Policy>>,
    ) -> Result<Self, PlannerError> {
        config.check()?;
        limits.check()?;
        let control = Control::new(&config, limits)?;
        Self::assemble(config, limits, policy, control)
    }

    /// A frame of its own: what is copied here must not lie under the gain table, which is computed
    /// before, on the stack of a small computer.
    #[inline(never)]
    fn assemble(
        config: StackConfig,
        limits: &VehicleLimits,
        policy: Option<Arc<Policy>>,
        control: Control,
    ) -> Result<Self, PlannerError> {
        let estimator = config.estimator;
        Ok(Self {
            tactics: Tactics::new(config, policy)?,
            control,
            guard: GuardMemory::default(),
            ticks: 0,
            last_tick: None,
            believed: EgoState::default(),
            estimator: LoadEstimator::new(estimator, &limits.road_load),
            estimated: None,
            demand: None,
            plan: Plan::default(),
        })
    }

    /// The configuration.
    #[must_use]
    pub fn config(&self) -> &StackConfig {
        self.tactics.config()
    }

    /// What decides on lane and speed.
    #[must_use]
    pub fn tactics(&self) -> &Tactics {
        &self.tactics
    }

    /// The latest plan.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The present estimate of mass and rolling resistance.
    #[must_use]
    pub fn load_estimate(&self) -> LoadEstimate {
        self.estimator.estimate()
    }

    /// The last plan of the predictive speed planner, made while driving.
    #[must_use]
    pub fn speed_plan(&self) -> Option<&HorizonPlan> {
        self.tactics.speed.last()
    }

    /// Why the last attempt to plan the speed brought none; `None` if it did.
    #[must_use]
    pub fn speed_plan_failure(&self) -> Option<&HorizonFailure> {
        self.tactics.speed.failure()
    }

    /// Speed plans made so far while driving.
    #[must_use]
    pub fn speed_plans_made(&self) -> u64 {
        self.tactics.speed.made()
    }

    /// Lateness against cruise control at the set speed, s; time lost behind traffic not counted.
    #[must_use]
    pub fn speed_plan_late_s(&self) -> f64 {
        self.tactics.speed.late_s()
    }

    /// The lane change that is wished from outside and was not looked at yet.
    #[must_use]
    pub fn wish(&self) -> LaneChoice {
        self.tactics.wish
    }

    /// One tick: the plan for `[now, next tick)`, its command guarded. Never fails: what is wrong
    /// with the inputs or the truck is in the plan's guard reasons.
    pub fn tick(
        &mut self,
        now: Time,
        ego: &Stamped<EgoState>,
        status: &VehicleStatus,
        scene: &Scene,
        road: &Road,
        limits: &VehicleLimits,
    ) -> &Plan {
        self.run(now, Some(ego), status, Some(scene), road, limits)
    }

    /// One tick without a scene, or without ego state and scene, because a seam failed: the
    /// minimal-risk manoeuvre.
    pub fn minimal_risk(
        &mut self,
        now: Time,
        ego: Option<&Stamped<EgoState>>,
        status: &VehicleStatus,
        road: &Road,
        limits: &VehicleLimits,
    ) -> &Plan {
        self.run(now, ego, status, None, road, limits)
    }

    fn run(
        &mut self,
        now: Time,
        ego: Option<&Stamped<EgoState>>,
        status: &VehicleStatus,
        scene: Option<&Scene>,
        road: &Road,
        limits: &VehicleLimits,
    ) -> &Plan {
        let tick_s = self.config().rates.tick_s;
        let dt_s = self.last_tick.map_or(tick_s, |t| now.seconds_since(t)).clamp(0.0, 0.5);
        self.last_tick = Some(now);
        let (scene_time, demand_time) = (scene.map(|s| s.time), self.demand.map(|d| d.time));
        let inputs = Inputs { ego, status, scene_time, demand_time };
        let (inspection, memory) = inspect(&self.config().guard, &self.guard, now, &inputs);
        self.guard = memory;
        match ego {
            Some(ego) if inspection.ego_usable => self.believed = ego.value,
            _ => self.dead_reckon(dt_s, road),
        }
        let ego = self.believed;
        let empty = Scene::default();
        let scene = scene.unwrap_or(&empty);

        self.plan.refusal = None;
        let demand = self.demand.filter(|_| !inspection.minimal_risk);
        let planned = if inspection.ego_usable && !inspection.driver {
            self.estimate_load(dt_s, &ego, road, limits);
            let estimated = self.estimated.take();
            let known = estimated.as_deref().unwrap_or(limits);
            let at = Situation { now, ego: &ego, scene, road, limits: known };
            let planned = match demand {
                Some(demand) => Some(self.obey(&demand, &at)),
                None => self.drive(&at),
            };
            self.estimated = estimated;
            planned
        } else {
            self.tactics.release();
            None
        };
        let (_, curvature) = road.line().curvature_1_m(ego.s_m);
        let lateral = &self.control.lateral;
        let steady =
            lateral.steady_road_wheel_rad(curvature, ego.speed_m_s, limits.road_load.mass_kg);
        let at = Situation { now, ego: &ego, scene, road, limits };
        let input = GuardInput {
            dt_s,
            speed_m_s: ego.speed_m_s,
            planned,
            keep_lane_wheel_rad: steady * limits.lateral.steering_ratio,
            minimal_risk: inspection.minimal_risk,
            driver_wheel_rad: inspection.driver.then_some(ego.steering_wheel_rad),
            headway: match demand {
                Some(_) => self.tactics.headway_of_others(&at),
                None => self.tactics.headway(&at),
            },
        };
        let (guarded, memory) = limit(&self.config().guard, &self.guard, &input, limits);
        self.guard = memory;
        self.plan.guard.clear();
        self.plan.guard.extend(inspection.reasons.union(guarded.reasons).iter());
        self.plan.command = guarded.command;
        if guarded.minimal_risk || inspection.driver {
            self.plan.maneuver =
                if inspection.driver { Maneuver::KeepLane } else { Maneuver::MinimalRisk };
        }
        if guarded.minimal_risk || inspection.driver || demand.is_some() {
            self.control
                .lateral
                .overridden(guarded.command.steering_wheel_rad / limits.lateral.steering_ratio);
        }
        self.ticks = self.ticks.wrapping_add(1);
        &self.plan
    }

    /// Listens to the force balance; once a second takes over a valid estimate that differs.
    fn estimate_load(&mut self, dt_s: f64, ego: &EgoState, road: &Road, limits: &VehicleLimits) {
        if !self.config().estimator.enabled {
            return;
        }
        self.estimator.update(dt_s, ego, grade_rad(road, ego, limits), limits);
        if !self.ticks.is_multiple_of(u64::from(self.config().rates.decision_ticks)) {
            return;
        }
        let retarder_n = &limits.powertrain.retarder_force_n;
        if let Some(known) = &mut self.estimated
            && known.powertrain.retarder_force_n != *retarder_n
        {
            known.powertrain.retarder_force_n.clone_from(retarder_n);
        }
        let estimate = self.estimator.estimate();
        let planned_kg =
            self.estimated.as_ref().map_or(limits.road_load.mass_kg, |l| l.road_load.mass_kg);
        if estimate.valid && (estimate.mass_kg / planned_kg - 1.0).abs() > 0.01 {
            let known = self.estimated.get_or_insert_with(|| Box::new(limits.clone()));
            known.road_load.mass_kg = estimate.mass_kg;
            known.road_load.rolling_coeff = estimate.rolling_coeff;
        }
    }

    /// Plans and controls with trustworthy inputs; `None` if there is no lane to drive in.
    fn drive(&mut self, at: &Situation<'_>) -> Option<Command> {
        let tactical = self.tactics.tick(at)?;
        let plan = &mut self.plan;
        plan.maneuver = tactical.maneuver;
        plan.refusal = tactical.refusal;
        plan.reason = tactical.reason;
        plan.lane = tactical.lane;
        plan.following = tactical.following;
        plan.reference_speed_m_s = tactical.reference_speed_m_s;
        plan.speed_status = self.tactics.speed_status;
        if tactical.new_speed {
            plan.speed.clear();
            plan.speed.extend(self.tactics.speed_points());
        }
        if tactical.new_path {
            publish_path(&mut plan.path, &tactical.path, at.road, at.ego);
        }
        let control_ticks = u64::from(self.tactics.config().rates.control_ticks);
        if !self.ticks.is_multiple_of(control_ticks) {
            return Some(*self.guard.sent());
        }
        let driven = self.control.step(&self.tactics, &tactical, at, self.guard.sent());
        if driven.traffic_rules {
            self.tactics.held_up();
        }
        let plan = &mut self.plan;
        plan.held_up = driven.traffic_rules || tactical.held_back;
        plan.target_speed_m_s = tactical.target.speed_m_s;
        plan.target_accel_m_s2 = driven.accel_m_s2;
        plan.target_d_m = at.ego.d_m - driven.offset_m;
        plan.lateral_error_m = driven.offset_m;
        Some(driven.command)
    }

    /// Moves the believed state along the road with the deceleration that was commanded.
    fn dead_reckon(&mut self, dt_s: f64, road: &Road) {
        let e = &mut self.believed;
        let before = road.line().at(e.s_m).heading_rad;
        let decel = self.guard.sent().xbr_decel_m_s2;
        e.speed_m_s = (e.speed_m_s - decel * dt_s).max(0.0);
        e.s_m += e.speed_m_s * dt_s;
        e.yaw_rad += road.line().at(e.s_m).heading_rad - before;
    }
}

fn publish_path(out: &mut Vec<PathPoint>, path: &LateralPath, road: &Road, ego: &EgoState) {
    let step_m = ego.speed_m_s.max(1.0) * PATH_STEP_S;
    out.clear();
    out.extend(
        (0..PATH_POINTS)
            .map(|i| path.point(road, ego.s_m + i as f64 * step_m, i as f64 * PATH_STEP_S)),
    );
}
