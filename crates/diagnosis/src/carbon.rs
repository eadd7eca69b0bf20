//! Two instruments of the same fuel: the engine control unit's rate and the carbon in the exhaust.
//!
//! Burnt diesel leaves [`CO2_PER_FUEL`] g of CO2 per g whatever the engine does, so the ratio of
//! the two says that one instrument is wrong but not which. The energy that the wheels needed on
//! climbs ([`crate::balance`]) is the arbiter: over the fuel of either instrument it gives the
//! engine's specific consumption, which physics bounds below and engines of a kind narrow.
//! Left out: carbon in CO, hydrocarbons and soot (below half a per cent), change of the fuel.

use core::ops::Range;

use dynamics::effects::fuel::CO2_PER_FUEL;

use crate::balance::{Body, EnergyWindow};

/// What is known of [`CO2_PER_FUEL`]: a carbon fraction of 0.865 +- 0.005.
pub const CO2_PER_FUEL_SIGMA: f64 = 0.018;
/// Length of a window of the ratio, s: longer than the transport in the exhaust sampling.
const WINDOW_S: f64 = 15.0;
/// Shortest climb, s, and its least gain of altitude, m.
const CLIMB: (f64, f64) = (60.0, 20.0);
/// Neighbouring windows that belong together, for the intervals: five minutes.
const BLOCK: usize = 20;

/// A record with both instruments on a uniform grid.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FuelRecord {
    /// Grid step, s.
    pub step_s: f64,
    /// Speed, m/s.
    pub speed_m_s: Vec<f64>,
    /// Engine speed, rpm.
    pub engine_rpm: Vec<f64>,
    /// Altitude, m.
    pub altitude_m: Vec<f64>,
    /// Fuel by the engine control unit, g/s.
    pub fuel_g_s: Vec<f64>,
    /// CO2 in the exhaust, g/s.
    pub co2_g_s: Vec<f64>,
    /// Number of the uninterrupted stretch that the sample belongs to.
    pub segment: Vec<f64>,
}

/// Ratio of CO2 to fuel in a range of load.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoadBin {
    /// Fuel rate over full load's, from and to.
    pub load_frac: (f64, f64),
    /// Windows in it.
    pub windows: usize,
    /// Mean fuel rate, g/s.
    pub fuel_g_s: f64,
    /// CO2 over fuel.
    pub ratio: f64,
    /// Standard deviation of the ratio, by jackknife over blocks.
    pub sigma: f64,
}

/// A climb under load.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Climb {
    /// First sample.
    pub from: usize,
    /// Duration, s.
    pub duration_s: f64,
    /// Gain of altitude, m.
    pub climb_m: f64,
    /// Energy that the wheels needed, J.
    pub wheel_energy_j: f64,
    /// Fuel by the engine control unit, g.
    pub fuel_g: f64,
    /// Fuel by the carbon in the exhaust, g.
    pub carbon_fuel_g: f64,
}

/// What is known of the truck, as standard deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Doubt {
    /// Mass, relative.
    pub mass_frac: f64,
    /// Drag area, relative.
    pub drag_frac: f64,
    /// Rolling resistance, relative.
    pub rolling_frac: f64,
    /// Head wind of a climb, m/s.
    pub headwind_m_s: f64,
    /// Altitude gained in a climb, m.
    pub altitude_m: f64,
    /// Driveline efficiency, relative.
    pub driveline_frac: f64,
}

/// Specific consumption by the two instruments over all climbs, g/kWh at the crank.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Consumption {
    /// By the engine control unit.
    pub fuel_g_kwh: f64,
    /// By the carbon in the exhaust.
    pub carbon_g_kwh: f64,
    /// Standard deviation that both share (mass, resistances, driveline), relative.
    pub shared_sigma_frac: f64,
    /// Standard deviation from the scatter of the climbs, relative.
    pub scatter_sigma_frac: f64,
}

impl FuelRecord {
    /// Fuel rate that three per cent of the samples exceed, g/s: full load.
    #[must_use]
    pub fn full_load_g_s(&self) -> f64 {
        let mut f = self.fuel_g_s.clone();
        if f.is_empty() {
            return 0.0;
        }
        let k = (0.97 * (f.len() - 1) as f64) as usize;
        *f.select_nth_unstable_by(k, f64::total_cmp).1
    }

    fn whole(&self, r: &Range<usize>) -> bool {
        r.end <= self.segment.len() && self.segment[r.start] == self.segment[r.end - 1]
    }

