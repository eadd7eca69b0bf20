//! Successive linearisation: solve, move, choose gears, again until the profile rests.
//!
//! Gears are frozen during the iteration, because a gear that flips back and forth would keep the
//! profile from resting. They come from a joint search over speed and gear on a coarse grid at the
//! current price of time; the places of the shifts are then refined once along the profile, among
//! gears that the search uses nearby, and kept if the driven plan is better.
//!
//! Every subproblem is linearised around a *driven* profile, one that the truth reaches in the
//! chosen gears, so that it has a feasible point.

use alloc::vec::Vec;
use core::ops::Range;

use super::eco_roll;
use super::lin::{Linearisation, Subproblem, Terminal, TimeRule};
use super::solution::{Solution, SolveStatus};
use crate::pcc::model::{Course, Drive, Truck, Tuning, drive_leg, drive_profile, needed_before};
use crate::pcc::search::{
    EngineTables, GearChoice, SearchGrid, SearchPrices, choose_gears, gear_bit, search,
};

/// A planning problem on a course.
#[derive(Debug, Clone)]
pub struct Problem<'a> {
    /// The truck.
    pub truck: &'a Truck,
    /// The course.
    pub course: &'a Course,
    /// Tuning.
    pub tuning: &'a Tuning,
    /// Lowest energy per node, J/kg.
    pub e_min: Vec<f64>,
    /// Highest energy per node, J/kg.
    pub e_max: Vec<f64>,
    /// Energy at node 0, J/kg.
    pub start_e: f64,
    /// What holds at the end.
    pub terminal: Terminal,
    /// How time enters.
    pub time: TimeRule,
    /// Earliest time per node behind a vehicle ahead, s; `-∞` where it does not bind.
    pub fence_s: Option<Vec<f64>>,
    /// Gear engaged at the start.
    pub start_gear: Option<Drive>,
    /// How part load between fuel cut-off and zero wheel force is charged.
    pub cut: CutModel,
    /// Intervals held at fuel cut-off (empty: none).
    pub forced_cut: Vec<bool>,
    /// Intervals in which the driveline may be open (empty: in none).
    pub may_roll: Vec<bool>,
}

/// How the fuel map is made convex between fuel cut-off and zero wheel force.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CutModel {
    /// Straight from zero at cut-off: the lower convex hull of a map that jumps there.
    Hull,
    /// The map's own slope, its fixed part charged at cut-off too.
    Charged,
}

/// Iteration limits of the successive linearisation.
#[derive(Debug, Clone, Copy)]
pub struct Iterations {
    /// Most subproblems.
    pub most: usize,
    /// Largest change of speed at rest, m/s.
    pub rest_m_s: f64,
}

impl Iterations {
    /// For a whole trip.
    pub const TRIP: Self = Self { most: 8, rest_m_s: 0.03 };
    /// For a whole trip with an open driveline: there is no traction that makes up for what the
    /// linearisation missed, so the profile has to rest closer.
    pub const ROLLING_TRIP: Self = Self { most: 14, rest_m_s: 0.004 };
}

/// Result of the successive linearisation.
#[derive(Debug, Clone)]
pub struct Profile {
    /// How the last subproblem ended.
    pub status: SolveStatus,
    /// Energies per node, J/kg.
    pub e_j_kg: Vec<f64>,
    /// Gear per interval.
    pub gears: Vec<Drive>,
    /// Price of time, g/s.
    pub beta_g_s: f64,
    /// Interior-point iterations in all.
    pub iterations: u32,
    /// Subproblems solved.
    pub subproblems: u32,
    /// Worth of traction per interval, g per m/s².
    pub worth: Vec<f64>,
    /// Power-limited intervals.
    pub limited: Vec<bool>,
    /// Intervals at fuel cut-off.
    pub cut: Vec<bool>,
}

impl Profile {
    /// No solution; energies and gears of something that can be driven instead.
    #[must_use]
    pub fn failed((e, gears): (&[f64], &[Drive])) -> Self {
        let n = gears.len();
        Self {
            status: SolveStatus::Failed,
            e_j_kg: e.to_vec(),
            gears: gears.to_vec(),
            beta_g_s: 0.0,
            iterations: 0,
            subproblems: 0,
            worth: alloc::vec![0.0; n],
            limited: alloc::vec![false; n],
            cut: alloc::vec![false; n],
        }
    }
}

