//! Residuals and sensitivities of a drive by groups of modules, kept from call to call. A group
//! does not see the parameters of the others, so what has been replayed once serves wherever only
//! those of other groups have moved.

use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, OnceLock};

use super::white::{Part, Whitened};
use super::{Direction, Problem, moves};
use crate::causes::param::{SPECS, Theta};
use crate::replay::{GROUPS, Group, MODULES, Module, Residuals, affects, offset_of, replay_group};

/// Residuals of one group at one point, or a sensitivity: minus the derivative of the residual.
#[derive(Debug)]
pub(super) struct Signals {
    pub(super) group: Group,
    /// A residual rather than a sensitivity: clipped when whitened.
    residual: bool,
    /// Per module of the group; empty where it is not available.
    raw: Arc<Vec<Part>>,
    whitened: OnceLock<Vec<Whitened>>,
    /// Inner products with the sensitivities to the drive's tolerances.
    products: OnceLock<Vec<f64>>,
}

/// What one direction, or one point, does to the groups that it touches.
pub(super) type Line = Vec<Arc<Signals>>;

type Key = Vec<u64>;

/// Raw samples kept per drive.
const KEPT: usize = 3_000_000;

/// What has been replayed of one drive, oldest first.
#[derive(Debug, Default)]
pub(super) struct Kept(Mutex<Store>);

#[derive(Debug, Default)]
struct Store {
    entries: HashMap<Key, Arc<Signals>>,
    order: VecDeque<Key>,
    samples: usize,
}

/// Limit of a whitened residual: beyond it a row says "wrong" but not "how wrong".
const CLIP: f64 = 1e3;

impl Signals {
    fn new(group: Group, residual: bool, raw: Arc<Vec<Part>>) -> Self {
        Self { group, residual, raw, whitened: OnceLock::new(), products: OnceLock::new() }
    }

    /// The same, to be whitened again.
    pub(super) fn renewed(&self) -> Arc<Self> {
        Arc::new(Self::new(self.group, self.residual, self.raw.clone()))
    }

    /// Residuals with something added, part by part.
    pub(super) fn plus(&self, added: &[Part]) -> Self {
        let raw = self.raw.iter().zip(added).map(|(a, b)| a.plus(b)).collect();
        Self::new(self.group, self.residual, Arc::new(raw))
    }

    /// What it changes by to `other` per `scale`, as a sensitivity.
    pub(super) fn change_to(&self, other: &Self, scale: f64) -> Arc<Self> {
        let both = self.raw.iter().zip(other.raw.iter());
        let raw = both.map(|(a, b)| a.change_to(b, scale)).collect();
        Arc::new(Self::new(self.group, false, Arc::new(raw)))
    }

    fn samples(&self) -> usize {
        self.raw.iter().map(|part| part.rows.len()).sum()
    }
}

impl Kept {
    fn get(&self, key: &Key) -> Option<Arc<Signals>> {
        self.0.lock().ok()?.entries.get(key).cloned()
    }

    fn put(&self, key: Key, signals: Arc<Signals>) {
        let Ok(mut store) = self.0.lock() else { return };
        store.samples += signals.samples();
        store.order.push_back(key.clone());
        if let Some(twice) = store.entries.insert(key, signals) {
            store.samples -= twice.samples();
        }
        while store.samples > KEPT
            && let Some(oldest) = store.order.pop_front()
        {
            if let Some(gone) = store.entries.remove(&oldest) {
                store.samples -= gone.samples();
            }
        }
    }

    /// Noise or tolerances have changed: what was replayed stays.
    pub(super) fn renew(&self) {
        if let Ok(mut store) = self.0.lock() {
            store.entries.values_mut().for_each(|s| *s = s.renewed());
        }
    }
}

/// Values of the parameters that a group sees.
fn seen(group: Group, theta: &Theta) -> impl Iterator<Item = u64> + '_ {
    SPECS
        .iter()
        .filter(move |s| affects(s.p).contains(&group))
        .map(|s| theta[s.p as usize].to_bits())
}