    /// Ratio of CO2 to fuel over load, in bins between these fractions of full load.
    #[must_use]
    pub fn ratio_by_load(&self, edges: &[f64]) -> Vec<LoadBin> {
        let n = (WINDOW_S / self.step_s) as usize;
        let full = self.full_load_g_s().max(1e-9);
        let windows: Vec<(f64, f64)> = (0..self.fuel_g_s.len() / n.max(1))
            .map(|k| k * n..(k + 1) * n)
            .filter(|r| self.whole(r))
            .map(|r| {
                let mean = |v: &[f64]| v[r.clone()].iter().sum::<f64>() / n as f64;
                (mean(&self.fuel_g_s), mean(&self.co2_g_s))
            })
            .collect();
        edges
            .windows(2)
            .filter_map(|edge| {
                let (low, high) = (edge[0], edge[1]);
                let blocks: Vec<(f64, f64, usize)> = windows
                    .chunks(BLOCK)
                    .map(|block| {
                        block
                            .iter()
                            .filter(|w| (low..high).contains(&(w.0 / full)))
                            .fold((0.0, 0.0, 0), |s, w| (s.0 + w.0, s.1 + w.1, s.2 + 1))
                    })
                    .filter(|b| b.2 > 0)
                    .collect();
                let sum =
                    blocks.iter().fold((0.0, 0.0, 0), |s, b| (s.0 + b.0, s.1 + b.1, s.2 + b.2));
                let m = blocks.len() as f64;
                if m < 3.0 || sum.0 <= 0.0 {
                    return None;
                }
                let ratio = sum.1 / sum.0;
                let spread: f64 =
                    blocks.iter().map(|b| ((sum.1 - b.1) / (sum.0 - b.0) - ratio).powi(2)).sum();
                Some(LoadBin {
                    load_frac: (low, high),
                    windows: sum.2,
                    fuel_g_s: sum.0 / sum.2 as f64,
                    ratio,
                    sigma: (spread * (m - 1.0) / m).sqrt(),
                })
            })
            .collect()
    }

    /// Climbs at more than half of full load, and the energy that each needed.
    #[must_use]
    pub fn climbs(&self, body: &Body) -> Vec<Climb> {
        let n = (WINDOW_S / self.step_s) as usize;
        let full = self.full_load_g_s();
        let len = self.fuel_g_s.len();
        // A shift interrupts the fuel for seconds: the mean over a window counts.
        let loaded = |i: usize| {
            let r = i.saturating_sub(n / 2)..(i + n / 2 + 1).min(len);
            let mean = self.fuel_g_s[r.clone()].iter().sum::<f64>() / r.len() as f64;
            mean > 0.5 * full && self.speed_m_s[i] > 3.0
        };
        let mut found = Vec::new();
        let mut from = 0;
        for i in 0..len {
            let goes_on = i + 1 < len && loaded(i) && self.segment[i + 1] == self.segment[from];
            if goes_on {
                continue;
            }
            if i > from {
                found.extend(self.climb(from..i, body));
            }
            from = i + 1;
        }
        found
    }

    fn climb(&self, r: Range<usize>, body: &Body) -> Option<Climb> {
        let climb_m = self.altitude_m[r.end - 1] - self.altitude_m[r.start];
        let window = self.window(&r);
        if window.duration_s() < CLIMB.0 || climb_m < CLIMB.1 {
            return None;
        }
        let total = |v: &[f64]| {
            v[r.clone()].windows(2).map(|w| 0.5 * (w[0] + w[1]) * self.step_s).sum::<f64>()
        };
        Some(Climb {
            from: r.start,
            duration_s: window.duration_s(),
            climb_m,
            wheel_energy_j: window.wheel_energy_j(body, 0.0),
            fuel_g: total(&self.fuel_g_s),
            carbon_fuel_g: total(&self.co2_g_s) / CO2_PER_FUEL,
        })
    }

    fn window(&self, r: &Range<usize>) -> EnergyWindow {
        EnergyWindow {
            start_s: r.start as f64 * self.step_s,
            step_s: self.step_s,
            speed_m_s: self.speed_m_s[r.clone()].to_vec(),
            climb_m: self.altitude_m[r.end - 1] - self.altitude_m[r.start],
            engine_rpm: (self.engine_rpm[r.start], self.engine_rpm[r.end - 1]),
        }
    }

