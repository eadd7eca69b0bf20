//! How probable an explanation is: posterior weights of the models that were compared.
//!
//! ```text
//! weight(M) ~ exp(log Z(M) + log p(M))     log p(M) = sum over its members of ln(pi/(1-pi))
//! ```
//! (MacKay, Neural Computation 4, 1992). A cause's probability is the share of the models
//! that hold it: the set that was found, the sets with one of its causes left out or replaced by
//! another one, and none at all. What a cause adds to the form of a large one is no evidence for it ([`crate::problem::course`]).
//!
//! A free function in the place of a cause is a model like any other: what has no name may share a
//! cause's part of the balance and follow a signal. One beside the causes is judged before
//! ([`crate::outside::sure`]).

use std::collections::BTreeMap;

use crate::search::decisions::{PRIOR_CAUSE, PRIOR_FUNCTION};

/// Log odds of a prior probability.
pub(crate) fn log_odds(p: f64) -> f64 {
    (p / (1.0 - p)).ln()
}

/// A model that was compared.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Weighed {
    /// Ids of its causes.
    pub(crate) causes: Vec<&'static str>,
    /// A free function beside them, by its number.
    pub(crate) function: Option<usize>,
    /// Log evidence, nats, from whatever level is common to all.
    pub(crate) log_z: f64,
}

/// The sets of `models` with each of the functions that are left beside what was found, numbered from 0,
/// which add `firm` nats. What is left says nothing about which of the causes are there: it stands beside
/// every set alike. Beside the found one alone it would make all of its members certain.
pub(crate) fn beside(models: &[Weighed], firm: &[f64]) -> Vec<Weighed> {
    let sets = models.iter().filter(|m| m.function.is_none());
    let with = |m: &Weighed| -> Vec<Weighed> {
        let one = |(n, nats): (usize, &f64)| Weighed {
            causes: m.causes.clone(),
            function: Some(n),
            log_z: m.log_z + nats,
        };
        firm.iter().enumerate().map(one).collect()
    };
    sets.flat_map(with).collect()
}

/// Weights of models, in their order; they add up to one. The same set under two shapes counts once,
/// by its better one.
pub(crate) fn weights(models: &[Weighed]) -> Vec<f64> {
    let score = |m: &Weighed| {
        let function = m.function.map_or(0.0, |_| log_odds(PRIOR_FUNCTION));
        m.log_z + m.causes.len() as f64 * log_odds(PRIOR_CAUSE) + function
    };
    let scores: Vec<f64> = models.iter().map(score).collect();
    let mut best: BTreeMap<(Option<usize>, Vec<&str>), usize> = BTreeMap::new();
    for (i, m) in models.iter().enumerate() {
        let mut causes = m.causes.clone();
        causes.sort_unstable();
        let before = best.entry((m.function, causes)).or_insert(i);
        if scores[i] > scores[*before] {
            *before = i;
        }
    }
    let top = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut raw = vec![0.0; models.len()];
    for i in best.into_values() {
        raw[i] = (scores[i] - top).exp();
    }
    let sum: f64 = raw.iter().sum();
    raw.iter().map(|w| w / sum).collect()
}

/// Weight of the models that `pick` chooses.
pub(crate) fn probability(
    models: &[Weighed],
    weights: &[f64],
    pick: impl Fn(&Weighed) -> bool,
) -> f64 {
    let chosen = models.iter().zip(weights).filter(|(m, _)| pick(m));
    chosen.map(|(_, w)| w).sum::<f64>().clamp(0.0, 1.0)
}

/// Weight of the models with each of the first `functions` functions, by their numbers.
pub(crate) fn of_functions(models: &[Weighed], weights: &[f64], functions: usize) -> Vec<f64> {
    let mut sums = vec![0.0; functions];
    for (model, weight) in models.iter().zip(weights) {
        if let Some(sum) = model.function.and_then(|n| sums.get_mut(n)) {
            *sum += weight;
        }
    }
    sums.into_iter().map(|sum: f64| sum.clamp(0.0, 1.0)).collect()
}