impl Problem<'_> {
    /// Residuals of a group at `theta`.
    pub(super) fn point(&self, i: usize, group: Group, theta: &Theta) -> Arc<Signals> {
        let key: Key = core::iter::once(group as u64).chain(seen(group, theta)).collect();
        if let Some(kept) = self.kept[i].get(&key) {
            return kept;
        }
        let raw = Arc::new(self.replay_one(i, group, theta));
        let signals = Arc::new(Signals::new(group, true, raw));
        self.kept[i].put(key, signals.clone());
        signals
    }

    /// Residuals of a module at `theta` before whitening.
    pub(crate) fn raw(&self, i: usize, module: Module, theta: &Theta) -> Vec<f64> {
        let of = |group: &Group| {
            let at = group.modules().iter().position(|m| *m == module)?;
            self.point(i, *group, theta).raw.get(at).map(|part| part.rows.clone())
        };
        GROUPS.iter().find_map(of).unwrap_or_default()
    }

    /// Residuals of all groups at `theta`.
    pub(super) fn at(&self, i: usize, theta: &Theta) -> Line {
        GROUPS.iter().map(|g| self.point(i, *g, theta)).collect()
    }

    /// Rows that a group's residuals at the reference, taken along columns, miss of those at `there`.
    pub(super) fn remainder(
        &self,
        i: usize,
        group: Group,
        there: &Theta,
        columns: &[(f64, &Signals)],
    ) -> Vec<Part> {
        let mut raw = self.replay_one(i, group, there);
        let plain = self.point(i, group, &self.reference.theta);
        for (k, part) in raw.iter_mut().enumerate() {
            part.rows.iter_mut().zip(&plain.raw[k].rows).for_each(|(x, b)| *x -= b);
            for (by, column) in columns {
                let column = &column.raw[k];
                part.rows.iter_mut().zip(&column.rows).for_each(|(x, c)| *x += by * c);
            }
        }
        raw
    }

    /// Sensitivities along a direction from `theta`, of the groups that it touches.
    pub(super) fn line(&self, i: usize, theta: &Theta, direction: &Direction) -> Line {
        let groups = affects(direction.p);
        groups.iter().map(|g| self.sensitivity(i, *g, theta, direction)).collect()
    }

    /// A sensitivity of one module alone, with these rows.
    pub(super) fn column(module: Module, rows: Vec<f64>) -> Line {
        let of = |group: &&Group| group.modules().contains(&module);
        let line = GROUPS.iter().find(of).map(|group| {
            let mut raw = vec![Part::default(); group.modules().len()];
            if let Some(at) = group.modules().iter().position(|m| *m == module) {
                raw[at] = Part::whole(rows);
            }
            Arc::new(Signals::new(*group, false, Arc::new(raw)))
        });
        line.into_iter().collect()
    }

    fn sensitivity(
        &self,
        i: usize,
        group: Group,
        theta: &Theta,
        direction: &Direction,
    ) -> Arc<Signals> {
        let mut t = *theta;
        for (p, v) in &direction.shape {
            t[*p as usize] = *v;
        }
        let hat =
            direction.hat.map_or([0; 3], |h| [1 + h.signal, h.knot, h.last].map(|x| x as u64));
        let key: Key = [group as u64, direction.p as u64, direction.step.to_bits()]
            .into_iter()
            .chain(hat)
            .chain(seen(group, theta))
            .chain(seen(group, &t))
            .collect();
        if let Some(kept) = self.kept[i].get(&key) {
            return kept;
        }
        let raw: Vec<Part> = if let Some(hat) = direction.hat {
            let whole = Direction { hat: None, ..direction.clone() };
            let whole = self.sensitivity(i, group, theta, &whole);
            let modules = group.modules().iter().zip(whole.raw.iter());
            let of = |(m, part): (&Module, &Part)| self.under_hat(i, *m, hat, &part.rows);
            modules.map(|x| Part::acting(&of(x))).collect()
        } else if let Some(offset) = offset_of(direction.p).filter(|o| group.modules().contains(o))
        {
            let d = &self.drives[i];
            let of = |m: &crate::replay::Module| -> Vec<f64> {
                let size = if *m == offset { 1.0 } else { 0.0 };
                let rows = &d.valid[*m as usize];
                if d.available[*m as usize] {
                    rows.iter().map(|ok| if *ok { size } else { 0.0 }).collect()
                } else {
                    Vec::new()
                }
            };
            group.modules().iter().map(of).map(Part::whole).collect()
        } else {
            t[direction.p as usize] += direction.step;
            let mut moved = self.replay_one(i, group, &t);
            let (base, step) = if moves(direction.p) {
                t[direction.p as usize] -= 2.0 * direction.step;
                (Arc::new(self.replay_one(i, group, &t)), 2.0 * direction.step)
            } else {
                (self.point(i, group, theta).raw.clone(), direction.step)
            };
            let base = base.iter().flat_map(|part| &part.rows);
            for (x, b) in moved.iter_mut().flat_map(|part| &mut part.rows).zip(base) {
                *x = (b - *x) / step;
            }
            moved
        };
        let signals = Arc::new(Signals::new(group, false, Arc::new(raw)));
        self.kept[i].put(key, signals.clone());
        signals
    }

    fn replay_one(&self, i: usize, group: Group, theta: &Theta) -> Vec<Part> {
        let mut out = Residuals::default();
        replay_group(&self.drives[i], self.plant, theta, group, &mut out);
        let of = |m: &Module| Part::whole(core::mem::take(&mut out[*m as usize]));
        group.modules().iter().map(of).collect()
    }

    /// Whitened signals, per module of the group.
    pub(super) fn white<'s>(&self, i: usize, signals: &'s Signals) -> &'s [Whitened] {
        signals.whitened.get_or_init(|| {
            let of = |(m, raw): (&Module, &Part)| {
                let m = *m as usize;
                let (whitener, ok) = (&self.reference.whiteners[m], &self.drives[i].valid[m]);
                let clip = signals.residual.then_some(CLIP);
                Whitened::of(raw, whitener, ok, self.slow[i][m].as_ref(), clip)
            };
            signals.group.modules().iter().zip(signals.raw.iter()).map(of).collect()
        })
    }

    /// Whitened signals of a line by module; empty where it does not reach.
    pub(super) fn spread(&self, i: usize, line: &Line) -> [Vec<f64>; MODULES] {
        let mut out: [Vec<f64>; MODULES] = Default::default();
        for (m, white) in line.iter().flat_map(|signals| self.whites(i, signals)) {
            out[m] = self.written_out(i, m, white);
        }
        out
    }

    /// Modules that signals reach with what is whitened there.
    pub(super) fn whites<'s>(
        &self,
        i: usize,
        signals: &'s Signals,
    ) -> impl Iterator<Item = (usize, &'s Whitened)> {
        let modules = signals.group.modules().iter().map(|m| *m as usize);
        modules.zip(self.white(i, signals)).filter(|(_, white)| !white.is_nothing())
    }

    /// All rows of a whitened record.
    pub(super) fn written_out(&self, i: usize, m: usize, white: &Whitened) -> Vec<f64> {
        white.written_out(self.drives[i].valid[m].len(), self.slow[i][m].as_ref())
    }

    /// Inner product of two lines.
    pub(super) fn dot(&self, i: usize, a: &Line, b: &Line) -> f64 {
        let both =
            a.iter().flat_map(|a| b.iter().filter(|b| b.group == a.group).map(move |b| (a, b)));
        both.flat_map(|(a, b)| {
            let modules = a.group.modules().iter().map(|m| self.slow[i][*m as usize].as_ref());
            let whites = self.white(i, a).iter().zip(self.white(i, b));
            whites.zip(modules).map(|((a, b), slow)| a.dot(b, slow))
        })
        .sum()
    }

    /// Inner products of a line with the sensitivities to the tolerances of the drive.
    pub(super) fn products(&self, i: usize, line: &Line) -> Vec<f64> {
        let columns = &self.nuisance[i].columns;
        let mut out = vec![0.0; columns.len()];
        for signals in line {
            let products = signals.products.get_or_init(|| {
                let own = vec![signals.clone()];
                columns.iter().map(|c| self.dot(i, c, &own)).collect()
            });
            out.iter_mut().zip(products).for_each(|(x, p)| *x += p);
        }
        out
    }
}
