//! Receding horizon: the fuel-optimal speed for the next kilometres, renewed while driving.
//!
//! The same subproblem as for whole trips (Eq. 18), with three differences: the end is soft (energy
//! beyond the horizon is worth the fuel that it saves, missing energy costs what it takes to
//! regain), time has a price instead of a limit (`clock`), and a vehicle ahead is a
//! fence (`fence`).
//!
//! Two candidates compete: the last plan moved on, gears included (the warm start, which keeps gears
//! from flickering; one subproblem brings it up to date), and one from the joint search over speed
//! and gear, where its gears differ. The new one has to be cheaper by [`SWITCH_GAIN_G`]. The profile that is handed out is driven in the truck model: what
//! it promises can be reached. No iteration is unbounded: a plan ends when its budget of
//! interior-point iterations is used up.
//!
//! Left out: wind, the duration of shifts, and what the vehicle ahead will do beyond driving on.

use road::ProfilePoint;
use serde::{Deserialize, Serialize};
use tractrix_core::VehicleLimits;

use super::clock::TripClock;
use super::fence::{Fence, LeadAhead};
use super::setting::{Candidate, Known, Setting};
use crate::PlannerError;
use crate::error::config_in;
use crate::pcc::error::PccError;
use crate::pcc::model::{Drive, Driven, Tuning, cruise_energies};
use crate::pcc::solve::{
    DefaultSolver, Iterations, Problem, Profile, Solution, SolveStatus, Subproblem, Terminal,
    TimeRule, eco_roll, iterate,
};

/// A plan with other gears has to be cheaper by this much, g.
const SWITCH_GAIN_G: f64 = 1.0;
/// `k_a` of a plan behind a fence, g s³/m²: slowing down early and hard costs no fuel, but comfort.
const FENCED_ACCEL_PENALTY: f64 = 10.0;
/// Length of a plan behind a fence, m: elapsed times make its subproblem several times dearer.
const FENCED_M: f64 = 1_500.0;

/// Settings of the receding horizon.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HorizonConfig {
    /// Length, m.
    pub length_m: f64,
    /// Speeds down to this much below the set speed may be planned, m/s.
    pub below_m_s: f64,
    /// Speeds up to this much above the set speed may be planned, m/s.
    pub above_m_s: f64,
    /// Coasting phases may open the driveline.
    pub eco_roll: bool,
    /// Gears are asked for, not only speeds.
    pub request_gears: bool,
    /// Slowest speed that is planned from, m/s; below it cruise control drives.
    pub slowest_m_s: f64,
    /// Subproblems of a candidate with new gears.
    pub sqp_iterations: u32,
    /// Interior-point iterations per plan; a plan that needs more fails.
    pub iteration_budget: u32,
    /// A vehicle ahead is taken to drive on for this long, s.
    pub lead_s: f64,
}

impl Default for HorizonConfig {
    /// 4 km, 10 km/h below to 8 km/h above the set speed.
    fn default() -> Self {
        Self {
            length_m: 4_000.0,
            below_m_s: 2.8,
            above_m_s: 2.2,
            eco_roll: false,
            request_gears: true,
            slowest_m_s: 6.0,
            sqp_iterations: 2,
            iteration_budget: 400,
            lead_s: 90.0,
        }
    }
}

impl HorizonConfig {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`PlannerError::Config`] names the key.
    pub fn check(&self) -> Result<(), PlannerError> {
        config_in("speed_plan.length_m", self.length_m, 500.0, 10_000.0)?;
        config_in("speed_plan.below_m_s", self.below_m_s, 0.0, 20.0)?;
        config_in("speed_plan.above_m_s", self.above_m_s, 0.0, 10.0)?;
        config_in("speed_plan.slowest_m_s", self.slowest_m_s, 3.0, 25.0)?;
        config_in("speed_plan.sqp_iterations", f64::from(self.sqp_iterations), 1.0, 8.0)?;
        config_in("speed_plan.iteration_budget", f64::from(self.iteration_budget), 0.0, 1e5)?;
        config_in("speed_plan.lead_s", self.lead_s, 0.0, 300.0)
    }
}

