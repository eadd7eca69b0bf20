//! Where the side force of the wind acts on this truck, as its drives in order show.
//!
//! The winds of the days are tolerances with a mean of next to nothing, so that the point where they
//! act has no first derivative there; it shows in how what the drives have left scatters. The response
//! to a wind is linear in the tractor's part and in the moment about the trailer's CG, so that a few
//! columns serve for any point. The point is that of the largest evidence with its prior.

use nalgebra::{DMatrix, DVector};

use super::nuisance::Changed;
use super::signals::Line;
use super::{Direction, Problem, Reference, nuisance_directions};
use crate::causes::param::{P, Theta};
use crate::causes::sentence;
use crate::search::decisions::MIN_EVIDENCE;
use crate::{DiagnosisError, Plant, SideForcePoint};

/// The tractor's part and how far behind its CG the trailer's part acts, off the truck file's.
const POINT: [P; 2] = [P::SideShare, P::SideBehind];
/// Tolerances that push to the side.
const WINDS: [P; 3] = [P::WindX, P::WindY, P::Crosswind];
/// Steps of the search in spreads of the prior: the first one, and where it ends.
const STEPS: [f64; 2] = [0.5, 0.05];
/// Most points that the search moves to.
const MOVES: usize = 100;

/// A drive's lines with the point where it is, and what becomes of them elsewhere.
struct Elsewhere {
    /// Inner products of the tolerances, of the winds' changes with part and with moment, of the
    /// residual and of its changes.
    products: DMatrix<f64>,
    sigma: Vec<f64>,
    /// Places of the winds among the tolerances.
    winds: Vec<usize>,
}

impl Elsewhere {
    /// Evidence of the drive with part and moment per force off by `by`, nats.
    fn evidence(&self, by: [f64; 2]) -> Option<f64> {
        let (q, w) = (self.sigma.len(), self.winds.len());
        let mut mix = DMatrix::zeros(self.products.nrows(), q + 1);
        for (j, sigma) in self.sigma.iter().enumerate() {
            mix[(j, j)] = *sigma;
        }
        mix[(q + 2 * w, q)] = 1.0;
        for (side, by) in by.iter().enumerate() {
            for (k, j) in self.winds.iter().enumerate() {
                mix[(q + side * w + k, *j)] = self.sigma[*j] * by;
            }
            mix[(q + 2 * w + 1 + side, q)] = *by;
        }
        let all = mix.transpose() * &self.products * mix;
        let factor = (all.view((0, 0), (q, q)) + DMatrix::identity(q, q)).cholesky()?;
        let against: DVector<f64> = all.view((0, q), (q, 1)).column(0).into_owned();
        let ln_det: f64 = factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum();
        Some(0.5 * (against.dot(&factor.solve(&against)) - all[(q, q)]) - ln_det)
    }
}

impl Reference {
    /// Where side winds act, if the drives have shown another point than the truck file's.
    pub(crate) fn side_force(&self, plant: &Plant) -> Option<SideForcePoint> {
        let own = &plant.truck.resistance;
        let evidence = self.attack_nats;
        let tractor_frac = own.side_force_tractor_frac + self.theta[POINT[0] as usize];
        let trailer_behind_cg_m =
            own.side_force_trailer_behind_cg_m + self.theta[POINT[1] as usize];
        (evidence > MIN_EVIDENCE).then(|| SideForcePoint {
            sentence: sentence::side_force(tractor_frac, trailer_behind_cg_m, evidence),
            tractor_frac,
            trailer_behind_cg_m,
            evidence,
        })
    }
}

