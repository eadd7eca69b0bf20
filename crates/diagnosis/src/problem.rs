//! Residuals, sensitivities and tolerances of a set of drives in one nuisance-marginal metric.
//!
//! Per drive `M = I - Z (I + Z'Z)^-1 Z'`, the columns of `Z` being the sensitivities to the
//! tolerances of that drive (load sheet, weather, instruments), scaled by their standard
//! deviations. Everything that the search needs is a Gram matrix in `M`, kept per drive.

use std::collections::HashMap;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use crate::param::{P, PARAMS, SPECS, Theta};
use crate::replay::{GROUPS, Group, MODULES, Module, Prepared, Residuals, affects, replay_group};
use crate::stats::whiten::Whitener;
use crate::unknown::KNOTS;
use crate::{DiagnosisError, Executor, Plant};

/// Tolerances, calibration and noise of a truck and its logger.
#[derive(Debug, Clone)]
pub(crate) struct Reference {
    /// Common calibration, the zero of all causes.
    pub(crate) theta: Theta,
    /// Scatter between drives, per parameter; 0 where none.
    pub(crate) tolerance: [f64; PARAMS],
    pub(crate) whiteners: Vec<Whitener>,
    /// Mean square of whitened residuals at the calibration, tolerances included, per module.
    pub(crate) ratio: [f64; MODULES],
    /// The same with the tolerances taken out.
    pub(crate) settled: [f64; MODULES],
    /// Evidence of the best free function per module on drives that are in order, nats per drive.
    pub(crate) free_form: [f64; MODULES],
}

/// Whitened columns per module; empty where zero.
pub(crate) type Column = [Vec<f64>; MODULES];

/// Raw sensitivities already replayed, by direction and by the parameters of the groups that they
/// touch: modules do not see each other's parameters.
type Replayed = std::sync::Mutex<HashMap<Vec<u64>, Arc<Column>>>;

/// Drives' worth of the expected scatter that the baseline has to outweigh, and rounds of the
/// iteration.
const SCATTER_PRIOR: f64 = 2.0;
/// Spread of a tolerance's mean, in its scatter.
const MEAN_PRIOR: f64 = 0.7;
const SCATTER_ROUNDS: usize = 25;

/// Most sensitivities kept per drive.
const KEPT: usize = 160;

struct Nuisance {
    /// Residuals at the reference, and whitened.
    base: Residuals,
    whitened: Column,
    /// Sensitivities before whitening, per unit of the parameter.
    raw: Vec<Arc<Column>>,
    columns: Vec<Column>,
    factor: nalgebra::Cholesky<f64, nalgebra::Dyn>,
}

/// What is left of a drive: whitened, its squared length, its product with the tolerances.
pub(crate) struct Rest {
    pub(crate) whitened: Column,
    norm: f64,
    tolerances: DVector<f64>,
}

/// A set of drives ready for the search.
pub(crate) struct Problem<'a> {
    pub(crate) plant: &'a Plant,
    pub(crate) drives: Vec<Prepared>,
    pub(crate) reference: Reference,
    nuisance: Vec<Nuisance>,
    replayed: Vec<Replayed>,
    executor: &'a dyn Executor,
}

/// A direction in parameter space: from `base`, a step of `step` along `p`.
#[derive(Debug, Clone)]
pub(crate) struct Direction {
    pub(crate) p: P,
    /// Shape parameters that hold while the direction is taken.
    pub(crate) shape: Vec<(P, f64)>,
    pub(crate) step: f64,
}

/// Marginal Gram matrix per drive over `[r, columns]`.
#[derive(Debug, Clone)]
pub(crate) struct Gram {
    pub(crate) per_drive: Vec<DMatrix<f64>>,
}

impl Gram {
    /// Information, gradient and residual norm over the drives chosen.
    pub(crate) fn sum(&self, pick: impl Fn(usize) -> bool) -> (DMatrix<f64>, DVector<f64>, f64) {
        let k = self.per_drive.first().map_or(1, DMatrix::nrows);
        let mut total = DMatrix::zeros(k, k);
        for (i, g) in self.per_drive.iter().enumerate() {
            if pick(i) {
                total += g;
            }
        }
        let a = total.view((1, 1), (k - 1, k - 1)).into_owned();
        let b = total.view((1, 0), (k - 1, 1)).column(0).into_owned();
        (a, b, total[(0, 0)])
    }
}

