//! Speeds once more, with the engine as it is: dynamic programming in a narrow tube around the plan.
//!
//! A subproblem takes an interval's fuel for one parabola over all tractions. A measured map bends at
//! the torques of its test bench, and once more where the engine begins to pull; a plan that costs
//! least sits on these bends for long. Here each node of the best plan gets a few energies around its
//! own, each interval is driven from each to each with the map as it is, and the cheapest way through
//! is kept if it is cheaper when it is driven; closer and closer tubes follow. Gears stay.
//!
//! Two things are not sought. Fuel cut-off where the plan injects, and injection amid a cut-off: with a
//! map that jumps there, full power and cut-off by turns would pay on a flat road. And a torque that goes up and down between two
//! ends of a dent in the map, from which the price of a changed acceleration keeps, as far as the
//! cheapest way to a node tells how it came there.

use alloc::vec::Vec;

use super::planner::Best;
use crate::pcc::model::{CUT_ROUNDING, Demand, Drive, coast_energy, demand_m_s2, duration_s};
use crate::pcc::solve::{Problem, Profile};

/// Acceleration from an energy to the neighbouring one of the next node, one after the other, m/s²: at
/// 20 m/s and 25 m energies of speeds 0.12 to 0.005 m/s apart. Far ones come first: where fuel is dear
/// at low load, close ones alone find many short bursts in place of few long ones.
const STEPS_M_S2: [f64; 4] = [0.096, 0.032, 0.012, 0.004];
/// Most tubes of one step.
const ROUNDS: usize = 4;
/// Gain of a tube, relative, below which no other of its step follows.
const LEAST_GAIN: f64 = 2e-5;
/// Most prices of time that are tried in a tube.
const PRICES: usize = 8;
/// Factor from one price to the next until they enclose the trip time.
const PRICE_STEP: f64 = 1.1;
/// Energies on either side of the plan.
const HALF: usize = 6;
/// Energies of a node.
const LEVELS: usize = 2 * HALF + 1;
/// Part of the tuning's price of a changed acceleration that is paid here. All of it leaves 0.5 % of
/// the fuel on a map with dents to a reference that pays nothing for it; with none the force changes
/// half as much again as that reference's, with this a third as much (docs/results/pcc.md).
const RESTLESS_SHARE: f64 = 0.4;

/// A figure per energy of a node.
type Levels = [f64; LEVELS];

/// Improves the best plan in its gears.
pub(super) fn settle_in_tubes(problem: &Problem<'_>, best: &mut Best<'_>) {
    for step_m_s2 in STEPS_M_S2 {
        let step_j_kg = step_m_s2 * problem.course.h_m;
        for _ in 0..ROUNDS {
            let before_g = best.cost_g();
            improve(problem, best, step_j_kg);
            if best.cost_g() > before_g * (1.0 - LEAST_GAIN) {
                break;
            }
        }
    }
}

/// Offers the cheapest ways through one tube that come in time.
fn improve(problem: &Problem<'_>, best: &mut Best<'_>, step_j_kg: f64) {
    let Some(kept) = &best.kept else { return };
    let from = kept.profile.clone();
    let tube = Tube::around(problem, &kept.driven.e_j_kg, &from.gears, step_j_kg);
    let (mut low, mut high) = (None, None);
    let mut beta_g_s = from.beta_g_s.max(f64::MIN_POSITIVE);
    for _ in 0..PRICES {
        let Some(e_j_kg) = tube.cheapest(beta_g_s) else { break };
        if best.is_late(tube.time_s(&e_j_kg)) {
            low = Some(beta_g_s);
        } else {
            high = Some(beta_g_s);
            let cut = (0..from.gears.len())
                .map(|k| demand(problem, &from.gears, &e_j_kg, k) < CUT_ROUNDING)
                .collect();
            // The price of time that is told stays a subproblem's: a tube's are too far apart.
            best.offer(problem, Profile { e_j_kg, cut, ..from.clone() });
        }
        beta_g_s = match (low, high) {
            (Some(low), Some(high)) => 0.5 * (low + high),
            (Some(low), None) => low * PRICE_STEP,
            (None, Some(high)) => high / PRICE_STEP,
            (None, None) => beta_g_s,
        };
    }
}

