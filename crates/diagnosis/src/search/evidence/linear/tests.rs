//! What the search makes of evidence that is known exactly.

use super::*;
use crate::search::decisions::MIN_EVIDENCE;
use crate::search::decisions::RHO;
use crate::search::refit::{Beyond, Fit};

mod gate;

const ROWS: usize = 64;

/// Rows that are orthogonal for different `k`, of length one.
fn wave(k: usize) -> Vec<f64> {
    let of = |i: usize| {
        let angle = core::f64::consts::PI * (i as f64 + 0.5) * k as f64 / ROWS as f64;
        angle.cos() * (2.0 / ROWS as f64).sqrt()
    };
    (0..ROWS).map(of).collect()
}

fn times(x: &[f64], factor: f64) -> Vec<f64> {
    x.iter().map(|x| x * factor).collect()
}

fn plus(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + b).collect()
}

/// One drive of the force balance.
fn drive(residual: Vec<f64>, columns: &[(P, Vec<f64>)]) -> LinearDrive {
    let columns = columns.to_vec();
    LinearDrive { residual, columns, tolerances: Vec::new(), squares: Vec::new() }
}

/// The same drive `count` times.
fn alike(count: usize, residual: &[f64], columns: &[(P, Vec<f64>)]) -> LinearProblem {
    LinearProblem::new((0..count).map(|_| drive(residual.to_vec(), columns)).collect())
}

/// The set that the search finds among `ids`, and what the gate leaves of it; with the empty set.
fn found(problem: &LinearProblem, ids: &[&str]) -> (Vec<&'static str>, Fit, Fit) {
    let open: Vec<usize> = ids.iter().map(|id| LinearProblem::cause(id)).collect();
    let evidence: &dyn Evidence = problem;
    let (empty, fit) = evidence.search(&open, 4, 0.0, &mut |_| {}).unwrap();
    let fit = evidence.gate(fit, &empty);
    let names = fit.set.iter().map(|h| CATALOGUE[*h].id).collect();
    (names, fit, empty)
}

const DRAG: &str = "air_drag";
const MASS: &str = "mass";

/// A cause of one prior deviation leaves this many nats' worth of squares in each of six drives.
const STRONG: f64 = 40.0;

#[test]
fn nothing_is_found_where_nothing_is() {
    let columns = [(P::Drag, times(&wave(1), STRONG)), (P::Mass, times(&wave(2), STRONG))];
    let noise = times(&plus(&wave(7), &wave(9)), 4.0);
    assert!(found(&alike(6, &noise, &columns), &[DRAG, MASS]).0.is_empty());
}

#[test]
fn orthogonal_causes_are_both_found_with_their_sizes() {
    let columns = [(P::Drag, times(&wave(1), STRONG)), (P::Mass, times(&wave(2), STRONG))];
    let residual = plus(&times(&columns[0].1, 0.3), &times(&columns[1].1, -0.2));
    let (mut names, fit, _) = found(&alike(6, &residual, &columns), &[DRAG, MASS]);
    names.sort_unstable();
    assert_eq!(names, [DRAG, MASS]);
    assert!((fit.theta[P::Drag as usize] - 0.3).abs() < 0.01);
    assert!((fit.theta[P::Mass as usize] + 0.2).abs() < 0.01);
}

#[test]
fn of_a_collinear_pair_one_is_found_and_the_other_says_as_much() {
    let (one, other) = (wave(1), plus(&times(&wave(1), 0.998), &times(&wave(2), 0.06)));
    let columns = [(P::Drag, times(&one, STRONG)), (P::Mass, times(&other, STRONG))];
    let problem = alike(6, &times(&one, 0.15 * STRONG), &columns);
    let (names, fit, empty) = found(&problem, &[DRAG, MASS]);
    assert_eq!(names.len(), 1, "{names:?}");
    let evidence: &dyn Evidence = &problem;
    let rival = if names[0] == DRAG { MASS } else { DRAG };
    let screen = evidence.screen(&empty, &[LinearProblem::cause(rival)]);
    let gain = screen.singles(None)[0].gain;
    assert!((fit.log_z - gain).abs() < 3.0, "{} {gain}", fit.log_z);
}

