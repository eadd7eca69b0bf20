//! The predictive speed planner in the stack: when to plan, what to do with a plan, what without.
//!
//! A plan is made every `speed_plan_ticks`, and earlier when the truck is no longer where the last
//! one has it or another vehicle is ahead. When there is no new plan the last one is driven on as
//! far as it reaches; beyond it cruise control drives.

use alloc::vec::Vec;

use crate::StackConfig;
use crate::pcc::horizon::{
    HorizonFailure, HorizonPlan, HorizonPlanner, HorizonPoint, HorizonRequest, LeadAhead,
};
use crate::pcc::model::Tuning;
use road::{LaneEnd, ProfilePoint, Road};
use tractrix_core::{EgoState, PlanStatus, Time, VehicleLimits};

/// Largest planned brake force per mass, m/s²: holds the truck on -9 %.
const BRAKE_M_S2: f64 = 1.0;
/// Spacing of the road profile that is planned on, m.
const STEP_M: f64 = 12.5;
/// A truck this far off the plan's speed makes a new plan, m/s.
const REPLAN_OFF_M_S: f64 = 0.7;
/// What the road ahead, the truck and traffic are when a plan is asked for.
pub(super) struct Ahead<'a> {
    pub(super) now: Time,
    pub(super) ego: &'a EgoState,
    pub(super) road: &'a Road,
    pub(super) lane: u16,
    pub(super) limits: &'a VehicleLimits,
    pub(super) lead: Option<LeadAhead>,
}

/// Plans and their use.
#[derive(Debug, Clone)]
pub(super) struct SpeedPlanning {
    planner: HorizonPlanner,
    profile: Vec<ProfilePoint>,
    planned_at: Option<u64>,
    made: u64,
    failure: Option<HorizonFailure>,
    lead: Option<u64>,
    lane: u16,
    held_up: bool,
}

impl SpeedPlanning {
    pub(super) fn new(config: &StackConfig) -> Self {
        let tuning = Tuning {
            lateral_accel_m_s2: config.curve_accel_m_s2,
            brake_decel_m_s2: BRAKE_M_S2,
            ..Tuning::default()
        };
        Self {
            planner: HorizonPlanner::new(config.speed_plan, tuning),
            profile: Vec::new(),
            planned_at: None,
            made: 0,
            failure: None,
            lead: None,
            lane: 0,
            held_up: false,
        }
    }

    /// As [`Self::new`], with the attempts counted on.
    pub(super) fn anew(&self, config: &StackConfig) -> Self {
        Self { made: self.made, ..Self::new(config) }
    }

    /// Why the last attempt brought no plan.
    pub(super) fn failure(&self) -> Option<&HorizonFailure> {
        self.failure.as_ref()
    }

    /// The last plan.
    pub(super) fn last(&self) -> Option<&HorizonPlan> {
        self.planner.last()
    }

    /// Attempts so far.
    pub(super) fn made(&self) -> u64 {
        self.made
    }

    /// Lateness against cruise control, s.
    pub(super) fn late_s(&self) -> f64 {
        self.planner.late_s()
    }

    /// Plan at a station; `None` where cruise control drives.
    pub(super) fn at(&self, s_m: f64) -> Option<HorizonPoint> {
        self.planner.last().and_then(|plan| plan.at(s_m))
    }

    /// Outcome in words for a truck at `s_m`.
    pub(super) fn status(&self, s_m: f64) -> PlanStatus {
        match self.planner.last() {
            Some(plan) if plan.at(s_m).is_some() => match (&self.failure, plan.solved) {
                (Some(_), _) => PlanStatus::LastProfile,
                (None, true) => PlanStatus::Solved,
                (None, false) => PlanStatus::AlmostSolved,
            },
            _ => PlanStatus::Fallback,
        }
    }

    /// Takes note that traffic, not the plan, sets the acceleration.
    pub(super) fn held_up(&mut self) {
        self.held_up = true;
    }

    /// Whether the truck has settled behind a vehicle ahead. Before, a decider that may change lanes
    /// is not kept at a distance from which it would never overtake: car following approaches.
    pub(super) fn settled(&self, ego: &EgoState, lead: &LeadAhead) -> bool {
        let (near, alike) = if self.lead == Some(lead.id) && self.last().is_some_and(|p| p.fenced) {
            (2.0, 3.0)
        } else {
            (1.3, 0.7)
        };
        lead.gap_m < near * lead.wanted_gap_m && (ego.speed_m_s - lead.speed_m_s).abs() < alike
    }

    /// Plans if it is time to.
    pub(super) fn update(&mut self, ticks: u64, config: &StackConfig, ahead: &Ahead<'_>) {
        let since = self.planned_at.map_or(u64::MAX, |at| ticks.wrapping_sub(at));
        let lead = ahead.lead.map(|lead| lead.id);
        let off = self
            .at(ahead.ego.s_m)
            .is_none_or(|p| (p.speed_m_s - ahead.ego.speed_m_s).abs() > REPLAN_OFF_M_S);
        let changed = off || lead != self.lead || ahead.lane != self.lane;
        let rates = &config.rates;
        let due = since >= u64::from(rates.speed_plan_ticks)
            || changed && since >= u64::from(rates.decision_ticks);
        if !due {
            return;
        }
        self.planned_at = Some(ticks);
        self.made += 1;
        (self.lead, self.lane) = (lead, ahead.lane);
        self.sample(config, ahead);
        let request = HorizonRequest {
            profile: &self.profile,
            limits: ahead.limits,
            now_s: ahead.now.seconds(),
            speed_m_s: ahead.ego.speed_m_s,
            gear: ahead.ego.powertrain.gear,
            set_speed_m_s: config.set_speed_m_s,
            lead: ahead.lead,
            held_up: self.held_up,
        };
        self.failure = self.planner.plan(&request).err();
        if self.failure.is_none() {
            self.held_up = self.last().is_some_and(|plan| plan.fenced);
        }
    }

    /// The road from the truck to the horizon or the lane's end, with the speeds that count.
    fn sample(&mut self, config: &StackConfig, ahead: &Ahead<'_>) {
        let (road, s_m) = (ahead.road, ahead.ego.s_m);
        let lane = road.lanes().get(usize::from(ahead.lane));
        let end_m = lane
            .filter(|lane| lane.end != LaneEnd::Continues)
            .map_or(road.length_m(), |lane| lane.s_end_m)
            .min(s_m + config.speed_plan.length_m);
        let count = (libm::floor((end_m - s_m) / STEP_M) + 1.0).clamp(0.0, 4_000.0) as usize;
        self.profile.clear();
        self.profile.resize(count, ProfilePoint::default());
        road.profile(s_m, STEP_M, &mut self.profile);
        for p in &mut self.profile {
            p.speed_limit_m_s = if config.obey_speed_limits {
                road.lane_speed_limit_m_s(ahead.lane, p.s_m)
            } else {
                f64::INFINITY
            };
        }
    }

    /// Whether the plan wants neither fuel nor brake here, and sets the reference.
    pub(super) fn coasts(&self, s_m: f64, free: bool, reference_m_s: f64) -> bool {
        free && self.at(s_m).is_some_and(|p| p.coast && (p.speed_m_s - reference_m_s).abs() < 0.1)
    }
}
