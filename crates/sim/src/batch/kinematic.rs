//! The ego as a point on its planned path: the tactics of the stack without controllers and plant.
//!
//! The acceleration of [`TacticalPlan`](planner::TacticalPlan) is driven at once, as far as engine
//! power and tyres give it; across the road the ego is on its path; the trailer follows its hitch.
//! Left out: gears, jerk limits, the guard, tracking errors.

use std::sync::Arc;

use planner::decider::LaneChoice;
use planner::{Situation, Tactics};
use road::Road;
use tractrix_core::{EgoState, Geometry, RoadPiece, Scene, Time, TrafficSource, VehicleLimits};
use traffic_client::native::NativeTraffic;

use super::{SUBSTEP_S, Substep};
use crate::SimError;

/// Below this speed the tyres, not the power, bound the force, m/s.
const POWER_FROM_M_S: f64 = 4.0;
/// Length of a step, ns.
const SUBSTEP_NS: i64 = 100_000_000;

/// A kinematic ego in native traffic. `clone_from` copies into the memory that is there.
#[derive(Debug)]
pub(super) struct Kinematic {
    pub(super) road: Arc<Road>,
    pub(super) limits: Arc<VehicleLimits>,
    pub(super) traffic: NativeTraffic,
    pub(super) tactics: Tactics,
    pub(super) ego: EgoState,
    pub(super) now: Time,
    /// Grade at the ego, rad.
    grade_rad: f64,
    /// Power at the wheels at full load, W.
    at_wheels_w: f64,
}

impl Clone for Kinematic {
    fn clone(&self) -> Self {
        Self {
            road: Arc::clone(&self.road),
            limits: Arc::clone(&self.limits),
            traffic: self.traffic.clone(),
            tactics: self.tactics.clone(),
            ..*self
        }
    }

    fn clone_from(&mut self, from: &Self) {
        let Self { road, limits, traffic, tactics, ego, now, grade_rad, at_wheels_w } = from;
        self.road.clone_from(road);
        self.limits.clone_from(limits);
        self.traffic.clone_from(traffic);
        self.tactics.clone_from(tactics);
        (self.ego, self.now) = (*ego, *now);
        (self.grade_rad, self.at_wheels_w) = (*grade_rad, *at_wheels_w);
    }
}

impl Kinematic {
    /// A truck that stands ready at the road's start.
    pub(super) fn new(
        road: Arc<Road>,
        limits: Arc<VehicleLimits>,
        traffic: NativeTraffic,
        tactics: Tactics,
    ) -> Self {
        let at_wheels_w = at_wheels_w(&limits);
        let (ego, now) = (EgoState::default(), Time::ZERO);
        Self { road, limits, traffic, tactics, ego, now, grade_rad: 0.0, at_wheels_w }
    }

    /// Starts here and looks around.
    pub(super) fn begin(&mut self, ego: EgoState) -> Result<(), SimError> {
        (self.ego, self.now) = (ego, Time::ZERO);
        self.grade_rad = self.road.at(ego.s_m, ego.d_m).grade_rad;
        self.look()
    }

    /// Brings the scene up to the present.
    pub(super) fn look(&mut self) -> Result<(), SimError> {
        self.traffic.advance(self.now, &self.ego)?;
        let at = situation(self.now, &self.ego, self.traffic.scene(), &self.road, &self.limits);
        self.tactics.foresee(&at);
        Ok(())
    }