/// A force without a name took a minute: each further cause patched a little more of it, and in the end
/// a function won over all of them.
#[test]
fn the_search_ends_where_a_function_wins_over_whatever_may_follow() {
    let columns = [(P::Drag, 1, 0.4), (P::Mass, 2, 0.2), (P::Rolling, 3, 0.1)]
        .map(|(p, k, size)| ((p, times(&wave(k), STRONG)), size));
    let residual = columns.iter().map(|((_, x), size)| times(x, *size));
    let residual = residual.reduce(|a, b| plus(&a, &b)).unwrap();
    let problem = alike(6, &residual, &columns.map(|x| x.0));
    let open = [DRAG, MASS, "rolling_resistance"].map(LinearProblem::cause);
    let evidence: &dyn Evidence = &problem;
    let found = |bare| evidence.search(&open, 4, bare, &mut |_| {}).unwrap().1;
    let all = found(0.0);
    assert_eq!(all.set.len(), 3);
    // Two causes say 960 nats, the second one 192 of them: two more may bring 1,344.
    assert_eq!(found(2000.0).set, all.set[..2]);
    assert_eq!(found(1400.0).set, all.set);
}

/// Where one cause alone says nothing, two must say as much as another one would have to.
#[test]
fn two_causes_that_say_little_are_no_more_found_than_one() {
    let near =
        |sign: f64| plus(&times(&wave(1), 0.995 * STRONG), &times(&wave(2), sign * 0.1 * STRONG));
    let columns = [(P::Drag, near(1.0)), (P::Mass, near(-1.0))];
    let open = [DRAG, MASS].map(LinearProblem::cause);
    let of = |residual: f64| {
        let problem = alike(6, &times(&wave(2), residual), &columns);
        let evidence: &dyn Evidence = &problem;
        let zero = *evidence.zero();
        let norm = evidence.gram(&zero, &[]).sum(|_| true).2;
        let both = evidence.fit(&open, &zero, norm).unwrap().log_z;
        (both, evidence.search(&open, 4, 0.0, &mut |_| {}).unwrap().1.set.len())
    };
    let [(little, none), (much, two)] = [of(2.0), of(4.0)];
    assert!((1.0..MIN_EVIDENCE).contains(&little) && much > MIN_EVIDENCE, "{little} {much}");
    assert_eq!([none, two], [0, 2]);
}

#[test]
fn a_fit_that_would_not_say_enough_is_given_up() {
    let columns = [(P::Drag, times(&wave(1), STRONG))];
    let problem = alike(6, &times(&columns[0].1, 0.3), &columns);
    let evidence: &dyn Evidence = &problem;
    let (set, zero) = ([LinearProblem::cause(DRAG)], *evidence.zero());
    let norm = evidence.gram(&zero, &[]).sum(|_| true).2;
    let fit = evidence.fit(&set, &zero, norm).unwrap();
    let beyond = |least| evidence.fit_beyond(&set, &zero, norm, &mut Beyond::evidence(least));
    let kept = beyond(0.9 * fit.log_z).unwrap();
    assert_eq!((kept.log_z, kept.theta), (fit.log_z, fit.theta));
    assert!(beyond(1.1 * fit.log_z).is_none());
}

/// A wind was fitted from five sides to the end, though most of them led to the same place.
#[test]
fn a_fit_from_another_side_ends_where_it_comes_to_where_one_has_ended() {
    let columns = [(P::Drag, times(&wave(1), STRONG)), (P::Mass, times(&wave(2), STRONG))];
    let residual = plus(&times(&columns[0].1, 0.3), &times(&columns[1].1, 0.1));
    let problem = alike(6, &residual, &columns);
    let evidence: &dyn Evidence = &problem;
    let (set, zero) = ([LinearProblem::cause(DRAG)], *evidence.zero());
    let norm = evidence.gram(&zero, &[]).sum(|_| true).2;
    let from = |start, beyond: &mut _| evidence.fit_beyond(&set, start, norm, beyond);
    let mut other_side = zero;
    other_side[P::Drag as usize] = 0.5;
    // Nothing has to be beaten in any of these but the place.
    let nothing = || Beyond::evidence(f64::NEG_INFINITY);
    assert!(from(&other_side, &mut nothing()).is_some());
    let mut known = nothing();
    assert!(from(&zero, &mut known).is_some());
    known.least = f64::NEG_INFINITY;
    assert!(from(&other_side, &mut known).is_none());
    // The same size beside another figure that the fit holds is another place, and a better one.
    let mut elsewhere = other_side;
    elsewhere[P::Mass as usize] = 0.1;
    assert!(from(&elsewhere, &mut known).is_some());
}

