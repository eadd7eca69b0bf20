//! CO2 in the exhaust against the fuel rate: burnt diesel leaves
//! [`CO2_PER_FUEL`] of it whatever the engine does, so that the
//! two instruments check each other.
//!
//! Rows are means over fifteen seconds, longer than the way through exhaust and sampling tunnel. Left
//! out: carbon in CO, hydrocarbons and soot (below half a per cent).

use dynamics::effects::fuel::CO2_PER_FUEL;
use dynamics::effects::instruments::scale_at_rate;

use super::Module as M;
use super::prepared::Prepared;
use crate::Plant;
use crate::causes::param::{P, Theta};

/// Samples of a row.
pub(super) const WINDOW: usize = 300;
/// How much later than the fuel rate the CO2 may be measured, samples: two seconds for exhaust, tunnel
/// and analyser, which a laboratory's time alignment leaves.
pub(super) const TRANSPORT: usize = 40;
/// Noise of a row's mean: a constant part, g/s, and a part of the rate.
const NOISE: (f64, f64) = (0.1, 0.01);
/// Newton steps from a reported fuel rate to the true one, which its error follows.
const STEPS: usize = 5;

/// Measured CO2 rate minus that of the fuel, over its noise scale.
pub(super) fn residual(d: &Prepared, plant: &Plant, t: &Theta) -> Vec<f64> {
    let at = |p: P| t[p as usize];
    let most_g_s = plant.engine.most_fuel_g_s;
    d.valid[M::Co2 as usize]
        .iter()
        .enumerate()
        .map(|(k, ok)| {
            if !ok {
                return 0.0;
            }
            let rows = k * WINDOW..(k + 1) * WINDOW;
            let mean = |x: &[f64]| x[rows.clone()].iter().sum::<f64>() / WINDOW as f64;
            let (reported_g_s, measured_g_s) = (mean(&d.fuel), mean(&d.co2));
            let fuel_g_s = most_g_s
                * true_rate(reported_g_s / most_g_s, at(P::FuelFlow), at(P::FuelFlowPower));
            let scale = scale_at_rate(at(P::Co2Scale), at(P::Co2Power), fuel_g_s / most_g_s);
            (measured_g_s - CO2_PER_FUEL * fuel_g_s * scale) / d.co2_noise_g_s[k]
        })
        .collect()
}

/// The rate of which a meter makes this one, both over the highest.
fn true_rate(reported: f64, error_frac: f64, exponent: f64) -> f64 {
    let mut rate = reported;
    for _ in 0..STEPS {
        let scale = scale_at_rate(error_frac, exponent, rate);
        let slope = scale + exponent * (scale - 1.0);
        // a meter that says less the more there is says nothing
        rate = (rate - (rate * scale - reported) / slope.max(0.2)).max(0.0);
    }
    rate
}

/// Noise of the CO2 rate per row, g/s: what the instrument has, and what its delay makes of a fuel
/// rate that was another before the row than before its end.
pub(super) fn noise_g_s(co2_g_s: &[f64], fuel_g_s: &[f64]) -> Vec<f64> {
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len().max(1) as f64;
    let before = |end: usize| {
        let end = end.min(fuel_g_s.len());
        fuel_g_s.get(end.saturating_sub(TRANSPORT)..end).map_or(0.0, mean)
    };
    let of = |(k, co2): (usize, &[f64])| {
        let change_g_s = before((k + 1) * WINDOW) - before(k * WINDOW);
        let late = CO2_PER_FUEL * change_g_s * TRANSPORT as f64 / WINDOW as f64;
        (NOISE.0 + NOISE.1 * mean(co2).max(0.0)).hypot(late)
    };
    co2_g_s.chunks(WINDOW).enumerate().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Channel as C;
    use crate::Drive;
    use crate::causes::param::PARAMS;
    use dynamics::TruckParameters;

    /// Half an hour of a fuel rate that wanders, reported by a meter that reads high with load and
    /// measured by carbon a second later.
    fn drive(plant: &Plant, error_frac: f64) -> Prepared {
        let (n, most) = (1_800 * 20, plant.engine.most_fuel_g_s);
        let rate = |i: usize| {
            let turns = i as f64 * Drive::STEP_S / 400.0;
            most * (0.5 + 0.45 * libm::sin(core::f64::consts::TAU * turns))
        };
        let mut d = Drive::new("d", 0.0, n);
        let reported = |r: f64| r * (1.0 + error_frac * r / most);
        d.set(C::SpeedMS, vec![20.0; n]);
        d.set(C::FuelRateGS, (0..n).map(|i| reported(rate(i))).collect());
        let late = |i: usize| CO2_PER_FUEL * rate(i.saturating_sub(20));
        d.set(C::Co2RateGS, (0..n).map(late).collect());
        Prepared::new(&d, plant)
    }

    #[test]
    fn the_true_rate_is_what_the_meter_makes_of_it() {
        for (error, exponent) in [(0.3, 0.0), (0.3, 1.5), (-0.3, 1.0), (0.02, -1.0), (-0.01, -1.0)]
        {
            for rate in [0.05, 0.3, 1.0] {
                let reported = rate * scale_at_rate(error, exponent, rate);
                let found = true_rate(reported, error, exponent);
                assert!((found / rate - 1.0).abs() < 1e-3, "{error} {exponent} {rate}: {found}");
            }
        }
    }

    #[test]
    fn a_meter_that_reads_high_with_load_is_the_whole_difference_and_carbon_is_right() {
        let plant = Plant::of_truck(&TruckParameters::load("reference").unwrap()).unwrap();
        let d = drive(&plant, 0.12);
        let worst = |t: &Theta| {
            let rows = residual(&d, &plant, t);
            assert!(rows.len() > 100 && d.available[M::Co2 as usize]);
            rows.iter().fold(0.0, |worst: f64, x| worst.max(x.abs()))
        };
        let mut t = [0.0; PARAMS];
        assert!(worst(&t) > 5.0);
        (t[P::FuelFlow as usize], t[P::FuelFlowPower as usize]) = (0.12, 1.0);
        assert!(worst(&t) < 1.0, "{}", worst(&t));
    }
}
