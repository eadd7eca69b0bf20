//! Forward selection of causes with refit, swap and drop.
//!
//! At every step all hypotheses outside the set are screened with the set's parameters free
//! (secant sensitivities at the fitted point, one Gram matrix), the best are refitted by
//! Gauss-Newton, and the best refit is taken if it beats the threshold: six nats for the first
//! cause, ten for a further one. What a helper would patch of the form of a large cause is in the
//! score already ([`crate::problem::course`]).

use crate::causes::hypothesis::{CATALOGUE, Hypothesis};
use crate::causes::param::{PARAMS, Spec, Theta};
use crate::problem::Gram;
use crate::replay::affects;
use crate::search::decisions::{AHEAD, MIN_EVIDENCE, PRIOR_CAUSE, RANKED};
use crate::search::evidence::Evidence;
use crate::search::refit::{Beyond, Fit};
use crate::search::screen::{Candidate, Screen, outside};
use crate::search::weights::log_odds;

/// Hypotheses refitted per step.
const REFIT: usize = 4;
/// Linear gain below which a hypothesis is not refitted, nats.
const LEAST_GAIN: f64 = 2.0;
/// Pairs refitted.
const PAIRS: usize = 3;

impl dyn Evidence + '_ {
    /// The best set of causes among `open`. `bare` is the evidence of the best free function: where
    /// it wins even if every further cause added as much as the last one, others only patch what the
    /// catalogue does not have.
    pub(crate) fn search(
        &self,
        open: &[usize],
        max_causes: usize,
        bare: f64,
        progress: &mut dyn FnMut(usize),
    ) -> Option<(Fit, Fit)> {
        let zero = *self.zero();
        let g = self.gram(&zero, &[]);
        let zero_norm = g.sum(|_| true).2;
        let empty = self.fit(&[], &zero, zero_norm)?;
        let mut best = empty.clone();
        while best.set.len() < max_causes {
            progress(best.set.len());
            let Some(next) = self.step(&best, open, zero_norm) else { break };
            let before = best.log_z;
            best = self.drop_and_swap(next, open, zero_norm);
            // Causes add less and less.
            let most = best.log_z + (max_causes - best.set.len()) as f64 * (best.log_z - before);
            if best.set.len() > 1 && bare > AHEAD * most {
                break;
            }
        }
        if bare <= AHEAD * best.log_z
            && let Some(better) = self.pair_step(&best, &empty, open, zero_norm)
        {
            best = self.drop_and_swap(better, open, zero_norm);
        }
        if let Some(one) = self.one_for_all(&best, &empty, open, zero_norm) {
            best = one;
        }
        Some((empty, best))
    }

    /// One cause that says as much as a set of several. Near the limit of stability a linear gain says
    /// little of what a cause explains, and one that begins far down the list is never fitted: where
    /// the largest is less than half of what the set explains, each cause that shows where the set
    /// does is fitted for itself, from one prior deviation to every side.
    fn one_for_all(&self, best: &Fit, empty: &Fit, open: &[usize], zero_norm: f64) -> Option<Fit> {
        if best.set.len() < 2 {
            return None;
        }
        let candidates = self.screen(empty, &outside(empty, open)).singles(None);
        if candidates.first()?.gain > RANKED * best.log_z {
            return None;
        }
        let groups = |h: usize| CATALOGUE[h].sizes.iter().flat_map(|p| affects(*p));
        let shows =
            |h: usize| groups(h).any(|g| best.set.iter().any(|k| groups(*k).any(|x| x == g)));
        let mut tried: Vec<usize> = Vec::new();
        let mut winner: Option<Fit> = None;
        for c in candidates.iter().filter(|c| shows(c.hypothesis)) {
            if tried.contains(&c.hypothesis) || c.gain < LEAST_GAIN {
                continue;
            }
            tried.push(c.hypothesis);
            let from = to_all_sides(&CATALOGUE[c.hypothesis]);
            let least = winner.as_ref().map_or(best.log_z, |w| w.log_z);
            winner = self.with_added_from(empty, c, &from, zero_norm, least).or(winner);
        }
        winner
    }

    /// Two causes at once where one at a time stops: every member in turn (or nothing) is replaced
    /// by the best pairs of the whole catalogue.
    fn pair_step(&self, best: &Fit, empty: &Fit, open: &[usize], zero_norm: f64) -> Option<Fit> {
        let screen = self.screen(best, &outside(best, open));
        let places: Vec<Option<usize>> =
            if best.set.is_empty() { vec![None] } else { (0..best.set.len()).map(Some).collect() };
        let mut pairs: Vec<(f64, Option<usize>, [Candidate; 2])> = Vec::new();
        for place in places {
            let lost = screen.lost(place);
            let found = screen.pairs(place).into_iter().filter(|p| p[0].gain > 0.85 * lost);
            pairs.extend(found.take(PAIRS).map(|p| (p[0].gain - lost, place, p)));
        }
        pairs.sort_by(|x, y| y.0.total_cmp(&x.0));
        let mut winner: Option<Fit> = None;
        for (_, place, pair) in pairs.iter().take(PAIRS) {
            let there = match place.map(|i| self.without(best, i)) {
                Some((fewer, theta)) if !fewer.is_empty() => self.fit(&fewer, &theta, zero_norm)?,
                _ => empty.clone(),
            };
            // The first of them alone may be worth nothing.
            let Some(one) = self.with_added(&there, &pair[0], zero_norm, f64::NEG_INFINITY) else {
                continue;
            };
            let needed = if one.set.len() >= best.set.len() { MIN_EVIDENCE } else { 0.0 };
            let least = winner.as_ref().map_or(best.log_z + needed, |w| w.log_z);
            winner = self.with_added(&one, &pair[1], zero_norm, least).or(winner);
        }
        winner
    }

    /// What another cause must add to `best`, nats: a first one at least its prior odds.
    pub(crate) fn threshold(best: &Fit) -> f64 {
        if best.set.is_empty() { -log_odds(PRIOR_CAUSE) } else { MIN_EVIDENCE }
    }

    /// The set with the cause that says most beyond it, if that is enough.
    fn step(&self, best: &Fit, open: &[usize], zero_norm: f64) -> Option<Fit> {
        let candidates = self.screen(best, &outside(best, open)).singles(None);
        let top = candidates.first()?.gain;
        let mut tried: Vec<usize> = Vec::new();
        let mut winner: Option<Fit> = None;
        for c in &candidates {
            let hyp = &CATALOGUE[c.hypothesis];
            let again = tried.contains(&c.hypothesis);
            if again || (tried.len() >= REFIT && !hyp.nonlinear()) {
                continue;
            }
            let least = if hyp.nonlinear() { 0.15 } else { 0.3 };
            if c.gain < least * top && !(best.set.is_empty() && hyp.nonlinear()) {
                continue;
            }
            if c.gain < LEAST_GAIN {
                continue;
            }
            tried.push(c.hypothesis);
            let least = winner.as_ref().map_or(best.log_z + Self::threshold(best), |w| w.log_z);
            winner = self.with_added(best, c, zero_norm, least).or(winner);
        }
        winner
    }

    /// The set with a candidate added, fitted from its start; from all of its starts if its shape is
    /// a switch, which a fit holds, or one that gets stuck. `None` where its evidence is not above
    /// `least`.
    pub(crate) fn with_added(
        &self,
        best: &Fit,
        c: &Candidate,
        zero_norm: f64,
        least: f64,
    ) -> Option<Fit> {
        let sides = sides(&CATALOGUE[c.hypothesis], &c.sizes);
        self.with_added_from(best, c, &sides, zero_norm, least)
    }

    /// The same from given sizes.
    fn with_added_from(
        &self,
        best: &Fit,
        c: &Candidate,
        sides: &[Vec<f64>],
        zero_norm: f64,
        least: f64,
    ) -> Option<Fit> {
        let hyp = &CATALOGUE[c.hypothesis];
        let starts = if hyp.shapes.iter().any(|p| p.is_switch() || p.is_stuck()) {
            hyp.starts
        } else {
            core::slice::from_ref(&c.start)
        };
        let mut set = best.set.clone();
        set.push(c.hypothesis);
        let mut beyond = Beyond::evidence(least);
        let mut found: Option<Fit> = None;
        for (start, sizes) in starts.iter().flat_map(|s| sides.iter().map(move |x| (s, x))) {
            let mut theta = best.theta;
            for (p, start) in hyp.shapes.iter().zip(start) {
                theta[*p as usize] = *start;
            }
            for (p, size) in hyp.sizes.iter().zip(sizes) {
                theta[*p as usize] = self.zero()[*p as usize] + size;
            }
            found = self.fit_beyond(&set, &theta, zero_norm, &mut beyond).or(found);
        }
        found
    }

    /// Drops members that no longer pay, then tries another hypothesis in every place.
    fn drop_and_swap(&self, mut best: Fit, open: &[usize], zero_norm: f64) -> Fit {
        for round in 0..2 {
            let mut changed = false;
            let mut screen: Option<Screen> = None;
            let mut i = 0;
            while best.set.len() > 1 && i < best.set.len() {
                let (fewer, theta) = self.without(&best, i);
                let Some(f) = self.fit(&fewer, &theta, zero_norm) else {
                    i += 1;
                    continue;
                };
                if best.log_z - f.log_z < Self::threshold(&f) {
                    (best, screen) = (f, None);
                    changed = true;
                    continue;
                }
                if round == 0 {
                    let screen_of = || self.screen(&best, &outside(&best, open));
                    let alternatives = screen.get_or_insert_with(screen_of).singles(Some(i));
                    for c in alternatives.iter().take(2) {
                        if f.log_z + c.gain < best.log_z - 20.0 - 0.1 * (best.log_z - f.log_z) {
                            continue;
                        }
                        if let Some(s) = self.with_added(&f, c, zero_norm, best.log_z) {
                            (best, screen) = (s, None);
                            changed = true;
                            break;
                        }
                    }
                }
                i += 1;
            }
            if !changed {
                break;
            }
        }
        best
    }

    /// The set without its `i`-th member, and a start for its refit.
    pub(crate) fn without(&self, fit: &Fit, i: usize) -> (Vec<usize>, Theta) {
        let mut set = fit.set.clone();
        let gone = set.remove(i);
        let mut theta = fit.theta;
        for p in CATALOGUE[gone].params() {
            theta[p as usize] = self.zero()[p as usize];
        }
        debug_assert_eq!(theta.len(), PARAMS);
        (set, theta)
    }

    /// The set without each of its members in turn, fitted; `None` where that cannot be computed.
    pub(crate) fn each_left_out(&self, fit: &Fit, empty: &Fit) -> Vec<Option<Fit>> {
        let without = |i| match self.without(fit, i) {
            (fewer, _) if fewer.is_empty() => Some(empty.clone()),
            (fewer, theta) => self.fit(&fewer, &theta, empty.norm),
        };
        (0..fit.set.len()).map(without).collect()
    }

    /// What the set loses without each of its members, nats.
    pub(crate) fn lost(fit: &Fit, without: &[Option<Fit>]) -> Vec<f64> {
        let of = |f: &Option<Fit>| fit.log_z - f.as_ref().map_or(0.0, |f| f.log_z);
        without.iter().map(of).collect()
    }

    /// The same, of causes that a tolerance could be, less what tolerances take beyond their first order.
    pub(crate) fn lost_as_driven(&self, fit: &Fit, without: &[Option<Fit>]) -> Vec<f64> {
        let falls = |theta: &Theta| {
            let left = |gram: Gram| gram.total().2;
            (left(self.gram(theta, &[])) - left(self.gram_as_driven(theta, &[]))).max(0.0)
        };
        let could_be = |h: usize| CATALOGUE[h].sizes.iter().any(|p| p.is_smooth());
        let beside = if fit.set.iter().any(|h| could_be(*h)) { falls(&fit.theta) } else { 0.0 };
        let taken = |f: &Option<Fit>| {
            let theta = f.as_ref().map_or(self.zero(), |f| &f.theta);
            0.5 * (falls(theta) - beside).max(0.0)
        };
        let of = |((nats, f), h): ((f64, &Option<Fit>), &usize)| {
            if could_be(*h) { nats - taken(f) } else { nats }
        };
        Self::lost(fit, without).into_iter().zip(without).zip(&fit.set).map(of).collect()
    }
}

