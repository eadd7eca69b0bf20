//! The part of a tick with trustworthy inputs: reference, decision, path, both controllers.

use alloc::vec::Vec;

use super::speed::{Ahead, Doing};
use super::{Stack, grade};
use crate::SpeedPlannerKind;
use crate::decider::{
    DeciderKind, LaneChoice, View, keep_right, lane_ends, lane_ends_in_m, leave_ending_lane,
    leaving_gap_m, mobil, observation, rules,
};
use crate::pcc::horizon::LeadAhead;
use crate::safety::RearResponse;
use crate::speed::{
    Following, Lead, LeadView, SpeedBounds, SpeedTarget, follow, leads, steady_gap_m,
};
use crate::steering::{
    LOWEST_SPEED_M_S, Lateral, LateralPath, ManeuverPlanner, PREVIEW_POINTS, PREVIEW_STEP_S,
    PathError, Situation,
};
use crate::wrapped;
use road::{LaneKind, Road};
use tractrix_core::{
    Command, EgoState, GearRequest, LaneChangeReason, Maneuver, PlanStatus, Scene, Time,
    VehicleLimits,
};

/// Spacing of the published path, s, and its number of points.
const PATH_STEP_S: f64 = 0.2;
const PATH_POINTS: usize = 26;
/// Headway that a return to the right lane leaves a follower under MOBIL, s.
const REAR_HEADWAY_S: f64 = 2.0;
/// Time for joining a lane's centre from beside it, s.
const JOIN_S: f64 = 6.0;

impl Stack {
    /// Decide, plan and control with trustworthy inputs; `None` if there is no lane to drive in.
    pub(super) fn drive(
        &mut self,
        now: Time,
        ego: &EgoState,
        scene: &Scene,
        road: &Road,
        limits: &VehicleLimits,
    ) -> Option<Command> {
        let rates = self.config.rates;
        let ticks = self.ticks;
        let due = |every: u32| ticks.is_multiple_of(u64::from(every));
        let mut maneuver = match self.maneuver.take() {
            Some(maneuver) => maneuver,
            None => ManeuverPlanner::new(
                self.config.lane_change,
                self.config.rss,
                join_from(road, start_lane(road, ego)?, ego),
            ),
        };
        if due(rates.path_ticks) || self.reference.points().is_empty() {
            self.plan_speed(now, ego, scene, road, limits, &maneuver);
            self.update_reference(ego, road, maneuver.path().lane, limits);
        }
        let grade_rad = grade(road, ego, limits);
        let (reference_m_s, reference_accel) = self.reference.at(ego.s_m)?;
        if due(rates.path_ticks) {
            let at = Situation {
                now,
                ego,
                scene,
                road,
                limits,
                reference_speed_m_s: reference_m_s,
                grade_rad: grade_rad.min(steepest_descent(road, ego.s_m)),
            };
            self.decide(&mut maneuver, &at, due(rates.decision_ticks));
            publish_path(&mut self.plan.path, maneuver.path(), road, ego);
        }
        self.plan.maneuver = maneuver.maneuver();
        self.plan.lane = maneuver.lane();
        let command = if due(rates.control_ticks) {
            let view = LeadView { ego, scene, road, limits, rss: &self.config.rss };
            let leads = leads(&view, &maneuver);
            let response = self.config.rss.ego_response(limits);
            let following = self.follow(&leads, &response, ego.speed_m_s, grade_rad);
            let jam_accel_m_s2 = self.stop_and_go(&leads, &response, ego.speed_m_s);
            let planned = maneuver.planned_speed(now).filter(|p| p.0 < reference_m_s);
            let (speed_m_s, accel_m_s2) = planned.unwrap_or((reference_m_s, reference_accel));
            self.plan.following = following.map(|(id, _)| id);
            self.plan.reference_speed_m_s = reference_m_s;
            let doing = Doing {
                reference_m_s: speed_m_s,
                free: planned.is_none(),
                braking: self.guard.sent().retarder_frac > 0.3
                    || self.guard.sent().xbr_decel_m_s2 > 0.0,
                pedal_frac: self.guard.sent().accelerator_pedal_frac,
            };
            let target = SpeedTarget {
                speed_m_s,
                accel_m_s2,
                traffic_accel_m_s2: following
                    .map_or(f64::INFINITY, |(_, f)| f.accel_m_s2)
                    .min(jam_accel_m_s2),
                haste: following.map_or(1.0, |(_, f)| f.haste),
                grade_rad,
                brake_from: self.may_overspeed().then(|| self.ceiling.at(ego.s_m)).flatten(),
                coast: self.plans_ahead() && self.speed.coasts(ego.s_m, &doing),
            };
            self.control(ego, maneuver.path(), &target, doing, road, limits)
        } else {
            *self.guard.sent()
        };
        self.maneuver = Some(maneuver);
        Some(command)
    }