/// Limit of a whitened residual: beyond it a row says "wrong" but not "how wrong".
const CLIP: f64 = 1e3;

fn order(m: Module) -> usize {
    match m {
        Module::Shift => 0,
        Module::Force | Module::Imu => 8,
        _ => 6,
    }
}

impl Reference {
    fn start(drives: &[Prepared], residuals: &[Residuals], theta: Theta) -> Self {
        let mut tolerance = [0.0; PARAMS];
        for (t, s) in tolerance.iter_mut().zip(&SPECS) {
            *t = s.scatter();
        }
        let whiteners = fit_whiteners(drives, residuals, true);
        Self {
            theta,
            tolerance,
            whiteners,
            ratio: [1.0; MODULES],
            settled: [1.0; MODULES],
            free_form: [0.0; MODULES],
        }
    }
}

fn fit_whiteners(drives: &[Prepared], residuals: &[Residuals], white: bool) -> Vec<Whitener> {
    Module::ALL
        .iter()
        .map(|m| {
            let i = *m as usize;
            let records = drives
                .iter()
                .zip(residuals)
                .filter(|(d, _)| d.available[i])
                .map(|(d, r)| (r[i].as_slice(), d.valid[i].as_slice()));
            let fitted = Whitener::fit(records, if white { 0 } else { order(*m) });
            let mut w = fitted.unwrap_or_else(|| Whitener::white(1.0));
            w.sigma = w.sigma.max(floor(*m));
            w
        })
        .collect()
}

/// Resolution of the channels: noise is never assumed smaller.
fn floor(m: Module) -> f64 {
    match m {
        Module::Force | Module::Imu | Module::Gps => 1e-3,
        Module::Torque => 0.2,
        Module::Fuel => 0.05,
        Module::Brake => 0.3,
        Module::Shift => 0.02,
        Module::Yaw | Module::TrailerYaw | Module::Heading => 5e-5,
        Module::AccelY | Module::Altitude => 1e-2,
    }
}

fn nuisance_directions(tolerance: &[f64; PARAMS]) -> Vec<Direction> {
    SPECS
        .iter()
        .filter(|s| tolerance[s.p as usize] > 0.0)
        .map(|s| Direction { p: s.p, shape: Vec::new(), step: s.step })
        .collect()
}

impl<'a> Problem<'a> {
    /// Learns calibration, tolerances and noise from drives that are in order (`clean`), or only
    /// the noise from drives that need not be.
    pub(crate) fn learn(
        plant: &'a Plant,
        drives: Vec<Prepared>,
        clean: bool,
        executor: &'a dyn Executor,
    ) -> Result<Self, DiagnosisError> {
        let theta = [0.0; PARAMS];
        let residuals: Vec<Residuals> = drives.iter().map(|d| replay(d, plant, &theta)).collect();
        let reference = Reference::start(&drives, &residuals, theta);
        let replayed = drives.iter().map(|_| Replayed::default()).collect();
        let mut problem =
            Self { plant, drives, reference, nuisance: Vec::new(), replayed, executor };
        problem.refresh()?;
        for round in 0..2 {
            if clean || round > 0 {
                problem.calibrate(clean, round == 0)?;
            }
            if clean && round > 0 {
                problem.scatter();
                problem.follow()?;
            }
            let mut noise = Vec::with_capacity(problem.drives.len());
            for i in 0..problem.drives.len() {
                let z = problem.nuisance_mean(i);
                noise.push(problem.without_nuisance(i, &z));
            }
            problem.reference.whiteners = fit_whiteners(&problem.drives, &noise, false);
            problem.follow()?;
        }
        if clean {
            problem.scatter();
            problem.follow()?;
        }
        if clean {
            problem.reference.ratio = problem.ratios(&problem.reference.theta);
            problem.reference.settled = problem.settled(&problem.reference.theta);
            let count = problem.drives.len() as f64;
            for s in problem.shapes(&problem.reference.theta) {
                let f = &mut problem.reference.free_form[s.module as usize];
                *f = f.max(s.log_z / count);
            }
        }
        Ok(problem)
    }

