//! The numbers that decide what is said of drives, each with its unit and where it comes from. Figures
//! of the truck, bounds of the readers and how finely something is computed stand where they are used.
//!
//! "Clean": set so that trucks in order stay silent in the campaigns of the first family. "Policy": what
//! a reader wants to hear of. `docs/results/diagnosis.md` says how they are counted.

// The model's priors.

/// Deviation of a cause's size between drives, and of its course along a signal, in its size, where
/// physics gives its law: what laws of drag or rolling resistance leave out. Prior deviation of a free
/// factor on a module's quantity.
pub(crate) const RHO: f64 = 0.05;
/// The same where the law is what a maker chose or a component happens to do, and the catalogue's is
/// one of many: a quarter more or less is still that cause (the meaning of the word, not fitted). Not
/// along a signal over which its form is fitted: form and course would be free of each other.
pub(crate) const RHO_SHAPE: f64 = 0.25;
/// Deviation of a wind within a drive, in its mean: turbulence of 0.15 to 0.25 along it (IEC 61400-1,
/// categories A to C), directions that scatter by 0.17 to 0.26 rad in an hour (Pasquill's classes D to
/// C, EPA-454/R-99-005).
pub(crate) const WEATHER: f64 = 0.2;
/// Probability of a cause before any drive is seen: with 37 causes one truck in six has one.
pub(crate) const PRIOR_CAUSE: f64 = 0.005;
/// Probability of a free function: of some two hundred that are tried one, in one truck in a hundred.
pub(crate) const PRIOR_FUNCTION: f64 = 5e-5;
/// Drives' worth of the expected scatter that a baseline's tolerances, or drives about a free function,
/// have to outweigh.
pub(crate) const SCATTER_PRIOR: f64 = 2.0;
/// Drives' worth of the expectation that drives scatter about a cause's size as their information says.
pub(crate) const DISPERSION_PRIOR: f64 = 4.0;
/// Deviation of a tolerance's mean, in its scatter.
pub(crate) const MEAN_PRIOR: f64 = 0.7;
/// Evidence of a free function that a drive in order may have where no baseline says how much, nats: a
/// third of the most that one of another simulator had.
pub(crate) const FREE_FORM_NATS: f64 = 12.0;
/// Times that what drives in order have of a free function is taken from its evidence, 1: clean.
pub(crate) const FREE_FORM_TIMES: f64 = 3.0;

// What is looked for and kept.

/// Least evidence for another cause, and for a first one that has a rival, nats: clean.
pub(crate) const MIN_EVIDENCE: f64 = 10.0;
/// Evidence that tells two explanations apart, nats: odds of twenty, where "strong" begins (Kass and
/// Raftery, J. Am. Stat. Assoc. 90, 1995). For rivals, drives held out and the odds of a cause that is
/// stated as the explanation.
pub(crate) const STRONG_NATS: f64 = 3.0;
/// Evidence within which another cause is listed, nats: where "very strong" begins (the same).
pub(crate) const LISTED_NATS: f64 = 5.0;
/// Part of the smallest size worth a word below which a cause is dropped, 1: policy.
pub(crate) const WORTH: f64 = 0.5;

// Sure or not.

/// Evidence that a free function needs beside or instead of named causes, nats: clean.
pub(crate) const UNKNOWN_EVIDENCE: f64 = 30.0;
/// Evidence of a free function or a disturbance over that of causes above which it wins, 1. Where
/// further causes would not come near it none are searched.
pub(crate) const AHEAD: f64 = 1.15;
/// Part of an evidence above which a linear gain ranks, 1: the half; in linear problems it is all. A set
/// whose causes' gains are below it is sought without their order, a rival whose gain is above it is
/// fitted.
pub(crate) const RANKED: f64 = 0.5;
/// Part of the evidence of several causes of one module above which a free function replaces them if
/// they leave much over, 1.
pub(crate) const REPLACED_MANY: f64 = 0.5;
/// Variance over that of drives in order, in tractor and trailer yaw alike, that is a disturbance of its
/// own, 1: clean.
pub(crate) const RESTLESS: f64 = 1.1;
/// The same in one module alone, 1: clean.
pub(crate) const RESTLESS_ALONE: f64 = 2.0;
/// Causes in one module from which on they may stand in for another one.
pub(crate) const CROWD: usize = 3;
/// Evidence, nats, and part of the causes' evidence that a force without a name may add: deleted causes
/// of the first family.
pub(crate) const CATCH_ALL: f64 = 4.0;
/// See [`CATCH_ALL`].
pub(crate) const CATCH_ALL_PART: f64 = 0.05;
/// Evidence, nats, and part of a size's evidence that sizes of the drives' own may add: deleted causes of
/// the first family.
pub(crate) const OWN_SIZES: f64 = 6.0;
/// See [`OWN_SIZES`].
pub(crate) const OWN_SIZES_PART: f64 = 0.15;

#[cfg(test)]
mod tests {
    /// They were about 120 once: whoever adds one looks for the term that the model lacks, or takes one out.
    #[test]
    fn at_most_twenty_five_numbers_decide_and_each_says_what_it_is() {
        let lines: Vec<&str> = include_str!("decisions.rs").lines().collect();
        let is_number = |line: &str| line.starts_with("pub(crate) const");
        let silent = lines.windows(2).find(|w| is_number(w[1]) && !w[0].starts_with("///"));
        assert_eq!(silent, None);
        assert!(lines.iter().filter(|line| is_number(line)).count() <= 25);
    }
}
