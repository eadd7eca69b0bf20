//! The course of a cause in this truck, and its scatter between drives.
//!
//! No truck has a cause exactly as the catalogue writes it: a fan does not turn by its law, a
//! retarder gives more when it is cold, a payload lies elsewhere on the next trip. Beside its size
//! `theta` a cause therefore has random effects of zero mean that vanish with it:
//!
//! ```text
//! r_d = theta S_d + theta u_d S_d + theta sum_k w_k (S_d o B_k) + ...
//! u_d ~ N(0, rho²)   of each drive for itself
//! w_k ~ N(0, rho²)   of all drives together, B_k hat functions of a signal that drives the cause
//! ```
//! What a cause brings along (more load lies somewhere) is another such effect of all drives, along the
//! sensitivity of that parameter.
//!
//! A wind has `w_k` of each drive for itself, over its time: weather swells and turns, and what blows
//! aside of it goes with its whole length. So has what wanders within a drive (a steering that is off
//! centre, a map that is shifted): a crosswind beside it would explain how it does. Whether it wanders is
//! for the likelihood to say.
//!
//! (Kennedy and O'Hagan, J. R. Statist. Soc. B 63, 2001; here multiplicative.) What another cause
//! would patch of the form of a large one is explained without it, and a size is known no better
//! than its form.

use crate::causes::hypothesis::{Along, CATALOGUE, Hypothesis};
use crate::causes::param::{P, Theta};
use crate::problem::{Direction, Gram, Hat};
use crate::replay::signal::signal;
use crate::search::decisions::{RHO, RHO_SHAPE, WEATHER};
use crate::search::free::directions;
use crate::search::refit::Fit;
use dynamics::catalogue::Law;

/// Hat functions along one signal.
pub(crate) const HATS: usize = 4;
/// Those of weather, over the time of a drive: it changes within minutes (gusts of tens of seconds are
/// noise, which drives in order have too).
const OF_WEATHER: usize = 10;
/// Those of what wanders, over the time of a drive: nothing says how fast it does, and what is left of a
/// large offset between knots minutes apart is a wind's to explain.
const OF_WANDER: usize = 40;

/// Signals along which the course of a cause with this size may differ, those that drive it, and its
/// standard deviation there.
pub(crate) fn signals(p: P) -> impl Iterator<Item = (&'static str, f64)> {
    let own = CATALOGUE.iter().find(|h| h.sizes.contains(&p));
    own.into_iter().flat_map(|h| h.course.iter().map(|along| (along.signal(), rho(h, along))))
}

/// Part of a cause that its form may differ by, in whatever way: the widest of its courses, and what its
/// law is open to.
pub(crate) fn form(h: &Hypothesis) -> f64 {
    h.course.iter().map(|along| rho(h, along)).fold(law(h), f64::max)
}

/// What the law of a cause is open to.
fn law(h: &Hypothesis) -> f64 {
    if h.of_truck().is_some_and(|c| c.law == Law::Chosen) { RHO_SHAPE } else { RHO }
}

fn rho(h: &Hypothesis, along: &Along) -> f64 {
    match along {
        Along::Open(_) => law(h),
        Along::Fitted(_) => RHO,
        Along::Weather(_) => WEATHER,
        Along::Made(_) | Along::Wanders(_) => RHO_SHAPE,
    }
}

/// Is a size one of weather?
fn weather(h: &Hypothesis) -> bool {
    h.course.iter().any(|along| matches!(along, Along::Weather(_)))
}

/// Does a size wander?
fn wanders(h: &Hypothesis) -> bool {
    h.course.iter().any(|along| matches!(along, Along::Wanders(_)))
}

/// Hat functions along each signal of a cause.
fn count(h: &Hypothesis) -> usize {
    if wanders(h) {
        OF_WANDER
    } else if weather(h) {
        OF_WEATHER
    } else {
        HATS
    }
}

/// Has every drive a course of its own?
fn of_drive(h: &Hypothesis) -> bool {
    h.course.iter().any(Along::of_drive)
}

/// Random effects of one size: columns of a Gram matrix (the residual is column 0).
#[derive(Debug, Clone)]
struct Effect {
    p: P,
    /// The cause that it is a size of.
    of: &'static Hypothesis,
    /// Its sensitivity.
    column: usize,
    /// Its hats per signal, with the deviation of its course there.
    hats: Vec<(f64, Vec<usize>)>,
    /// What it brings along, with its deviation per unit of the size.
    brings: Vec<(f64, usize)>,
    /// Its course is not held to what shows of it.
    in_full: bool,
}

