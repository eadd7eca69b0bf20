//! Hat functions of a signal over the rows of a module, for the [course](crate::problem::course) of causes.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use super::{Hat, Problem};
use crate::replay::Module;
use crate::replay::signal::{SIGNALS, means};

/// Part of the rows below the first and above the last knot, of those where the signal is not at rest:
/// brakes act in one row of twenty.
const TAIL: f64 = 0.02;

/// A signal over the rows of a module.
#[derive(Debug)]
struct Places {
    /// Values at the first and the last knot.
    ends: [f64; 2],
    /// Places of rows between these, 0 to 1, per drive.
    rows: Vec<Vec<f64>>,
}

/// What has been asked for, by module and signal.
#[derive(Debug, Default)]
pub(super) struct Hats(Mutex<HashMap<(Module, usize), Arc<Places>>>);

impl Problem<'_> {
    /// Rows of a module times a hat function.
    pub(super) fn under_hat(&self, i: usize, module: Module, hat: Hat, rows: &[f64]) -> Vec<f64> {
        let places = self.places(module, hat.signal);
        let [knot, last] = [hat.knot, hat.last].map(|x| x as f64);
        let weight = |x: &f64| (1.0 - (x * last - knot).abs()).max(0.0);
        rows.iter().zip(&places.rows[i]).map(|(r, x)| r * weight(x)).collect()
    }

    /// Values of a signal at the first and the last knot of its hats over a module.
    pub(crate) fn ends(&self, module: Module, signal: usize) -> [f64; 2] {
        self.places(module, signal).ends
    }

    fn places(&self, module: Module, signal: usize) -> Arc<Places> {
        let key = (module, signal);
        if let Some(known) = self.hats.0.lock().ok().and_then(|h| h.get(&key).cloned()) {
            return known;
        }
        let read = SIGNALS.get(signal);
        let of = |d| read.map_or_else(Vec::new, |s| means(d, s, module));
        let values: Vec<Vec<f64>> = self.drives.iter().map(of).collect();
        let drives = self.drives.iter().zip(&values);
        let mut valid: Vec<f64> = drives
            .flat_map(|(d, x)| x.iter().zip(&d.valid[module as usize]))
            .filter(|(x, ok)| **ok && x.is_finite() && **x != 0.0)
            .map(|(x, _)| *x)
            .collect();
        valid.sort_by(f64::total_cmp);
        let at = |part: f64| valid.get((part * valid.len() as f64) as usize).copied();
        let (lo, hi) = (at(TAIL).unwrap_or(0.0), at(1.0 - TAIL).unwrap_or(0.0));
        let width = (hi - lo).max(1e-9);
        let place = |x: &f64| {
            let x = (x - lo) / width;
            if x.is_finite() { x.clamp(0.0, 1.0) } else { 0.0 }
        };
        let rows = values.iter().map(|x| x.iter().map(place).collect()).collect();
        let places = Arc::new(Places { ends: [lo, lo + width], rows });
        if let Ok(mut known) = self.hats.0.lock() {
            known.insert(key, places.clone());
        }
        places
    }
}

#[cfg(test)]
mod tests {
    use dynamics::TruckParameters;

    use super::*;
    use crate::replay::Prepared;
    use crate::replay::signal::signal;
    use crate::replay::tests::recorded;
    use crate::{Channel, Plant, Serial};

    /// The knots stood where rows are, and brakes act in few: half of all braking lay beyond the last one,
    /// so that a brake that is weaker at high pressure was patched by a retarder.
    #[test]
    fn knots_lie_where_a_signal_is_not_at_rest() {
        let truck = TruckParameters::load("reference").unwrap();
        let plant = Plant::of_truck(&truck).unwrap();
        let mut drive = recorded(&truck, 16_000.0);
        let count = drive.get(Channel::SpeedMS).unwrap().len();
        let braked = |i: usize| {
            if (i / 60).is_multiple_of(12) { 20.0 + (i / 720 % 6) as f64 * 20.0 } else { 0.0 }
        };
        drive.set(Channel::BrakePressureKpa, (0..count).map(braked).collect());
        let drives = vec![Prepared::new(&drive, &plant)];
        let problem = Problem::learn(&plant, drives, false, &Serial).unwrap();
        let pressure = signal("brake_pressure_kpa").unwrap();
        let [low, high] = problem.ends(Module::Force, pressure);
        let d = &problem.drives[0];
        let rows = means(d, &SIGNALS[pressure], Module::Force).into_iter();
        let valid = rows.zip(&d.valid[Module::Force as usize]).filter(|(_, ok)| **ok);
        let (resting, acting): (Vec<f64>, Vec<f64>) = valid.map(|x| x.0).partition(|x| *x == 0.0);
        let beyond = acting.iter().filter(|x| **x > high).count();
        assert!(low > 0.0 && resting.len() > acting.len(), "{low}: else the test tells nothing");
        assert!(beyond * 20 < acting.len(), "{beyond} of {} beyond {high} kPa", acting.len());
    }
}