/// A solver of subproblems; the last argument are the fence's earliest times.
pub type Solver<'s> = dyn FnMut(&Subproblem, Terminal, TimeRule, Option<&[f64]>) -> Solution + 's;

/// Length of an interval of the gear search, m.
const SEARCH_INTERVAL_M: f64 = 100.0;
/// Energy steps of the gear search that full traction covers in one interval.
const SEARCH_STEPS: f64 = 14.0;
/// Length of an interval of the search in a tube, m.
const TUBE_INTERVAL_M: f64 = 25.0;
/// Energy steps that full traction covers in one interval of the tube.
const TUBE_STEPS: f64 = 12.0;
/// Half width of the tube in energy steps.
const TUBE_HALF_STEPS: f64 = 14.0;

impl Problem<'_> {
    /// Gears and a first profile from the coarse joint search at the price `beta_g_s`; `otherwise`
    /// where the grid holds no path. `fineness` scales the number of energy steps.
    #[must_use]
    pub fn first_profile(
        &self,
        tables: &EngineTables,
        beta_g_s: f64,
        fineness: f64,
        otherwise: (&[f64], &[Drive]),
    ) -> (Vec<f64>, Vec<Drive>) {
        let (n, h) = (self.course.n(), self.course.h_m);
        let merge = (libm::round(SEARCH_INTERVAL_M / h) as usize).clamp(1, n);
        let step = (self.reach_j_kg(merge) / (SEARCH_STEPS * fineness)).clamp(0.5, 4.0);
        self.searched(tables, beta_g_s, (&self.e_min, &self.e_max), merge, step)
            .unwrap_or_else(|| (otherwise.0.to_vec(), otherwise.1.to_vec()))
    }

    /// Gears and profile from the joint search on a finer grid in a tube around the energies `e`;
    /// `None` where the tube holds no path.
    #[must_use]
    pub fn tube_profile(
        &self,
        tables: &EngineTables,
        beta_g_s: f64,
        e: &[f64],
    ) -> Option<(Vec<f64>, Vec<Drive>)> {
        let (n, h) = (self.course.n(), self.course.h_m);
        let merge = (libm::round(TUBE_INTERVAL_M / h) as usize).clamp(1, n);
        let step = (self.reach_j_kg(merge) / TUBE_STEPS).clamp(0.1, 2.0);
        let half = TUBE_HALF_STEPS * step;
        let low: Vec<f64> =
            e.iter().zip(&self.e_min).map(|(e, low)| (e - half).max(low.min(*e))).collect();
        let high: Vec<f64> =
            e.iter().zip(&self.e_max).map(|(e, high)| (e + half).min(*high)).collect();
        self.searched(tables, beta_g_s, (&low, &high), merge, step)
    }

    /// Energy that full traction adds in `merge` intervals, J/kg.
    fn reach_j_kg(&self, merge: usize) -> f64 {
        let (truck, n) = (self.truck, self.course.n());
        let v = libm::sqrt(2.0 * self.e_max.iter().sum::<f64>() / (n + 1) as f64);
        truck.traction_m_s2(truck.strongest_gear(v), v) * self.course.h_m * merge as f64
    }

    fn searched(
        &self,
        tables: &EngineTables,
        beta_g_s: f64,
        bounds: (&[f64], &[f64]),
        merge: usize,
        step_e: f64,
    ) -> Option<(Vec<f64>, Vec<Drive>)> {
        let n = self.course.n();
        let end = match self.terminal {
            Terminal::Fixed(e) => Some(e),
            Terminal::Soft { .. } => None,
        };
        let grid = SearchGrid::new(self.course, merge, step_e, bounds, self.start_e, end);
        let coarse = grid.n();
        let range = |k: usize| SearchGrid::node(n, coarse, k)..SearchGrid::node(n, coarse, k + 1);
        let may_roll: Vec<bool> = match self.may_roll.as_slice() {
            [] => Vec::new(),
            may => (0..coarse).map(|k| may[range(k)].iter().all(|m| *m)).collect(),
        };
        let prices = SearchPrices {
            beta_g_s,
            shift_fuel_g: self.tuning.shift_fuel_g,
            accel_penalty_g_s3_m2: self.tuning.accel_penalty_g_s3_m2,
            brake_m_s2: self.course.brake_m_s2,
            free_cut: true,
            may_roll: &may_roll,
        };
        let path = search(self.truck, tables, &grid, &prices, self.start_gear)?;
        let (mut e, mut gears) = (Vec::with_capacity(n + 1), Vec::with_capacity(n));
        for k in 0..coarse {
            let Range { start: a, end: b } = range(k);
            for i in a..b {
                let f = (i - a) as f64 / (b - a) as f64;
                e.push(path.e_j_kg[k] + f * (path.e_j_kg[k + 1] - path.e_j_kg[k]));
                gears.push(path.gears[k]);
            }
        }
        e.push(path.e_j_kg[coarse]);
        for (k, value) in e.iter_mut().enumerate() {
            *value = value.min(self.e_max[k]).max(self.e_min[k]);
        }
        eco_roll::close_short(&mut gears, eco_roll::shortest(self.course, self.tuning));
        Some((e, gears))
    }
}

