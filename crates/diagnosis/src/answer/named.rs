//! The causes of a fit with their sizes, what else they could be, and how probable each is.

use std::collections::BTreeMap;

use crate::causes::hypothesis::CATALOGUE;
use crate::causes::param::P;
use crate::causes::sentence;
use crate::outside::sure::{beyond, shows};
use crate::outside::unknown::{Acts, Shape};
use crate::problem::Problem;
use crate::problem::course::{Point, signals};
use crate::search::decisions::{LISTED_NATS, RANKED, STRONG_NATS};
use crate::search::evidence::Evidence;
use crate::search::refit::Fit;
use crate::search::screen::outside;
use crate::search::weights::{Weighed, beside, of_functions, probability, weights};
use crate::{Cause, Confusion, Parameter};

/// A named cause, and whether another one says as much.
pub(crate) struct Named {
    pub(crate) cause: Cause,
    pub(crate) rivalled: bool,
}

/// What a fit says.
pub(crate) struct Answer {
    /// Its causes, those with most evidence first.
    pub(crate) causes: Vec<Named>,
    /// Free functions that may be there in place of one of them, and how probable each is.
    pub(crate) instead: Vec<(Shape, f64)>,
}

/// The models that a fit is compared with.
struct Compared<'a> {
    problem: &'a Problem<'a>,
    fit: &'a Fit,
    empty: &'a Fit,
    models: Vec<Weighed>,
    functions: Vec<Shape>,
}

fn ids(set: &[usize]) -> Vec<&'static str> {
    set.iter().map(|h| CATALOGUE[*h].id).collect()
}

impl Compared<'_> {
    fn model(&mut self, causes: Vec<&'static str>, log_z: f64) {
        self.models.push(Weighed { causes, function: None, log_z });
    }

    /// Factors on parts of a balance beside `fewer`, in the modules that show the `i`-th cause: `bare`
    /// where it is the only one. One of a signal along which the cause has a course is the cause
    /// itself; so is an addition, which takes a steady effect along whatever signal it follows.
    fn functions(&mut self, i: usize, fewer: &Fit, bare: &[Shape]) {
        let beside;
        let found = if fewer.set.is_empty() {
            bare
        } else {
            beside = beyond(self.problem, &Point::of(fewer));
            &beside
        };
        let own = |s: &Shape| {
            let sizes = CATALOGUE[self.fit.set[i]].sizes.iter();
            s.memory_s == 0.0 && sizes.flat_map(|p| signals(*p)).any(|x| x.0 == s.signal)
        };
        let part = |s: &&Shape| matches!(s.acts, Acts::Part(_)) && shows(self.fit.set[i], s.module);
        for s in found.iter().filter(part).filter(|s| !own(s)) {
            self.models.push(Weighed {
                causes: ids(&fewer.set),
                function: Some(self.functions.len()),
                log_z: fewer.log_z + s.firm,
            });
            self.functions.push(s.clone());
        }
    }

    /// Causes of `open` beside `fewer`, which is the fit without its `i`-th cause that loses
    /// `lost_nats`; those that say nearly as much are listed.
    fn rivals(
        &mut self,
        i: usize,
        fewer: &Fit,
        lost_nats: f64,
        open: &[usize],
    ) -> (Vec<Confusion>, bool) {
        let (evidence, hyp) = (self.problem.evidence(), &CATALOGUE[self.fit.set[i]]);
        let (mut confused_with, mut rivalled): (Vec<Confusion>, bool) = (Vec::new(), false);
        let mut refitted: Vec<usize> = Vec::new();
        for c in evidence.screen(fewer, &outside(self.fit, open)).singles(None) {
            let rival = &CATALOGUE[c.hypothesis];
            let (id, mut lost) = (rival.id, lost_nats - c.gain);
            if lost < LISTED_NATS || c.gain > RANKED * lost_nats {
                // A screen promises more than it keeps, or less; who stands in for a cause passes
                // the gate that the cause has passed.
                if refitted.contains(&c.hypothesis) {
                    continue;
                }
                refitted.push(c.hypothesis);
                // What is less likely than a rounding error needs no figure.
                let least = self.fit.log_z + f64::EPSILON.ln();
                let instead = evidence.with_added(fewer, &c, self.empty.norm, least);
                let kept = instead.map(|fit| evidence.gate(fit, self.empty));
                let kept = kept.filter(|fit| fit.set.contains(&c.hypothesis));
                let Some(kept) = kept else { continue };
                lost = self.fit.log_z - kept.log_z;
            }
            let mut instead = ids(&fewer.set);
            instead.push(id);
            self.model(instead, self.fit.log_z - lost.max(0.0));
            if lost < LISTED_NATS && confused_with.iter().all(|x| x.id != id) {
                rivalled |= lost < STRONG_NATS;
                let why = sentence::confusion(hyp.id, id, lost);
                confused_with.push(Confusion { id, why, probability: 0.0 });
            }
        }
        (confused_with, rivalled)
    }
}