    /// What the tactics look at now.
    pub(super) fn at(&self) -> Situation<'_> {
        situation(self.now, &self.ego, self.traffic.scene(), &self.road, &self.limits)
    }

    /// Drives [`SUBSTEP_S`]; the wish is looked at in it.
    pub(super) fn step(&mut self, wish: LaneChoice) -> Result<Substep, SimError> {
        self.tactics.request_lane_change(wish);
        let at = situation(self.now, &self.ego, self.traffic.scene(), &self.road, &self.limits);
        let plan = self.tactics.tick(&at).ok_or_else(|| SimError::Batch {
            what: "ego.s_m",
            value: format!("{:.1}", self.ego.s_m),
            why: "there is no lane to drive in".to_owned(),
        })?;
        let substep = Substep {
            speed_m_s: self.ego.speed_m_s,
            reference_m_s: plan.reference_speed_m_s,
            maneuver: plan.maneuver,
            refused: plan.refusal,
            contact: None,
        };
        let accel_m_s2 = plan
            .target_accel_m_s2
            .min(self.most_accel_m_s2())
            .max(-self.limits.brakes.max_decel_m_s2);
        let before_m_s = self.ego.speed_m_s;
        let speed_m_s = (before_m_s + accel_m_s2 * SUBSTEP_S).max(0.0);
        let s_m = self.ego.s_m + 0.5 * (before_m_s + speed_m_s) * SUBSTEP_S;
        let lateral = plan.path.at(&self.road, s_m);
        let at = self.road.at(s_m, lateral.d_m);
        let (angle_rad, curvature_1_m) = lateral.direction(at.curvature_1_m);
        self.grade_rad = at.grade_rad;
        let e = &mut self.ego;
        (e.x_m, e.y_m, e.z_m) = (at.x_m, at.y_m, at.z_m);
        (e.s_m, e.d_m, e.yaw_rad) = (s_m, lateral.d_m, at.heading_rad + angle_rad);
        (e.speed_m_s, e.accel_x_m_s2) = (speed_m_s, (speed_m_s - before_m_s) / SUBSTEP_S);
        e.yaw_rate_rad_s = speed_m_s * curvature_1_m;
        e.accel_y_m_s2 = speed_m_s * e.yaw_rate_rad_s;
        follow_hitch(e, &self.limits.geometry);
        self.now = self.now.plus_nanos(SUBSTEP_NS);
        self.traffic.advance(self.now, &self.ego)?;
        Ok(substep)
    }

    /// The acceleration that full power gives on this grade, m/s².
    fn most_accel_m_s2(&self) -> f64 {
        let grade_rad = self.grade_rad;
        let piece = RoadPiece {
            sin_grade: libm::sin(grade_rad),
            cos_grade: libm::cos(grade_rad),
            ..RoadPiece::default()
        };
        let v = self.ego.speed_m_s;
        let load = &self.limits.road_load;
        (self.at_wheels_w / v.max(POWER_FROM_M_S) - load.resistance_n(v, &piece)) / load.mass_kg
    }
}

/// Power at the wheels at full load, W.
fn at_wheels_w(limits: &VehicleLimits) -> f64 {
    let powertrain = &limits.powertrain;
    let full = &powertrain.full_load_nm;
    let power_w = full.x().iter().zip(full.y()).map(|(w, m)| w * m).fold(0.0, f64::max);
    let efficiency = powertrain.gear_efficiency_frac.last().copied().unwrap_or(1.0);
    (power_w - powertrain.auxiliary_power_w) * efficiency
}

fn situation<'a>(
    now: Time,
    ego: &'a EgoState,
    scene: &'a Scene,
    road: &'a Road,
    limits: &'a VehicleLimits,
) -> Situation<'a> {
    Situation { now, ego, scene, road, limits }
}

/// The trailer's turn over a step: its axle group does not slip, `L r_t = e r cos φ - v sin φ`.
fn follow_hitch(ego: &mut EgoState, geometry: &Geometry) {
    let (sin, cos) = libm::sincos(ego.trailer.articulation_rad);
    let turned = geometry.hitch_ahead_m * ego.yaw_rate_rad_s * cos - ego.speed_m_s * sin;
    ego.trailer.yaw_rate_rad_s = turned / geometry.hitch_to_trailer_axle_m.max(1.0);
    ego.trailer.articulation_rad += (ego.trailer.yaw_rate_rad_s - ego.yaw_rate_rad_s) * SUBSTEP_S;
}