    /// Mean square of whitened residuals per module; 1 where a module has no rows.
    pub(crate) fn ratios(&self, theta: &Theta) -> [f64; MODULES] {
        let mut sums = [(0.0, 0.0); MODULES];
        for (i, d) in self.drives.iter().enumerate() {
            for ((sum, w), ok) in sums.iter_mut().zip(&self.at(i, theta).1).zip(&d.valid) {
                sum.0 += w.iter().map(|x| x * x).sum::<f64>();
                sum.1 += ok.iter().filter(|x| **x).count() as f64;
            }
        }
        sums.map(|(s, n)| if n > 0.0 && s > 0.0 { s / n } else { 1.0 })
    }

    /// The same after what the tolerances of each drive can take is taken out.
    pub(crate) fn settled(&self, theta: &Theta) -> [f64; MODULES] {
        let parts = self.each(|i| {
            let rest = self.rest(i, theta);
            let nuisance = &self.nuisance[i];
            let z = nuisance.factor.solve(&rest.tolerances);
            let mut left = rest.whitened;
            for (c, z) in nuisance.columns.iter().zip(z.iter()) {
                for (left, c) in left.iter_mut().zip(c) {
                    left.iter_mut().zip(c).for_each(|(x, c)| *x -= z * c);
                }
            }
            left.map(|x| inner(&x, &x))
        });
        core::array::from_fn(|m| {
            let rows: usize =
                self.drives.iter().map(|d| d.valid[m].iter().filter(|x| **x).count()).sum();
            let sum: f64 = parts.iter().map(|p| p[m]).sum();
            if rows > 0 && sum > 0.0 { sum / rows as f64 } else { 1.0 }
        })
    }

    /// A problem on other drives with a reference learned before.
    pub(crate) fn with(
        plant: &'a Plant,
        drives: Vec<Prepared>,
        reference: Reference,
        executor: &'a dyn Executor,
    ) -> Result<Self, DiagnosisError> {
        let replayed = drives.iter().map(|_| Replayed::default()).collect();
        let mut problem =
            Self { plant, drives, reference, nuisance: Vec::new(), replayed, executor };
        problem.refresh()?;
        Ok(problem)
    }

    fn each<T: Send>(&self, f: impl Fn(usize) -> T + Sync) -> Vec<T> {
        let slots: Vec<std::sync::Mutex<Option<T>>> =
            self.drives.iter().map(|_| std::sync::Mutex::new(None)).collect();
        self.executor.run(self.drives.len(), &|i| {
            let value = f(i);
            if let Ok(mut slot) = slots[i].lock() {
                *slot = Some(value);
            }
        });
        slots.into_iter().filter_map(|s| s.into_inner().ok().flatten()).collect()
    }

    /// Residuals and sensitivities to the tolerances at the reference.
    fn refresh(&mut self) -> Result<(), DiagnosisError> {
        self.rebuild(false)
    }

    /// The same after a small change of the reference: the sensitivities themselves stay.
    fn follow(&mut self) -> Result<(), DiagnosisError> {
        self.rebuild(true)
    }

    fn rebuild(&mut self, keep: bool) -> Result<(), DiagnosisError> {
        let directions = nuisance_directions(&self.reference.tolerance);
        let theta = self.reference.theta;
        let built = self.each(|i| {
            let base = replay(&self.drives[i], self.plant, &theta);
            let old = self.nuisance.get(i).filter(|n| keep && n.raw.len() == directions.len());
            let raw: Vec<Arc<Column>> = match old {
                Some(n) => n.raw.clone(),
                None => directions.iter().map(|d| self.raw(i, &theta, &base, d)).collect(),
            };
            let columns: Vec<Column> = directions
                .iter()
                .zip(&raw)
                .map(|(d, raw)| {
                    let mut c = self.whiten_sensitivity(i, raw);
                    let sigma = self.reference.tolerance[d.p as usize];
                    c.iter_mut().flatten().for_each(|x| *x *= sigma);
                    c
                })
                .collect();
            let q = columns.len();
            let mut s = DMatrix::identity(q, q);
            for a in 0..q {
                for b in a..q {
                    let v = dot(&columns[a], &columns[b]);
                    s[(a, b)] += v;
                    if a != b {
                        s[(b, a)] += v;
                    }
                }
            }
            let whitened = self.whiten(i, &base);
            s.cholesky().map(|factor| Nuisance { base, whitened, raw, columns, factor })
        });
        self.nuisance = built
            .into_iter()
            .collect::<Option<Vec<_>>>()
            .ok_or_else(|| DiagnosisError::Numerics("tolerances of a drive".into()))?;
        Ok(())
    }