impl Effect {
    /// Size that its effects go with: that of a wind goes to all sides.
    fn size(&self, theta: &Theta, zero: &Theta) -> f64 {
        let own = [self.p];
        let of = if weather(self.of) { self.of.sizes } else { &own };
        let squared = |p: &P| (theta[*p as usize] - zero[*p as usize]).powi(2);
        of.iter().map(squared).sum::<f64>().sqrt()
    }

    /// Its hats with their deviations at a size.
    ///
    /// A course is one of what shows of a cause: where the tolerances can take a cause (a headwind is
    /// almost a little more drag) but not its course, the course shows no more than the cause does.
    /// Else any cause would bring a free function along for what trucks in order leave, too. A size is
    /// known no better than its form all the same.
    fn hats<'a>(&'a self, gram: &'a Gram, size: f64) -> impl Iterator<Item = (usize, f64)> + 'a {
        let shows = |j: usize| gram.per_drive.iter().map(|g| g[(j, j)]).sum::<f64>();
        self.hats.iter().flat_map(move |(rho, hats)| {
            let of_hats: f64 = hats.iter().map(|j| shows(*j)).sum();
            let shown = (shows(self.column) / of_hats.max(f64::MIN_POSITIVE)).min(1.0).sqrt();
            let part = if self.in_full { 1.0 } else { shown };
            hats.iter().map(move |j| (*j, rho * size * part))
        })
    }

    /// Its scatter between drives, in its size.
    fn between(&self) -> f64 {
        if weather(self.of) { WEATHER } else { RHO }
    }
}

/// Random effects of the sizes among some directions.
#[derive(Debug, Clone, Default)]
pub(crate) struct Course(Vec<Effect>);

impl Course {
    /// The effects of those of `directions` whose parameters are `sizes`; appends their hats.
    pub(crate) fn of(sizes: &[P], directions: &mut Vec<Direction>) -> Self {
        let mut out = Vec::new();
        for j in 0..directions.len() {
            let p = directions[j].p;
            if !sizes.contains(&p) {
                continue;
            }
            let Some(of) = CATALOGUE.iter().find(|h| h.sizes.contains(&p)) else { continue };
            let mut hats = Vec::new();
            let count = count(of);
            for (name, rho) in signals(p) {
                let Some(signal) = signal(name) else { continue };
                let first = directions.len() + 1;
                for knot in 0..count {
                    let hat = Some(Hat { signal, knot, last: count - 1 });
                    directions.push(Direction { hat, ..directions[j].clone() });
                }
                hats.push((rho, (first..first + count).collect()));
            }
            let mut brings = Vec::new();
            for (brought, per_unit) in of.brings {
                brings.push((*per_unit, directions.len() + 1));
                directions.push(Direction::new(*brought, Vec::new(), brought.spec().step));
            }
            out.push(Effect { p, of, column: j + 1, hats, brings, in_full: false });
        }
        Self(out)
    }

    /// The same in a matrix with `more` columns between the residual and the directions.
    pub(crate) fn behind(&self, more: usize) -> Self {
        let mut out = self.clone();
        for e in &mut out.0 {
            e.column += more;
            e.hats.iter_mut().flat_map(|h| &mut h.1).for_each(|j| *j += more);
            e.brings.iter_mut().for_each(|b| b.1 += more);
        }
        out
    }

    /// Standard deviations of the directions' random effects at `theta`, those of drives and those
    /// common to all alike; 0 for those that have none.
    pub(crate) fn deviations(&self, count: usize, theta: &Theta, zero: &Theta) -> Vec<f64> {
        let mut out = vec![0.0; count];
        for e in &self.0 {
            let size = e.size(theta, zero);
            out[e.column - 1] = e.between() * size;
            for (rho, hats) in &e.hats {
                hats.iter().for_each(|j| out[j - 1] = rho * size);
            }
            e.brings.iter().for_each(|(per_unit, j)| out[j - 1] = per_unit * size);
        }
        out
    }

    /// The same for stating a size: along a signal over which a form is fitted, too, another law may
    /// differ by as much as the catalogue's is open.
    pub(crate) fn stated(&self) -> Self {
        let mut out = self.clone();
        for e in &mut out.0 {
            e.in_full = true;
            let open = law(e.of);
            e.hats.iter_mut().for_each(|(rho, _)| *rho = rho.max(open));
        }
        out
    }

    /// The same with what may wander free to do so: of a steering that is off centre the tolerances take
    /// what is constant, and how it wanders is nearly all that shows.
    fn freely(&self) -> Self {
        let mut out = self.clone();
        out.0.iter_mut().for_each(|e| e.in_full |= wanders(e.of));
        out
    }

    /// The same without the effects of some sizes.
    pub(crate) fn without(&self, sizes: &[P]) -> Self {
        Self(self.0.iter().filter(|e| !sizes.contains(&e.p)).cloned().collect())
    }