    /// Specific consumption over all climbs; `None` with fewer than three.
    ///
    /// `own_power_w` is what the engine needs for itself, `efficiency_frac` the driveline's.
    #[must_use]
    pub fn consumption(
        &self,
        climbs: &[Climb],
        body: &Body,
        doubt: &Doubt,
        efficiency_frac: f64,
        own_power_w: f64,
    ) -> Option<Consumption> {
        if climbs.len() < 3 {
            return None;
        }
        let ranges: Vec<Range<usize>> = climbs
            .iter()
            .map(|c| c.from..c.from + (c.duration_s / self.step_s).round() as usize + 1)
            .collect();
        let energy = |body: &Body, headwind: f64| -> f64 {
            ranges.iter().map(|r| self.window(r).wheel_energy_j(body, headwind)).sum()
        };
        let crank = |wheel: f64, duration: f64| wheel / efficiency_frac + own_power_w * duration;
        let duration: f64 = climbs.iter().map(|c| c.duration_s).sum();
        let kwh = crank(energy(body, 0.0), duration) / 3.6e6;
        let moved = |change: &dyn Fn(&mut Body), headwind: f64| {
            let mut b = body.clone();
            change(&mut b);
            crank(energy(&b, headwind), duration) / 3.6e6 / kwh - 1.0
        };
        let n = climbs.len() as f64;
        let lifted = n.sqrt() * doubt.altitude_m * body.mass_kg * tractrix_core::GRAVITY_M_S2;
        let shared = [
            moved(&|b| b.mass_kg *= 1.0 + doubt.mass_frac, 0.0),
            moved(&|b| b.resistance.drag_area_m2 *= 1.0 + doubt.drag_frac, 0.0),
            moved(&|b| b.resistance.rolling_coeff *= 1.0 + doubt.rolling_frac, 0.0),
            moved(&|_| {}, doubt.headwind_m_s) / n.sqrt(),
            lifted / efficiency_frac / 3.6e6 / kwh,
            doubt.driveline_frac,
        ];
        let sums = climbs.iter().fold((0.0, 0.0), |s, c| (s.0 + c.fuel_g, s.1 + c.carbon_fuel_g));
        // Jackknife over climbs of the fuel over the energy.
        let total = crank(climbs.iter().map(|c| c.wheel_energy_j).sum(), duration);
        let spread: f64 = climbs
            .iter()
            .map(|c| {
                let left = total - crank(c.wheel_energy_j, c.duration_s);
                ((sums.0 - c.fuel_g) / left / (sums.0 / total) - 1.0).powi(2)
            })
            .sum();
        Some(Consumption {
            fuel_g_kwh: sums.0 / kwh,
            carbon_g_kwh: sums.1 / kwh,
            shared_sigma_frac: shared.iter().map(|s| s * s).sum::<f64>().sqrt(),
            scatter_sigma_frac: (spread * (n - 1.0) / n).sqrt(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynamics::TruckParameters;

    /// A truck that climbs and rests by turns, with a control unit that reads high with load.
    fn record(body: &Body, high: f64) -> FuelRecord {
        let mut r = FuelRecord { step_s: 1.0, ..FuelRecord::default() };
        let mut altitude = 100.0;
        for i in 0..6000 {
            let (climbs, wave) = (i % 600 < 300, (0.05 * f64::from(i)).sin());
            let v = 15.0 + 2.0 * wave;
            let accel = 2.0 * 0.05 * (0.05 * f64::from(i)).cos();
            let grade = if climbs { 0.03 } else { -0.004 };
            altitude += grade * v;
            let m = body.mass_kg;
            let force = body.resistance_n(v, 0.0)
                + m * 9.806_65 * grade
                + (m + body.rotating_mass_kg) * accel;
            let power = (force * v / 0.94).max(0.0) + 5000.0;
            let fuel = power / 3.6e6 * 200.0 + 0.3;
            r.speed_m_s.push(v);
            r.engine_rpm.push(1400.0);
            r.altitude_m.push(altitude);
            r.fuel_g_s.push(fuel * (1.0 + high * fuel / 15.0));
            r.co2_g_s.push(fuel * CO2_PER_FUEL);
            r.segment.push(0.0);
        }
        r
    }

    const DOUBT: Doubt = Doubt {
        mass_frac: 0.02,
        drag_frac: 0.15,
        rolling_frac: 0.2,
        headwind_m_s: 2.0,
        altitude_m: 1.0,
        driveline_frac: 0.02,
    };

    fn body() -> Body {
        let mut b = Body::of(&TruckParameters::load("reference").unwrap(), 1.15);
        b.mass_kg = 28_000.0;
        b
    }

    #[test]
    fn instruments_that_agree_show_the_ratio_of_chemistry_at_every_load() {
        for bin in record(&body(), 0.0).ratio_by_load(&[0.0, 0.1, 0.5, 1.2]) {
            assert!((bin.ratio - CO2_PER_FUEL).abs() < 1e-9, "{bin:?}");
        }
    }

    #[test]
    fn a_control_unit_that_reads_high_with_load_shows_in_the_ratio_and_in_the_consumption() {
        let (body, record) = (body(), record(&body(), 0.2));
        let bins = record.ratio_by_load(&[0.0, 0.1, 0.5, 1.2]);
        let (first, last) = (bins[0], bins[bins.len() - 1]);
        assert!(first.ratio - last.ratio > 6.0 * first.sigma.hypot(last.sigma), "{bins:?}");
        let climbs = record.climbs(&body);
        assert!(climbs.len() >= 8 && climbs.iter().all(|c| c.climb_m > 50.0), "{climbs:?}");
        let c = record.consumption(&climbs, &body, &DOUBT, 0.94, 5000.0).unwrap();
        // 200 g/kWh and the constant 0.3 g/s.
        assert!((205.0..212.0).contains(&c.carbon_g_kwh), "{c:?}");
        assert!(c.fuel_g_kwh > 1.1 * c.carbon_g_kwh && c.shared_sigma_frac > 0.02);
    }

    #[test]
    fn an_empty_record_says_nothing() {
        let r = FuelRecord { step_s: 1.0, ..FuelRecord::default() };
        assert!(r.ratio_by_load(&[0.0, 1.0]).is_empty() && r.climbs(&body()).is_empty());
        assert!(r.consumption(&[], &body(), &DOUBT, 0.94, 0.0).is_none());
    }
}
