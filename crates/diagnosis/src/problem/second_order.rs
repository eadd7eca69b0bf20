//! The tolerances of a drive beyond their first order.
//!
//! Tolerances enter a residual linearly, with columns taken at the reference. But the force of a wind goes
//! with the square of the air's speed, and what turns a truck with the product of wind, load, stiffness
//! and steering: of a wind of 2 m/s at 22 m/s a twentieth is of second order, and a drive tells such a
//! wind to 0.05 m/s. What that leaves of the windier days of trucks in order looks like a wind, which is
//! followed exactly. Before a cause is believed, what a set without it leaves is therefore taken with what
//! the tolerances `z` that each drive has most probably had there do beyond their columns `S`:
//!
//! ```text
//! r(theta) + [r(reference, z) + S z - r(reference)]
//! ```
//!
//! (Laplace's approximation about a Gauss-Newton step; Tierney and Kadane, J. Am. Stat. Assoc. 81, 1986.)
//! The remainder is that at the reference, where the columns are from: taken at `theta` it holds besides
//! how the columns change on the way, and a single step of `z` along the old ones is none to be judged
//! by. Not the tolerances of sampled delays, places on a map and what begins at a threshold: beyond their
//! kinks a step is no better than none.

use std::sync::Arc;

use super::signals::{Line, Signals};
use super::{Direction, Gram, Problem, nuisance_directions};
use crate::causes::param::Theta;
use crate::replay::{GROUPS, Group, affects};

/// Deviations that a drive's tolerances have at the most. Where the drive says more, its cause is not in
/// the model yet, and what tolerances of ten deviations would do says nothing of the day.
const MOST_DEVIATIONS: f64 = 3.0;

impl Problem<'_> {
    /// The Gram matrix of the residual at `theta` with what the tolerances do there beyond their first
    /// order, and the directions from there.
    pub(crate) fn gram_as_driven(&self, theta: &Theta, directions: &[Direction]) -> Gram {
        let parts = self.each(|i| {
            let mut lines = vec![self.as_driven(i, theta)];
            lines.extend(directions.iter().map(|d| self.line(i, theta, d)));
            self.marginal(i, &lines, theta)
        });
        self.with_moved(parts, theta)
    }

    /// Residuals of drive `i` at `theta` with what its tolerances do there beyond their first order.
    fn as_driven(&self, i: usize, theta: &Theta) -> Line {
        let nuisance = &self.nuisance[i];
        let directions = nuisance_directions(&self.reference.tolerance);
        let smooth: Vec<usize> =
            (0..directions.len()).filter(|j| directions[*j].p.is_smooth()).collect();
        let line = self.at(i, theta);
        let z = self.most_probable(i, &line, theta);
        let most = smooth.iter().map(|j| z[*j].abs()).fold(MOST_DEVIATIONS, f64::max);
        let mut day = vec![0.0; z.len()];
        smooth.iter().for_each(|j| day[*j] = MOST_DEVIATIONS / most * z[*j]);
        let (zero, there) = (&self.reference.theta, self.off_by(&day));
        let remainder = |group: &Group| {
            let reach = smooth.iter().filter(|j| affects(directions[**j].p).contains(group));
            let column = |j: &usize| {
                let p = directions[*j].p as usize;
                let own = nuisance.columns[*j].iter().filter(|s| s.group == *group);
                own.map(move |s| (there[p] - zero[p], s.as_ref()))
            };
            let columns: Vec<(f64, &Signals)> = reach.flat_map(column).collect();
            (!columns.is_empty()).then(|| self.remainder(i, *group, &there, &columns))
        };
        let of = |(group, plain): (&Group, &Arc<Signals>)| match remainder(group) {
            Some(added) => Arc::new(plain.plus(&added)),
            None => plain.clone(),
        };
        GROUPS.iter().zip(&line).map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use dynamics::TruckParameters;

    use super::*;
    use crate::causes::param::P;
    use crate::problem::nuisance::Changed;
    use crate::replay::Prepared;
    use crate::replay::tests::recorded;
    use crate::{Channel, Drive, Plant, Serial};

    /// A truck that differs much from day to day, in order on a windy day with other tyres than the day
    /// before: half of what was left beside its tolerances was of second order.
    #[test]
    fn a_windy_day_leaves_little_of_second_order() {
        const DAY: [P; 3] = [P::Headwind, P::Crosswind, P::CDrive];
        let truck = TruckParameters::load("reference").unwrap();
        let plant = Plant::of_truck(&truck).unwrap();
        let mut drive = recorded(&truck, 16_000.0);
        let hand_wheel = |i| 0.3 * (i as f64 * Drive::STEP_S / 4.0).sin();
        drive.set(Channel::SteeringWheelRad, (0..drive.len).map(hand_wheel).collect());
        let drives = vec![Prepared::new(&drive, &plant)];
        let mut problem = Problem::learn(&plant, drives, false, &Serial).unwrap();
        for p in DAY {
            problem.reference.tolerance[p as usize] = 4.0 * p.spec().tolerance;
        }
        let zero = problem.reference.theta;
        // The drive's own day is what the reference is off by, to the other side. What is left beside what
        // tolerances of that size cost themselves, taken to first order and as driven.
        let mut left = |deviations: f64| {
            problem.reference.theta = zero;
            for p in DAY {
                let by = deviations * problem.reference.tolerance[p as usize];
                problem.reference.theta[p as usize] -= by;
            }
            problem.rebuild(Changed::Everything).unwrap();
            let at = problem.reference.theta;
            [problem.at(0, &at), problem.as_driven(0, &at)].map(|line| {
                let against = problem.against(0, &line);
                let z = problem.nuisance[0].factor.solve(&against);
                problem.dot(0, &line, &line) - z.dot(&against) - z.norm_squared()
            })
        };
        let (calm, windy) = (left(0.0), left(0.9 * MOST_DEVIATIONS));
        let [linear, driven] = [0, 1].map(|k| windy[k] - calm[k]);
        assert!(linear > 4.0 && driven.abs() < 0.5 * linear, "{linear} {driven}");
    }
}
