//! Speeds once more, with the fuel map as it bends where the plan drives.
//!
//! The other steps take an interval's fuel for one parabola over all tractions, which a measured map
//! is not: it bends at the torques of its test bench, and where the engine begins to pull. Here the
//! map is read around the plan's own traction, over less and less of the range. Such a fit holds
//! nearby only, so that parts of the way to a subproblem's solution are tried too, and what is driven
//! for less fuel is kept. A plan that rolls stays as it is: its fits would let it brake in neutral.

use super::planner::Best;
use crate::pcc::model::Drive;
use crate::pcc::solve::{Iterations, Problem, Profile, Solver, iterate};

/// Parts of the tractions over which the map is read, one after the other.
const FITS_FRAC: [f64; 4] = [0.5, 0.3, 0.2, 0.12];

/// Most subproblems per such part.
const ROUNDS: usize = 6;

/// Parts of the way to a subproblem's solution that are tried.
const STEPS_FRAC: [f64; 3] = [1.0, 0.5, 0.25];

/// Improves the best plan in its gears.
pub(super) fn settle_torques(
    problem: &mut Problem<'_>,
    best: &mut Best<'_>,
    solver: &mut Solver<'_>,
) {
    let whole_frac = problem.fit_frac;
    for fit_frac in FITS_FRAC {
        problem.fit_frac = fit_frac;
        let rounds = (0..ROUNDS).take_while(|_| is_improved(problem, best, solver)).count();
        // A map that does not bend: its parabola was right.
        if rounds == 0 && fit_frac == FITS_FRAC[0] {
            break;
        }
    }
    problem.fit_frac = whole_frac;
}

/// One subproblem around the best plan: is any part of the way to its solution better?
fn is_improved(problem: &Problem<'_>, best: &mut Best<'_>, solver: &mut Solver<'_>) -> bool {
    let Some(kept) = &best.kept else { return false };
    if kept.profile.gears.contains(&Drive::Neutral) {
        return false;
    }
    let from = kept.profile.clone();
    let once = Iterations { most: 1, ..Iterations::TRIP };
    let to = iterate(problem, &from.e_j_kg, &from.gears, from.beta_g_s, once, solver);
    let mut better = false;
    for part in STEPS_FRAC {
        better |= best.offer(problem, between(&from, &to, part));
    }
    better
}

/// The profile `part` of the way from one to another of the same gears.
fn between(from: &Profile, to: &Profile, part: f64) -> Profile {
    let mix = |(a, b): (&f64, &f64)| a + part * (b - a);
    Profile {
        e_j_kg: from.e_j_kg.iter().zip(&to.e_j_kg).map(mix).collect(),
        cut: from.cut.iter().zip(&to.cut).map(|(a, b)| *a && *b).collect(),
        ..to.clone()
    }
}