    /// Whether the speed is planned while driving.
    fn plans_ahead(&self) -> bool {
        self.config.speed_planner == SpeedPlannerKind::Predictive && self.profile.is_none()
    }

    /// Whether the truck may roll above the reference on descents.
    fn may_overspeed(&self) -> bool {
        self.config.speed_planner == SpeedPlannerKind::Cruise && self.config.overspeed_m_s > 0.0
    }

    /// The speed that the truck would drive without others, m/s. A plan begins at the speed that it
    /// has, and may be made for staying behind somebody: the reference then wishes nothing.
    fn wish_speed_m_s(&self, at: &Situation<'_>) -> f64 {
        let allowed = self.plans_ahead().then(|| self.ceiling.at(at.ego.s_m)).flatten();
        allowed.map_or(at.reference_speed_m_s, |(m_s, _)| m_s.max(at.reference_speed_m_s))
    }

    /// Plans the speed of the next kilometres, if it is time to.
    fn plan_speed(
        &mut self,
        now: Time,
        ego: &EgoState,
        scene: &Scene,
        road: &Road,
        limits: &VehicleLimits,
        maneuver: &ManeuverPlanner,
    ) {
        if !self.plans_ahead() {
            return;
        }
        let view = LeadView { ego, scene, road, limits, rss: &self.config.rss };
        let response = self.config.rss.ego_response(limits);
        let lead = leads(&view, maneuver)
            .into_iter()
            .flatten()
            .filter(|lead| lead.in_path && !lead.being_left)
            .min_by(|a, b| a.gap_m.total_cmp(&b.gap_m))
            .map(|lead| LeadAhead {
                id: lead.id,
                gap_m: lead.gap_m,
                speed_m_s: lead.speed_m_s,
                wanted_gap_m: steady_gap_m(&self.config.following, &response, &lead),
            });
        let lead = lead.filter(|lead| {
            self.config.decider == DeciderKind::KeepLane || self.speed.settled(ego, lead)
        });
        let ahead = Ahead { now, ego, road, lane: maneuver.path().lane, limits, lead };
        self.speed.update(self.ticks, &self.config, &ahead);
    }

    fn update_reference(&mut self, ego: &EgoState, road: &Road, lane: u16, limits: &VehicleLimits) {
        let bounds = SpeedBounds {
            set_speed_m_s: self.config.set_speed_m_s,
            obey_speed_limits: self.config.obey_speed_limits,
            curve_accel_m_s2: self.config.curve_accel_m_s2,
        };
        let profile = match self.config.speed_planner {
            SpeedPlannerKind::Predictive => self.profile.as_ref(),
            SpeedPlannerKind::Cruise => None,
        };
        let ahead = self.plans_ahead().then_some(&self.speed);
        let planned = |s_m: f64| match ahead {
            Some(speed) => speed.at(s_m).map(|p| p.speed_m_s),
            None => profile.and_then(|p| p.at(s_m)),
        };
        self.reference.update(road, lane, ego.s_m, &limits.geometry, &bounds, planned);
        if self.may_overspeed() || self.plans_ahead() {
            let over_m_s = if self.may_overspeed() { self.config.overspeed_m_s } else { 0.0 };
            self.ceiling.update_like(&self.reference, bounds.set_speed_m_s + over_m_s);
        }
        self.plan.speed_status = match (self.config.speed_planner, profile) {
            (SpeedPlannerKind::Cruise, _) => PlanStatus::Cruise,
            (SpeedPlannerKind::Predictive, None) => self.speed.status(ego.s_m),
            (SpeedPlannerKind::Predictive, Some(p)) if p.at(ego.s_m).is_some() => p.status(),
            (SpeedPlannerKind::Predictive, _) => PlanStatus::Fallback,
        };
        self.plan.speed.clear();
        self.plan.speed.extend_from_slice(self.reference.points());
    }

