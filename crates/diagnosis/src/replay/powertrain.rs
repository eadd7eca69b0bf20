//! Engine torque from pedal and engine speed, shift durations, fuel from torque and speed.

use std::sync::Arc;

use dynamics::effects::engine::left_frac;
use dynamics::effects::instruments::scale_at_rate;
use dynamics::effects::shift::ShiftPhase;
use tractrix_core::{RPM_PER_RAD_S, ZERO_DEGC_K};

use super::Module as M;
use super::prepared::{Prepared, at_index};
use super::profiles::Kind;
use super::rise::Rise;
use super::smooth::{JUMP_FRAC, beside, calm_at};
use crate::causes::param::{P, Theta};
use crate::{Drive, Plant};

/// Torque response, percent of the reference torque, mean over two samples.
pub(super) fn torque(d: &Prepared, plant: &Plant, t: &Theta) -> Vec<f64> {
    let valid = &d.valid[M::Torque as usize];
    let (engine, file) = (&plant.control, &plant.truck.engine);
    let slow_s = (file.slow_lag_s + t[P::TurboLag as usize]).max(0.02);
    let about = (file.lag_threshold_frac + t[P::TurboStart as usize]).max(0.0);
    let half = 0.5 * (file.lag_width_frac + t[P::TurboWidth as usize]);
    let rise = Rise::new([file.fast_lag_s, slow_s], [about - half, about + half]);
    let percent = 100.0 / file.reference_torque_nm * (1.0 + t[P::TorqueReport as usize]);
    let pedal = late_pedal(d, file.pedal_delay_s, t);
    let derating = Derating::new(d, plant, t);
    let mut out = vec![0.0; valid.len()];
    let mut torque = 0.0;
    let mut running = false;
    for (k, ok) in valid.iter().enumerate() {
        if !ok {
            running = false;
            continue;
        }
        for i in 2 * k..2 * k + 2 {
            if !running {
                // The measurement is where it starts: what follows is the response.
                torque = d.torque[i] / percent;
                running = true;
                continue;
            }
            let n = d.turning[i];
            let full = d.full_load[i] * derating.left(d, i);
            let demand = engine.governed_nm(engine.pedal_demand_nm(pedal[i], n, full), n, full);
            torque = rise.sample(torque, demand, full);
            out[k] += 0.5 * (d.torque[i] - torque.max(0.0) * percent);
        }
    }
    out
}

/// Pedal after its delay: later, or followed slowly, by the part of the fitted delay that is a lag.
fn late_pedal(d: &Prepared, file_s: f64, t: &Theta) -> Arc<[f64]> {
    let extra_s = t[P::PedalDelay as usize];
    let lag_s = (t[P::PedalLag as usize] * extra_s).max(0.0);
    let dead = (file_s + extra_s - lag_s) / Drive::STEP_S;
    d.profiles.get(Kind::Pedal, [dead, lag_s], || {
        let late = |i: usize, before: f64| at_index(&d.pedal, i as f64 - before - dead);
        if lag_s == 0.0 {
            return (0..d.n).map(|i| late(i, 0.0)).collect();
        }
        // What a lag follows over a sample is the mean over it.
        followed((0..d.n).map(|i| late(i, 0.5)), late(0, 0.0), lag_s)
    })
}

/// What altitude, air and coolant temperature take from the full load: loss per unit, and where it
/// begins (m, degC), or by how much it is exceeded (K).
struct Derating {
    thin: (f64, f64),
    hot: (f64, f64),
    boiling: Option<(f64, Arc<[f64]>)>,
}

impl Derating {
    fn new(d: &Prepared, plant: &Plant, t: &Theta) -> Self {
        let (file, at) = (&plant.truck.engine, |p: P| t[p as usize]);
        let air_degc = file.derate_air_k - ZERO_DEGC_K;
        let loss_1_k = file.derate_coolant_1_k + 0.1 * at(P::HeatCoolant);
        Self {
            thin: (
                file.derate_altitude_1_m + 1e-3 * at(P::Altitude),
                file.derate_altitude_m + at(P::AltitudeStart),
            ),
            hot: (file.derate_air_1_k + 0.1 * at(P::HeatAir), air_degc + at(P::HeatAirStart)),
            boiling: (loss_1_k != 0.0).then(|| {
                let from_degc = file.derate_coolant_k - ZERO_DEGC_K + at(P::HeatCoolantStart);
                let lag_s = file.derate_coolant_lag_s + at(P::HeatCoolantLag);
                (loss_1_k, overheat(d, from_degc, lag_s))
            }),
        }
    }