    /// Whitened residuals of a drive.
    fn whiten(&self, i: usize, r: &Residuals) -> Column {
        core::array::from_fn(|m| self.whiten_module(i, m, &r[m]))
    }

    fn whiten_module(&self, i: usize, m: usize, r: &[f64]) -> Vec<f64> {
        if r.is_empty() {
            return Vec::new();
        }
        let mut w = self.reference.whiteners[m].apply(r, &self.drives[i].valid[m]);
        w.iter_mut().for_each(|x| *x = if x.is_finite() { x.clamp(-CLIP, CLIP) } else { CLIP });
        w
    }

    /// Whitened sensitivity: minus the derivative of the residual along the direction.
    fn column(&self, i: usize, theta: &Theta, base: &Residuals, direction: &Direction) -> Column {
        self.whiten_sensitivity(i, &self.raw(i, theta, base, direction))
    }

    fn whiten_sensitivity(&self, i: usize, raw: &Column) -> Column {
        core::array::from_fn(|m| {
            if raw[m].is_empty() {
                return Vec::new();
            }
            self.reference.whiteners[m].apply(&raw[m], &self.drives[i].valid[m])
        })
    }

    /// The sensitivity before whitening.
    fn raw(&self, i: usize, theta: &Theta, base: &Residuals, direction: &Direction) -> Arc<Column> {
        let d = &self.drives[i];
        let mut t = *theta;
        for (p, v) in &direction.shape {
            t[*p as usize] = *v;
        }
        let groups = affects(direction.p);
        let mut key = vec![direction.p as u64, direction.step.to_bits()];
        key.extend(
            SPECS
                .iter()
                .filter(|s| affects(s.p).iter().any(|g| groups.contains(g)))
                .flat_map(|s| [theta[s.p as usize].to_bits(), t[s.p as usize].to_bits()]),
        );
        if let Ok(kept) = self.replayed[i].lock()
            && let Some(column) = kept.get(&key)
        {
            return column.clone();
        }
        t[direction.p as usize] += direction.step;
        let mut moved = Residuals::default();
        for g in groups {
            replay_group(d, self.plant, &t, *g, &mut moved);
        }
        for (moved, base) in moved.iter_mut().zip(base) {
            for (x, b) in moved.iter_mut().zip(base) {
                *x = (b - *x) / direction.step;
            }
        }
        let column = Arc::new(moved);
        if let Ok(mut kept) = self.replayed[i].lock() {
            if kept.len() >= KEPT {
                kept.clear();
            }
            kept.insert(key, column.clone());
        }
        column
    }

    /// Gram matrix of the residual at `theta` and the directions from there, and the raw
    /// (not marginal) chi-square per module.
    pub(crate) fn gram(&self, theta: &Theta, directions: &[Direction]) -> (Gram, [f64; MODULES]) {
        let parts = self.each(|i| {
            let (base, whitened) = self.at(i, theta);
            let mut columns = vec![whitened];
            columns.extend(directions.iter().map(|d| self.column(i, theta, &base, d)));
            let chi: [f64; MODULES] =
                core::array::from_fn(|m| columns[0][m].iter().map(|x| x * x).sum());
            (self.marginal(i, &columns), chi)
        });
        let mut chi = [0.0; MODULES];
        for p in &parts {
            for (c, x) in chi.iter_mut().zip(&p.1) {
                *c += x;
            }
        }
        (Gram { per_drive: parts.into_iter().map(|p| p.0).collect() }, chi)
    }

    /// Squared whitened residuals per module at the reference.
    pub(crate) fn chi_at_reference(&self) -> [f64; MODULES] {
        core::array::from_fn(|m| {
            self.nuisance.iter().map(|n| inner(&n.whitened[m], &n.whitened[m])).sum()
        })
    }

