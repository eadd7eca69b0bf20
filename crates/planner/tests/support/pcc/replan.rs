//! Replans of a few kilometres out of a whole trip, for the benches: what a receding horizon asks
//! of the solver, with gears and first profile from the trip.

use planner::pcc::model::{Course, Drive, Driven};
use planner::pcc::solve::{
    CutModel, Iterations, Problem, Profile, Solver, Terminal, TimeRule, iterate,
};
use planner::pcc::trip::Trip;

/// Length of a replan, m.
pub(crate) const LENGTH_M: f64 = 4_000.0;
/// Subproblems of a replan.
pub(crate) const SUBPROBLEMS: usize = 2;

/// A window of a trip.
pub(crate) struct Window {
    course: Course,
    e_min: Vec<f64>,
    e_max: Vec<f64>,
    e: Vec<f64>,
    gears: Vec<Drive>,
    beta_g_s: f64,
}

/// Windows of [`LENGTH_M`] every `every` steps along a driven plan. The truck enters each 2 J/kg
/// (about 0.1 m/s) beside the plan, so that there is something to correct.
pub(crate) fn windows(trip: &Trip, driven: &Driven, beta_g_s: f64, every: usize) -> Vec<Window> {
    let n = (LENGTH_M / trip.course.h_m).round() as usize;
    (0..=trip.course.n().saturating_sub(n))
        .step_by(every)
        .map(|k| {
            let (nodes, intervals) = (k..=k + n, k..k + n);
            let mut e = driven.e_j_kg[nodes.clone()].to_vec();
            e[0] -= 2.0;
            Window {
                course: Course {
                    start_s_m: trip.course.s_m(k),
                    h_m: trip.course.h_m,
                    road: trip.course.road[intervals.clone()].to_vec(),
                    limit_m_s: trip.course.limit_m_s[nodes.clone()].to_vec(),
                    brake_m_s2: trip.course.brake_m_s2,
                },
                e_min: trip.e_min[nodes.clone()].to_vec(),
                e_max: trip.e_max[nodes].to_vec(),
                e,
                gears: driven.drive[intervals].to_vec(),
                beta_g_s,
            }
        })
        .collect()
}

impl Window {
    /// Plans the window anew.
    pub(crate) fn replan(&self, trip: &Trip, solver: &mut Solver<'_>) -> Profile {
        let n = self.course.n();
        // Fuel that a unit of energy at the end is worth: regained at 1.15, spared at 0.85.
        let worth = 0.052 * trip.truck.mass_kg / 1e3;
        let problem = Problem {
            truck: &trip.truck,
            course: &self.course,
            tuning: &trip.tuning,
            e_min: self.e_min.clone(),
            e_max: self.e_max.clone(),
            start_e: self.e[0],
            terminal: Terminal::Soft {
                reference: self.e[n],
                pay: 1.15 * worth,
                credit: 0.85 * worth,
            },
            time: TimeRule::Price(self.beta_g_s),
            fence_s: None,
            start_gear: None,
            cut: CutModel::Hull,
            forced_cut: Vec::new(),
            may_roll: Vec::new(),
        };
        let iterations = Iterations { most: SUBPROBLEMS, rest_m_s: 0.0 };
        iterate(&problem, &self.e, &self.gears, self.beta_g_s, iterations, solver)
    }
}
