//! What to drive: lane and speed, from the situation alone. How it is driven, and the last check,
//! are the stack's; a point that follows [`TacticalPlan`] needs neither.

use alloc::boxed::Box;
use alloc::sync::Arc;

use super::speed::SpeedPlanning;
use super::{SpeedPlannerKind, StackConfig};
use crate::decider::observation::Observer;
use crate::decider::{DeciderKind, LaneChoice, Policy, Scratch, lane_ends_in_m};
use crate::safety::Headway;
use crate::speed::{Following, LeadView, ReferenceSpeed, SpeedTarget, StopAndGo, leads};
use crate::steering::{Lateral, LateralPath, ManeuverPlanner, Outlook};
use crate::{PlannerError, Situation, SpeedProfile, wrapped};
use road::{LaneKind, Road};
use tractrix_core::{EgoState, LaneChangeReason, LaneChangeRefusal, Maneuver, PlanStatus};

/// Time for joining a lane's centre from beside it, s.
const JOIN_S: f64 = 6.0;

/// What is to be driven until the next tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TacticalPlan {
    /// The path.
    pub path: LateralPath,
    /// Acceleration that the reference speed and traffic ask for, m/s², before jerk limits.
    pub target_accel_m_s2: f64,
    /// The manoeuvre.
    pub maneuver: Maneuver,
    /// Why a change was refused or aborted in this tick.
    pub refusal: Option<LaneChangeRefusal>,
    /// Why the change is wished that is driven, or that was refused in this tick.
    pub reason: Option<LaneChangeReason>,
    /// Lane track that the truck is in, or leaves.
    pub lane: u16,
    /// Reference speed at the truck, m/s, before traffic.
    pub reference_speed_m_s: f64,
    /// Identifier of the vehicle that is followed.
    pub following: Option<u64>,
    /// What the speed controller is to follow.
    pub(super) target: SpeedTarget,
    /// No change under way sets the speed.
    pub(super) free: bool,
    /// Traffic is a jam.
    pub(super) jam: bool,
    /// The plan is made for staying behind a vehicle, or the lane must be left.
    pub(super) held_back: bool,
    /// The reference ahead is new.
    pub(super) new_speed: bool,
    /// The path has been looked at.
    pub(super) new_path: bool,
}

/// Decider, lane changes, car following and reference speed of one truck.
///
/// `clone_from` copies into the memory that is there; only a plan of the speed ahead is made anew.
#[derive(Debug)]
pub struct Tactics {
    pub(super) config: StackConfig,
    /// In a box, as each tick takes it out and puts it back.
    pub(super) maneuver: Option<Box<ManeuverPlanner>>,
    pub(super) reference: ReferenceSpeed,
    /// What the driver, limits and curves allow: up to there cruise control rolls before it brakes,
    /// and so fast a planned truck would be without others.
    pub(super) ceiling: ReferenceSpeed,
    pub(super) profile: Option<SpeedProfile>,
    pub(super) speed: SpeedPlanning,
    pub(super) speed_status: PlanStatus,
    pub(super) wish: LaneChoice,
    pub(super) reason: Option<LaneChangeReason>,
    pub(super) policy: Option<Arc<Policy>>,
    pub(super) scratch: Scratch,
    pub(super) observer: Observer,
    pub(super) jam: StopAndGo,
    pub(super) ticks: u64,
    /// The tick for which the reference speed was renewed last.
    foreseen: Option<u64>,
    /// The speed part of the last plan; the controllers may run less often than the loop.
    last: Option<TacticalPlan>,
}

impl Clone for Tactics {
    fn clone(&self) -> Self {
        Self {
            config: self.config.clone(),
            maneuver: self.maneuver.clone(),
            reference: self.reference.clone(),
            ceiling: self.ceiling.clone(),
            profile: self.profile.clone(),
            speed: self.speed.clone(),
            policy: self.policy.clone(),
            scratch: self.scratch.clone(),
            observer: self.observer.clone(),
            ..*self
        }
    }

