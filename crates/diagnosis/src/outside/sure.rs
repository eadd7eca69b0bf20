//! Named causes against what the catalogue does not have: whether the causes explain the drives,
//! may stand in for something else, or give way to a free function of a signal.

use crate::Unknown;
use crate::causes::hypothesis::CATALOGUE;
use crate::causes::param::{P, Theta};
use crate::causes::sentence;
use crate::outside::catch_all::Left;
use crate::outside::unknown::{Acts, Restless, Shape};
use crate::problem::Problem;
use crate::problem::course::Point;
use crate::replay::Module;
use crate::search::decisions::{
    AHEAD, CATCH_ALL, CATCH_ALL_PART, CROWD, FREE_FORM_TIMES, REPLACED_MANY, UNKNOWN_EVIDENCE,
};
use crate::search::refit::Fit;
use crate::studies::identify::SIGMAS_90;

/// Modules whose replay reads what another one measures: speed is read by all, torque and pressure by
/// the force balance, torque by the fuel, the yaw rate by heading and trailer.
fn reads(reader: Module, measured: Module) -> bool {
    match measured {
        Module::Force => true,
        Module::Torque => matches!(reader, Module::Force | Module::Fuel),
        Module::Brake => reader == Module::Force,
        Module::Fuel => reader == Module::Co2,
        Module::Yaw => matches!(reader, Module::Heading | Module::TrailerYaw),
        _ => false,
    }
}

/// How sure a set of named causes is against what the catalogue does not have.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sure {
    /// The causes explain what there is.
    Yes,
    /// Much is left that they do not explain: the causes may stand in for something else.
    Not,
    /// A free function, or a random disturbance, explains more than any cause.
    Outside,
}

/// Decides between named causes, a free function of a signal and a random disturbance, and whether
/// causes that stay may stand in for something else.
pub(crate) fn judge(
    problem: &Problem<'_>,
    empty: &Fit,
    fit: Fit,
    bare: &[Shape],
) -> (Fit, Option<Unknown>, Sure) {
    let (fit, unknown, sure) = against_functions(problem, empty, fit, bare);
    if sure != Sure::Yes || fit.set.is_empty() {
        return (fit, unknown, sure);
    }
    let doubt = || -> Option<Left> {
        let left = (sharing(&fit, Module::Force) > 0).then(|| problem.catch_all(&fit)).flatten()?;
        (left.evidence > CATCH_ALL.max(CATCH_ALL_PART * fit.log_z)).then_some(left)
    };
    if let Some(left) = doubt() {
        return (fit, unknown.or(Some(resembling(&left))), Sure::Not);
    }
    let sure = if stands_in(problem, &fit) || problem.evidence().disagree(&fit) {
        Sure::Not
    } else {
        Sure::Yes
    };
    (fit, unknown, sure)
}

fn against_functions(
    problem: &Problem<'_>,
    empty: &Fit,
    fit: Fit,
    bare: &[Shape],
) -> (Fit, Option<Unknown>, Sure) {
    let best_bare = bare.first().map_or(0.0, |s| s.log_z);
    if let Some(random) = problem.restless(&Point::of(empty))
        && random.evidence > best_bare
        && bare.first().is_none_or(|s| s.module != random.module)
    {
        let left = apart(problem, empty, &fit, random.module);
        if random.evidence > AHEAD * (fit.log_z - left.log_z) {
            return (left, Some(noise(&random)), Sure::Outside);
        }
    }
    if bare.first().is_some_and(|s| s.firm > UNKNOWN_EVIDENCE) && best_bare > AHEAD * fit.log_z {
        return (elsewhere(problem, empty, &fit, bare), describe(bare), Sure::Outside);
    }
    let rest = if fit.set.is_empty() { bare.to_vec() } else { beyond(problem, &Point::of(&fit)) };
    let left = rest.first().map_or(0.0, |s| s.firm);
    if left > UNKNOWN_EVIDENCE {
        let share = rest.first().map_or(0, |s| sharing(&fit, s.module));
        // Causes that leave much and that one free function replaces stand in for it.
        let replaced = if share > 1 { REPLACED_MANY } else { 1.0 };
        let outdone = share > 0 && best_bare > replaced * fit.log_z;
        if outdone && best_bare > alone(problem, empty, &fit, rest.first()) {
            return (elsewhere(problem, empty, &fit, bare), describe(bare), Sure::Outside);
        }
        let sure = match (fit.set.is_empty(), share) {
            (true, _) => Sure::Outside,
            (false, 0) => Sure::Yes,
            (false, _) => Sure::Not,
        };
        return (fit, describe(&rest), sure);
    }
    if let Some(random) = problem.restless(&Point::of(&fit)) {
        let left = apart(problem, empty, &fit, random.module);
        if fit.set.is_empty() || random.evidence > fit.log_z - left.log_z {
            return (left, Some(noise(&random)), Sure::Outside);
        }
        let sure = if sharing(&fit, random.module) > 0 { Sure::Not } else { Sure::Yes };
        return (fit, Some(noise(&random)), sure);
    }
    (fit, None, Sure::Yes)
}