/// Sizes from which a hypothesis is fitted. What is linear needs one start, near nothing. Else the sign
/// decides where a fit ends (a wind from the wrong side pushes the right way with its force further
/// back): that of the linear model, and one prior deviation to every side.
fn sides(hyp: &Hypothesis, linear: &[f64]) -> Vec<Vec<f64>> {
    let specs = || hyp.sizes.iter().map(|p| p.spec());
    if !hyp.nonlinear() {
        let sign = if hyp.sign < 0.0 { -1.0 } else { 1.0 };
        return vec![specs().map(|s| 0.5 * s.step * sign).collect()];
    }
    let mut out = vec![specs().zip(linear).map(|(s, x)| x.clamp(s.lo, s.hi)).collect()];
    out.extend(to_all_sides(hyp));
    out
}

/// One prior deviation to every side that the sizes may have.
fn to_all_sides(hyp: &Hypothesis) -> Vec<Vec<f64>> {
    let specs = || hyp.sizes.iter().map(|p| p.spec());
    let signs = 0..1_u32 << hyp.sizes.len();
    let side =
        |signs: u32, k: usize, s: &Spec| if signs >> k & 1 == 0 { s.prior } else { -s.prior };
    let all = signs.map(|signs| specs().enumerate().map(|(k, s)| side(signs, k, s)).collect());
    all.filter(|x: &Vec<f64>| hyp.sign == 0.0 || x[0] * hyp.sign > 0.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::causes::param::P;

    #[test]
    fn a_wind_is_fitted_from_every_side_and_what_is_linear_from_near_nothing() {
        let of = |id: &str| CATALOGUE.iter().find(|h| h.id == id).unwrap();
        let wind = sides(of("wind"), &[-6.5, 100.0]);
        assert_eq!(wind[0], [-6.5, 20.0]);
        for signs in [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]] {
            assert!(wind[1..].contains(&signs.map(|x| 4.0 * x).to_vec()), "{signs:?}");
        }
        assert_eq!(sides(of("mass"), &[0.3]), [[0.005]]);
        // Where linear gains say little, from both sides; from one what has a sign.
        assert_eq!(to_all_sides(of("mass")), [[P::Mass.spec().prior], [-P::Mass.spec().prior]]);
        let play = to_all_sides(of("steering_free_play"));
        assert_eq!(play, [[P::FreePlay.spec().prior]]);
    }
}
