//! Predictive gear choice: the shortest path over gears along a given speed profile.
//!
//! Per interval and gear the cost is fuel plus the price of traction that the gear cannot give
//! (or the worth of traction that it gives beyond the need, where the profile is power-limited).
//! `κ` is the worth of traction in an interval, g per m/s²: the multiplier of the dynamics in the
//! quadratic programme, which makes the choice the minimisation of the Hamiltonian over gears
//! (Pontryagin), with a shift cost on top. Viterbi over `n` intervals × gears.
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
    /// Bit set of gears that may be chosen, per interval.
    pub allowed: Option<&'a [u32]>,
}

impl GearChoice<'_> {
    /// Gears that follow a profile as well as they can, with the least fuel.
    #[must_use]
    pub(crate) fn follow(shift_fuel_g: f64) -> Self {
        Self { shift_fuel_g, worth: None, start: None, allowed: None }
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
    let (n, m) = (course.n(), truck.gears());
    let mut total: Vec<f64> = (0..m)
        .map(|g| match choice.start {
            Some(Drive::Gear(s)) if s as usize != g => choice.shift_fuel_g,
            _ => 0.0,
        })
        .collect();
    let mut from = alloc::vec![0u8; n * m];
    let mut next = alloc::vec![f64::INFINITY; m];
    for k in 0..n {
        let v = libm::sqrt(e[k] + e[k + 1]);
        let best = argmin(&total);
        let may = |g: usize| {
            truck.usable(g, v) && choice.allowed.is_none_or(|a| a[k] & (1 << (g & 31)) != 0)
        };
        let fallback = if (0..m).any(may) { m } else { truck.strongest_gear(v) };
        for g in 0..m {
            if !may(g) && g != fallback {
                next[g] = f64::INFINITY;
                continue;
            }
            let (base, came) = if total[g] <= total[best] + choice.shift_fuel_g {
                (total[g], g)
            } else {
                (total[best] + choice.shift_fuel_g, best)
            };
            next[g] = base + interval_cost(truck, course, k, g, e[k], e[k + 1], v, choice);
            from[k * m + g] = came as u8;
        }
        core::mem::swap(&mut total, &mut next);
    }
    let mut gears = alloc::vec![Drive::Gear(0); n];
    let mut g = argmin(&total);
    for k in (0..n).rev() {
        gears[k] = Drive::Gear(g as u8);
        g = from[k * m + g] as usize;
    }
    gears
}

fn interval_cost(
    truck: &Truck,
    course: &Course,
    k: usize,
    g: usize,
    e0: f64,
    e1: f64,
    v: f64,
    choice: &GearChoice<'_>,
) -> f64 {
    let drive = Drive::Gear(g as u8);
    let need = demand_m_s2(truck, course, k, drive, e0, e1);
    let at = truck.at(g, v);
    let most = at.traction_m_s2();
    let fuel = |p: f64| course.h_m / v * at.fuel_charged_g_s(p);
    let p = need.clamp(0.0, most);
    let at_need = fuel(p);
    let missing = (need - most).max(0.0);
    let own = (fuel(most) - fuel(0.0)) / most.max(1e-9);
    match choice.worth {
        Some((worth, limited)) if limited[k] => {
            let kappa = worth[k].max(own);
            let full = fuel(most) + kappa * (need - most);
            if missing > 0.0 { full } else { full.min(at_need) }
        }
        Some((worth, _)) => at_need + worth[k].max(DEFICIT_FACTOR * own) * missing,
        None => at_need + DEFICIT_FACTOR * own * missing,
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
