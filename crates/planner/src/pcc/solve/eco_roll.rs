//! Eco-roll: phases with the driveline open.
//!
//! In gear without fuel the engine's own drag slows the truck; in neutral the truck keeps that
//! energy and the engine burns its idle fuel. Which intervals are rolled is chosen by the searches
//! that choose the gears: the open driveline is one more gear (`search`). What stays here are the
//! rules that are not a matter of cost:
//!
//! - **No pulse-and-glide.** Accelerating and rolling by turns is cheapest even on a flat road. The
//!   driveline may open only where the road falls, or where a truck that rolls from cruise speed
//!   still arrives too fast at a ceiling ahead ([`may_roll`]).
//! - **Dwell.** A phase is at least `eco_roll_dwell_m` long ([`close_short`]).
//! - **Runaway.** A truck in neutral has lost its engine brake: a phase in which the solved plan
//!   uses a brake is closed and the plan solved again ([`rolled`]).

use alloc::vec::Vec;
use core::ops::Range;

use super::solution::SolveStatus;
use super::sqp::{Iterations, Problem, Profile, Solver, iterate};
use crate::pcc::model::{Course, Drive, Driven, Truck, Tuning, drive_profile};

/// Brake force per mass in neutral that counts as braking, m/s².
const BRAKING_M_S2: f64 = 1e-3;
/// Times that phases are closed again and the plan is solved anew.
const ROUNDS: usize = 4;

/// Intervals in which the driveline may be open, for the ceiling `e_max` and the energies `cruise` of
/// cruise control (both J/kg per node).
pub(crate) fn may_roll(truck: &Truck, course: &Course, e_max: &[f64], cruise: &[f64]) -> Vec<bool> {
    let n = course.n();
    let mut may = alloc::vec![false; n];
    // Energy from which rolling just keeps below the ceilings ahead.
    let mut most = e_max[n];
    for k in (0..n).rev() {
        let held = truck.resistance_m_s2(most, &course.road[k]);
        most += held * course.h_m / truck.inertia(Drive::Neutral);
        may[k] = course.road[k].sin_grade < 0.0 || cruise[k] > most;
        most = most.min(e_max[k]);
    }
    may
}

/// Intervals of the shortest phase.
pub(crate) fn shortest(course: &Course, tuning: &Tuning) -> usize {
    libm::ceil(tuning.eco_roll_dwell_m / course.h_m).max(1.0) as usize
}

/// Phases, as ranges of intervals.
fn phases(gears: &[Drive]) -> Vec<Range<usize>> {
    let mut found: Vec<Range<usize>> = Vec::new();
    for k in (0..gears.len()).filter(|k| gears[*k] == Drive::Neutral) {
        match found.last_mut() {
            Some(last) if last.end == k => last.end = k + 1,
            _ => found.push(k..k + 1),
        }
    }
    found
}

/// Closes a phase with the gear before it, at the start with the gear after it.
fn close(gears: &mut [Drive], phase: Range<usize>) {
    let gear =
        match phase.start.checked_sub(1).or_else(|| (phase.end < gears.len()).then_some(phase.end))
        {
            Some(beside) => gears[beside],
            None => Drive::Gear(0),
        };
    gears[phase].fill(gear);
}

/// Closes phases that are shorter than `shortest` intervals.
pub(crate) fn close_short(gears: &mut [Drive], shortest: usize) {
    for phase in phases(gears) {
        if phase.len() < shortest {
            close(gears, phase);
        }
    }
}

/// [`iterate`], with phases that would run away closed; `None` if there is no usable solution.
pub(crate) fn rolled(
    problem: &Problem<'_>,
    e: &[f64],
    gears: &[Drive],
    beta_g_s: f64,
    iterations: Iterations,
    solver: &mut Solver<'_>,
) -> Option<Profile> {
    let (mut e, mut gears) = (e.to_vec(), gears.to_vec());
    for _ in 0..ROUNDS {
        let profile = iterate(problem, &e, &gears, beta_g_s, iterations, solver);
        if !matches!(profile.status, SolveStatus::Solved | SolveStatus::AlmostSolved) {
            return None;
        }
        let driven = drive_profile(
            problem.truck,
            problem.course,
            &profile.e_j_kg,
            &profile.gears,
            &profile.cut,
            problem.tuning.shift_fuel_g,
        );
        gears.clone_from(&profile.gears);
        let mut runs = phases(&gears);
        runs.retain(|phase| phase.clone().any(|k| runs_away(&driven, k)));
        if runs.is_empty() {
            return Some(profile);
        }
        for phase in runs {
            close(&mut gears, phase);
        }
        e = profile.e_j_kg;
    }
    None
}

/// Whether a brake works in an open interval.
#[must_use]
pub(crate) fn runs_away(driven: &Driven, k: usize) -> bool {
    driven.drive[k] == Drive::Neutral && driven.brake_m_s2[k] > BRAKING_M_S2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_phases_are_closed_with_the_gear_beside_them() {
        let (g, h, o) = (Drive::Gear(10), Drive::Gear(11), Drive::Neutral);
        let mut gears = [o, g, o, o, o, h, o, h, o, o];
        close_short(&mut gears, 2);
        assert_eq!(gears, [g, g, o, o, o, h, h, h, o, o]);
        let mut all = [o; 3];
        close_short(&mut all, 4);
        assert_eq!(all, [Drive::Gear(0); 3]);
    }
}