    /// Residuals of a drive at `theta`, raw and whitened; only groups whose parameters differ
    /// from the reference are replayed.
    fn at(&self, i: usize, theta: &Theta) -> (Residuals, Column) {
        let nuisance = &self.nuisance[i];
        let (mut base, mut whitened) = (nuisance.base.clone(), nuisance.whitened.clone());
        let mut moved: Vec<Group> = Vec::new();
        for s in &SPECS {
            if theta[s.p as usize] != self.reference.theta[s.p as usize] {
                for g in affects(s.p) {
                    if !moved.contains(g) {
                        moved.push(*g);
                    }
                }
            }
        }
        for g in moved {
            replay_group(&self.drives[i], self.plant, theta, g, &mut base);
            for m in g.modules() {
                whitened[*m as usize] = self.whiten_module(i, *m as usize, &base[*m as usize]);
            }
        }
        (base, whitened)
    }

    /// Gram matrix of given columns in the metric `M` of a drive.
    pub(crate) fn marginal(&self, i: usize, columns: &[Column]) -> DMatrix<f64> {
        let nuisance = &self.nuisance[i];
        let (k, q) = (columns.len(), nuisance.columns.len());
        let mut g = DMatrix::zeros(k, k);
        for a in 0..k {
            for b in a..k {
                let v = dot(&columns[a], &columns[b]);
                g[(a, b)] = v;
                g[(b, a)] = v;
            }
        }
        if q > 0 {
            let zc = DMatrix::from_fn(q, k, |a, b| dot(&nuisance.columns[a], &columns[b]));
            if let Some(y) = nuisance.factor.l().solve_lower_triangular(&zc) {
                g -= y.transpose() * y;
            }
        }
        g
    }

    /// What is left of drive `i` at `theta`.
    pub(crate) fn rest(&self, i: usize, theta: &Theta) -> Rest {
        let whitened = self.at(i, theta).1;
        let columns = &self.nuisance[i].columns;
        Rest {
            tolerances: DVector::from_iterator(
                columns.len(),
                columns.iter().map(|c| dot(c, &whitened)),
            ),
            norm: dot(&whitened, &whitened),
            whitened,
        }
    }

    /// Marginal Gram matrix over the residual and hat functions of one module: `places` gives the
    /// knot to the left and the way to the next, per row. Only a few hats touch a row, so the
    /// whitened hats are never written out.
    pub(crate) fn hats(
        &self,
        i: usize,
        m: usize,
        places: &[Option<(usize, f64)>],
        rest: &Rest,
    ) -> DMatrix<f64> {
        let (d, nuisance) = (&self.drives[i], &self.nuisance[i]);
        let whitener = &self.reference.whiteners[m];
        let scale = 1.0 / whitener.sigma;
        let touched: Vec<(usize, &[f64])> = nuisance
            .columns
            .iter()
            .enumerate()
            .filter(|(_, c)| !c[m].is_empty())
            .map(|(j, c)| (j, c[m].as_slice()))
            .collect();
        let mut g = DMatrix::zeros(KNOTS + 1, KNOTS + 1);
        let mut z = DMatrix::zeros(nuisance.columns.len(), KNOTS + 1);
        g[(0, 0)] = rest.norm;
        z.set_column(0, &rest.tolerances);
        let residual = &rest.whitened[m];
        for k in 0..residual.len().min(places.len()) {
            if !d.valid[m][k] {
                continue;
            }
            let (mut hat, mut low, mut high) = ([0.0; KNOTS], KNOTS, 0);
            let mut add = |place: Option<(usize, f64)>, weight: f64| {
                if let Some((j, w)) = place {
                    hat[j] += weight * (1.0 - w);
                    hat[j + 1] += weight * w;
                    (low, high) = (low.min(j), high.max(j + 1));
                }
            };
            add(places[k], scale);
            for (lag, a) in whitener.coefficients.iter().enumerate().take(k) {
                add(places[k - 1 - lag], -a * scale);
            }
            for a in low..=high {
                g[(0, a + 1)] += residual[k] * hat[a];
                for b in a..=high {
                    g[(a + 1, b + 1)] += hat[a] * hat[b];
                }
                for (j, c) in &touched {
                    z[(*j, a + 1)] += c[k] * hat[a];
                }
            }
        }
        for a in 0..=KNOTS {
            for b in 0..a {
                g[(a, b)] = g[(b, a)];
            }
        }
        if let Some(y) = nuisance.factor.l().solve_lower_triangular(&z) {
            g -= y.transpose() * y;
        }
        g
    }