    /// The Gram matrix over the columns `keep`, the residual first, with these effects taken out, the
    /// sizes being those of `theta` beyond `zero`. Whether what may wander does is for the drives to say: of
    /// a steering that is off centre by the same all the time, a free course would cost more than it is
    /// worth. `None` where it is not positive definite.
    pub(crate) fn taken_out(
        &self,
        gram: &Gram,
        keep: &[usize],
        theta: &Theta,
        zero: &Theta,
    ) -> Option<Gram> {
        let held = self.taken_out_as_is(gram, keep, theta, zero);
        if !self.0.iter().any(|e| wanders(e.of) && !e.in_full) {
            return held;
        }
        let free = self.freely().taken_out_as_is(gram, keep, theta, zero);
        [held, free].into_iter().flatten().min_by(|a, b| a.total().2.total_cmp(&b.total().2))
    }

    fn taken_out_as_is(
        &self,
        gram: &Gram,
        keep: &[usize],
        theta: &Theta,
        zero: &Theta,
    ) -> Option<Gram> {
        let (mut between, mut along) = (Vec::new(), Vec::new());
        for e in &self.0 {
            let size = e.size(theta, zero);
            between.push((e.column, e.between() * size));
            let to = if of_drive(e.of) { &mut between } else { &mut along };
            to.extend(e.hats(gram, size));
            along.extend(e.brings.iter().map(|(per_unit, j)| (*j, per_unit * size)));
        }
        gram.marginal(keep, &between, &along)
    }
}

/// A point with the courses of the causes that are there: where what is left over is judged.
pub(crate) struct Point {
    pub(crate) theta: Theta,
    pub(crate) directions: Vec<Direction>,
    pub(crate) course: Course,
}

impl Point {
    /// Without causes.
    pub(crate) fn bare(theta: Theta) -> Self {
        Self { theta, directions: Vec::new(), course: Course::default() }
    }

    pub(crate) fn of(fit: &Fit) -> Self {
        let sizes = fit.sizes();
        let mut directions = directions(&sizes, &fit.theta);
        let course = Course::of(&sizes, &mut directions);
        Self { theta: fit.theta, directions, course }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Weather scatters by its whole length to every side, a truck's cause by its size.
    #[test]
    fn a_wind_scatters_to_all_sides() {
        let zero = [0.0; crate::causes::param::PARAMS];
        let mut theta = zero;
        theta[P::WindX as usize] = 3.0;
        theta[P::WindY as usize] = -4.0;
        theta[P::Mass as usize] = 0.1;
        let sizes = [P::WindX, P::WindY, P::Mass];
        let mut directions = directions(&sizes, &theta);
        let course = Course::of(&sizes, &mut directions);
        let sigma = course.deviations(directions.len(), &theta, &zero);
        assert_eq!(sigma[..2], [WEATHER * 5.0; 2]);
        assert_eq!(sigma[2], RHO * 0.1);
        let hats = &sigma[3..3 + 2 * OF_WEATHER];
        assert!(hats.iter().all(|x| *x == WEATHER * 5.0), "{hats:?}");
    }

    /// The truck model's catalogue says who gives a cause's law; the courses follow it, but for the
    /// signals over which a form is fitted.
    #[test]
    fn a_course_is_as_wide_as_the_catalogue_says_of_its_causes_law() {
        let (mut broad, mut fitted) = (0, 0);
        for h in CATALOGUE {
            let law = h.of_truck().unwrap().law;
            let along: Vec<f64> = h.sizes.iter().flat_map(|p| signals(*p)).map(|s| s.1).collect();
            match law {
                Law::Physics if weather(h) => assert_eq!(along[0], WEATHER, "{}", h.id),
                Law::Physics if of_drive(h) => assert_eq!(along, [RHO_SHAPE], "{}", h.id),
                Law::Physics => {
                    let made = h.course.iter().filter(|a| matches!(a, Along::Made(_))).count();
                    let wide = along.iter().filter(|rho| **rho != RHO).count();
                    assert_eq!(wide, made, "{}", h.id);
                }
                Law::Chosen => assert!(along.contains(&RHO_SHAPE), "{}", h.id),
            }
            broad += usize::from(law == Law::Chosen);
            for along in h.course {
                assert!(signal(along.signal()).is_some(), "{}: {}", h.id, along.signal());
                fitted += usize::from(matches!(along, Along::Fitted(_)));
                // what is fitted needs a form
                assert!(!matches!(along, Along::Fitted(_)) || !h.shapes.is_empty(), "{}", h.id);
            }
        }
        assert!(broad >= 15 && fitted >= 5, "{broad} {fitted}");
    }
}
