//! How sure the gain is: a block bootstrap over windows of 60 s of the held-out drives.
//!
//! Errors along a drive depend on each other over seconds to a minute, so that windows rather than
//! samples are drawn, with replacement and within every drive (Kuensch 1989); with three drives or
//! more the drives are drawn too. A fall of an error is claimed when the 90 % interval of its
//! relative size lies above zero, and the diagnosis as a whole is significant.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde::Serialize;

use super::rows::Rows;
use crate::answer::gain::HORIZON_S;
use crate::causes::hypothesis::CATALOGUE;
use crate::replay::Module;
use crate::run::report_models::Models;
use crate::{Diagnosis, Drive};

/// Lower and upper end of a 90 % interval.
pub type Interval = [f64; 2];

/// An error on held-out drives before and after.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GainInterval {
    /// Column name, with its unit.
    pub quantity: &'static str,
    /// What is compared.
    pub title: &'static str,
    /// Length of the free runs, s; 0 for one-step residuals.
    pub horizon_s: f64,
    /// Root mean square error with the truck file, in the quantity's unit.
    pub before: f64,
    /// The same with the extended truck.
    pub after: f64,
    /// Part of the error that is gone, and its 90 % interval.
    pub fall_frac: f64,
    /// 90 % interval of it.
    pub fall_frac_interval: Interval,
    /// The fall is significant.
    pub claimed: bool,
    /// The error grows beyond its interval, and on every drive.
    pub lost: bool,
    /// Of a loss: the causes that have to go until it is gone, those with the least evidence first.
    pub blamed: Vec<&'static str>,
}

/// Bootstrap samples.
const RESAMPLES: usize = 1000;
/// Drives from which on drives are drawn too.
const DRIVES_TO_DRAW: usize = 3;
/// A fall below this is none.
const LEAST_FALL_FRAC: f64 = 0.01;

/// Squared errors of a window before and after, and its rows.
type Window = [f64; 3];

pub(super) fn gains(held: &[Rows], found: &Diagnosis, seed: u64) -> Vec<GainInterval> {
    let Some(gain) = &found.gain else { return Vec::new() };
    let mut out = Vec::new();
    let speed: Vec<Vec<Window>> = held.iter().map(speed_windows).collect();
    out.extend(interval("speed_m_s", "Speed in free runs", HORIZON_S, &speed, seed));
    for m in Module::ALL {
        let windows: Vec<Vec<Window>> = held.iter().map(|r| module_windows(r, m)).collect();
        out.extend(interval(m.quantity(), super::traces::title(m), 0.0, &windows, seed));
    }
    for g in &mut out {
        g.claimed &= gain.significant;
    }
    out
}

/// Says which causes a loss comes from: those with the least evidence that act there, as many as
/// have to go until it is gone. `rows` replays the drives held out with two models.
pub(super) fn blame(
    gains: &mut [GainInterval],
    found: &Diagnosis,
    seed: u64,
    rows: &dyn Fn(&Models) -> Vec<Rows>,
) {
    let mut less = std::collections::BTreeMap::<Vec<&str>, Vec<Rows>>::new();
    for g in gains.iter_mut().filter(|g| g.lost) {
        let acts = |c: &&crate::Cause| {
            let groups = CATALOGUE.iter().filter(|h| h.id == c.id).flat_map(|h| h.groups());
            groups.flat_map(|g| g.modules()).any(|m| m.quantity() == g.quantity)
        };
        // They are in the order of their evidence.
        for cause in found.causes.iter().rev().filter(acts) {
            g.blamed.push(cause.id);
            let held = less.entry(g.blamed.clone()).or_insert_with(|| {
                rows(&Models { after: found.models.without(&g.blamed), ..found.models })
            });
            let module = Module::ALL.into_iter().find(|m| m.quantity() == g.quantity);
            let windows: Vec<Vec<Window>> = match module {
                Some(m) if g.horizon_s <= 0.0 => {
                    held.iter().map(|r| module_windows(r, m)).collect()
                }
                _ => held.iter().map(speed_windows).collect(),
            };
            if !interval(g.quantity, g.title, g.horizon_s, &windows, seed).is_some_and(|g| g.lost) {
                break;
            }
        }
    }
}

fn speed_windows(r: &Rows) -> Vec<Window> {
    let run = (HORIZON_S / Drive::STEP_S) as usize;
    let error = |x: f64, m: f64| (x - m) * (x - m);
    let mut out = Vec::new();
    for start in (0..r.drive.n).step_by(run) {
        let mut w = [0.0; 3];
        for i in start + 1..(start + run + 1).min(r.drive.n) {
            let (b, a, m) = (r.speed_before[i], r.speed_after[i], r.drive.speed[i]);
            if b.is_finite() && a.is_finite() {
                w = [w[0] + error(b, m), w[1] + error(a, m), w[2] + 1.0];
            }
        }
        if w[2] > 0.0 {
            out.push(w);
        }
    }
    out
}