/// Evidence once only the strongest of the causes that show where most is `left` stands there. A function
/// that does not outdo this one is not made its better by a small cause that stands beside it.
fn alone(problem: &Problem<'_>, empty: &Fit, fit: &Fit, left: Option<&Shape>) -> f64 {
    let Some(module) = left.map(|s| s.module) else { return fit.log_z };
    let mut now = fit.clone();
    while sharing(&now, module) > 1 {
        let all = problem.evidence().each_left_out(&now, empty);
        let there = all.into_iter().zip(&now.set).filter(|(_, h)| shows(**h, module));
        let fewer = there.filter_map(|(without, _)| without);
        let Some(best) = fewer.max_by(|a, b| a.log_z.total_cmp(&b.log_z)) else { break };
        now = best;
    }
    now.log_z
}

/// The causes that do not show where the best free function wins.
fn elsewhere(problem: &Problem<'_>, empty: &Fit, fit: &Fit, won: &[Shape]) -> Fit {
    won.first().map_or_else(|| empty.clone(), |w| apart(problem, empty, fit, w.module))
}

/// The causes that do not show where something without a name wins, nor in what is replayed from what
/// is measured there: it says nothing about them.
fn apart(problem: &Problem<'_>, empty: &Fit, fit: &Fit, won: Module) -> Fit {
    without(problem, empty, fit, |cause| {
        Module::ALL.into_iter().any(|m| (m == won || reads(m, won)) && shows(cause, m))
    })
}

/// The causes that are not in doubt, as far as they stand alone.
pub(crate) fn without(
    problem: &Problem<'_>,
    empty: &Fit,
    fit: &Fit,
    in_doubt: impl Fn(usize) -> bool,
) -> Fit {
    let mut left = fit.clone();
    let mut i = 0;
    while i < left.set.len() {
        if !in_doubt(left.set[i]) {
            i += 1;
            continue;
        }
        let (fewer, theta) = problem.evidence().without(&left, i);
        let Some(refit) = problem.evidence().fit(&fewer, &theta, empty.norm) else {
            return empty.clone();
        };
        left = refit;
    }
    // Who stood beside those that are gone has to pay for itself now.
    let left = problem.evidence().gate(left, empty);
    if left.log_z > UNKNOWN_EVIDENCE { left } else { empty.clone() }
}

/// Free functions of what is left at a point, beyond those that drives in order have too, best first.
pub(crate) fn beyond(problem: &Problem<'_>, at: &Point) -> Vec<Shape> {
    let mut shapes = problem.shapes(at);
    let drives = problem.drives.len() as f64;
    for s in &mut shapes {
        let usual = problem.reference.free_form[s.module as usize].max(0.0);
        let agreed = if s.log_z > 0.0 { (s.firm / s.log_z).clamp(0.0, 1.0) } else { 1.0 };
        s.log_z -= FREE_FORM_TIMES * drives * usual;
        s.firm = agreed * s.log_z;
    }
    shapes.sort_by(|a, b| b.log_z.total_cmp(&a.log_z));
    shapes
}

/// A cause of the catalogue acts on a module.
pub(crate) fn shows(cause: usize, module: Module) -> bool {
    CATALOGUE[cause].groups().iter().any(|g| g.modules().contains(&module))
}