/// Rows times what grows evenly from -1 to 1 over them.
fn growing(x: &[f64]) -> Vec<f64> {
    let place = |i: usize| 2.0 * i as f64 / (ROWS - 1) as f64 - 1.0;
    x.iter().enumerate().map(|(i, x)| x * place(i)).collect()
}

/// A large cause whose course differs by 5 % from the catalogue's leaves what another cause would
/// take: far more nats than one needs that stands alone. Known exactly, it would be a cause.
#[test]
fn a_helper_that_patches_the_form_of_a_large_cause_is_not_taken() {
    let (one, patch) = (wave(1), growing(&wave(1)));
    let columns = [(P::Drag, times(&one, 800.0)), (P::Mass, times(&patch, 200.0))];
    let course = plus(&columns[0].1, &times(&patch, 0.05 * 800.0));
    let problem = alike(6, &times(&course, 0.4), &columns);
    let (names, fit, _) = found(&problem, &[DRAG, MASS]);
    assert_eq!(names, [DRAG]);
    assert!((fit.theta[P::Drag as usize] - 0.4).abs() < 0.01);
    let patched =
        0.5 * 6.0 * (0.4 * 0.05 * 800.0_f64).powi(2) * patch.iter().map(|x| x * x).sum::<f64>();
    assert!(patched > 200.0, "{patched}");
}

/// Beside a cause that explains millions of nats another one is named by its own evidence: no share
/// of the large one is asked of it, for it does what no course of the large one does.
#[test]
fn a_small_cause_beside_a_very_strong_one_is_found() {
    let columns = [(P::Drag, times(&wave(1), 4000.0)), (P::Mass, times(&wave(2), STRONG))];
    let residual = plus(&times(&columns[0].1, 0.4), &times(&columns[1].1, 0.2));
    let (mut names, fit, empty) = found(&alike(6, &residual, &columns), &[DRAG, MASS]);
    assert!(fit.log_z - empty.log_z > 1e6);
    names.sort_unstable();
    assert_eq!(names, [DRAG, MASS]);
}

/// What drives in plenty say about a size is no better than the form of the cause.
#[test]
fn a_size_is_known_no_better_than_the_form_of_its_cause() {
    let sigma = |strength: f64| {
        let columns = [(P::Drag, times(&wave(1), strength))];
        let (_, fit, _) = found(&alike(6, &times(&columns[0].1, 0.4), &columns), &[DRAG]);
        fit.covariance[(0, 0)].sqrt()
    };
    assert!(sigma(4000.0) > 0.02 * 0.4, "{}", sigma(4000.0));
    assert!((sigma(STRONG) - 1.0 / (6.0_f64.sqrt() * STRONG)).abs() < 0.01);
}

#[test]
fn the_wind_of_one_stormy_drive_is_no_cause() {
    let columns = [(P::WindX, times(&wave(1), 2.0)), (P::WindY, times(&wave(2), 2.0))];
    let mut problem = alike(6, &[0.0; ROWS], &columns);
    problem.drives[2].residual = times(&wave(1), 40.0);
    assert!(found(&problem, &["wind"]).0.is_empty());
    // The same push in every drive is one.
    let problem = alike(6, &times(&wave(1), 16.0), &columns);
    assert_eq!(found(&problem, &["wind"]).0, ["wind"]);
}