/// What interval `k` of a profile asks for, m/s².
fn demand(problem: &Problem<'_>, gears: &[Drive], e_j_kg: &[f64], k: usize) -> f64 {
    demand_m_s2(problem.truck, problem.course, k, gears[k], e_j_kg[k], e_j_kg[k + 1])
}

/// What an interval of the plan does.
#[derive(Debug, Clone, Copy)]
struct Planned {
    /// Whether its fuel is cut off.
    is_cut: bool,
    /// Whether that of its neighbours is as well.
    is_amid_cut: bool,
}

/// Energies per node, and what each interval costs between them.
struct Tube {
    h_m: f64,
    /// Price of a changed acceleration, g s⁴/m².
    restless_g_s4_m2: f64,
    /// Energies per node, J/kg; infinite where the truck must not be.
    e_j_kg: Vec<Levels>,
    /// Per interval `[from][to]`.
    edges: Vec<Edges>,
}

impl Tube {
    fn around(problem: &Problem<'_>, plan_j_kg: &[f64], gears: &[Drive], step_j_kg: f64) -> Self {
        let (truck, course, n) = (problem.truck, problem.course, gears.len());
        let allowed = |k: usize, at: f64| {
            let plan = plan_j_kg[k];
            let inside = at >= problem.e_min[k].min(plan) && at <= problem.e_max[k].max(plan);
            if inside { at } else { f64::INFINITY }
        };
        let asked: Vec<f64> = (0..n).map(|k| demand(problem, gears, plan_j_kg, k)).collect();
        // Where nothing drives or brakes each energy leads to one.
        let coasts = |k: usize| gears[k] == Drive::Neutral || asked[k].abs() < CUT_ROUNDING;
        let mut e_j_kg: Vec<Levels> = Vec::with_capacity(n + 1);
        for (k, &plan) in plan_j_kg.iter().enumerate() {
            e_j_kg.push(core::array::from_fn(|j| {
                if k > 0 && coasts(k - 1) {
                    let before = e_j_kg[k - 1][j];
                    let coasted = || coast_energy(truck, course, k - 1, gears[k - 1], before);
                    if before.is_finite() { allowed(k, coasted()) } else { before }
                } else if j == HALF {
                    plan
                } else if k == 0 || k == n {
                    f64::INFINITY
                } else {
                    allowed(k, plan + (j as f64 - HALF as f64) * step_j_kg)
                }
            }));
        }
        let tuning = problem.tuning;
        let mut tube = Self {
            h_m: course.h_m,
            restless_g_s4_m2: RESTLESS_SHARE * tuning.accel_change_penalty_g_s4_m2,
            e_j_kg,
            edges: Vec::with_capacity(n),
        };
        for (k, &drive) in gears.iter().enumerate() {
            let around = &asked[k.saturating_sub(1)..(k + 2).min(n)];
            let plan = Planned {
                is_cut: asked[k] < CUT_ROUNDING,
                is_amid_cut: around.iter().all(|p| *p < CUT_ROUNDING),
            };
            tube.edges.push(tube.edges(problem, k, drive, plan));
        }
        tube
    }