/// How many of the causes show in a module.
fn sharing(fit: &Fit, module: Module) -> usize {
    fit.set.iter().filter(|h| shows(**h, module)).count()
}

/// Signs that the named causes stand in for one that the catalogue lacks: three of them share a
/// module, a size or a form has run to its bound, or the meters of fuel and of what it burns to err
/// alike.
fn stands_in(problem: &Problem<'_>, fit: &Fit) -> bool {
    let crowded = Module::ALL.into_iter().any(|m| sharing(fit, m) >= CROWD);
    let zero = &problem.reference.theta;
    let ends = |h: &usize| {
        CATALOGUE[*h].is_at_bound(&fit.theta, zero) || CATALOGUE[*h].strays(&fit.theta, zero)
    };
    crowded || fit.set.iter().any(ends) || meters_err_alike(fit, zero)
}

/// The meters of fuel and CO2 err by the same: they agree, and what is off is the fuel that is burnt, of
/// which the catalogue has low loads alone.
fn meters_err_alike(fit: &Fit, zero: &Theta) -> bool {
    let at = |p: P| fit.free.iter().position(|q| *q == p);
    let (Some(i), Some(j)) = (at(P::FuelFlow), at(P::Co2Scale)) else { return false };
    let [fuel, co2] = [P::FuelFlow, P::Co2Scale].map(|p| p.of_truck(&fit.theta, zero));
    err_alike(fuel, co2, fit.covariance[(i, i)] + fit.covariance[(j, j)])
}

/// Two errors to the same side whose 90 % intervals meet at the root of this sum of their variances. What
/// both have in common is known better than either: their covariance says nothing here.
fn err_alike(a: f64, b: f64, variance: f64) -> bool {
    a * b > 0.0 && (a - b).powi(2) < (SIGMAS_90 * SIGMAS_90) * variance
}

/// What the best of some free functions says, with the signals that say nearly as much.
pub(crate) fn describe(shapes: &[Shape]) -> Option<Unknown> {
    let best = shapes.first()?;
    let mut signals: Vec<&'static str> = Vec::new();
    for s in shapes.iter().filter(|s| s.module == best.module && s.log_z > 0.5 * best.log_z) {
        if signals.len() < 3 && !signals.contains(&s.signal) {
            signals.push(s.signal);
        }
    }
    Some(Unknown {
        signals,
        quantity: best.module.quantity(),
        shape: sentence::shape(best),
        explained_frac: best.explained_frac,
        evidence: best.log_z,
        table: best.knots.clone(),
        is_factor: best.acts != Acts::Added,
        memory_s: best.memory_s,
    })
}

/// A force that named causes leave.
fn resembling(left: &Left) -> Unknown {
    Unknown {
        signals: vec![left.signal],
        quantity: Module::Force.quantity(),
        shape: format!("what is left resembles {}", left.words),
        explained_frac: 0.0,
        evidence: left.evidence,
        table: Vec::new(),
        is_factor: false,
        memory_s: 0.0,
    }
}

/// A disturbance that follows no signal: the channel that shows it, and the other yaw rate with it.
fn noise(random: &Restless) -> Unknown {
    let quantity = random.module.quantity();
    let signals = match random.module {
        Module::Yaw => vec![quantity, Module::TrailerYaw.quantity()],
        Module::TrailerYaw => vec![quantity, Module::Yaw.quantity()],
        _ => vec![quantity],
    };
    Unknown {
        signals,
        quantity,
        shape: sentence::restless(random.module, random.excess),
        explained_frac: 0.0,
        evidence: random.evidence,
        table: Vec::new(),
        is_factor: false,
        memory_s: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::err_alike;

    /// An island in a fuel map was a fuel meter of +5.9 % and a CO2 meter of +6.7 %, stated as sure.
    #[test]
    fn meters_that_err_by_the_same_are_told_from_those_that_do_not() {
        let variance = 0.0074_f64.powi(2) + 0.0107_f64.powi(2);
        assert!(err_alike(0.0588, 0.0675, variance));
        assert!(!err_alike(0.0588, -0.0675, variance));
        assert!(!err_alike(0.0588, 0.12, variance));
    }
}
