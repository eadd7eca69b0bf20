//! The tolerances of a drive beyond their first order.
//!
//! Tolerances enter a residual linearly, with columns taken at the reference. But the force of a wind goes
//! with the square of the air's speed, and what turns a truck with the product of wind, load, stiffness
//! and steering: of a wind of 2 m/s at 22 m/s a twentieth is of second order, and a drive tells such a
//! wind to 0.05 m/s. What that left of the windier days of trucks in order was taken for another wind, one
//! that acts elsewhere. Where a step begins, at `from`, residuals are therefore taken with what the
//! tolerances `z` that the drive has most probably had there do beyond their columns `S`:
//!
//! ```text
//! r(theta) + [r(reference, z) + S z - r(reference)]
//! ```
//!
//! (Laplace's approximation about a Gauss-Newton step; Tierney and Kadane, J. Am. Stat. Assoc. 81, 1986.)
//! Both ends of a step are compared with the same. The remainder is that at the reference, where the
//! columns are from: taken at `from` it holds besides how the columns change on the way, and a single step
//! of `z` along the old ones is none to be judged by. Not the tolerances of sampled delays, places on a map
//! and what begins at a threshold: beyond their kinks a step is no better than none.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use super::signals::{Bend, Line, Signals};
use super::{Problem, nuisance_directions};
use crate::causes::param::{P, Theta};
use crate::replay::{GROUPS, Group, affects};

/// Tolerances without kinks that enter as products: air, loads, tyres, steering.
const SMOOTH: [P; 14] = [
    P::Headwind,
    P::WindX,
    P::WindY,
    P::Crosswind,
    P::Drag,
    P::Rolling,
    P::Mass,
    P::PayloadX,
    P::Bank,
    P::CFront,
    P::CDrive,
    P::CTrailer,
    P::SteerRatio,
    P::SteerOffset,
];

/// Deviations that a drive's tolerances have at the most. Where the drive says more, its cause is not in
/// the model yet, and what tolerances of ten deviations would do says nothing of the day.
const MOST_DEVIATIONS: f64 = 3.0;
/// Points about which a drive keeps what is added.
const KEPT: usize = 24;

/// What is added about some points, of one drive.
#[derive(Default)]
pub(super) struct Bends(Mutex<HashMap<Vec<u64>, Arc<Bend>>>);

impl Bends {
    /// Forgets all: noise or tolerances have changed.
    pub(super) fn renew(&self) {
        if let Ok(mut kept) = self.0.lock() {
            kept.clear();
        }
    }
}

impl Problem<'_> {
    /// Residuals of drive `i` at `theta` with what its tolerances do beyond their first order as they are
    /// at `from`.
    pub(super) fn as_driven(&self, i: usize, theta: &Theta, from: &Theta) -> Line {
        let key: Vec<u64> = from.iter().map(|x| x.to_bits()).collect();
        let kept = || self.bends[i].0.lock().ok()?.get(&key).cloned();
        let bend = kept().unwrap_or_else(|| {
            let bend = Arc::new(self.bend(i, from));
            if let Ok(mut kept) = self.bends[i].0.lock() {
                if kept.len() >= KEPT {
                    kept.clear();
                }
                kept.insert(key.clone(), bend.clone());
            }
            bend
        });
        self.bent(i, theta, &bend, &key)
    }

    /// What is added to the residuals of drive `i` where a step begins at `from`.
    fn bend(&self, i: usize, from: &Theta) -> Bend {
        let nuisance = &self.nuisance[i];
        let directions = nuisance_directions(&self.reference.tolerance);
        let smooth: Vec<usize> =
            (0..directions.len()).filter(|j| SMOOTH.contains(&directions[*j].p)).collect();
        let moved = self.moved(i, from);
        let mut z = self.against_at(i, &self.at(i, from), moved.as_deref());
        moved.as_ref().map_or(&nuisance.factor, |m| &m.factor).solve_mut(&mut z);
        let most = smooth.iter().map(|j| z[*j].abs()).fold(MOST_DEVIATIONS, f64::max);
        let zero = &self.reference.theta;
        let mut there = *zero;
        for j in &smooth {
            let spec = directions[*j].p.spec();
            let x = &mut there[spec.p as usize];
            let by = MOST_DEVIATIONS / most * z[*j] * nuisance.sigma[*j];
            *x = (*x + by).clamp(spec.lo, spec.hi);
        }
        let of = |group: &Group| {
            let reach = smooth.iter().filter(|j| affects(directions[**j].p).contains(group));
            let column = |j: &usize| {
                let p = directions[*j].p as usize;
                let own = nuisance.columns[*j].iter().filter(|s| s.group == *group);
                own.map(move |s| (there[p] - zero[p], s.as_ref()))
            };
            let columns: Vec<(f64, &Signals)> = reach.flat_map(column).collect();
            (!columns.is_empty()).then(|| self.bend_of(i, *group, &there, &columns))
        };
        GROUPS.iter().map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use dynamics::TruckParameters;

    use super::*;
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
            [problem.at(0, &at), problem.as_driven(0, &at, &at)].map(|line| {
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