/// What a plan is made for.
#[derive(Debug, Clone, Copy)]
pub struct HorizonRequest<'a> {
    /// Road from the truck on, at least two points.
    pub profile: &'a [ProfilePoint],
    /// The truck as it reports itself, with the estimated load.
    pub limits: &'a VehicleLimits,
    /// Time, s.
    pub now_s: f64,
    /// Speed, m/s.
    pub speed_m_s: f64,
    /// Engaged gear, 1-based; 0 = neutral.
    pub gear: u8,
    /// The driver's set speed, m/s.
    pub set_speed_m_s: f64,
    /// The vehicle ahead, if there is one.
    pub lead: Option<LeadAhead>,
    /// Traffic ruled over the plan since the last one.
    pub held_up: bool,
}

/// Why there is no plan.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum HorizonFailure {
    /// The truck or the vehicle ahead is slower than is planned for.
    #[error("{speed_m_s:.1} m/s is below the slowest planned speed of {slowest_m_s:.1} m/s")]
    TooSlow {
        /// Speed found, m/s.
        speed_m_s: f64,
        /// Slowest planned speed, m/s.
        slowest_m_s: f64,
    },
    /// Too little road is left.
    #[error("{length_m:.0} m of road ahead are too short to plan")]
    RoadEnds {
        /// Length found, m.
        length_m: f64,
    },
    /// Truck or road cannot be used.
    #[error(transparent)]
    Request(#[from] PccError),
    /// No candidate was solved.
    #[error("no subproblem was solved: {status:?} after {iterations} iterations")]
    Solver {
        /// How the last one ended.
        status: SolveStatus,
        /// Interior-point iterations used.
        iterations: u32,
    },
}

/// A plan: the truck driven over the horizon.
#[derive(Debug, Clone)]
pub struct HorizonPlan {
    /// Station of node 0, m.
    pub start_s_m: f64,
    /// Step, m.
    pub h_m: f64,
    /// The drive.
    pub driven: Driven,
    /// Every subproblem was solved to tolerance.
    pub solved: bool,
    /// A fence behind a vehicle ahead shaped it.
    pub fenced: bool,
    /// Price of time that it was made with, g/s.
    pub beta_g_s: f64,
    /// Interior-point iterations.
    pub iterations: u32,
    /// Fuel, price of time and worth of the end energy, g.
    pub cost_g: f64,
}

/// What the plan wants at a station.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HorizonPoint {
    /// Speed, m/s.
    pub speed_m_s: f64,
    /// Gear or open driveline.
    pub drive: Drive,
    /// Neither fuel nor brake.
    pub coast: bool,
}

impl HorizonPlan {
    /// The plan at a station; `None` outside the horizon.
    #[must_use]
    pub fn at(&self, s_m: f64) -> Option<HorizonPoint> {
        let x = (s_m - self.start_s_m) / self.h_m;
        let n = self.driven.drive.len();
        if !(x >= 0.0 && x < n as f64) {
            return None;
        }
        let k = x as usize;
        let (a, b) = (self.driven.e_j_kg[k], self.driven.e_j_kg[k + 1]);
        Some(HorizonPoint {
            speed_m_s: libm::sqrt(2.0 * (a + (x - k as f64) * (b - a))),
            drive: self.driven.drive[k],
            coast: self.driven.p_m_s2[k] <= 0.0 && self.driven.brake_m_s2[k] <= 0.0,
        })
    }
}

/// The planner with its workspace and what it remembers of the last plan.
#[derive(Debug, Clone)]
pub struct HorizonPlanner {
    config: HorizonConfig,
    tuning: Tuning,
    solver: DefaultSolver,
    known: Option<Known>,
    last: Option<HorizonPlan>,
    clock: TripClock,
}

impl HorizonPlanner {
    /// A planner without a last plan.
    #[must_use]
    pub fn new(config: HorizonConfig, tuning: Tuning) -> Self {
        Self {
            config,
            tuning,
            solver: DefaultSolver::default(),
            known: None,
            last: None,
            clock: TripClock::default(),
        }
    }

    /// The last plan.
    #[must_use]
    pub fn last(&self) -> Option<&HorizonPlan> {
        self.last.as_ref()
    }

    /// Lateness against cruise control at the set speed, s, time behind traffic not counted.
    #[must_use]
    pub fn late_s(&self) -> f64 {
        self.clock.late_s()
    }