/// Which causes functions in their place outweigh: a function is there more probably than not
/// (`functions`, the sum of their weights), and the cause less so.
pub(crate) fn outweighed<'a>(causes: &[(&'a str, f64)], functions: f64) -> Vec<&'a str> {
    let open = causes.iter().filter(|c| log_odds(functions) > 0.0 && log_odds(c.1) < 0.0);
    open.map(|c| c.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An engine brake that holds less in thin air was called 10 % less engine brake, with a probability
    /// of 0.10 against functions of the altitude.
    #[test]
    fn a_cause_that_functions_outweigh_is_not_named_and_one_that_a_cause_outweighs_stays() {
        assert_eq!(outweighed(&[("engine_brake_torque", 0.1)], 0.9), ["engine_brake_torque"]);
        assert_eq!(outweighed(&[("mass", 0.99), ("engine_brake_torque", 0.2)], 0.75).len(), 1);
        assert!(outweighed(&[("air_drag", 0.3)], 0.01).is_empty());
        assert!(outweighed(&[("air_drag", 0.6)], 0.4).is_empty());
    }

    fn model(causes: &[&'static str], log_z: f64) -> Weighed {
        Weighed { causes: causes.to_vec(), function: None, log_z }
    }

    fn of(models: &[Weighed], id: &str) -> f64 {
        probability(models, &weights(models), |m| m.causes.contains(&id))
    }

    #[test]
    fn two_causes_that_say_the_same_share_the_probability() {
        let models = [model(&[], 0.0), model(&["a"], 40.0), model(&["b"], 40.0)];
        assert!((of(&models, "a") - 0.5).abs() < 1e-9 && (of(&models, "b") - 0.5).abs() < 1e-9);
        let models = [model(&[], 0.0), model(&["a"], 40.0), model(&["b"], 40.0 - 19.0_f64.ln())];
        assert!((of(&models, "a") - 0.95).abs() < 1e-9);
    }

    #[test]
    fn evidence_has_to_pay_for_the_prior() {
        let p = |nats| of(&[model(&[], 0.0), model(&["a"], nats)], "a");
        assert!((p(log_odds(1.0 - PRIOR_CAUSE)) - 0.5).abs() < 1e-9);
        assert!((p(0.0) - PRIOR_CAUSE).abs() < 1e-9);
        assert!(p(7.0) < 0.9 && p(10.0) > 0.99);
    }

    #[test]
    fn a_function_that_says_a_little_more_than_a_cause_makes_it_less_probable_and_not_unlikely() {
        let function = |n, log_z| Weighed { causes: Vec::new(), function: Some(n), log_z };
        let p =
            |more: f64| of(&[model(&[], 0.0), model(&["a"], 40.0), function(0, 40.0 + more)], "a");
        assert!(p(-5.0) > 0.9999 && p(1.0) > 0.95 && p(3.0) < 0.9 && p(10.0) < 0.01);
        let models = [model(&["a"], 40.0), function(0, 42.0), function(1, 42.0)];
        assert!(of(&models, "a") < p(2.0));
    }

    /// A helper was certain as soon as a function of 20 nats was left beside the set: only the whole set
    /// had it.
    #[test]
    fn a_function_beside_the_causes_says_nothing_about_which_of_them_are_there() {
        let sets =
            [model(&[], 0.0), model(&["a", "b"], 63.0), model(&["a"], 60.0), model(&["c"], 59.0)];
        let mut with = sets.to_vec();
        with.extend(beside(&sets, &[20.0, 35.0]));
        assert_eq!(with.len(), 12);
        for id in ["a", "b", "c"] {
            let (less, more) = (of(&sets, id), of(&with, id));
            assert!((less - more).abs() < 1e-9, "{id}: {less} {more}");
        }
        assert!(of(&with, "b") < 0.1);
        // A function in the place of a cause competes with what stands beside it.
        let instead = Weighed { causes: Vec::new(), function: Some(2), log_z: 75.0 };
        let alone = [&sets[..], core::slice::from_ref(&instead)].concat();
        let both = [&with[..], core::slice::from_ref(&instead)].concat();
        assert!(of(&alone, "a") < 0.1 && of(&both, "a") > 0.6);
    }

    #[test]
    fn shapes_of_one_set_count_once_and_evidence_of_any_size_is_no_overflow() {
        let models = [
            model(&[], 0.0),
            model(&["a"], 3e6),
            model(&["a"], 3e6),
            model(&["b"], 3e6),
            model(&["b", "a"], 3e6 - 1e3),
            model(&["a", "b"], 3e6 - 1e3),
        ];
        assert!((of(&models, "a") - 0.5).abs() < 1e-9, "{:?}", weights(&models));
        assert!((weights(&models).iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }
}