/// What follows no cause at all costs the cause beside it nothing, and names none.
#[test]
fn an_unknown_beside_a_cause_leaves_the_cause_alone() {
    let columns = [(P::Drag, times(&wave(1), STRONG)), (P::Mass, times(&wave(2), STRONG))];
    let unknown = times(&wave(11), 30.0);
    let residual = plus(&times(&columns[0].1, 0.3), &unknown);
    let (names, fit, _) = found(&alike(6, &residual, &columns), &[DRAG, MASS]);
    assert_eq!(names, [DRAG]);
    assert!((fit.theta[P::Drag as usize] - 0.3).abs() < 0.01);
    assert!(found(&alike(6, &unknown, &columns), &[DRAG, MASS]).0.is_empty());
}

#[test]
fn a_tolerance_that_does_the_same_takes_the_cause_away() {
    let columns = [(P::Drag, times(&wave(1), STRONG))];
    let residual = times(&columns[0].1, 0.1);
    assert_eq!(found(&alike(6, &residual, &columns), &[DRAG]).0, [DRAG]);
    let mut problem = alike(6, &residual, &columns);
    for d in &mut problem.drives {
        d.tolerances = vec![times(&wave(1), STRONG)];
    }
    assert!(found(&problem, &[DRAG]).0.is_empty());
}

/// Trucks in order that differed twice as much from day to day had a wind or softer tyres, 13 and 29 nats:
/// the days' own, squared.
#[test]
fn the_squares_of_windy_days_are_no_cause() {
    let columns = [(P::Drag, times(&wave(2), STRONG))];
    let windy = |z: f64, drag: f64, squares: bool| {
        let tolerance = times(&wave(1), 5.0);
        let day = plus(&times(&tolerance, z), &times(&wave(2), z * z));
        let mut problem = alike(6, &plus(&day, &times(&columns[0].1, drag)), &columns);
        for d in &mut problem.drives {
            d.tolerances = vec![tolerance.clone()];
            d.squares = if squares { vec![wave(2)] } else { Vec::new() };
        }
        found(&problem, &[DRAG]).0
    };
    assert_eq!(windy(2.0, 0.0, false), [DRAG]);
    assert!(windy(2.0, 0.0, true).is_empty());
    // A drag on calm days, and a large one on windy ones, stay.
    assert_eq!(windy(0.0, 0.1, true), [DRAG]);
    assert_eq!(windy(2.0, 0.3, true), [DRAG]);
}

#[test]
fn drives_held_out_confirm_a_cause_doubt_it_or_take_it_away() {
    let columns = [(P::Drag, times(&wave(1), STRONG))];
    let of = |count, size: f64| alike(count, &times(&columns[0].1, size), &columns);
    let learned = of(6, 0.1);
    let (names, fit, empty) = found(&learned, &[DRAG]);
    assert_eq!(names, [DRAG]);
    let evidence: &dyn Evidence = &learned;
    let revised = |held: f64| {
        let r = evidence.revise(&of(2, held), fit.clone(), &empty);
        (r.fit.set.len(), r.opposed)
    };
    assert_eq!(revised(0.1), (1, false));
    assert_eq!(revised(0.0), (1, true));
    assert_eq!(revised(-0.2), (0, false));
}

/// Nats that a fit leaves where a cause wanders by `swing` of it within every drive, to one side or the
/// other, beside tolerances of its constant part of `tolerance` of its size.
fn left_of(p: P, tolerance: f64, swing: f64) -> f64 {
    let size = p.spec().prior;
    let columns = [(p, times(&wave(1), 240.0 / size))];
    let of = |sign: f64| {
        let along =
            |(i, x): (usize, &f64)| x * (1.0 + sign * swing * (2.0 * i as f64 / ROWS as f64 - 1.0));
        let rows = times(&columns[0].1, size).iter().enumerate().map(along).collect();
        let tolerances = vec![times(&columns[0].1, tolerance * size)];
        LinearDrive { tolerances, ..drive(rows, &columns) }
    };
    let problem = LinearProblem::new([1.0, -1.0, 1.0, -1.0, 1.0, -1.0].map(of).into());
    let evidence: &dyn Evidence = &problem;
    let norm = evidence.gram(&[0.0; PARAMS], &[]).total().2;
    let set: Vec<usize> =
        (0..CATALOGUE.len()).filter(|h| CATALOGUE[*h].sizes == [p]).take(1).collect();
    let fit = evidence.fit(&set, &[0.0; PARAMS], norm).unwrap();
    0.5 * norm - fit.log_z
}