    fn clone_from(&mut self, from: &Self) {
        // Destructured, so that no new part is forgotten.
        let Self {
            config,
            maneuver,
            reference,
            ceiling,
            profile,
            speed,
            speed_status,
            wish,
            reason,
            policy,
            scratch,
            observer,
            jam,
            ticks,
            foreseen,
            last,
        } = from;
        self.config.clone_from(config);
        self.maneuver.clone_from(maneuver);
        self.reference.clone_from(reference);
        self.ceiling.clone_from(ceiling);
        self.profile.clone_from(profile);
        if from.plans_ahead() {
            self.speed.clone_from(speed);
        }
        self.policy.clone_from(policy);
        self.scratch.clone_from(scratch);
        self.observer.clone_from(observer);
        (self.speed_status, self.wish, self.reason) = (*speed_status, *wish, *reason);
        (self.jam, self.ticks, self.foreseen, self.last) = (*jam, *ticks, *foreseen, *last);
    }
}

impl Tactics {
    /// Tactics with a configuration; `policy` is the learned decider's.
    ///
    /// # Errors
    /// [`PlannerError`] names the configuration key; [`PlannerError::NoPolicy`] if the decider is
    /// the learned one and there is none.
    pub fn new(config: StackConfig, policy: Option<Arc<Policy>>) -> Result<Self, PlannerError> {
        config.check()?;
        if config.decider == DeciderKind::Dqn && policy.is_none() {
            return Err(PlannerError::NoPolicy);
        }
        let rates = &config.rates;
        Ok(Self {
            maneuver: None,
            reference: ReferenceSpeed::default(),
            ceiling: ReferenceSpeed::default(),
            profile: None,
            speed: SpeedPlanning::new(&config),
            speed_status: PlanStatus::default(),
            wish: LaneChoice::Keep,
            reason: None,
            scratch: policy.as_ref().map(|p| p.scratch()).unwrap_or_default(),
            policy,
            observer: Observer::new(rates.tick_s * f64::from(rates.path_ticks)),
            jam: StopAndGo::default(),
            ticks: 0,
            foreseen: None,
            last: None,
            config,
        })
    }

    /// The configuration.
    #[must_use]
    pub fn config(&self) -> &StackConfig {
        &self.config
    }

    /// As [`crate::Stack::set_decider`].
    pub(super) fn set_decider(
        &mut self,
        decider: DeciderKind,
        policy: Option<Arc<Policy>>,
    ) -> Result<(), PlannerError> {
        decider.check()?;
        let policy = policy.or_else(|| self.policy.clone());
        if decider == DeciderKind::Dqn && policy.is_none() {
            return Err(PlannerError::NoPolicy);
        }
        self.scratch = policy.as_ref().map(|p| p.scratch()).unwrap_or_default();
        (self.config.decider, self.policy, self.wish) = (decider, policy, LaneChoice::Keep);
        Ok(())
    }

    /// As [`crate::Stack::set_speed_planner`].
    pub(super) fn set_speed_planner(&mut self, kind: SpeedPlannerKind) {
        if kind != self.config.speed_planner {
            self.config.speed_planner = kind;
            self.speed = self.speed.anew(&self.config);
            // What is known of the road ahead is of the other one
            self.foreseen = None;
        }
    }

    /// Wishes a lane change from outside (decider `external`); it is looked at in the next tick
    /// that looks at paths.
    pub fn request_lane_change(&mut self, wish: LaneChoice) {
        self.wish = wish;
    }

    /// Whether a change to a side would be started here: what a tick would do with the wish.
    ///
    /// # Errors
    /// Why it would be refused; [`LaneChangeRefusal::Busy`] before the first tick and while the
    /// truck is not in the tactics' hands.
    pub fn would_pass(
        &self,
        choice: LaneChoice,
        at: &Situation<'_>,
    ) -> Result<(), LaneChangeRefusal> {
        match (&self.maneuver, self.outlook(at)) {
            (Some(maneuver), Some(outlook)) => maneuver.would_pass(choice, &outlook),
            _ => Err(LaneChangeRefusal::Busy),
        }
    }