    /// Plans from the truck on. The last plan stays in place on failure.
    ///
    /// # Errors
    /// [`HorizonFailure`] says why there is no new plan.
    pub fn plan(&mut self, request: &HorizonRequest<'_>) -> Result<&HorizonPlan, HorizonFailure> {
        let slowest_m_s = self.config.slowest_m_s;
        let slower = request.lead.map_or(request.speed_m_s, |l| l.speed_m_s.min(request.speed_m_s));
        let near = request.lead.is_some_and(|l| l.gap_m < 2.0 * l.wanted_gap_m + 50.0);
        let speed_m_s = if near { slower } else { request.speed_m_s };
        if speed_m_s.is_nan() || speed_m_s < slowest_m_s {
            return Err(HorizonFailure::TooSlow { speed_m_s, slowest_m_s });
        }
        let known = match self.known.take() {
            Some(known) if known.fits(request, &self.config) => known,
            _ => Known::new(request, &self.config)?,
        };
        let planned = self.plan_with(&known, request);
        self.known = Some(known);
        Ok(self.last.insert(planned?))
    }

    fn plan_with(
        &mut self,
        known: &Known,
        request: &HorizonRequest<'_>,
    ) -> Result<HorizonPlan, HorizonFailure> {
        let mut budget = Budget { left: self.config.iteration_budget, used: 0 };
        let free = Setting::new(known, request, &self.config, &self.tuning)?;
        self.keep_time(known, &free, request, &mut budget)?;
        if let Some(plan) = self.behind(known, request, &free, free.cruise(), &mut budget)? {
            return Ok(plan);
        }
        let plan = self.solve(known, &free, request, None, &mut budget)?;
        let e = plan.driven.e_j_kg.clone();
        if let Some(plan) = self.behind(known, request, &free, &e, &mut budget)? {
            return Ok(plan);
        }
        let shadow_s = self.clock.shadow_time_s(free.course.n()).unwrap_or(0.0);
        self.clock.expect(plan.driven.trip_time_s(), shadow_s);
        Ok(plan)
    }

    /// The plan behind the vehicle ahead, if driving `e_j_kg` (per node) comes too near to it.
    fn behind(
        &mut self,
        known: &Known,
        request: &HorizonRequest<'_>,
        free: &Setting,
        e_j_kg: &[f64],
        budget: &mut Budget,
    ) -> Result<Option<HorizonPlan>, HorizonFailure> {
        let Some(lead) = request.lead else { return Ok(None) };
        let (truck, lead_s) = (&known.truck, self.config.lead_s);
        let fence = Fence::new(truck, &free.course, e_j_kg, &lead, lead_s);
        if !fence.cuts(free.course.h_m, e_j_kg) {
            return Ok(None);
        }
        let points = request.profile;
        let last = points.partition_point(|p| p.s_m <= points[0].s_m + FENCED_M).max(2);
        let near = HorizonRequest { profile: &points[..last.min(points.len())], ..*request };
        let mut setting = Setting::new(known, &near, &self.config, &self.tuning)?;
        let e = &e_j_kg[..=setting.course.n().min(e_j_kg.len() - 1)];
        let fence = Fence::new(truck, &setting.course, e, &lead, lead_s);
        setting.stay_behind(&fence, &lead);
        self.solve(known, &setting, request, Some(&fence), budget).map(Some)
    }

    /// Moves the shadow cruise control on; at the first plan finds the price of time.
    fn keep_time(
        &mut self,
        known: &Known,
        setting: &Setting,
        request: &HorizonRequest<'_>,
        budget: &mut Budget,
    ) -> Result<(), HorizonFailure> {
        let (s_m, h_m) = (setting.course.start_s_m, setting.course.h_m);
        let e = self.clock.advance(s_m, request.now_s, request.held_up);
        let start = e.unwrap_or(setting.start_e).min(setting.hold[0]);
        let shadow =
            cruise_energies(&known.truck, &setting.course, start, &setting.hold, &setting.hold)?;
        self.clock.set_shadow(s_m, h_m, request.now_s, shadow);
        if self.clock.price_g_s().is_none() {
            let guess = known.beta_guess(request.set_speed_m_s);
            let goal_s = self.clock.shadow_time_s(setting.course.n()).unwrap_or(0.0);
            let problem = setting.problem(known, &self.tuning, TimeRule::AtMost(goal_s));
            let (e, gears) = setting.searched(known, &problem, guess);
            let iterations = Iterations { most: 3, rest_m_s: 0.1 };
            let solver = &mut self.solver;
            let probe =
                iterate(&problem, &e, &gears, guess, iterations, &mut |sub, end, time, f| {
                    budget.solve(solver, sub, end, time, f)
                });
            let found = if is_usable(probe.status) { probe.beta_g_s } else { guess };
            self.clock.begin(found.clamp(0.3 * guess, 1.1 * guess));
        }
        Ok(())
    }