/// What wandering by a fifth takes from that.
fn lost_to_wander(p: P, tolerance: f64) -> f64 {
    left_of(p, tolerance, 0.2) - left_of(p, tolerance, 0.0)
}

/// A steering that is off centre by a fifth more at the start of a trip and a fifth less at its end, or
/// the other way round, was a crosswind, which may swell: an offset may wander of every drive for itself,
/// a drag may not.
#[test]
fn what_wanders_does_so_of_every_drive_for_itself() {
    let lost = |p| lost_to_wander(p, 0.0);
    let (offset, drag) = (lost(P::SteerOffset), lost(P::Drag));
    assert!(offset < 0.2 * drag && drag > 100.0, "{offset} {drag}");
}

/// Trucks in order are off centre, too, by a tenth of it: that took nearly all that a constant offset
/// shows, the course was allowed no more than was left, and a wind and the front tyres explained how the
/// offset wandered.
#[test]
fn what_wanders_does_so_in_full_where_tolerances_take_what_is_constant() {
    let lost = |p| lost_to_wander(p, 0.1);
    let (offset, drag) = (lost(P::SteerOffset), lost(P::Drag));
    assert!(offset < 0.2 * drag && drag > 100.0, "{offset} {drag}");
}

/// With a course that was free whatever the drives show, a yaw rate sensor with a steady bias was silent:
/// the forty hats of each of these six drives cost more than 300 nats.
#[test]
fn what_may_wander_and_does_not_costs_few_nats_a_drive() {
    let left = |p| left_of(p, 0.1, 0.0);
    let (offset, drag) = (left(P::SteerOffset), left(P::Drag));
    assert!(offset < drag + 6.0 * 3.0, "{offset} {drag}");
}

/// Five drives ask for 0.2, one for 0.5: each says so, with what it knows.
#[test]
fn every_drive_says_which_size_it_alone_would_choose() {
    let columns = [(P::Drag, times(&wave(1), STRONG))];
    let mut problem = alike(6, &times(&columns[0].1, 0.2), &columns);
    problem.drives[3].residual = times(&columns[0].1, 0.5);
    let evidence: &dyn Evidence = &problem;
    let set = [LinearProblem::cause(DRAG)];
    let fit = evidence.fit(&set, evidence.zero(), 0.0).unwrap();
    let alone = evidence.alone(&fit);
    assert_eq!(alone.len(), 6);
    // What the drive knows, and what the cause may scatter between drives.
    let sigma = STRONG.recip().hypot(RHO * fit.theta[P::Drag as usize]);
    for (i, sizes) in alone.iter().enumerate() {
        let expected = if i == 3 { 1.5 } else { 1.2 };
        assert_eq!((sizes[0].id, sizes[0].parameter), (DRAG, "cd_a_scale"));
        assert!((sizes[0].value - expected).abs() < 0.01, "{i}: {sizes:?}");
        assert!((sizes[0].sigma / sigma - 1.0).abs() < 0.01, "{i}: {sizes:?}");
    }
}

/// The drives themselves say how they scatter, a few of them little: a little that they agree about is
/// worth less than it says, and what they contradict each other about still less.
#[test]
fn a_cause_is_worth_what_few_drives_can_say() {
    let columns = [(P::Drag, times(&wave(1), STRONG)), (P::Mass, times(&wave(2), STRONG))];
    let worth = |sizes: [f64; 6]| {
        let of = |x: &f64| plus(&times(&columns[0].1, 0.3), &times(&columns[1].1, *x));
        let drives = sizes.iter().map(|x| drive(of(x), &columns)).collect();
        let problem = LinearProblem::new(drives);
        let evidence: &dyn Evidence = &problem;
        let set = [DRAG, MASS].map(LinearProblem::cause);
        let zero = [0.0; PARAMS];
        let norm = evidence.gram(&zero, &[]).total().2;
        let both = evidence.fit(&set, &zero, norm).unwrap();
        let one = evidence.fit(&set[..1], &zero, norm).unwrap();
        let nats = both.log_z - one.log_z;
        let of = |nats| evidence.worth(&both, 1, &[2e4, nats]);
        (nats, of(nats), of(1e4))
    };
    let (nats, agreed, much) = worth([0.06; 6]);
    assert!((9.0..13.0).contains(&nats), "{nats}");
    assert!((agreed - 4.5 * (2.0 * nats / 9.0).ln_1p()).abs() < 1e-9, "{agreed}");
    assert!(much > 20.0, "{much}");
    let (nats, contradicted, _) = worth([0.13, -0.01, 0.13, -0.01, 0.13, -0.01]);
    assert!(nats > 9.0 && contradicted < 0.8 * agreed, "{nats} {contradicted} {agreed}");
}