impl Problem<'_> {
    /// Moves the point where side winds act to where the drives have it; what that is worth, nats.
    pub(super) fn find_attack(&mut self) -> Result<f64, DiagnosisError> {
        let from = POINT.map(|p| self.reference.theta[p as usize]);
        let by = |at: [f64; 2]| [at[0] - from[0], self.moment_m(at) - self.moment_m(from)];
        let drives = self.elsewhere(from);
        let value = |at: [f64; 2]| -> Option<f64> {
            let prior = POINT.iter().zip(at).map(|(p, x)| 0.5 * (x / p.spec().prior).powi(2));
            let each = drives.iter().map(|d| d.evidence(by(at)));
            Some(each.sum::<Option<f64>>()? - prior.sum::<f64>())
        };
        let start =
            value(from).ok_or_else(|| DiagnosisError::Numerics("where side winds act".into()))?;
        let (mut at, mut best, mut size) = (from, start, STEPS[0]);
        for _ in 0..MOVES {
            let around = WAYS.map(|way| {
                let to: [f64; 2] = core::array::from_fn(|j| {
                    let s = POINT[j].spec();
                    (at[j] + way[j] * size * s.prior).clamp(s.lo, s.hi)
                });
                (value(to).unwrap_or(f64::NEG_INFINITY), to)
            });
            match around.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)) {
                Some((e, to)) if e > best => (best, at) = (e, to),
                _ if size > STEPS[1] => size *= 0.5,
                _ => break,
            }
        }
        POINT.iter().zip(at).for_each(|(p, x)| self.reference.theta[*p as usize] = x);
        self.rebuild(Changed::Everything)?;
        Ok(best - start)
    }

    /// Moment about the trailer's CG per side force with the point off by `at`, m.
    fn moment_m(&self, at: [f64; 2]) -> f64 {
        let own = &self.plant.truck.resistance;
        let on_trailer = 1.0 - own.side_force_tractor_frac - at[0];
        (own.side_force_trailer_behind_cg_m + at[1]) * on_trailer
    }

    /// All drives about the point `from`: one step away in the part at the same moment, and one in the
    /// moment at the same part.
    fn elsewhere(&self, from: [f64; 2]) -> Vec<Elsewhere> {
        let own = &self.plant.truck.resistance;
        let part = from[0] + POINT[0].spec().step;
        let on_trailer = 1.0 - own.side_force_tractor_frac - part;
        let behind_m = self.moment_m(from) / on_trailer - own.side_force_trailer_behind_cg_m;
        let further = [from[0], from[1] + POINT[1].spec().step];
        let moment_m = self.moment_m(further) - self.moment_m(from);
        let points = [[part, behind_m], further].map(|at| {
            let mut theta = self.reference.theta;
            POINT.iter().zip(at).for_each(|(p, x)| theta[*p as usize] = x);
            theta
        });
        self.each(|i| self.seen_from(i, &points, [POINT[0].spec().step, moment_m]))
    }

    /// The lines of drive `i` and how they change towards `points`, per `scales`.
    fn seen_from(&self, i: usize, points: &[Theta; 2], scales: [f64; 2]) -> Elsewhere {
        let nuisance = &self.nuisance[i];
        let directions = nuisance_directions(&self.reference.tolerance);
        let winds: Vec<usize> =
            (0..directions.len()).filter(|j| WINDS.contains(&directions[*j].p)).collect();
        let change = |a: &Line, b: &Line, scale: f64| -> Line {
            a.iter().zip(b).map(|(a, b)| a.change_to(b, scale)).collect()
        };
        let mut lines = nuisance.columns.clone();
        for (theta, scale) in points.iter().zip(scales) {
            for j in &winds {
                let p = directions[*j].p;
                let there = self.line(i, theta, &Direction::new(p, Vec::new(), p.spec().step));
                lines.push(change(&nuisance.columns[*j], &there, scale));
            }
        }
        lines.push(nuisance.base.clone());
        for (theta, scale) in points.iter().zip(scales) {
            lines.push(change(&nuisance.base, &self.at(i, theta), scale));
        }
        let products = self.inner_products(i, &lines);
        Elsewhere { products, sigma: nuisance.sigma.clone(), winds }
    }
}

/// Where the search looks around a point.
const WAYS: [[f64; 2]; 8] = [
    [1.0, 0.0],
    [-1.0, 0.0],
    [0.0, 1.0],
    [0.0, -1.0],
    [1.0, 1.0],
    [1.0, -1.0],
    [-1.0, 1.0],
    [-1.0, -1.0],
];

#[cfg(test)]
mod tests {
    use dynamics::TruckParameters;

    use super::*;
    use crate::replay::Prepared;
    use crate::replay::tests::recorded;
    use crate::{Channel, Drive, Serial};

    #[test]
    fn evidence_elsewhere_is_that_of_columns_taken_there() {
        let truck = TruckParameters::load("reference").unwrap();
        let plant = Plant::of_truck(&truck).unwrap();
        let drives = [9_000.0, 16_000.0].map(|kg| {
            let mut drive = recorded(&truck, kg);
            let hand_wheel = |i| 0.3 * (i as f64 * Drive::STEP_S / 4.0).sin();
            drive.set(Channel::SteeringWheelRad, (0..drive.len).map(hand_wheel).collect());
            Prepared::new(&drive, &plant)
        });
        let mut problem = Problem::learn(&plant, drives.into(), false, &Serial).unwrap();
        // A wind that blew on all drives, so that the residual depends on the point as well.
        problem.reference.theta[P::Crosswind as usize] = 3.0;
        problem.rebuild(Changed::Everything).unwrap();
        let from = [0.0, 0.5];
        POINT.iter().zip(from).for_each(|(p, x)| problem.reference.theta[*p as usize] = x);
        problem.rebuild(Changed::Everything).unwrap();
        let drives = problem.elsewhere(from);
        let there = |problem: &Problem<'_>| -> Vec<f64> {
            let drives = problem.elsewhere(POINT.map(|p| problem.reference.theta[p as usize]));
            drives.iter().map(|d| d.evidence([0.0; 2]).unwrap()).collect()
        };
        let here = there(&problem);
        for to in [[0.2, -1.0], [-0.1, -2.0]] {
            let by = [to[0] - from[0], problem.moment_m(to) - problem.moment_m(from)];
            let told: Vec<f64> = drives.iter().map(|d| d.evidence(by).unwrap()).collect();
            POINT.iter().zip(to).for_each(|(p, x)| problem.reference.theta[*p as usize] = x);
            problem.rebuild(Changed::Everything).unwrap();
            for ((told, taken), here) in told.iter().zip(there(&problem)).zip(&here) {
                assert!((taken - here).abs() > 1.0, "{to:?} makes no difference");
                // The other columns change a little, too, as far as the wind has a mean.
                assert!((told - taken).abs() < 0.05 * (taken - here).abs(), "{told} {taken}");
            }
        }
    }
}