    /// What interval `k` takes between its energies.
    fn edges(&self, problem: &Problem<'_>, k: usize, drive: Drive, plan: Planned) -> Edges {
        let (truck, course) = (problem.truck, problem.course);
        let mut edges = [[Edge::NONE; LEVELS]; LEVELS];
        let edge = |from: usize, to: usize, rate_g_s: f64| {
            let a = self.accel_m_s2(k, from, to);
            let rate_g_s = rate_g_s + problem.tuning.accel_penalty_g_s3_m2 * a * a;
            let time_s = duration_s(self.h_m, self.e_j_kg[k][from], self.e_j_kg[k + 1][to]);
            Edge { cost_g: (rate_g_s * time_s) as f32, time_s: time_s as f32 }
        };
        let Drive::Gear(gear) = drive else {
            for (j, row) in edges.iter_mut().enumerate() {
                if self.e_j_kg[k + 1][j].is_finite() {
                    row[j] = edge(j, j, truck.idle_fuel_g_s());
                }
            }
            return edges;
        };
        // The energies of a node lie at equal distances, or nearly: pairs of one sum share their mean.
        for sum in 0..2 * LEVELS - 1 {
            let pairs = sum.saturating_sub(LEVELS - 1)..=sum.min(LEVELS - 1);
            let drivable = |from: &usize| {
                self.e_j_kg[k][*from].is_finite() && self.e_j_kg[k + 1][sum - from].is_finite()
            };
            let Some(one) = pairs.clone().find(drivable) else { continue };
            let mean = 0.5 * (self.e_j_kg[k][one] + self.e_j_kg[k + 1][sum - one]);
            let at = truck.at(gear as usize, libm::sqrt(2.0 * mean));
            for from in pairs.filter(drivable) {
                let to = sum - from;
                let ends_j_kg = (self.e_j_kg[k][from], self.e_j_kg[k + 1][to]);
                let asked = Demand::with(truck, course, k, drive, Some(at), ends_j_kg);
                let p = asked.needed_m_s2;
                let pulls = p >= CUT_ROUNDING;
                let is_out_of_reach = p > asked.limit_m_s2 || p < -course.brake_m_s2;
                if is_out_of_reach || pulls && plan.is_amid_cut {
                    continue;
                }
                let p = if pulls { p } else { 0.0 };
                let rate_g_s = if plan.is_cut { at.fuel_g_s(p) } else { at.fuel_charged_g_s(p) };
                edges[from][to] = edge(from, to, rate_g_s);
            }
        }
        edges
    }

    fn accel_m_s2(&self, k: usize, from: usize, to: usize) -> f64 {
        (self.e_j_kg[k + 1][to] - self.e_j_kg[k][from]) / self.h_m
    }

    fn time_s(&self, e_j_kg: &[f64]) -> f64 {
        e_j_kg.windows(2).map(|w| duration_s(self.h_m, w[0], w[1])).sum()
    }

    /// Energies of the cheapest way at a price of time; `None` where there is none.
    fn cheapest(&self, beta_g_s: f64) -> Option<Vec<f64>> {
        let mut ways = [Way::NONE; LEVELS];
        ways[HALF].cost_g = 0.0;
        let mut came_from = Vec::with_capacity(self.edges.len());
        for (k, edges) in self.edges.iter().enumerate() {
            let mut next = [Way::NONE; LEVELS];
            let mut before = [0_u8; LEVELS];
            for (from, way) in ways.iter().enumerate().filter(|(_, way)| way.cost_g.is_finite()) {
                for (to, edge) in
                    edges[from].iter().enumerate().filter(|(_, e)| e.cost_g.is_finite())
                {
                    let accel = self.accel_m_s2(k, from, to);
                    let change = if k == 0 { 0.0 } else { accel - way.accel_m_s2 };
                    let cost_g = way.cost_g
                        + f64::from(edge.cost_g)
                        + beta_g_s * f64::from(edge.time_s)
                        + self.restless_g_s4_m2 * change * change;
                    if cost_g < next[to].cost_g {
                        next[to] = Way { cost_g, accel_m_s2: accel };
                        before[to] = from as u8;
                    }
                }
            }
            ways = next;
            came_from.push(before);
        }
        let mut at = HALF;
        if ways[at].cost_g.is_infinite() {
            return None;
        }
        let mut e_j_kg: Vec<f64> = self.e_j_kg.iter().map(|e| e[HALF]).collect();
        for (k, before) in came_from.iter().enumerate().rev() {
            at = usize::from(before[at]);
            e_j_kg[k] = self.e_j_kg[k][at];
        }
        Some(e_j_kg)
    }
}

/// What an interval takes from an energy to one of the next node.
#[derive(Debug, Clone, Copy)]
struct Edge {
    /// Fuel and the price of acceleration, g; infinite where it cannot be driven.
    cost_g: f32,
    time_s: f32,
}

impl Edge {
    const NONE: Self = Self { cost_g: f32::INFINITY, time_s: 0.0 };
}

/// `[from][to]`.
type Edges = [[Edge; LEVELS]; LEVELS];

/// The cheapest way to an energy of a node, and the acceleration that it comes with.
#[derive(Debug, Clone, Copy)]
struct Way {
    cost_g: f64,
    accel_m_s2: f64,
}

impl Way {
    const NONE: Self = Self { cost_g: f64::INFINITY, accel_m_s2: 0.0 };
}
