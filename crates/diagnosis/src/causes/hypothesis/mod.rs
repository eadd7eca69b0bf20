//! The causes as hypotheses: what each one has, and what follows from it. They stand in `table.rs`.

mod table;

use dynamics::catalogue::{Cause, CauseKind};

pub(crate) use self::table::CATALOGUE;
use crate::Channel;
use crate::causes::param::{P, Theta};
use crate::replay::{Group, affects};

/// Where the fit of the shape parameters begins, in their order.
pub(crate) type Start = [f64; 3];

/// Part of the width between its bounds within which a figure counts as at one.
const BOUND: f64 = 1e-3;

/// One hypothesis. Several may share an id: variants of shape.
#[derive(Debug)]
pub(crate) struct Hypothesis {
    pub(crate) id: &'static str,
    /// Sizes, then shapes.
    pub(crate) sizes: &'static [P],
    pub(crate) shapes: &'static [P],
    /// Values of the shape parameters (offsets from nominal) to start from.
    pub(crate) starts: &'static [Start],
    pub(crate) channels: &'static [Channel],
    /// Smallest size worth a word, in the unit of the first parameter.
    pub(crate) min_size: f64,
    /// Sign that the size must have; 0: either.
    pub(crate) sign: f64,
    /// What its course may differ along from the catalogue's: signals that drive it, but not the law
    /// that tells it from others.
    pub(crate) course: &'static [Along],
    /// What it brings along, the same on all drives, and how far that is off: standard deviation in that
    /// parameter's unit per unit of the size.
    pub(crate) brings: &'static [(P, f64)],
}

/// A measured signal along which the course of a cause may differ from the catalogue's.
#[derive(Debug)]
pub(crate) enum Along {
    /// As widely as its law is open.
    Open(&'static str),
    /// As widely as what a maker chose ([`RHO_SHAPE`]), though the rest of its law is physics.
    ///
    /// [`RHO_SHAPE`]: crate::search::decisions::RHO_SHAPE
    Made(&'static str),
    /// Its form is fitted over it (onset and slope, threshold and hysteresis, knee): with a wide course
    /// beside it the two would be free of each other. Its size is stated as if it were open.
    Fitted(&'static str),
    /// It is weather: of every drive for itself, it swells and turns.
    Weather(&'static str),
    /// It wanders, of every drive for itself, as widely as an open law ([`RHO_SHAPE`]): nothing that is
    /// measured drives it, and no data sheet says how far it goes.
    ///
    /// [`RHO_SHAPE`]: crate::search::decisions::RHO_SHAPE
    Wanders(&'static str),
}

impl Along {
    /// The column.
    pub(crate) fn signal(&self) -> &'static str {
        match self {
            Self::Open(name)
            | Self::Made(name)
            | Self::Fitted(name)
            | Self::Weather(name)
            | Self::Wanders(name) => name,
        }
    }

    /// Every drive has a course of its own.
    pub(crate) fn of_drive(&self) -> bool {
        matches!(self, Self::Weather(_) | Self::Wanders(_))
    }
}

impl Hypothesis {
    /// All parameters, sizes first.
    pub(crate) fn params(&self) -> impl Iterator<Item = P> + '_ {
        self.sizes.iter().chain(self.shapes).copied()
    }

    /// The cause in the catalogue of the truck model: its kind, and the figures that carry it.
    pub(crate) fn of_truck(&self) -> Option<&'static Cause> {
        dynamics::catalogue::cause(self.id)
    }

    /// Kind of error.
    pub(crate) fn kind(&self) -> CauseKind {
        self.of_truck().map_or(CauseKind::MissingPhysics, |c| c.kind)
    }

    /// Groups of modules where the cause shows.
    pub(crate) fn groups(&self) -> Vec<Group> {
        let mut out: Vec<Group> = Vec::new();
        for g in self.params().flat_map(affects) {
            if !out.contains(g) {
                out.push(*g);
            }
        }
        out
    }

    /// Size of the cause at `t`: the value, or the length of a vector.
    pub(crate) fn size(&self, t: &Theta, zero: &Theta) -> f64 {
        let values: Vec<f64> =
            self.sizes.iter().map(|p| t[*p as usize] - zero[*p as usize]).collect();
        if values.len() == 1 { values[0] } else { values.iter().map(|v| v * v).sum::<f64>().sqrt() }
    }

    /// One of its sizes has run to a bound: the fit would go on.
    pub(crate) fn is_at_bound(&self, t: &Theta, zero: &Theta) -> bool {
        self.sizes.iter().any(|p| at_bound(*p, t, zero))
    }

    /// Its form has run to the end of what a truck may have: something else is drawn with it. A form that
    /// begins at nothing (a lag, a width) may be there.
    pub(crate) fn strays(&self, t: &Theta, zero: &Theta) -> bool {
        self.shapes.iter().any(|p| p.spec().lo < 0.0 && at_bound(*p, t, zero))
    }

    /// Nonlinear enough that a linear screen may miss it.
    pub(crate) fn nonlinear(&self) -> bool {
        self.sizes.len() > 1
    }
}

/// A parameter stands at a bound that is not nothing.
fn at_bound(p: P, t: &Theta, zero: &Theta) -> bool {
    let (s, x) = (p.spec(), t[p as usize] - zero[p as usize]);
    let near = BOUND * (s.hi - s.lo);
    x <= s.lo + near && s.lo < 0.0 || x >= s.hi - near
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::causes::param::PARAMS;

    /// A steering offset beside soft drive tyres was a crosswind of 8.9 m/s that pushes the trailer 4 m
    /// behind its CG, `explained`.
    #[test]
    fn a_form_at_the_end_of_what_a_truck_may_have_strays_and_one_that_is_not_there_does_not() {
        let of = |id: &str| CATALOGUE.iter().find(|h| h.id == id).unwrap();
        let zero = [0.0; PARAMS];
        let mut t = zero;
        t[P::Crosswind as usize] = 8.9;
        assert!(!of("crosswind").strays(&t, &zero));
        t[P::CrosswindBehind as usize] = P::CrosswindBehind.spec().hi;
        assert!(of("crosswind").strays(&t, &zero) && !of("crosswind").is_at_bound(&t, &zero));
        assert!(!of("brake_fade").strays(&zero, &zero), "linings without a lag");
    }

    #[test]
    fn the_catalogue_is_that_of_the_truck_model() {
        for h in CATALOGUE {
            assert!(h.of_truck().is_some(), "{}", h.id);
        }
        for c in &dynamics::catalogue::CATALOGUE {
            assert!(CATALOGUE.iter().any(|h| h.id == c.id), "{}", c.id);
        }
    }
}