    /// The better of the candidates, or behind a fence the only one.
    fn solve(
        &mut self,
        known: &Known,
        setting: &Setting,
        request: &HorizonRequest<'_>,
        fence: Option<&Fence>,
        budget: &mut Budget,
    ) -> Result<HorizonPlan, HorizonFailure> {
        let beta = self.clock.price_g_s().unwrap_or(0.0);
        let mut tuning = self.tuning;
        if fence.is_some() {
            tuning.accel_penalty_g_s3_m2 = tuning.accel_penalty_g_s3_m2.max(FENCED_ACCEL_PENALTY);
        }
        let mut problem = setting.problem(known, &tuning, TimeRule::Price(beta));
        problem.start_gear = request.gear.checked_sub(1).map(Drive::Gear);
        if self.config.eco_roll && fence.is_none() {
            problem.may_roll = setting.may_roll(known);
        }
        let most = self.config.sqp_iterations as usize;
        let (solver, last) = (&mut self.solver, &self.last);
        let mut run = |problem: &Problem<'_>, e: &[f64], gears: &[Drive], most: usize| {
            let iterations = Iterations { most, ..Iterations::TRIP };
            let mut solve = |sub: &Subproblem, end, time, f: Option<&[f64]>| {
                budget.solve(solver, sub, end, time, f)
            };
            let profile = if problem.may_roll.is_empty() {
                iterate(problem, e, gears, beta, iterations, &mut solve)
            } else {
                eco_roll::rolled(problem, e, gears, beta, iterations, &mut solve)
                    .unwrap_or_else(|| Profile::failed((e, gears)))
            };
            setting.driven(problem, profile, beta)
        };
        let warm = last.as_ref().and_then(|plan| setting.moved_on(plan));
        let mut best = None;
        let mut failed = SolveStatus::Failed;
        let mut keep = |candidate: Candidate, gain_g: f64| {
            let driven = &candidate.driven;
            let usable = is_usable(candidate.profile.status)
                && !(0..driven.drive.len()).any(|k| eco_roll::runs_away(driven, k));
            if !usable {
                failed = candidate.profile.status;
            } else if best
                .as_ref()
                .is_none_or(|kept: &Candidate| candidate.cost_g + gain_g < kept.cost_g)
            {
                best = Some(candidate);
            }
        };
        if let Some(fence) = fence {
            problem.fence_s = Some(fence.earliest_s.clone());
            let e = &fence.follow_e_j_kg;
            let gears = setting.gears_along(known, &problem, e);
            keep(run(&problem, e, &gears, most), 0.0);
        } else {
            let (e, gears) = setting.searched(known, &problem, beta);
            let same = warm.as_ref().is_some_and(|warm| warm.1 == gears);
            if let Some((e, gears)) = warm {
                keep(run(&problem, &e, &gears, most), 0.0);
            }
            if !same {
                keep(run(&problem, &e, &gears, most), SWITCH_GAIN_G);
            }
        }
        let Some(best) = best else {
            return Err(HorizonFailure::Solver { status: failed, iterations: budget.used });
        };
        let iterations = budget.used;
        Ok(HorizonPlan {
            start_s_m: setting.course.start_s_m,
            h_m: setting.course.h_m,
            solved: best.profile.status == SolveStatus::Solved,
            driven: best.driven,
            fenced: fence.is_some(),
            beta_g_s: beta,
            iterations,
            cost_g: best.cost_g,
        })
    }
}

/// Interior-point iterations that are left.
struct Budget {
    left: u32,
    used: u32,
}

impl Budget {
    fn solve(
        &mut self,
        solver: &mut DefaultSolver,
        sub: &Subproblem,
        terminal: Terminal,
        time: TimeRule,
        fence_s: Option<&[f64]>,
    ) -> Solution {
        if self.used >= self.left {
            return Solution::default();
        }
        let found = solver.solve(sub, terminal, time, fence_s);
        self.used += found.iterations;
        if self.used > self.left { Solution::default() } else { found }
    }
}

fn is_usable(status: SolveStatus) -> bool {
    matches!(status, SolveStatus::Solved | SolveStatus::AlmostSolved)
}