    /// Part of the full load that is left at a sample.
    #[inline]
    fn left(&self, d: &Prepared, i: usize) -> f64 {
        if [self.thin.0, self.hot.0] == [0.0; 2] && self.boiling.is_none() {
            return 1.0;
        }
        let left = |(loss, from): (f64, f64), x: f64| left_frac(loss, x, from);
        let air = left(self.thin, d.altitude[i]) * left(self.hot, d.ambient[i]);
        let coolant =
            self.boiling.as_ref().map_or(1.0, |(loss, over)| left_frac(*loss, over[i], 0.0));
        (air * coolant).clamp(0.2, 1.5)
    }
}

/// How far the coolant is above where the engine protects itself, K, as its controller follows it.
fn overheat(d: &Prepared, from_degc: f64, lag_s: f64) -> Arc<[f64]> {
    d.profiles.get(Kind::Overheat, [from_degc, lag_s], || followed_k(&d.coolant, from_degc, lag_s))
}

/// A temperature above a threshold, K, followed with a lag up and down: protection that jumped would
/// be felt as a jerk.
fn followed_k(degc: &[f64], from_degc: f64, lag_s: f64) -> Vec<f64> {
    followed(degc.iter().map(|degc| (degc - from_degc).max(0.0)), 0.0, lag_s)
}

/// A signal that is followed with a lag from a value on.
fn followed(signal: impl Iterator<Item = f64>, from: f64, lag_s: f64) -> Vec<f64> {
    let keep = if lag_s > 0.0 { (-Drive::STEP_S / lag_s).exp() } else { 0.0 };
    let mut now = from;
    signal
        .map(|x| {
            now = x + (now - x) * keep;
            now
        })
        .collect()
}

/// Measured minus expected duration of every shift, s.
pub(super) fn shift(d: &Prepared, plant: &Plant, t: &Theta) -> Vec<f64> {
    let phases = [ShiftPhase::RampDown, ShiftPhase::Open, ShiftPhase::RampUp];
    let file: f64 = phases.iter().map(|p| plant.truck.shift.phase_length_s(*p)).sum();
    let expected = file + t[P::ShiftTime as usize];
    d.shifts.iter().map(|s| s.1 as f64 * Drive::STEP_S - expected).collect()
}

/// Load below which extra consumption begins, before the fitted factor.
pub(crate) const LOW_LOAD_FRAC: f64 = 0.3;
/// Engine speed at which a load is a power, rpm: where highway trucks cruise.
pub(crate) const CRUISE_RPM: f64 = 1_250.0;

/// Fuel rate, over its noise scale (a constant part and one percent of the rate).
pub(super) fn fuel(d: &Prepared, plant: &Plant, t: &Theta) -> Vec<f64> {
    let valid = &d.valid[M::Fuel as usize];
    let lag = t[P::FuelLag as usize] / Drive::STEP_S;
    let torque = |i: usize| {
        let percent = calm_at(&d.torque, i as f64 - lag);
        // Rows without fuel are masked: what is injected elsewhere burns along the map's line, even
        // where the message says no torque.
        (percent * 0.01 * plant.truck.engine.reference_torque_nm).max(1e-9)
    };
    let omega = |i: usize| calm_at(&d.rpm, i as f64 - lag) / RPM_PER_RAD_S;
    let rate = d.profiles.get(Kind::Willans, [lag], || {
        (0..d.n).map(|i| plant.engine.fuel_rate_g_s(omega(i), torque(i))).collect()
    });
    // What is low: torque over the full load at this speed, power, or torque, these two over full
    // load at cruise.
    let over = t[P::FuelLowOver as usize];
    let cruise = CRUISE_RPM / RPM_PER_RAD_S;
    let load = d.profiles.get(Kind::Load, [lag, over], || {
        let full_nm = |omega: f64| plant.engine.full_load_nm.at(omega).max(1.0);
        let of = |i: usize| match over {
            1.0 => torque(i) / full_nm(cruise) * omega(i) / cruise,
            2.0 => torque(i) / full_nm(cruise),
            _ => torque(i) / full_nm(omega(i)),
        };
        (0..d.n).map(of).collect()
    });
    let (scale, low) = (1.0 + t[P::FuelScale as usize], t[P::FuelLow as usize]);
    let (meter, power) = (t[P::FuelFlow as usize], t[P::FuelFlowPower as usize]);
    let most_g_s = plant.engine.most_fuel_g_s;
    let per_load = 1.0 / (LOW_LOAD_FRAC * t[P::FuelLowLoad as usize].exp());
    // The map is read where the torque message is, with its noise; what is off is a factor on what the
    // rows beside say, where they can.
    let row_means = |x: &[f64]| -> Vec<f64> {
        x.chunks_exact(4).map(|row| row.iter().sum::<f64>() * 0.25).collect()
    };
    let (rates, loads) = (row_means(&rate), row_means(&load));
    let burnt_g_s =
        |rate: f64, load: f64| rate * scale * (1.0 + low * (1.0 - load * per_load).max(0.0));
    let reported = |burnt: f64| burnt * scale_at_rate(meter, power, burnt / most_g_s);
    valid
        .iter()
        .enumerate()
        .map(|(k, ok)| {
            if !ok {
                return 0.0;
            }
            let samples = 4 * k..4 * k + 4;
            let measured = d.fuel[samples.clone()].iter().sum::<f64>() * 0.25;
            let told = beside(&rates, k, JUMP_FRAC * most_g_s).zip(beside(&loads, k, JUMP_FRAC));
            let modelled = match told {
                Some((rate, load)) => rates[k] + reported(burnt_g_s(rate, load)) - rate,
                None => reported(samples.map(|i| 0.25 * burnt_g_s(rate[i], load[i])).sum()),
            };
            (measured - modelled) / d.row_unit(M::Fuel, k)
        })
        .collect()
}

