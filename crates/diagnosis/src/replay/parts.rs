//! What is left outside the catalogue may be a factor on one part of the balance: an engine brake
//! that holds less in thin air, tyres that soften as they warm. A part is the sensitivity to the
//! figure that scales it; its factor is as large as that figure's prior and a smooth function of a
//! signal, judged like the other free functions.

use nalgebra::{DMatrix, DVector};

use crate::causes::param::P;
use crate::outside::unknown::{Acts, Shape, dispersion, explained};
use crate::problem::course::{HATS, Point};
use crate::problem::stats::evidence;
use crate::problem::{Direction, Hat, Problem, Rest};
use crate::replay::Module;
use crate::replay::signal::SIGNALS;

/// Correlation length over the knots' range.
const LENGTH: f64 = 0.4;

/// A part of a balance: the figure that scales it, the module that shows it, its words, and signals
/// that its factor may follow. None is one of its own law; a memory has its own entry.
struct Part {
    p: P,
    module: Module,
    words: &'static str,
    follows: &'static [&'static str],
    remembers: &'static [&'static str],
}

const fn part(
    p: P,
    module: Module,
    words: &'static str,
    follows: &'static [&'static str],
    remembers: &'static [&'static str],
) -> Part {
    Part { p, module, words, follows, remembers }
}

const PARTS: &[Part] = &[
    part(
        P::EngineBrakeScale,
        Module::Force,
        "the engine brake",
        &["time_s", "coolant_temp_degc", "gps_altitude_m"],
        &["engine_brake_frac"],
    ),
    part(
        P::Friction,
        Module::Force,
        "the friction of the engine",
        &["time_s", "gps_altitude_m"],
        &["engine_torque_percent"],
    ),
    part(
        P::Rolling,
        Module::Force,
        "the rolling resistance",
        &["time_s", "speed_m_s", "ambient_temp_degc"],
        &[],
    ),
    part(P::Drag, Module::Force, "the air drag", &["time_s"], &[]),
    part(
        P::BrakeGain,
        Module::Force,
        "the brakes",
        &["time_s", "speed_m_s"],
        &["brake_pressure_kpa"],
    ),
    part(P::CFront, Module::Yaw, "the stiffness of the steer tyres", &["time_s", "speed_m_s"], &[]),
    part(P::CDrive, Module::Yaw, "the stiffness of the drive tyres", &["time_s", "speed_m_s"], &[]),
    part(
        P::CTrailer,
        Module::TrailerYaw,
        "the stiffness of the trailer tyres",
        &["time_s", "speed_m_s"],
        &[],
    ),
];

impl Problem<'_> {
    /// The best factors on parts of the balance beside the causes of a point and their courses.
    pub(crate) fn parts(&self, at: &Point, residuals: &[Rest]) -> Vec<Shape> {
        let mut out = Vec::new();
        for part in PARTS {
            if !self.drives.iter().any(|d| d.available[part.module as usize]) {
                continue;
            }
            let excess = self.excess(part.module, residuals);
            for (place, signal) in SIGNALS.iter().enumerate() {
                let of = if signal.memory_s > 0.0 { part.remembers } else { part.follows };
                if of.contains(&signal.name) {
                    out.extend(self.part(at, part, place, excess));
                }
            }
        }
        out
    }

    fn part(&self, at: &Point, part: &Part, place: usize, excess: f64) -> Option<Shape> {
        let (p, module) = (part.p, part.module);
        let whole = Direction::new(p, Vec::new(), p.spec().step);
        let hat = |knot| Direction {
            hat: Some(Hat { signal: place, knot, last: HATS - 1 }),
            ..whole.clone()
        };
        let directions: Vec<Direction> =
            (0..HATS).map(hat).chain(at.directions.iter().cloned()).collect();
        let gram = self.gram(&at.theta, &directions);
        let keep: Vec<usize> = (0..=HATS).collect();
        let course = at.course.behind(HATS);
        let gram = course.taken_out(&gram, &keep, &at.theta, &self.reference.theta)?;
        let kernel = DMatrix::from_fn(HATS, HATS, |i, j| {
            let x = (i as f64 - j as f64) / (HATS - 1) as f64 / LENGTH;
            (-0.5 * x * x).exp() + if i == j { 1e-3 } else { 0.0 }
        });
        let factor = kernel.cholesky()?.l() * p.spec().prior;
        let inside = |a: &DMatrix<f64>| factor.transpose() * a * &factor;
        let (a, b, _) = gram.sum(|_| true);
        let (a, b) = (inside(&a), factor.transpose() * b);
        let (log_z, w) = evidence::linear(&a, &b, &[1.0; HATS])?;
        let scores = gram.scores(&(&factor * &w));
        let systems: Vec<(DMatrix<f64>, DVector<f64>)> = gram
            .per_drive
            .iter()
            .zip(scores)
            .map(|(g, s)| {
                (inside(&g.view((1, 1), (HATS, HATS)).into_owned()), factor.transpose() * s)
            })
            .collect();
        let firm = log_z - 0.5 * b.dot(&w) * (1.0 - 1.0 / dispersion(&systems, &a, &w)?);
        let f = &factor * &w;
        let signal = SIGNALS.get(place)?;
        let [from, to] = self.ends(module, place);
        let knot = |k: usize| from + (to - from) * k as f64 / (HATS - 1) as f64;
        Some(Shape {
            module,
            signal: signal.name,
            memory_s: signal.memory_s,
            acts: Acts::Part(part.words),
            log_z,
            firm,
            knots: f.iter().enumerate().map(|(k, y)| (knot(k), *y)).collect(),
            explained_frac: explained(excess, 2.0 * b.dot(&w) - (&a * &w).dot(&w)),
        })
    }
}