/// Runs the iteration from the profile `start` (energies per node) in `gears`.
pub fn iterate(
    problem: &Problem<'_>,
    start: &[f64],
    gears: &[Drive],
    beta_g_s: f64,
    iterations: Iterations,
    solve: &mut Solver<'_>,
) -> Profile {
    let (truck, course, tuning) = (problem.truck, problem.course, problem.tuning);
    let n = course.n();
    let mut sub = Subproblem::default();
    let mut now = Profile { beta_g_s, ..Profile::failed((start, gears)) };
    hold_minimum(problem, &mut now);
    for _ in 0..iterations.most {
        let beta = match problem.time {
            TimeRule::Price(beta) => beta,
            TimeRule::AtMost(_) => now.beta_g_s,
        };
        // Where a gear is too weak for the minimum speed the truck goes on at full power.
        let targets: Vec<f64> =
            now.e_j_kg.iter().zip(&problem.e_min).map(|(e, low)| e.max(*low)).collect();
        let driven = drive_profile(truck, course, &targets, &now.gears, &[], 0.0).e_j_kg;
        let (gears, cut) = (&now.gears, problem.cut);
        let point = Linearisation { e_j_kg: &driven, gears, beta_g_s: beta, cut };
        sub.linearise(truck, course, tuning, &point);
        sub.force_cut(&problem.forced_cut);
        bounds(problem, &driven, &now.gears, &mut sub);
        let mut found = solve(&sub, problem.terminal, problem.time, problem.fence_s.as_deref());
        now.iterations += found.iterations;
        now.subproblems += 1;
        if found.status == SolveStatus::Infeasible && problem.time != TimeRule::Price(beta) {
            // These gears are too slow for the trip time: as fast as a dear second makes it.
            let dear = TimeRule::Price((2.0 * beta).clamp(1.0, 30.0));
            found = solve(&sub, problem.terminal, dear, problem.fence_s.as_deref());
            now.iterations += found.iterations;
            now.subproblems += 1;
        }
        if !matches!(found.status, SolveStatus::Solved | SolveStatus::AlmostSolved) {
            if now.status == SolveStatus::Failed {
                now.status = found.status;
            }
            return now;
        }
        now.status = found.status;
        let mut step = 0.0f64;
        for k in 1..=n {
            let e = found.e_j_kg[k].clamp(sub.e_min[k].min(sub.e_max[k]), sub.e_max[k]);
            step = step.max((libm::sqrt(2.0 * e) - libm::sqrt(2.0 * now.e_j_kg[k])).abs());
            now.e_j_kg[k] = e;
        }
        now.e_j_kg[0] = problem.start_e;
        now.beta_g_s = found.beta_g_s.max(0.0);
        for k in 0..n {
            let own = sub.marginal(k, sub.p(k, &now.e_j_kg, found.b_m_s2[k]).max(0.0));
            let price = found.traction_price[k];
            now.worth[k] = (own + price).max(0.0);
            now.limited[k] = price > 0.02 * own;
            let forced = problem.forced_cut.get(k).copied().unwrap_or(false);
            now.cut[k] = forced || found.cut_price[k] > 1e-3 * own;
        }
        if step < iterations.rest_m_s {
            break;
        }
    }
    now
}