    /// Reference speed at a station, m/s; `None` before the first tick.
    #[must_use]
    pub fn reference_speed_m_s(&self, s_m: f64) -> Option<f64> {
        self.reference.at(s_m).map(|(speed_m_s, _)| speed_m_s)
    }

    /// Brings the reference speed up to here, as the next tick does before it looks at wishes: after
    /// it [`Self::would_pass`] is what that tick does with a wish. False if there is no lane to
    /// drive in.
    pub fn foresee(&mut self, at: &Situation<'_>) -> bool {
        let maneuver = match self.maneuver.take() {
            Some(maneuver) => maneuver,
            None => match self.joining(at) {
                Some(maneuver) => Box::new(maneuver),
                None => return false,
            },
        };
        let due = self.ticks.is_multiple_of(u64::from(self.config.rates.path_ticks));
        let known = self.foreseen == Some(self.ticks);
        if !known && (due || self.reference.is_empty()) {
            self.plan_speed(at, &maneuver);
            self.update_reference(at, maneuver.path().lane);
            self.foreseen = Some(self.ticks);
        }
        self.maneuver = Some(maneuver);
        true
    }

    /// One tick: what to drive; `None` if there is no lane to drive in.
    pub fn tick(&mut self, at: &Situation<'_>) -> Option<TacticalPlan> {
        let lane = self.foresee(at);
        let ticks = self.ticks;
        self.ticks = ticks.wrapping_add(1);
        let mut maneuver = self.maneuver.take().filter(|_| lane)?;
        let rates = self.config.rates;
        let due = |every: u32| ticks.is_multiple_of(u64::from(every));
        let new_path = due(rates.path_ticks);
        let refusal = if new_path {
            self.decide(&mut maneuver, &self.outlook(at)?, due(rates.decision_ticks))
        } else {
            None
        };
        let plan = match self.last.filter(|_| !due(rates.control_ticks)) {
            Some(last) => TacticalPlan { path: *maneuver.path(), ..last },
            None => self.drive(at, &maneuver)?,
        };
        let plan = TacticalPlan {
            maneuver: maneuver.maneuver(),
            refusal,
            reason: self.reason,
            lane: maneuver.lane(),
            new_speed: self.foreseen == Some(ticks),
            new_path,
            ..plan
        };
        self.maneuver = Some(maneuver);
        self.last = Some(plan);
        Some(plan)
    }

    /// A tick without usable inputs, or with a driver at the wheel: what was being driven is
    /// forgotten.
    pub fn release(&mut self) {
        self.ticks = self.ticks.wrapping_add(1);
        self.maneuver = None;
    }