fn module_windows(r: &Rows, m: Module) -> Vec<Window> {
    let per_window = (HORIZON_S / Drive::STEP_S) as usize;
    let mut windows = std::collections::BTreeMap::<usize, Window>::new();
    for (k, b, a) in r.of(m) {
        let w = windows.entry(r.sample(m, k) / per_window).or_default();
        *w = [w[0] + b * b, w[1] + a * a, w[2] + 1.0];
    }
    windows.into_values().collect()
}

fn interval(
    quantity: &'static str,
    title: &'static str,
    horizon_s: f64,
    drives: &[Vec<Window>],
    seed: u64,
) -> Option<GainInterval> {
    let total = drives.iter().flatten().fold([0.0; 3], add);
    if total[2] < 2.0 || total[0] <= 0.0 {
        return None;
    }
    let rms = |s: f64| (s / total[2]).sqrt();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = |n: usize| ((u64::from(rng.next_u32()) * n as u64) >> 32) as usize;
    let mut falls: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            let mut sum = [0.0; 3];
            for i in 0..drives.len() {
                let d =
                    &drives[if drives.len() >= DRIVES_TO_DRAW { draw(drives.len()) } else { i }];
                for _ in 0..d.len() {
                    sum = add(sum, &d[draw(d.len())]);
                }
            }
            fall(sum)
        })
        .collect();
    falls.sort_by(f64::total_cmp);
    let at = |p: f64| falls[((RESAMPLES - 1) as f64 * p).round() as usize];
    let fall_frac = fall(total);
    let fall_frac_interval = [at(0.05), at(0.95)];
    let everywhere = drives.iter().all(|d| fall(d.iter().fold([0.0; 3], add)) < 0.0);
    Some(GainInterval {
        quantity,
        title,
        horizon_s,
        before: rms(total[0]),
        after: rms(total[1]),
        fall_frac,
        fall_frac_interval,
        claimed: fall_frac_interval[0] > 0.0 && fall_frac > LEAST_FALL_FRAC,
        lost: fall_frac_interval[1] < 0.0 && fall_frac < -LEAST_FALL_FRAC && everywhere,
        blamed: Vec::new(),
    })
}

fn add(a: Window, b: &Window) -> Window {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// Part of the root mean square error that is gone.
fn fall(w: Window) -> f64 {
    if w[0] > 0.0 { 1.0 - (w[1] / w[0]).sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn windows(seed: u64, fall: f64) -> Vec<Vec<Window>> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut u = || f64::from(rng.next_u32()) / f64::from(u32::MAX);
        (0..2)
            .map(|_| {
                (0..25)
                    .map(|_| {
                        let b = 50.0 + 100.0 * u();
                        [b, b * (1.0 - fall) * (0.5 + u()), 100.0]
                    })
                    .collect()
            })
            .collect()
    }

    #[test]
    fn a_clear_fall_is_claimed_and_its_interval_holds_it() {
        let g = interval("q", "t", 0.0, &windows(1, 0.75), 1).unwrap();
        assert!(g.claimed && (g.fall_frac - 0.5).abs() < 0.1, "{g:?}");
        assert!(g.fall_frac_interval[0] < g.fall_frac && g.fall_frac < g.fall_frac_interval[1]);
        assert_eq!(interval("q", "t", 0.0, &windows(1, 0.75), 1).unwrap(), g);
    }

    #[test]
    fn a_clear_loss_on_every_drive_is_one_and_a_loss_on_one_of_two_is_none() {
        let g = interval("q", "t", 0.0, &windows(1, -0.5), 1).unwrap();
        assert!(g.lost && !g.claimed, "{g:?}");
        let mixed = [windows(1, -0.9)[0].clone(), windows(1, 0.1)[1].clone()];
        assert!(!interval("q", "t", 0.0, &mixed, 1).unwrap().lost);
        assert!(!interval("q", "t", 0.0, &windows(1, 0.75), 1).unwrap().lost);
    }

    #[test]
    fn no_fall_is_rarely_claimed() {
        let claimed = (0..200)
            .filter(|s| interval("q", "t", 0.0, &windows(*s, 0.0), *s).unwrap().claimed)
            .count();
        assert!(claimed <= 20, "{claimed} of 200, 5 % are expected");
    }

    #[test]
    fn nothing_measured_gives_no_figure() {
        assert_eq!(interval("q", "t", 0.0, &[Vec::new()], 1), None);
    }
}