    /// Checks the change under way and looks at what is wished.
    fn decide(&mut self, maneuver: &mut ManeuverPlanner, at: &Situation<'_>, due: bool) {
        self.plan.refusal = maneuver.update(at);
        if self.policy.is_some() {
            let reference = |s_m: f64| self.reference.at(s_m).map_or(0.0, |r| r.0);
            self.observer.push(observation::frame(at.ego, at.scene, at.road, reference));
        }
        let wish = match self.config.decider {
            DeciderKind::External => core::mem::take(&mut self.wish),
            _ if !due || maneuver.maneuver() != Maneuver::KeepLane => LaneChoice::Keep,
            kind => {
                let view = View::new(
                    at.ego,
                    &at.limits.geometry,
                    at.scene,
                    at.road,
                    maneuver.lane(),
                    self.wish_speed_m_s(at),
                );
                let law = self.config.keep_right;
                match kind {
                    _ if lane_ends(&view) => leave_ending_lane(&view),
                    DeciderKind::Rules { distance_m } => match rules(&view, distance_m) {
                        LaneChoice::Keep if law => keep_right(&view, |_| distance_m, distance_m),
                        wish => wish,
                    },
                    DeciderKind::Mobil(config) => match mobil(&view, &config) {
                        LaneChoice::Keep if law => {
                            let leaving = |v: f64| leaving_gap_m(&view, &config, v);
                            keep_right(&view, leaving, REAR_HEADWAY_S * at.ego.speed_m_s)
                        }
                        wish => wish,
                    },
                    DeciderKind::Dqn => self.learned(&view),
                    DeciderKind::KeepLane | DeciderKind::External => LaneChoice::Keep,
                }
            }
        };
        if wish != LaneChoice::Keep {
            self.plan.reason = Some(self.reason(wish, maneuver.lane(), at));
        } else if maneuver.maneuver() == Maneuver::KeepLane {
            self.plan.reason = None;
        }
        if let Err(refusal) = maneuver.request(wish, at) {
            self.plan.refusal = Some(refusal);
        }
    }

    /// Why the decider wishes a change.
    fn reason(&self, wish: LaneChoice, lane: u16, at: &Situation<'_>) -> LaneChangeReason {
        let reference_m_s = at.reference_speed_m_s;
        let view = View::new(at.ego, &at.limits.geometry, at.scene, at.road, lane, reference_m_s);
        let slower_within = |distance_m: f64| {
            view.ahead(lane).is_some_and(|(n, gap)| gap < distance_m && n.speed_m_s < reference_m_s)
        };
        match self.config.decider {
            DeciderKind::External => LaneChangeReason::Requested,
            _ if lane_ends(&view) => LaneChangeReason::LaneEnds,
            DeciderKind::Dqn => LaneChangeReason::Policy,
            DeciderKind::Rules { distance_m } if slower_within(distance_m) => {
                LaneChangeReason::SlowerAhead
            }
            _ if wish == LaneChoice::Right => LaneChangeReason::KeepRight,
            _ => LaneChangeReason::SlowerAhead,
        }
    }

    /// The learned policy's choice among the lanes that exist; keep while nobody is in sight.
    fn learned(&self, view: &View<'_>) -> LaneChoice {
        let seen = self.observer.latest().is_some_and(observation::sees_anyone);
        match &self.policy {
            Some(policy) if seen => {
                policy.choose(&self.observer.observation(), |choice| view.beside(choice).is_some())
            }
            _ => LaneChoice::Keep,
        }
    }

    /// Both controllers.
    fn control(
        &mut self,
        ego: &EgoState,
        path: &LateralPath,
        target: &SpeedTarget,
        doing: Doing,
        road: &Road,
        limits: &VehicleLimits,
    ) -> Command {
        let dt_s = self.config.rates.control_s();
        let speed = self.longitudinal.step(dt_s, ego, target, limits);
        let fenced = self.plans_ahead() && self.speed.last().is_some_and(|plan| plan.fenced);
        // It wishes to leave a lane that ends: who still drives in it waits for a gap.
        let waits = lane_ends_in_m(road, path.lane, ego.s_m).is_some();
        self.plan.held_up = speed.traffic_rules || fenced || waits || !doing.free;
        let gear = if self.plans_ahead() {
            if speed.traffic_rules {
                self.speed.held_up();
            }
            let doing = Doing { free: doing.free && !speed.traffic_rules, ..doing };
            self.speed.gear(dt_s, &self.config, ego, limits, &doing)
        } else {
            GearRequest::Automatic
        };
        let kept = self.jam.gear(dt_s, ego, limits, speed.accelerator_pedal_frac);
        let gear = if gear == GearRequest::Automatic { kept } else { gear };
        let (error, wheel_rad) = self.steer(ego, path, road, limits);
        self.plan.target_speed_m_s = target.speed_m_s;
        self.plan.target_accel_m_s2 = speed.accel_m_s2;
        self.plan.target_d_m = ego.d_m - error.offset_m;
        self.plan.lateral_error_m = error.offset_m;
        // An open driveline has no use for the pedal.
        let pedal = if gear == GearRequest::Neutral { 0.0 } else { speed.accelerator_pedal_frac };
        Command {
            accelerator_pedal_frac: pedal,
            xbr_decel_m_s2: speed.xbr_decel_m_s2,
            brake_mode: speed.brake_mode,
            steering_wheel_rad: wheel_rad * limits.lateral.steering_ratio,
            retarder_frac: speed.retarder_frac,
            gear,
        }
    }

