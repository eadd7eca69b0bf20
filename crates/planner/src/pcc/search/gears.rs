//! Predictive gear choice: the shortest path over gears along a given speed profile.
//!
//! Per interval and gear the cost is fuel plus the price of traction that the gear cannot give
//! (or the worth of traction that it gives beyond the need, where the profile is power-limited).
//! `κ` is the worth of traction in an interval, g per m/s²: the multiplier of the dynamics in the
//! quadratic programme, which makes the choice the minimisation of the Hamiltonian over gears
//! (Pontryagin), with a shift cost on top. The open driveline is one more gear: it burns idle fuel,
//! and what it needs beyond rolling, or has left, is priced with `κ` too. Viterbi over `n` intervals
//! × gears.
//!
//! Left out: the shift's duration; it is charged as fuel.

use alloc::vec::Vec;

use crate::pcc::model::{Course, Drive, Truck, demand_m_s2};

/// What the gear choice is told beyond the profile.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GearChoice<'a> {
    /// Fuel charged per shift, g.
    pub shift_fuel_g: f64,
    /// Worth of traction per interval, g per m/s², and whether the profile is power-limited there.
    pub worth: Option<(&'a [f64], &'a [bool])>,
    /// Gear at the start, for a truck that is already driving.
    pub start: Option<Drive>,
    /// Bit set of gears that may be chosen, per interval; see [`gear_bit`].
    pub allowed: Option<&'a [u64]>,
    /// Intervals in which the driveline may be open (empty: in none); needs `worth`.
    pub may_roll: &'a [bool],
}

impl GearChoice<'_> {
    /// Gears that follow a profile as well as they can, with the least fuel.
    #[must_use]
    pub(crate) fn follow(shift_fuel_g: f64) -> Self {
        Self { shift_fuel_g, worth: None, start: None, allowed: None, may_roll: &[] }
    }
}

/// The bit of a gear, or of the open driveline, in a set.
#[must_use]
pub(crate) fn gear_bit(drive: Drive) -> u64 {
    match drive {
        Drive::Gear(g) => 1 << (g & 31),
        Drive::Neutral => 1 << 32,
    }
}

/// Worth of missing traction relative to its fuel, where the profile's own worth is not known.
const DEFICIT_FACTOR: f64 = 1.5;

/// Gears per interval for the energies `e` (one per node).
#[must_use]
pub(crate) fn choose_gears(
    truck: &Truck,
    course: &Course,
    e: &[f64],
    choice: &GearChoice<'_>,
) -> Vec<Drive> {
    let mut drives: Vec<Drive> = (0..truck.gears()).map(|g| Drive::Gear(g as u8)).collect();
    if choice.worth.is_some() && choice.may_roll.contains(&true) {
        drives.push(Drive::Neutral);
    }
    let (n, m) = (course.n(), drives.len());
    let mut total: Vec<f64> = drives
        .iter()
        .map(|drive| match choice.start {
            Some(start @ Drive::Gear(_)) if start != *drive => choice.shift_fuel_g,
            _ => 0.0,
        })
        .collect();
    let mut from = alloc::vec![0u8; n * m];
    let mut next = alloc::vec![f64::INFINITY; m];
    for k in 0..n {
        let at = Interval { truck, course, k, e0: e[k], e1: e[k + 1], choice };
        let best = argmin(&total);
        let fallback =
            if drives.iter().any(|d| at.may(*d)) { m } else { truck.strongest_gear(at.v_m_s()) };
        for (i, &drive) in drives.iter().enumerate() {
            if !at.may(drive) && i != fallback {
                next[i] = f64::INFINITY;
                continue;
            }
            let (base, came) = if total[i] <= total[best] + choice.shift_fuel_g {
                (total[i], i)
            } else {
                (total[best] + choice.shift_fuel_g, best)
            };
            next[i] = base + at.cost_g(drive);
            from[k * m + i] = came as u8;
        }
        core::mem::swap(&mut total, &mut next);
    }
    let mut gears = alloc::vec![Drive::Neutral; n];
    let mut i = argmin(&total);
    for k in (0..n).rev() {
        gears[k] = drives[i];
        i = from[k * m + i] as usize;
    }
    gears
}

/// One interval of the profile.
struct Interval<'a> {
    truck: &'a Truck,
    course: &'a Course,
    k: usize,
    e0: f64,
    e1: f64,
    choice: &'a GearChoice<'a>,
}

impl Interval<'_> {
    fn v_m_s(&self) -> f64 {
        libm::sqrt(self.e0 + self.e1)
    }

    /// Whether a gear drives here and may be chosen.
    fn may(&self, drive: Drive) -> bool {
        let may = match drive {
            Drive::Gear(g) => self.truck.usable(g as usize, self.v_m_s()),
            Drive::Neutral => self.choice.may_roll.get(self.k).copied().unwrap_or(false),
        };
        may && self.choice.allowed.is_none_or(|a| a[self.k] & gear_bit(drive) != 0)
    }

    /// Fuel and the price of what the gear lacks, g.
    fn cost_g(&self, drive: Drive) -> f64 {
        let need = demand_m_s2(self.truck, self.course, self.k, drive, self.e0, self.e1);
        let (v, h) = (self.v_m_s(), self.course.h_m);
        let g = match drive {
            Drive::Gear(g) => g as usize,
            Drive::Neutral => {
                let worth = self.choice.worth.map_or(0.0, |(worth, _)| worth[self.k]);
                return h / v * self.truck.idle_fuel_g_s() + worth * need;
            }
        };
        let at = self.truck.at(g, v);
        let most = at.traction_m_s2();
        let fuel = |p: f64| h / v * at.fuel_charged_g_s(p);
        let p = need.clamp(0.0, most);
        let at_need = fuel(p);
        let missing = (need - most).max(0.0);
        let own = (fuel(most) - fuel(0.0)) / most.max(1e-9);
        match self.choice.worth {
            Some((worth, limited)) if limited[self.k] => {
                let kappa = worth[self.k].max(own);
                let full = fuel(most) + kappa * (need - most);
                if missing > 0.0 { full } else { full.min(at_need) }
            }
            Some((worth, _)) => at_need + worth[self.k].max(DEFICIT_FACTOR * own) * missing,
            None => at_need + DEFICIT_FACTOR * own * missing,
        }
    }
}

fn argmin(values: &[f64]) -> usize {
    let mut best = 0;
    for (i, v) in values.iter().enumerate() {
        if *v < values[best] {
            best = i;
        }
    }
    best
}
