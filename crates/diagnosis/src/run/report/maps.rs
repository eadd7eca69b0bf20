//! Where the residuals are large: their size over speed, grade, gear, temperatures, time, ...,
//! against the noise.

use serde::Serialize;

use super::rows::Rows;
use super::traces::title;
use crate::Drive;
use crate::replay::{Module, Prepared};

/// Residuals of one quantity over one axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ResidualMap {
    /// Column name of the quantity, with its unit.
    pub quantity: &'static str,
    /// What the module compares.
    pub title: &'static str,
    /// The axis, with its unit.
    pub axis: &'static str,
    /// Root mean square residual of drives that are in order, in the quantity's unit; without a
    /// baseline that of the extended truck.
    pub noise_floor: f64,
    /// Bins along the axis.
    pub bins: Vec<Bin>,
}

/// A bin of a [`ResidualMap`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bin {
    /// Middle of the bin, in the axis' unit.
    pub at: f64,
    /// Rows in it.
    pub rows: usize,
    /// Mean residual (measured minus modelled) before and after, in the quantity's unit.
    pub bias: [f64; 2],
    /// Root mean square residual before and after.
    pub rms: [f64; 2],
}

/// Name, bin width, value at a sample.
type Axis = (&'static str, f64, fn(&Prepared, usize) -> f64);

const AXES: [Axis; 8] = [
    ("speed, km/h", 5.0, |d, i| 3.6 * d.speed[i]),
    ("grade, %", 0.5, |d, i| 100.0 * d.grade[i]),
    ("gear", 1.0, |d, i| d.gear[i] as f64),
    ("engine speed, rpm", 100.0, |d, i| d.rpm[i]),
    ("coolant, °C", 2.0, |d, i| d.coolant[i]),
    ("air, °C", 2.0, |d, i| d.ambient[i]),
    ("position, km", 1.0, |d, i| 1e-3 * d.s_map[i]),
    ("time, min", 1.0, |_, i| i as f64 * Drive::STEP_S / 60.0),
];
/// Smallest part of the rows that makes a bin.
const LEAST_FRAC: f64 = 0.002;

pub(super) fn maps(learned: &[Rows], held: &[Rows], clean: &[Rows]) -> Vec<ResidualMap> {
    let mut modules: Vec<(f64, Module)> = Module::ALL
        .iter()
        .filter_map(|m| {
            let [before, after] = rms(learned, *m)?;
            let floor = floor(clean, *m).unwrap_or(after).max(1e-12);
            // what the extension changed first, then what is large
            let relief = (before * before - after * after) / (floor * floor);
            Some((1e3 * relief + before / floor, *m))
        })
        .collect();
    modules.sort_by(|a, b| b.0.total_cmp(&a.0));
    modules
        .into_iter()
        .flat_map(|(_, m)| AXES.iter().filter_map(move |axis| map(learned, held, clean, m, axis)))
        .collect()
}

fn rms(rows: &[Rows], m: Module) -> Option<[f64; 2]> {
    let mut s = [0.0; 3];
    for (_, b, a) in rows.iter().flat_map(|r| r.of(m)) {
        s[0] += b * b;
        s[1] += a * a;
        s[2] += 1.0;
    }
    (s[2] > 0.0).then(|| [(s[0] / s[2]).sqrt(), (s[1] / s[2]).sqrt()])
}

fn floor(clean: &[Rows], m: Module) -> Option<f64> {
    rms(clean, m).map(|r| r[0])
}

fn map(
    learned: &[Rows],
    held: &[Rows],
    clean: &[Rows],
    m: Module,
    (axis, width, value): &Axis,
) -> Option<ResidualMap> {
    let mut bins = std::collections::BTreeMap::<i64, [f64; 5]>::new();
    let mut all = 0.0;
    for r in learned.iter().chain(held) {
        for (k, b, a) in r.of(m) {
            let at = value(&r.drive, r.sample(m, k));
            let bin = bins.entry((at / width).floor() as i64).or_default();
            for (sum, x) in bin.iter_mut().zip([1.0, b, a, b * b, a * a]) {
                *sum += x;
            }
            all += 1.0;
        }
    }
    let least = f64::max(LEAST_FRAC * all, 1.0);
    let bins: Vec<Bin> = bins
        .into_iter()
        .filter(|(_, s)| s[0] >= least)
        .map(|(i, s)| Bin {
            at: if *axis == "gear" { i as f64 } else { (i as f64 + 0.5) * width },
            rows: s[0] as usize,
            bias: [s[1] / s[0], s[2] / s[0]],
            rms: [(s[3] / s[0]).sqrt(), (s[4] / s[0]).sqrt()],
        })
        .collect();
    let noise_floor = floor(clean, m).or_else(|| rms(learned, m).map(|r| r[1]))?;
    (bins.len() > 1).then(|| ResidualMap {
        quantity: m.quantity(),
        title: title(m),
        axis,
        noise_floor,
        bins,
    })
}
