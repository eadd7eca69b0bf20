//! Which manoeuvres would tell causes apart, before anyone drives them.
//!
//! Every manoeuvre of a catalogue is driven in the truck model and logged. Its Fisher information
//! `A = G' M G` (sensitivities `G`, metric `M` in which the tolerances of each drive are marginal)
//! says what the search would see: if cause a is true with one prior spread `x`, its gradient is
//! `A x`, and the log evidence of a and of b follows in closed form. The expected lead of the true
//! cause over the other, in the worse of both directions, is what a manoeuvre is worth for the
//! pair (expected information: Lindley, Ann. Math. Statist. 27, 1956, in its linear-Gaussian form).
//!
//! Left out: errors of the linear model for large effects, drivers who do not keep to the plan,
//! traffic.

mod expect;
mod manoeuvre;
mod planned;

use serde::Serialize;

use crate::causes::hypothesis::CATALOGUE;
use crate::problem::{Problem, Reference};
use crate::replay::Prepared;
use crate::search::decisions::MIN_EVIDENCE;
use crate::studies::logger::Draw;
use crate::{Channel, DiagnosisError, Drive, DriveSet, Executor, Plant, collect};
use dynamics::TruckParameters;
use expect::{Information, Sensitivities};
use manoeuvre::{MANOEUVRES, Manoeuvre};

/// The other side of a pair: no cause at all.
pub const NOTHING: &str = "nothing";
/// Gain below which a further manoeuvre is not worth its time, nats.
const WORTH_NATS: f64 = 0.3;
/// What every manoeuvre costs besides driving it (loading, going there, turning), min.
const SET_UP_MIN: f64 = 5.0;
/// Most manoeuvres in a plan.
const LONGEST_PLAN: usize = 8;

/// Two causes and how far drives tell them apart.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Pair {
    /// First cause.
    pub a: &'static str,
    /// Second cause, or [`NOTHING`].
    pub b: &'static str,
    /// Expected lead of the true one of both over the other, the worse way round, nats.
    pub nats: f64,
}

/// A manoeuvre and what it is expected to bring, on top of the drives that are there.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Suggestion {
    /// Short name.
    pub manoeuvre: &'static str,
    /// What to drive.
    pub what: &'static str,
    /// Time at the wheel, min.
    pub duration_min: f64,
    /// All pairs with this manoeuvre.
    pub pairs: Vec<Pair>,
    /// Sum over the pairs of what it adds up to [`Experiment::needed_nats`], per minute, five for
    /// its set-up included.
    pub gain_nats_per_min: f64,
}

/// What was worked out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Experiment {
    /// Name of the truck.
    pub truck: String,
    /// Causes to tell apart.
    pub causes: Vec<&'static str>,
    /// Lead that counts as told apart, nats.
    pub needed_nats: f64,
    /// All pairs with the drives that are there.
    pub now: Vec<Pair>,
    /// Every manoeuvre alone, best first.
    pub manoeuvres: Vec<Suggestion>,
    /// What to drive, in this order, each on top of the ones before.
    pub plan: Vec<Suggestion>,
    /// Pairs that no manoeuvre here tells apart.
    pub not_separated: Vec<Pair>,
    /// Noise and tolerances were learned from drives in order; otherwise they are defaults.
    pub tolerances_from_baseline: bool,
}

/// What is known before the experiment.
#[derive(Debug, Clone, Copy, Default)]
pub struct Known<'a> {
    /// Drives that were measured already; channels that they lack are not expected of new ones.
    pub drives: Option<&'a DriveSet>,
    /// Drives of the same truck and logger that are in order.
    pub baseline: Option<&'a DriveSet>,
}