/// The causes of a fit with sizes, rivals and probabilities. `bare` are the free functions without
/// any cause; those beside all causes were judged before.
pub(crate) fn causes(
    problem: &Problem<'_>,
    fit: &Fit,
    empty: &Fit,
    open: &[usize],
    bare: &[Shape],
) -> Answer {
    let (evidence, zero) = (problem.evidence(), &problem.reference.theta);
    let variances = evidence.variances(fit);
    // Free functions beside all causes: a function in the place of one competes with these, too.
    let left = beyond(problem, &Point::of(fit));
    let firm: Vec<f64> = left.iter().map(|s| s.firm).collect();
    let mut compared = Compared { problem, fit, empty, models: Vec::new(), functions: left };
    compared.model(ids(&fit.set), fit.log_z);
    compared.model(Vec::new(), 0.0);
    let without = evidence.each_left_out(fit, empty);
    let nats = <dyn Evidence>::lost(fit, &without);
    let as_driven = evidence.lost_as_driven(fit, &without);
    let mut out = Vec::new();
    for (i, (h, without)) in fit.set.iter().zip(&without).enumerate() {
        let hyp = &CATALOGUE[*h];
        let lost_nats = nats[i];
        let (mut confused_with, mut rivalled) = (Vec::new(), false);
        if let Some(fewer) = without {
            let worth = evidence.worth(fit, i, &as_driven);
            compared.model(ids(&fewer.set), fit.log_z - worth);
            compared.functions(i, fewer, bare);
            (confused_with, rivalled) = compared.rivals(i, fewer, lost_nats, open);
        }
        let mut parameters = BTreeMap::new();
        for (j, p) in fit.free.iter().enumerate() {
            if hyp.params().any(|q| q == *p) {
                let s = p.spec();
                let x = p.of_truck(&fit.theta, zero);
                let sigma = variances[j].sqrt();
                let value = if s.is_factor() { 1.0 + x } else { x };
                parameters.insert(s.key, Parameter { value, sigma, unit: s.unit });
            }
        }
        let size = hyp.size(&fit.theta, zero);
        let sigma = {
            let of = |p: &P| {
                let x = fit.theta[*p as usize] - zero[*p as usize];
                parameters.get(p.spec().key).map_or(0.0, |q: &Parameter| x * q.sigma)
            };
            hyp.sizes.iter().map(of).map(|x| x * x).sum::<f64>().sqrt() / size.abs().max(1e-12)
        };
        let unit = hyp.sizes.first().map_or("", |p| p.spec().unit);
        let mut sentence =
            sentence::with_interval(sentence::cause(hyp.id, size), size, sigma, unit);
        if let Some(mesh) = parameters.get(P::MeshLoss.spec().key) {
            sentence.push_str(&sentence::where_lost(size, (mesh.value, mesh.sigma)));
        }
        let cause = Cause {
            id: hyp.id,
            kind: hyp.kind(),
            sentence,
            parameters,
            evidence: as_driven[i],
            probability: 0.0,
            confused_with,
        };
        out.push(Named { cause, rivalled });
    }
    let Compared { mut models, functions, .. } = compared;
    models.extend(beside(&models, &firm));
    let weights = weights(&models);
    for named in &mut out {
        let cause = &mut named.cause;
        let holds = |m: &Weighed, id| m.causes.contains(&id);
        cause.probability = probability(&models, &weights, |m| holds(m, cause.id));
        for rival in &mut cause.confused_with {
            let instead = |m: &Weighed| holds(m, rival.id) && !holds(m, cause.id);
            rival.probability = probability(&models, &weights, instead);
        }
    }
    out.sort_by(|a, b| b.cause.evidence.total_cmp(&a.cause.evidence));
    let of = of_functions(&models, &weights, functions.len());
    let mut instead: Vec<(Shape, f64)> = functions.into_iter().zip(of).skip(firm.len()).collect();
    instead.sort_by(|a, b| b.1.total_cmp(&a.1));
    Answer { causes: out, instead }
}