    /// Whitened residuals of drive `i` at `theta`.
    pub(crate) fn whitened(&self, i: usize, theta: &Theta) -> Column {
        self.at(i, theta).1
    }

    /// Posterior mean of a drive's tolerances at the reference, in their sigmas.
    fn nuisance_mean(&self, i: usize) -> Vec<f64> {
        let r = self.whitened(i, &self.reference.theta);
        let n = &self.nuisance[i];
        let zr = DVector::from_iterator(n.columns.len(), n.columns.iter().map(|c| dot(c, &r)));
        n.factor.solve(&zr).iter().copied().collect()
    }

    /// Mean and scatter of every tolerance between the drives by expectation-maximisation, with
    /// [`SCATTER_PRIOR`] drives' worth of the scatter that is expected and a prior for the mean. The
    /// mean is what this truck and its weather are like when all is well (a crosswind of any sign
    /// adds drag): causes count from there.
    fn scatter(&mut self) {
        let specs: Vec<&crate::param::Spec> =
            nuisance_directions(&self.reference.tolerance).iter().map(|d| d.p.spec()).collect();
        let systems: Vec<(DMatrix<f64>, DVector<f64>)> = (0..self.drives.len())
            .map(|i| {
                let r = self.whitened(i, &self.reference.theta);
                let c = &self.nuisance[i].columns;
                let a = DMatrix::from_fn(c.len(), c.len(), |x, y| {
                    if x <= y { dot(&c[x], &c[y]) } else { 0.0 }
                });
                let a = DMatrix::from_fn(c.len(), c.len(), |x, y| a[(x.min(y), x.max(y))]);
                (a, DVector::from_iterator(c.len(), c.iter().map(|c| dot(c, &r))))
            })
            .collect();
        let count = self.drives.len() as f64;
        // Means and variances in units of what the columns are scaled with.
        let mut variance = vec![1.0; specs.len()];
        let mut mean = DVector::<f64>::zeros(specs.len());
        for _ in 0..SCATTER_ROUNDS {
            let mut first = DVector::<f64>::zeros(specs.len());
            let mut second = vec![0.0; specs.len()];
            for (a, b) in &systems {
                let (mut a, mut b) = (a.clone(), b.clone());
                for (j, v) in variance.iter().enumerate() {
                    a[(j, j)] += 1.0 / v;
                    b[j] += mean[j] / v;
                }
                let Some(factor) = a.cholesky() else { return };
                let (z, spread) = (factor.solve(&b), factor.inverse());
                for (j, s) in second.iter_mut().enumerate() {
                    *s += (z[j] - mean[j]).powi(2) + spread[(j, j)];
                }
                first += z;
            }
            for (j, (v, s)) in variance.iter().zip(&specs).enumerate() {
                let own = MEAN_PRIOR * s.scatter() / self.reference.tolerance[s.p as usize];
                mean[j] = first[j] / (count + v / (own * own));
            }
            for ((v, second), s) in variance.iter_mut().zip(second).zip(&specs) {
                let expected = (s.scatter() / self.reference.tolerance[s.p as usize]).powi(2);
                let bound = match s.p {
                    P::TurboLag | P::PedalDelay | P::TorqueReport => 2.0,
                    _ => 10.0,
                };
                *v = ((SCATTER_PRIOR * expected + second) / (SCATTER_PRIOR + count))
                    .min(bound * bound * expected);
            }
        }
        for (j, (v, s)) in variance.iter().zip(&specs).enumerate() {
            let i = s.p as usize;
            let shift = mean[j] * self.reference.tolerance[i];
            let x = &mut self.reference.theta[i];
            *x = (*x + shift).clamp(s.lo, s.hi);
            self.reference.tolerance[i] *= v.sqrt();
        }
    }

    /// Raw residuals of a drive after its tolerances are taken out.
    fn without_nuisance(&self, i: usize, z: &[f64]) -> Residuals {
        let d = &self.drives[i];
        let mut t = self.reference.theta;
        for (s, z) in nuisance_directions(&self.reference.tolerance).iter().zip(z) {
            let x = &mut t[s.p as usize];
            *x = (*x + z * self.reference.tolerance[s.p as usize])
                .clamp(s.p.spec().lo, s.p.spec().hi);
        }
        replay(d, self.plant, &t)
    }