/// Suggests manoeuvres that tell `causes` apart, and each of them from nothing.
///
/// # Errors
/// [`DiagnosisError::Cause`] for an id that the catalogue lacks or if there is none;
/// [`DiagnosisError::Truck`] if the truck cannot drive the plan.
pub fn suggest(
    truck: &TruckParameters,
    causes: &[String],
    known: Known<'_>,
    seed: u64,
    executor: &dyn Executor,
) -> Result<Experiment, DiagnosisError> {
    let plant = &Plant::of_truck(truck)?;
    let ids = ids(causes)?;
    let planned = plan(truck, known.drives, seed, executor)?;
    let prepare = |d: &[Drive]| d.iter().map(|d| Prepared::new(d, plant)).collect::<Vec<_>>();
    let all: Vec<Drive> = planned.iter().flatten().cloned().collect();
    let learn = |d: &[Drive], clean| Problem::learn(plant, prepare(d), clean, executor);
    let reference: Option<Reference> = match (known.baseline, known.drives) {
        (Some(b), _) => Some(learn(&b.drives, true)?.reference),
        (None, Some(d)) => Some(learn(&d.drives, false)?.reference),
        (None, None) => None,
    };
    let problem = match reference {
        Some(reference) => Problem::with(plant, prepare(&all), reference, executor)?,
        None => learn(&all, false)?,
    };
    let sensitivities = Sensitivities::of(&ids);
    let there = match known.drives {
        Some(d) => {
            let reference = problem.reference.clone();
            let there = Problem::with(plant, prepare(&d.drives), reference, executor)?;
            sensitivities.information(&there, |_| true)
        }
        None => sensitivities.none(),
    };
    let mut first = 0;
    let mut offers: Vec<Offer> = Vec::new();
    for (m, drives) in MANOEUVRES.iter().zip(&planned) {
        let own = first..first + drives.len();
        first = own.end;
        let minutes = drives.iter().map(Drive::duration_s).sum::<f64>() / 60.0;
        offers.push((*m, minutes, sensitivities.information(&problem, |i| own.contains(&i))));
    }
    let pairs = |a: &Information| sensitivities.pairs(&ids, a);
    let total = |steps: &[usize]| steps.iter().fold(there.clone(), |a, i| a + &offers[*i].2);
    let suggestion = |base: &Information, i: usize| {
        let (m, minutes, own) = &offers[i];
        let with = pairs(&(base + own));
        let gain: f64 = with.iter().zip(&pairs(base)).map(|(w, b)| capped(w) - capped(b)).sum();
        Suggestion {
            manoeuvre: m.id,
            what: m.what,
            duration_min: *minutes,
            pairs: with,
            gain_nats_per_min: gain / (minutes + SET_UP_MIN),
        }
    };
    let steps = choose(&offers, &total, &|base, i| suggestion(base, i).gain_nats_per_min, &pairs);
    let plan = (0..steps.len()).map(|k| suggestion(&total(&steps[..k]), steps[k])).collect();
    let mut alone: Vec<Suggestion> = (0..offers.len()).map(|i| suggestion(&there, i)).collect();
    alone.sort_by(|a, b| b.gain_nats_per_min.total_cmp(&a.gain_nats_per_min));
    Ok(Experiment {
        truck: plant.name.clone(),
        needed_nats: MIN_EVIDENCE,
        now: pairs(&there),
        manoeuvres: alone,
        plan,
        not_separated: pairs(&total(&steps))
            .into_iter()
            .filter(|p| p.nats < MIN_EVIDENCE)
            .collect(),
        causes: ids,
        tolerances_from_baseline: known.baseline.is_some(),
    })
}

/// A manoeuvre with its time, min, and what it tells.
type Offer = (Manoeuvre, f64, Information);

/// Takes the manoeuvre with the best gain until all pairs are told apart or nothing helps, then
/// leaves out those that the later ones made needless.
fn choose(
    offers: &[Offer],
    total: &dyn Fn(&[usize]) -> Information,
    gain: &dyn Fn(&Information, usize) -> f64,
    pairs: &dyn Fn(&Information) -> Vec<Pair>,
) -> Vec<usize> {
    let worth = |steps: &[usize]| pairs(&total(steps)).iter().map(capped).sum::<f64>();
    let mut steps: Vec<usize> = Vec::new();
    while steps.len() < LONGEST_PLAN {
        let base = total(&steps);
        let best = (0..offers.len())
            .map(|i| (i, gain(&base, i)))
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .filter(|(i, g)| g * (offers[*i].1 + SET_UP_MIN) > WORTH_NATS);
        let Some((i, _)) = best else { break };
        steps.push(i);
    }
    let all = worth(&steps);
    let mut k = 0;
    while k < steps.len() {
        let mut fewer = steps.clone();
        fewer.remove(k);
        if worth(&fewer) > all - WORTH_NATS {
            steps = fewer;
        } else {
            k += 1;
        }
    }
    steps
}

/// What counts of a pair's lead: beyond what is needed nothing is gained.
fn capped(p: &Pair) -> f64 {
    p.nats.clamp(0.0, MIN_EVIDENCE)
}

fn ids(causes: &[String]) -> Result<Vec<&'static str>, DiagnosisError> {
    let mut out: Vec<&'static str> = Vec::new();
    for id in causes {
        let known = CATALOGUE.iter().find(|h| h.id == id);
        let known = known.ok_or_else(|| DiagnosisError::Cause { id: id.clone() })?;
        if !out.contains(&known.id) {
            out.push(known.id);
        }
    }
    if out.is_empty() { Err(DiagnosisError::Cause { id: String::new() }) } else { Ok(out) }
}