/// How far a held message of the fuel rate is from its time, s: it comes every 100 ms (J1939 PGN
/// 65266), and what is spread evenly over that has this standard deviation.
const HELD_S: f64 = 0.029;

/// Noise of the fuel rate per row, g/s: a constant part, one percent of the rate, and what it changes
/// while its message is held.
pub(super) fn noise_g_s(fuel_g_s: &[f64]) -> Vec<f64> {
    let step = M::Fuel.row_step();
    let rows: Vec<f64> =
        fuel_g_s.chunks(step).map(|r| r.iter().sum::<f64>() / r.len() as f64).collect();
    let last = rows.len().saturating_sub(1);
    let of = |k: usize| {
        let (from, to) = (k.saturating_sub(1), (k + 1).min(last));
        let per_s = (rows[to] - rows[from]) / ((to - from).max(1) * step) as f64 / Drive::STEP_S;
        (0.03 + 0.01 * rows[k]).hypot(HELD_S * per_s)
    };
    (0..rows.len()).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_derating_follows_the_coolant_with_its_lag_and_at_once_without_one() {
        let step: Vec<f64> = (0..2_000).map(|i| if i < 1_000 { 103.0 } else { 90.0 }).collect();
        let (lagged, at_once) = (followed_k(&step, 98.0, 20.0), followed_k(&step, 98.0, 0.0));
        for i in [0, 10, 400, 999] {
            let t_s = (i + 1) as f64 * Drive::STEP_S;
            assert!((lagged[i] - 5.0 * (1.0 - (-t_s / 20.0).exp())).abs() < 1e-9);
            assert_eq!(at_once[i], 5.0);
        }
        let left = (-1_000.0 * Drive::STEP_S / 20.0).exp();
        assert!((lagged[1_999] - lagged[999] * left).abs() < 1e-9 && at_once[1_999] == 0.0);
    }

    /// A ramp comes later by the whole delay, whatever part of it is a lag; a step says which part.
    #[test]
    fn a_delay_of_the_pedal_is_a_dead_time_a_lag_or_both() {
        let n = 400;
        let truck = dynamics::TruckParameters::load("reference").unwrap();
        let plant = Plant::of_truck(&truck).unwrap();
        let late = |pedal: &dyn Fn(f64) -> f64, lag_frac: f64| {
            let mut drive = Drive::new("pedal", 0.0, n);
            let times = (0..n).map(|i| i as f64 * Drive::STEP_S);
            drive.set(crate::Channel::AcceleratorPedalFrac, times.map(pedal).collect());
            drive.set(crate::Channel::SpeedMS, vec![20.0; n]);
            let mut theta = [0.0; crate::causes::param::PARAMS];
            theta[P::PedalDelay as usize] = 0.3;
            theta[P::PedalLag as usize] = lag_frac;
            late_pedal(&Prepared::new(&drive, &plant), 0.1, &theta)
        };
        for lag_frac in [0.0, 0.5, 1.0] {
            let ramp = late(&|t| 0.04 * t, lag_frac);
            assert!((ramp[300] - 0.04 * (15.0 - 0.4)).abs() < 1e-4, "{lag_frac}: {}", ramp[300]);
            let step = late(&|t| if t < 5.0 { 0.0 } else { 0.8 }, lag_frac);
            let lag_s = 0.3 * lag_frac;
            let over = (9.0 - 5.0 - 0.4 + lag_s).max(0.0);
            let rest = if lag_s > 0.0 { (-over / lag_s).exp() } else { 0.0 };
            assert!((step[180] - 0.8 * (1.0 - rest)).abs() < 0.01);
            let soon = step[112];
            // 0.6 s after the step, 0.2 s after a dead time alone would have passed.
            let expected = if lag_s > 0.0 { 1.0 - (-(0.2 + lag_s) / lag_s).exp() } else { 1.0 };
            assert!((soon / 0.8 - expected).abs() < 0.06, "{lag_frac}: {soon}");
        }
    }
}
