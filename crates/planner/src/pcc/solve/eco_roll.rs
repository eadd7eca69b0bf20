//! Eco-roll: coasting phases with the driveline open.
//!
//! In gear without fuel the engine's own drag slows the truck; in neutral the truck keeps that
//! energy and the engine burns its idle fuel. Opening interval `k` of a plan gains, in g,
//!
//! `fuel(p) Δt - idle Δt + κ (D - p)`,
//!
//! `κ` the worth of traction there (the multiplier of the dynamics), `D` the engine's drag, `p` the
//! indicated traction that the plan uses (0 at fuel cut-off, `D` at zero wheel force). Phases are
//! the runs of intervals with the largest sum, if it pays for two shifts and the phase is at least
//! `eco_roll_dwell_m` long. Only intervals that need no more than zero wheel force and no brake can
//! be opened.
//!
//! **Runaway rule.** A truck in neutral has lost its engine brake: where the plan, solved again with
//! the phases open, uses a brake inside a phase, that phase is closed again.
//!
//! Open or closed is decided between subproblems; a relaxed share would find pulse-and-glide on the
//! flat.

use alloc::vec::Vec;
use core::ops::Range;

use super::solution::SolveStatus;
use super::sqp::{Iterations, Problem, Profile, Solver, iterate};
use crate::pcc::model::{Drive, Driven, drive_profile};

/// Traction above zero wheel force that a phase may give up, m/s².
const SLACK_M_S2: f64 = 0.01;
/// Brake force per mass in neutral that counts as braking, m/s².
const BRAKING_M_S2: f64 = 1e-3;
/// Times that phases are closed again and the plan is solved anew.
const ROUNDS: usize = 3;

/// The plan solved again with its coasting phases open; `None` if no phase is worth it.
pub(crate) fn opened(
    problem: &Problem<'_>,
    plan: &Profile,
    driven: &Driven,
    iterations: Iterations,
    solver: &mut Solver<'_>,
) -> Option<Profile> {
    let mut open = phases(problem, plan, driven);
    for _ in 0..ROUNDS {
        if open.is_empty() {
            return None;
        }
        let mut gears = plan.gears.clone();
        for k in open.iter().cloned().flatten() {
            gears[k] = Drive::Neutral;
        }
        let profile = iterate(problem, &plan.e_j_kg, &gears, plan.beta_g_s, iterations, solver);
        if !matches!(profile.status, SolveStatus::Solved | SolveStatus::AlmostSolved) {
            return None;
        }
        let drive = drive_profile(
            problem.truck,
            problem.course,
            &profile.e_j_kg,
            &profile.gears,
            &profile.cut,
            problem.tuning.shift_fuel_g,
        );
        let before = open.len();
        open.retain(|phase| !phase.clone().any(|k| runs_away(&drive, k)));
        if open.len() == before {
            return Some(profile);
        }
    }
    None
}

/// Whether a brake works in an open interval.
#[must_use]
pub(crate) fn runs_away(driven: &Driven, k: usize) -> bool {
    driven.drive[k] == Drive::Neutral && driven.brake_m_s2[k] > BRAKING_M_S2
}

/// Phases worth opening.
fn phases(problem: &Problem<'_>, plan: &Profile, driven: &Driven) -> Vec<Range<usize>> {
    let (truck, course, tuning) = (problem.truck, problem.course, problem.tuning);
    let shortest = libm::ceil(tuning.eco_roll_dwell_m / course.h_m).max(1.0) as usize;
    let idle_g_s = truck.fuel_g_s(Drive::Neutral, 0.0, 0.0);
    let gain = |k: usize| -> Option<f64> {
        let Drive::Gear(g) = driven.drive[k] else { return None };
        let v = libm::sqrt(driven.e_j_kg[k] + driven.e_j_kg[k + 1]);
        let drag = truck.overrun_m_s2(g as usize, v);
        let p = driven.p_m_s2[k];
        if p > drag + SLACK_M_S2 || driven.brake_m_s2[k] > BRAKING_M_S2 {
            return None;
        }
        let dt_s = course.h_m / v;
        let burnt = truck.fuel_g_s(driven.drive[k], v, p);
        Some((burnt - idle_g_s) * dt_s + plan.worth[k] * (drag - p))
    };
    let mut found = Vec::new();
    let mut k = 0;
    while k < course.n() {
        let run: Vec<f64> = (k..course.n()).map_while(gain).collect();
        let best = largest_sum(&run);
        if let Some((range, sum_g)) = best.filter(|(range, _)| range.len() >= shortest)
            && sum_g > 2.0 * tuning.shift_fuel_g
        {
            found.push(k + range.start..k + range.end);
        }
        k += run.len() + 1;
    }
    found
}

/// The range with the largest sum (Kadane).
fn largest_sum(values: &[f64]) -> Option<(Range<usize>, f64)> {
    let (mut best, mut start, mut sum) = (None, 0, 0.0);
    for (i, v) in values.iter().enumerate() {
        if sum <= 0.0 {
            (start, sum) = (i, 0.0);
        }
        sum += v;
        if best.as_ref().is_none_or(|(_, most): &(Range<usize>, f64)| sum > *most) {
            best = Some((start..i + 1, sum));
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_phase_is_the_stretch_that_gains_most() {
        let (range, sum) = largest_sum(&[-1.0, 2.0, -0.5, 3.0, -4.0, 1.0]).unwrap();
        assert_eq!((range, sum), (1..4, 4.5));
        assert_eq!(largest_sum(&[]), None);
    }
}