    /// Speed and leads of a tick.
    fn drive(&mut self, at: &Situation<'_>, maneuver: &ManeuverPlanner) -> Option<TacticalPlan> {
        let ego = at.ego;
        let (reference_m_s, reference_accel) = self.reference.at(ego.s_m)?;
        let grade_rad = at.grade_rad();
        let leads = leads(&self.lead_view(at), maneuver);
        let response = self.config.rss.ego_response(at.limits);
        let following = self.follow(&leads, &response, ego.speed_m_s, grade_rad);
        let jam_accel_m_s2 = self.stop_and_go(&leads, &response, ego.speed_m_s);
        let planned = maneuver.planned_speed(at.now).filter(|p| p.0 < reference_m_s);
        let (speed_m_s, accel_m_s2) = planned.unwrap_or((reference_m_s, reference_accel));
        let free = planned.is_none();
        let path = *maneuver.path();
        let target = SpeedTarget {
            speed_m_s,
            accel_m_s2,
            traffic_accel_m_s2: following
                .map_or(f64::INFINITY, |(_, f)| f.accel_m_s2)
                .min(jam_accel_m_s2),
            haste: following.map_or(1.0, |(_, f)| f.haste),
            grade_rad,
            brake_from: self.may_overspeed().then(|| self.ceiling.at(ego.s_m)).flatten(),
            coast: self.plans_ahead() && self.speed.coasts(ego.s_m, free, speed_m_s),
        };
        let longitudinal = &self.config.longitudinal;
        let wanted_m_s2 = longitudinal.tracking_m_s2(&target, ego.speed_m_s);
        // It wishes to leave a lane that ends: who still drives in it waits for a gap.
        let waits = lane_ends_in_m(at.road, path.lane, ego.s_m).is_some();
        let fenced = self.plans_ahead() && self.speed.last().is_some_and(|plan| plan.fenced);
        Some(TacticalPlan {
            path,
            target_accel_m_s2: longitudinal.asked_m_s2(&target, wanted_m_s2).0,
            maneuver: maneuver.maneuver(),
            refusal: None,
            reason: None,
            lane: maneuver.lane(),
            reference_speed_m_s: reference_m_s,
            following: following.map(|(id, _)| id),
            target,
            free,
            jam: self.jam.is_jam(),
            held_back: fenced || waits || !free,
            new_speed: false,
            new_path: false,
        })
    }

    /// Into the lane where the truck is; `None` if there is none to drive in.
    fn joining(&self, at: &Situation<'_>) -> Option<ManeuverPlanner> {
        let path = join_from(at.road, start_lane(at.road, at.ego)?, at.ego);
        Some(ManeuverPlanner::new(self.config.lane_change, self.config.rss, path))
    }

    /// The vehicle in the path with the least time to spare, for the guard.
    pub(super) fn headway(&self, at: &Situation<'_>) -> Option<Headway> {
        self.headway_on(self.maneuver.as_ref()?, at)
    }

    /// As [`Self::headway`], where somebody else drives: in the lane where the truck is.
    pub(super) fn headway_of_others(&self, at: &Situation<'_>) -> Option<Headway> {
        self.headway_on(&self.joining(at)?, at)
    }

    /// What car following asks of whoever drives in the lane where the truck is, and whom it
    /// follows.
    pub(super) fn following_of_others(&self, at: &Situation<'_>) -> Option<(u64, Following)> {
        let leads = leads(&self.lead_view(at), &self.joining(at)?);
        let response = self.config.rss.ego_response(at.limits);
        self.follow(&leads, &response, at.ego.speed_m_s, at.grade_rad())
    }

    fn headway_on(&self, maneuver: &ManeuverPlanner, at: &Situation<'_>) -> Option<Headway> {
        leads(&self.lead_view(at), maneuver)
            .into_iter()
            .flatten()
            .filter(|lead| lead.in_path)
            .min_by(|a, b| a.gap_m.total_cmp(&b.gap_m))
            .map(|l| Headway { gap_m: l.gap_m, speed_m_s: l.speed_m_s, accel_m_s2: l.accel_m_s2 })
    }

    /// What a change is planned with; `None` before the first tick.
    pub(super) fn outlook<'a>(&self, at: &'a Situation<'a>) -> Option<Outlook<'a>> {
        let (reference_speed_m_s, _) = self.reference.at(at.ego.s_m)?;
        Some(Outlook { at, reference_speed_m_s })
    }

    pub(super) fn lead_view<'a>(&'a self, at: &Situation<'a>) -> LeadView<'a> {
        let Situation { ego, scene, road, limits, .. } = *at;
        LeadView { ego, scene, road, limits, rss: &self.config.rss }
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
    let heading = wrapped(ego.yaw_rad - road.line().heading_rad(ego.s_m));
    let here =
        Lateral { d_m: ego.d_m, slope: libm::tan(heading.clamp(-0.5, 0.5)), second_1_m: 0.0 };
    let length_m = JOIN_S * ego.speed_m_s.max(5.0);
    LateralPath::join(road, lane, here, ego.s_m, length_m)
}
