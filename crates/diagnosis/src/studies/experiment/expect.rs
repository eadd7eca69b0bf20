//! Expected evidence of causes from Fisher information.

use nalgebra::{DMatrix, DVector};

use super::{NOTHING, Pair};
use crate::causes::hypothesis::{CATALOGUE, Start};
use crate::causes::param::P;
use crate::problem::stats::evidence;
use crate::problem::{Direction, Problem};

/// Fisher information over all directions.
pub(super) type Information = DMatrix<f64>;

/// One way to read a cause: a shape, and a direction per size.
struct Reading {
    id: &'static str,
    /// Its shape is the nearest to nominal.
    typical: bool,
    columns: Vec<usize>,
}

/// Directions of all causes that are to be told apart.
pub(super) struct Sensitivities {
    directions: Vec<Direction>,
    readings: Vec<Reading>,
}

impl Sensitivities {
    pub(super) fn of(ids: &[&'static str]) -> Self {
        let mut out = Self { directions: Vec::new(), readings: Vec::new() };
        for h in CATALOGUE.iter().filter(|h| ids.contains(&h.id)) {
            let far = |s: &Start| s.iter().map(|x| x.abs()).sum::<f64>();
            let nearest = h.starts.iter().map(far).fold(f64::INFINITY, f64::min);
            for start in h.starts {
                let shape: Vec<(P, f64)> = h.shapes.iter().copied().zip(*start).collect();
                let first = out.directions.len();
                let of = |p: &P| Direction::new(*p, shape.clone(), p.spec().step);
                out.directions.extend(h.sizes.iter().map(of));
                let columns = (first..out.directions.len()).collect();
                out.readings.push(Reading { id: h.id, typical: far(start) <= nearest, columns });
            }
        }
        out
    }

    /// No drive at all.
    pub(super) fn none(&self) -> Information {
        DMatrix::zeros(self.directions.len(), self.directions.len())
    }

    /// What the drives chosen tell.
    pub(super) fn information(
        &self,
        problem: &Problem<'_>,
        pick: impl Fn(usize) -> bool,
    ) -> Information {
        let gram = problem.gram(&problem.reference.theta, &self.directions);
        gram.sum(pick).0
    }

    /// All pairs of causes, and each against nothing.
    pub(super) fn pairs(&self, ids: &[&'static str], a: &Information) -> Vec<Pair> {
        let mut out = Vec::new();
        for (i, x) in ids.iter().enumerate() {
            out.push(Pair { a: x, b: NOTHING, nats: self.lead(x, None, a) });
            for y in &ids[i + 1..] {
                let nats = self.lead(x, Some(y), a).min(self.lead(y, Some(x), a));
                out.push(Pair { a: x, b: y, nats });
            }
        }
        out
    }

    fn readings(&self, id: &str) -> impl Iterator<Item = &Reading> {
        self.readings.iter().filter(move |r| r.id == id)
    }

    fn sigma(&self, columns: &[usize]) -> Vec<f64> {
        columns.iter().map(|c| self.directions[*c].p.spec().prior).collect()
    }

    /// Log evidence of a reading where the truth is one spread along `truth`, nats.
    fn log_z(&self, columns: &[usize], truth: usize, size: f64, a: &Information) -> f64 {
        let b =
            DVector::from_iterator(columns.len(), columns.iter().map(|c| a[(*c, truth)] * size));
        let found = evidence::linear(&evidence::sub(a, columns), &b, &self.sigma(columns));
        found.map_or(0.0, |f| f.0)
    }

    /// Expected lead of a true cause over another (or over nothing): in its typical shape, along
    /// the size in which it shows least, against the best reading of the other.
    pub(super) fn lead(&self, truth: &str, other: Option<&str>, a: &Information) -> f64 {
        let best = |of: Option<&str>, column: usize, size: f64| {
            of.map_or(0.0, |id| {
                self.readings(id)
                    .map(|r| self.log_z(&r.columns, column, size, a))
                    .fold(0.0, f64::max)
            })
        };
        self.readings(truth)
            .filter(|r| r.typical)
            .map(|r| {
                r.columns
                    .iter()
                    .map(|c| {
                        let size = self.directions[*c].p.spec().prior;
                        self.log_z(&r.columns, *c, size, a) - best(other, *c, size)
                    })
                    .fold(f64::INFINITY, f64::min)
            })
            .fold(0.0, f64::max)
    }
}