    /// One parameter after the other, in halving steps: delays of sampled signals have a kink at
    /// every sample, where Gauss-Newton stops short.
    fn creep(
        &self,
        theta: &mut Theta,
        best: &mut f64,
        free: &[&crate::param::Spec],
        cost: &dyn Fn(f64, &Theta) -> f64,
    ) {
        for s in free.iter().filter(|s| s.unit == "s") {
            let mut step = 0.02;
            while step > 0.004 {
                let mut moved = false;
                for sign in [1.0, -1.0] {
                    let mut t = *theta;
                    let x = &mut t[s.p as usize];
                    *x = (*x + sign * step).clamp(s.lo, s.hi);
                    let c = cost(self.gram(&t, &[]).0.sum(|_| true).2, &t);
                    if c < *best {
                        (*theta, *best, moved) = (t, c, true);
                        break;
                    }
                }
                if !moved {
                    step *= 0.5;
                }
            }
        }
    }

    /// Gauss-Newton steps of the common calibration.
    fn calibrate(&mut self, clean: bool, first: bool) -> Result<(), DiagnosisError> {
        if !clean {
            return Ok(());
        }
        let free: Vec<&crate::param::Spec> = SPECS.iter().filter(|s| s.calibration > 0.0).collect();
        let directions: Vec<Direction> = free
            .iter()
            .map(|s| Direction { p: s.p, shape: Vec::new(), step: 0.3 * s.step })
            .collect();
        let cost = |norm: f64, t: &Theta| {
            norm + free.iter().map(|s| (t[s.p as usize] / s.calibration).powi(2)).sum::<f64>()
        };
        let mut theta = self.reference.theta;
        let (mut gram, _) = self.gram(&theta, &directions);
        let mut best = cost(gram.sum(|_| true).2, &theta);
        for _ in 0..if first { 4 } else { 2 } {
            let (mut a, mut b, _) = gram.sum(|_| true);
            for (j, s) in free.iter().enumerate() {
                let precision = 1.0 / (s.calibration * s.calibration);
                a[(j, j)] += precision;
                b[j] -= precision * theta[s.p as usize];
            }
            let step = a
                .cholesky()
                .ok_or_else(|| DiagnosisError::Numerics("calibration".into()))?
                .solve(&b);
            let mut factor = 1.0;
            let mut improved = false;
            while !improved && factor > 0.05 {
                let mut t = theta;
                for (s, d) in free.iter().zip(step.iter()) {
                    let x = &mut t[s.p as usize];
                    *x = (*x + factor * d).clamp(s.lo, s.hi);
                }
                let c = cost(self.gram(&t, &[]).0.sum(|_| true).2, &t);
                if c < best {
                    (theta, best, improved) = (t, c, true);
                    gram = self.gram(&theta, &directions).0;
                }
                factor *= 0.4;
            }
            if !improved {
                break;
            }
        }
        if first {
            self.creep(&mut theta, &mut best, &free, &cost);
        }
        self.reference.theta = theta;
        if first { self.refresh() } else { self.follow() }
    }
}

/// All residuals of a drive.
pub(crate) fn replay(d: &Prepared, plant: &Plant, theta: &Theta) -> Residuals {
    let mut out = Residuals::default();
    for g in GROUPS {
        let _: Group = g;
        replay_group(d, plant, theta, g, &mut out);
    }
    out
}

fn dot(a: &Column, b: &Column) -> f64 {
    a.iter().zip(b).map(|(a, b)| inner(a, b)).sum()
}

/// Inner product with eight running sums, so that the compiler may use wide registers.
fn inner(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let (mut sums, whole) = ([0.0; 8], n - n % 8);
    for (x, y) in a[..whole].chunks_exact(8).zip(b[..whole].chunks_exact(8)) {
        for (s, (x, y)) in sums.iter_mut().zip(x.iter().zip(y)) {
            *s += x * y;
        }
    }
    let rest: f64 = a[whole..n].iter().zip(&b[whole..n]).map(|(x, y)| x * y).sum();
    sums.iter().sum::<f64>() + rest
}