/// Makes a profile that can be driven above the minimum speed. Where full load in the planned gears
/// ends below it, the truck comes faster; where that is not enough either, the strongest gear
/// drives until the planned one holds the speed.
fn hold_minimum(problem: &Problem<'_>, now: &mut Profile) {
    let (truck, course) = (problem.truck, problem.course);
    let n = course.n();
    let mut floor = problem.e_min.clone();
    for k in (0..n).rev() {
        let before = needed_before(truck, course, k, now.gears[k], floor[k], floor[k + 1]);
        floor[k] = before.min(problem.e_max[k]).max(floor[k]);
    }
    let mut e = problem.start_e;
    let mut rescued = false;
    for k in 0..n {
        let target = now.e_j_kg[k + 1].max(floor[k + 1]);
        now.e_j_kg[k + 1] = target;
        let mut leg = drive_leg(truck, course, k, now.gears[k], e, target);
        let needed = if rescued { e.min(target) } else { problem.e_min[k + 1] };
        rescued = leg.end_e_j_kg < needed * (1.0 - 1e-6);
        if rescued {
            let strongest = Drive::Gear(truck.strongest_gear(libm::sqrt(2.0 * e)) as u8);
            let other = drive_leg(truck, course, k, strongest, e, target);
            if other.end_e_j_kg > leg.end_e_j_kg {
                now.gears[k] = strongest;
                leg = other;
            }
        }
        e = leg.end_e_j_kg;
    }
}

/// Gears chosen anew along a profile, among those used nearby, at the profile's worth of traction.
#[must_use]
pub(crate) fn refined_gears(problem: &Problem<'_>, profile: &Profile) -> Vec<Drive> {
    let reach = libm::round(2.0 * SEARCH_INTERVAL_M / problem.course.h_m) as usize;
    let mut gears = choose_gears(
        problem.truck,
        problem.course,
        &profile.e_j_kg,
        &GearChoice {
            shift_fuel_g: problem.tuning.shift_fuel_g,
            worth: Some((&profile.worth, &profile.limited)),
            start: problem.start_gear,
            allowed: Some(&nearby_gears(&profile.gears, reach)),
            may_roll: &problem.may_roll,
        },
    );
    eco_roll::close_short(&mut gears, eco_roll::shortest(problem.course, problem.tuning));
    gears
}

/// Bit set of gears used within `reach` intervals, per interval.
fn nearby_gears(gears: &[Drive], reach: usize) -> Vec<u64> {
    (0..gears.len())
        .map(|k| {
            let range = k.saturating_sub(reach)..(k + reach + 1).min(gears.len());
            gears[range].iter().map(|d| gear_bit(*d)).fold(0, |a, b| a | b)
        })
        .collect()
}

/// Part of the lowest energy by which a rolling truck may have missed it and still be asked for it.
const ROLLING_BELOW: f64 = 4e-3;

/// Energy bounds of a subproblem: the problem's, widened to the driven profile so that there is a
/// feasible point, and once gears are frozen the speed ranges of the gears.
fn bounds(problem: &Problem<'_>, driven: &[f64], gears: &[Drive], sub: &mut Subproblem) {
    sub.e_max.copy_from_slice(&problem.e_max);
    for (low, (&bound, &e)) in sub.e_min.iter_mut().zip(problem.e_min.iter().zip(driven)) {
        *low = bound.min(e * (1.0 - 1e-4));
    }
    for (k, &drive) in gears.iter().enumerate() {
        let Drive::Gear(g) = drive else {
            // Rolling cannot be helped by traction: a bound that gave way to what was driven would
            // give way again in every iteration. Who is only just below it comes faster.
            let bound = problem.e_min[k + 1];
            if driven[k + 1] > bound * (1.0 - ROLLING_BELOW) {
                sub.e_min[k + 1] = bound;
            }
            continue;
        };
        let (low, high) = problem.truck.speed_range_m_s(g as usize);
        for node in [k, k + 1] {
            let here = driven[node];
            sub.e_min[node] = sub.e_min[node].max((0.5 * low * low).min(here * 0.995));
            sub.e_max[node] = sub.e_max[node].min((0.5 * high * high).max(here * 1.005));
        }
    }
}