    fn steer(
        &mut self,
        ego: &EgoState,
        path: &LateralPath,
        road: &Road,
        limits: &VehicleLimits,
    ) -> (PathError, f64) {
        let here = path.at(road, ego.s_m);
        let (angle, _) = path.direction(road, ego.s_m);
        let heading = road.line().at(ego.s_m).heading_rad + angle;
        let error =
            PathError { offset_m: ego.d_m - here.d_m, heading_rad: wrapped(ego.yaw_rad - heading) };
        let step_m = ego.speed_m_s.max(LOWEST_SPEED_M_S) * PREVIEW_STEP_S;
        let mut curvature = [0.0; PREVIEW_POINTS];
        for (i, k) in curvature.iter_mut().enumerate() {
            *k = path.direction(road, ego.s_m + i as f64 * step_m).1;
        }
        (error, self.lateral.step(ego, error, &curvature, limits))
    }

    /// What a jam asks for, by the nearest vehicle in the path.
    fn stop_and_go(
        &mut self,
        leads: &[Option<Lead>; 2],
        response: &RearResponse,
        speed_m_s: f64,
    ) -> f64 {
        let config = &self.config.following;
        let lead = leads
            .iter()
            .flatten()
            .filter(|lead| lead.in_path && !lead.being_left)
            .min_by(|a, b| a.gap_m.total_cmp(&b.gap_m));
        let steady_gap = |speed_m_s: f64| {
            lead.map_or(0.0, |lead| steady_gap_m(config, response, &Lead { speed_m_s, ..*lead }))
        };
        self.jam.step(self.config.rates.control_s(), config, speed_m_s, lead, steady_gap)
    }

    /// The strictest request of car following, and whom it follows.
    fn follow(
        &self,
        leads: &[Option<Lead>; 2],
        response: &RearResponse,
        speed_m_s: f64,
        grade_rad: f64,
    ) -> Option<(u64, Following)> {
        let config = &self.config.following;
        leads
            .iter()
            .flatten()
            .map(|lead| (lead.id, follow(config, response, speed_m_s, grade_rad, lead)))
            .min_by(|a, b| a.1.accel_m_s2.total_cmp(&b.1.accel_m_s2))
    }
}

/// The lane to start in: the one that the truck is in, or the nearest drivable one.
fn start_lane(road: &Road, ego: &EgoState) -> Option<u16> {
    road.lanes_at(ego.s_m)
        .filter(|l| l.kind != LaneKind::Shoulder)
        .min_by(|a, b| {
            let off = |l: &road::LaneTrack| (l.center_d_m(ego.s_m) - ego.d_m).abs();
            off(a).total_cmp(&off(b))
        })
        .map(|l| l.id)
}

/// From where the truck is to the lane's centre, within [`JOIN_S`].
fn join_from(road: &Road, lane: u16, ego: &EgoState) -> LateralPath {
    let heading = wrapped(ego.yaw_rad - road.line().at(ego.s_m).heading_rad);
    let here =
        Lateral { d_m: ego.d_m, slope: libm::tan(heading.clamp(-0.5, 0.5)), second_1_m: 0.0 };
    let length_m = JOIN_S * ego.speed_m_s.max(5.0);
    LateralPath::join(road, lane, here, ego.s_m, length_m)
}

/// The steepest descent within the stopping distance ahead, rad, not above zero.
fn steepest_descent(road: &Road, s_m: f64) -> f64 {
    (0..8).map(|i| libm::atan(road.line().at(s_m + 25.0 * f64::from(i)).slope)).fold(0.0, f64::min)
}

fn publish_path(
    out: &mut Vec<tractrix_core::PathPoint>,
    path: &LateralPath,
    road: &Road,
    ego: &EgoState,
) {
    let step_m = ego.speed_m_s.max(1.0) * PATH_STEP_S;
    out.clear();
    out.extend(
        (0..PATH_POINTS)
            .map(|i| path.point(road, ego.s_m + i as f64 * step_m, i as f64 * PATH_STEP_S)),
    );
}