/// A cause that is 25 % off in its form may look like any other that shows where it does: what a little
/// of one adds beside it is worth little, what is far more than that stays, and so does what shows
/// elsewhere. What the strongest is worth its form says nothing about.
#[test]
fn what_the_form_of_a_stronger_cause_may_look_like_is_worth_little() {
    const FRICTION: &str = "engine_friction";
    let columns = [
        (P::Friction, times(&wave(1), 100.0)),
        (P::Drag, times(&wave(2), STRONG)),
        (P::YawBias, times(&wave(3), 1_000.0)),
    ];
    let worth = |name: &str, p: P, size: f64| {
        let own = &columns.iter().find(|c| c.0 == p).unwrap().1;
        let residual = plus(&times(&columns[0].1, 0.4), &times(own, size));
        let problem = alike(6, &residual, &columns);
        let evidence: &dyn Evidence = &problem;
        let set = [FRICTION, name].map(LinearProblem::cause);
        let zero = [0.0; PARAMS];
        let norm = evidence.gram(&zero, &[]).total().2;
        let both = evidence.fit(&set, &zero, norm).unwrap();
        let alone = |i: usize| evidence.fit(&[set[1 - i]], &zero, norm).unwrap();
        let nats = [0, 1].map(|i| both.log_z - alone(i).log_z);
        (nats, [0, 1].map(|i| evidence.worth(&both, i, &nats)))
    };
    let (nats, [main, patch]) = worth(DRAG, P::Drag, 0.1);
    assert!(nats[1] > 15.0 && patch < 3.0, "{nats:?} {patch}");
    assert!((main - 4.5 * (2.0 * nats[0] / 9.0).ln_1p()).abs() < 1e-9);
    let (nats, [_, large]) = worth(DRAG, P::Drag, 0.8);
    assert!(large > 10.0, "{nats:?} {large}");
    let (nats, [_, elsewhere]) = worth("yaw_rate_bias", P::YawBias, 0.02);
    assert!(nats[1] > 15.0 && elsewhere > 6.0, "{nats:?} {elsewhere}");
}

/// Noise that remembers longer than its filter scatters the drives about every size: drives in order say
/// by how much, and evidence counts for less by that, of a lone cause too.
#[test]
fn what_drives_in_order_scatter_about_a_cause_takes_from_its_evidence() {
    let columns = [(P::Drag, times(&wave(1), STRONG))];
    let scattered = |by: f64| {
        let pushes = [1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0];
        let of = |push: &f64| drive(times(&wave(1), by * push), &columns);
        let problem = LinearProblem::new(pushes.iter().map(of).collect());
        let evidence: &dyn Evidence = &problem;
        evidence.scatter_in_order()[LinearProblem::cause(DRAG)]
    };
    // Eight drives against four drives' worth of what is expected.
    assert!((scattered(1.0).ratio - 1.0).abs() < 1e-9);
    let more = scattered(2.0);
    assert!((more.ratio - (4.0 + 8.0 * 4.0) / 12.0).abs() < 1e-9);
    assert!((more.freedom - 12.0).abs() < 1e-9);
    let mut problem = alike(6, &times(&columns[0].1, 0.1), &columns);
    problem.scatter = more;
    let evidence: &dyn Evidence = &problem;
    let (_, fit, _) = found(&problem, &[DRAG]);
    // Student's t of twelve degrees of freedom, three times as scattered
    let worth = 6.0 * (1.0_f64 + 84.0 / 36.0).ln();
    assert!((evidence.worth(&fit, 0, &[42.0]) - worth).abs() < 1e-9);
}
