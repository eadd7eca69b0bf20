//! Search for the minimum of a function that is expensive and not smooth: differential evolution
//! (Storn & Price, J. Global Optimization 11, 1997).
//!
//! Half of the trials start from the best member, the others from any; one member in six begins
//! anywhere, the others around a first guess. Same seed, same result.

use crate::philox::{Draws, Stream};

/// Members of the population.
const MEMBERS: usize = 18;
/// Range around the first guess in which members begin, as a part of it.
const AROUND: f64 = 0.3;
/// Differential weight and crossover probability.
const SCALE: f64 = 0.5;
const CROSSOVER: f64 = 0.8;

/// What a search found.
pub(crate) struct Found<const N: usize> {
    pub(crate) best: [f64; N],
    pub(crate) trials: usize,
}

/// The best point within `bounds` (low, high) that was met.
///
/// # Errors
/// The first error of `cost`.
pub(crate) fn minimum<const N: usize, E>(
    bounds: &[(f64, f64); N],
    guess: &[f64; N],
    generations: usize,
    seed: u64,
    cost: impl Fn(&[f64; N]) -> Result<f64, E>,
) -> Result<Found<N>, E> {
    let draw = |generation: usize, member: usize, number: u32| {
        let index = (generation * MEMBERS + member) as u64;
        Draws::new(seed, Stream::Search, index).uniform(number)
    };
    let mut members: Vec<[f64; N]> = (0..MEMBERS)
        .map(|m| {
            std::array::from_fn(|k| {
                let (low, high) = bounds[k];
                let u = draw(0, m, k as u32);
                match m % 6 {
                    0 if m > 0 => low + (high - low) * u,
                    0 => guess[k],
                    _ => (guess[k] * (1.0 + AROUND * (2.0 * u - 1.0))).clamp(low, high),
                }
            })
        })
        .collect();
    let mut costs = members.iter().map(&cost).collect::<Result<Vec<f64>, E>>()?;
    let best_of =
        |costs: &[f64]| (0..MEMBERS).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or(0);
    for generation in 1..=generations {
        for m in 0..MEMBERS {
            let pick = |number: u32| (draw(generation, m, number) * MEMBERS as f64) as usize;
            let from = if draw(generation, m, 100) < 0.5 { best_of(&costs) } else { pick(101) };
            let (a, b, forced) = (pick(102), pick(103), pick(104) % N);
            let trial: [f64; N] = std::array::from_fn(|k| {
                let (low, high) = bounds[k];
                let crossed = k == forced || draw(generation, m, k as u32) < CROSSOVER;
                let moved = members[from][k] + SCALE * (members[a][k] - members[b][k]);
                if crossed { moved.clamp(low, high) } else { members[m][k] }
            });
            let trial_cost = cost(&trial)?;
            if trial_cost <= costs[m] {
                (members[m], costs[m]) = (trial, trial_cost);
            }
        }
    }
    let best = best_of(&costs);
    Ok(Found { best: members[best], trials: MEMBERS * (generations + 1) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_minimum_of_a_crooked_valley_is_found() {
        // Rosenbrock (1960): minimum 0 at (1, 1).
        let cost = |x: &[f64; 2]| {
            Ok::<f64, ()>((1.0 - x[0]).powi(2) + 100.0 * (x[1] - x[0] * x[0]).powi(2))
        };
        let found = minimum(&[(-2.0, 2.0), (-1.0, 3.0)], &[-1.0, 2.0], 150, 7, cost).unwrap();
        assert!(
            cost(&found.best).unwrap() < 1e-4 && (found.best[0] - 1.0).abs() < 0.03,
            "{:?}",
            found.best
        );
        assert_eq!(found.trials, 18 * 151);
    }
}