/// All manoeuvres, driven and logged, without channels that this truck's drives do not have.
fn plan(
    truck: &TruckParameters,
    measured: Option<&DriveSet>,
    seed: u64,
    executor: &dyn Executor,
) -> Result<Vec<Vec<Drive>>, DiagnosisError> {
    let driven = collect(executor, MANOEUVRES.len(), |i| {
        let m = &MANOEUVRES[i];
        let mut draw = Draw::of_seed(seed.wrapping_mul(1000).wrapping_add(i as u64));
        let name = |k| format!("{}_{k}", m.id);
        let drives = m.drives.iter().enumerate();
        let driven = drives.map(|(k, p)| planned::drive(name(k), truck, p, &mut draw));
        driven.collect::<Result<Vec<Drive>, _>>()
    });
    let mut out = Vec::with_capacity(driven.len());
    for drives in driven {
        let mut drives = drives?;
        if let Some(set) = measured {
            for c in Channel::all().filter(|c| !set.drives.iter().any(|d| d.has(*c))) {
                drives.iter_mut().for_each(|d| d.remove(c));
            }
        }
        out.push(drives);
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Serial;

    fn truck() -> TruckParameters {
        TruckParameters::load("reference").unwrap()
    }

    fn names(ids: &[&str]) -> Vec<String> {
        ids.iter().map(|s| (*s).to_owned()).collect()
    }

    fn with(e: &Experiment, manoeuvre: &str, a: &str, b: &str) -> f64 {
        let m = e.manoeuvres.iter().find(|m| m.manoeuvre == manoeuvre).unwrap();
        m.pairs.iter().find(|p| p.a == a && p.b == b).unwrap().nats
    }

    #[test]
    fn what_excites_a_cause_is_suggested_and_what_does_not_is_worth_nothing() {
        let causes = names(&["brake_fade", "altitude_derate", "heat_derate", "steering_free_play"]);
        let e = suggest(&truck(), &causes, Known::default(), 1, &Serial).unwrap();
        assert!(with(&e, "hot_brakes", "brake_fade", NOTHING) > 10.0);
        assert!(with(&e, "brake_stops", "brake_fade", NOTHING) < 10.0);
        assert!(with(&e, "full_pedal_low_and_high", "altitude_derate", NOTHING) > 10.0);
        assert!(with(&e, "coast_down", "altitude_derate", NOTHING) < 1.0);
        assert!(with(&e, "full_pedal_climb_cool_and_hot", "heat_derate", NOTHING) > 10.0);
        assert!(with(&e, "sine_steer", "steering_free_play", NOTHING) > 10.0);
        let plan: Vec<&str> = e.plan.iter().map(|s| s.manoeuvre).collect();
        assert!(plan.contains(&"hot_brakes"), "{plan:?}");
        assert!(e.not_separated.is_empty(), "{:?}", e.not_separated);
        assert!(e.now.iter().all(|p| p.nats == 0.0));
    }

    #[test]
    fn a_steady_wind_is_told_from_a_headwind_by_turning_to_all_sides() {
        // Nothing driven yet: the square turns to all sides, the descent for hot brakes to one.
        let causes = names(&["headwind", "wind"]);
        let e = suggest(&truck(), &causes, Known::default(), 1, &Serial).unwrap();
        assert!(with(&e, "square", "headwind", "wind") > 10.0);
        assert!(with(&e, "hot_brakes", "headwind", "wind") < 5.0);
    }

    /// The forecast against what happens when the cause is really there.
    #[test]
    fn the_expected_lead_is_the_lead_that_is_found() {
        let (base, ids) = (truck(), ["rolling_resistance", "air_drag"]);
        let plant = Plant::of_truck(&base).unwrap();
        let m = MANOEUVRES.iter().find(|m| m.id == "coast_down").unwrap();
        let driven = |truck: &TruckParameters, seed: u64| -> Vec<Prepared> {
            let mut draw = Draw::of_seed(seed);
            let one = |p| planned::drive("d".into(), truck, p, &mut draw).unwrap();
            m.drives
                .iter()
                .map(one)
                .collect::<Vec<_>>()
                .iter()
                .map(|d| Prepared::new(d, &plant))
                .collect()
        };
        let clean = Problem::learn(&plant, driven(&base, 1), true, &Serial).unwrap();
        let sensitivities = Sensitivities::of(&ids);
        let expected =
            sensitivities.lead(ids[0], Some(ids[1]), &sensitivities.information(&clean, |_| true));
        let mut hidden = base.clone();
        hidden.resistance.rolling_coeff *= 1.0 + crate::causes::param::P::Rolling.spec().prior;
        let problem =
            Problem::with(&plant, driven(&hidden, 2), clean.reference.clone(), &Serial).unwrap();
        let theta = problem.reference.theta;
        let norm = problem.gram(&theta, &[]).sum(|_| true).2;
        let log_z = |id: &str| {
            let h = CATALOGUE.iter().position(|h| h.id == id).unwrap();
            problem.evidence().fit(&[h], &theta, norm).unwrap().log_z
        };
        let found = log_z(ids[0]) - log_z(ids[1]);
        assert!(expected > 20.0, "{expected}");
        assert!((0.6..1.6).contains(&(found / expected)), "{found} expected {expected}");
    }

    #[test]
    fn an_id_outside_the_catalogue_is_refused_by_name() {
        let error = suggest(&truck(), &names(&["flux"]), Known::default(), 1, &Serial).unwrap_err();
        assert_eq!(error.to_string(), "flux is not a cause of the catalogue");
        let error = suggest(&truck(), &[], Known::default(), 1, &Serial).unwrap_err();
        assert_eq!(error.to_string(), "nothing is not a cause of the catalogue");
    }
}
