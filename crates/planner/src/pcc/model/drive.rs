//! The truth: driving a speed profile through the nonlinear truck, interval by interval.
//!
//! Inside an interval the specific energy is linear in `s` (constant acceleration), so its duration
//! is exactly `2h/(v_k + v_{k+1})`. Engine and drag are taken at the mean energy `Ē`. Every figure
//! that a plan, a baseline or the dynamic-programming reference reports comes from here.

use alloc::vec::Vec;

use super::course::Course;
use super::truck::{Drive, Operating, Truck};

/// Smallest energy that is driven, J/kg (about 0.6 m/s).
pub(crate) const E_FLOOR: f64 = 0.18;

/// What one interval took.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Leg {
    /// Energy at the end, J/kg.
    pub end_e_j_kg: f64,
    /// Duration, s.
    pub time_s: f64,
    /// Specific indicated traction, m/s².
    pub p_m_s2: f64,
    /// Brake force per mass, m/s².
    pub brake_m_s2: f64,
    /// Fuel, g, without shifts.
    pub fuel_g: f64,
}

/// A driven profile: nodes `0..=n`, intervals `0..n`.
#[derive(Debug, Clone, Default)]
pub struct Driven {
    /// Specific energy per node, J/kg.
    pub e_j_kg: Vec<f64>,
    /// Elapsed time per node, s.
    pub time_s: Vec<f64>,
    /// Cumulative fuel per node, g, shifts included.
    pub fuel_g: Vec<f64>,
    /// Gear per interval.
    pub drive: Vec<Drive>,
    /// Specific indicated traction per interval, m/s².
    pub p_m_s2: Vec<f64>,
    /// Brake force per mass per interval, m/s².
    pub brake_m_s2: Vec<f64>,
}

impl Driven {
    /// Duration, s.
    #[must_use]
    pub fn trip_time_s(&self) -> f64 {
        self.time_s.last().copied().unwrap_or(0.0)
    }

    /// Fuel, g.
    #[must_use]
    pub fn total_fuel_g(&self) -> f64 {
        self.fuel_g.last().copied().unwrap_or(0.0)
    }

    /// Speed at node `k`, m/s.
    #[must_use]
    pub fn v_m_s(&self, k: usize) -> f64 {
        libm::sqrt(2.0 * self.e_j_kg[k])
    }

    /// Number of gear changes, eco-roll included.
    #[must_use]
    pub fn shifts(&self) -> usize {
        self.drive.windows(2).filter(|w| w[0] != w[1]).count()
    }

    /// Energy taken by the brakes, J.
    #[must_use]
    pub fn brake_energy_j(&self, mass_kg: f64, h_m: f64) -> f64 {
        self.brake_m_s2.iter().sum::<f64>() * mass_kg * h_m
    }
}

/// Duration of an interval with constant acceleration, s.
pub(crate) fn duration_s(h_m: f64, e0: f64, e1: f64) -> f64 {
    2.0 * h_m / (libm::sqrt(2.0 * e0) + libm::sqrt(2.0 * e1))
}

/// Traction (positive) or brake (negative) per mass that interval `k` needs, m/s², from `e0` to
/// `e1`: the indicated traction `p` is this where it is positive.
pub(crate) fn demand_m_s2(
    truck: &Truck,
    course: &Course,
    k: usize,
    drive: Drive,
    e0: f64,
    e1: f64,
) -> f64 {
    Demand::new(truck, course, k, drive, e0, e1).needed_m_s2
}

/// What an interval needs, and what the engine has at its mean energy.
pub(crate) struct Demand<'a> {
    /// As [`demand_m_s2`].
    pub(crate) needed_m_s2: f64,
    /// Full load's traction, m/s²; zero with the driveline open.
    pub(crate) limit_m_s2: f64,
    /// The engine; `None` with the driveline open.
    at: Option<Operating<'a>>,
}

impl<'a> Demand<'a> {
    fn new(truck: &'a Truck, course: &Course, k: usize, drive: Drive, e0: f64, e1: f64) -> Self {
        let mean = 0.5 * (e0 + e1);
        let at = match drive {
            Drive::Gear(g) => Some(truck.at(g as usize, libm::sqrt(2.0 * mean))),
            Drive::Neutral => None,
        };
        Self::with(truck, course, k, drive, at, (e0, e1))
    }

    /// The same with the engine read already, near the mean energy.
    pub(crate) fn with(
        truck: &Truck,
        course: &Course,
        k: usize,
        drive: Drive,
        at: Option<Operating<'a>>,
        (e0, e1): (f64, f64),
    ) -> Self {
        let needed_m_s2 = truck.inertia(drive) * (e1 - e0) / course.h_m
            + at.map_or(0.0, |at| at.overrun_m_s2())
            + truck.resistance_m_s2(0.5 * (e0 + e1), &course.road[k]);
        Self { needed_m_s2, limit_m_s2: at.map_or(0.0, |at| at.traction_m_s2()), at }
    }

    /// Need beyond full load, m/s²; negative where there is power to spare.
    fn excess_m_s2(&self) -> f64 {
        self.needed_m_s2 - self.limit_m_s2
    }
}

/// Excess of demand over full load that counts as none, m/s².
const POWER_ROUNDING: f64 = 1e-11;

/// The highest energy up to `target` that full load reaches: the root of demand minus full load,
/// which rises with `e1` almost linearly. False position with Illinois' safeguard.
fn full_load_energy(
    truck: &Truck,
    course: &Course,
    k: usize,
    drive: Drive,
    e0: f64,
    target: f64,
    excess_at_target: f64,
) -> f64 {
    let excess = |e1: f64| Demand::new(truck, course, k, drive, e0, e1).excess_m_s2();
    let (mut high, mut f_high) = (target, excess_at_target);
    // The inertia alone tells how far below the target the root lies, to first order.
    let slope = truck.inertia(drive) / course.h_m;
    let mut low = (target - 1.2 * excess_at_target / slope).max(E_FLOOR);
    let mut f_low = excess(low);
    if f_low > 0.0 {
        (high, f_high) = (low, f_low);
        low = E_FLOOR;
        f_low = excess(low);
        if f_low > 0.0 {
            return E_FLOOR;
        }
    }
    let mut kept_low = 0;
    for _ in 0..60 {
        if high - low <= 1e-13 * high {
            break;
        }
        let mut mid = high - f_high * (high - low) / (f_high - f_low);
        if !(mid > low && mid < high) {
            mid = 0.5 * (low + high);
        }
        let f = excess(mid);
        if f.abs() <= POWER_ROUNDING {
            return mid;
        }
        if f > 0.0 {
            (high, f_high) = (mid, f);
            kept_low = if kept_low > 0 { 2 } else { 1 };
            if kept_low == 2 {
                f_low *= 0.5;
            }
        } else {
            (low, f_low) = (mid, f);
            kept_low = if kept_low < 0 { -2 } else { -1 };
            if kept_low == -2 {
                f_high *= 0.5;
            }
        }
    }
    low
}

/// The least energy, from `e0` up, from which full load reaches `e1` in interval `k`.
pub(crate) fn needed_before(
    truck: &Truck,
    course: &Course,
    k: usize,
    drive: Drive,
    e0: f64,
    e1: f64,
) -> f64 {
    let excess = |e0: f64| Demand::new(truck, course, k, drive, e0, e1).excess_m_s2();
    let mut before = e0;
    // The inertia dominates: each step takes away most of what is missing.
    for _ in 0..8 {
        let missing = excess(before);
        if missing <= POWER_ROUNDING {
            break;
        }
        before += missing * course.h_m / truck.inertia(drive);
    }
    before
}

/// Drives interval `k` toward `target_e`, with no more than full load and the planned brakes.
pub(crate) fn drive_leg(
    truck: &Truck,
    course: &Course,
    k: usize,
    drive: Drive,
    e0: f64,
    target_e: f64,
) -> Leg {
    let mut e1 = target_e.max(E_FLOOR);
    let mut demand = Demand::new(truck, course, k, drive, e0, e1);
    let needed = demand.needed_m_s2;
    let reached = if needed > demand.limit_m_s2 {
        full_load_energy(truck, course, k, drive, e0, e1, demand.excess_m_s2())
    } else if needed < -course.brake_m_s2 {
        let rest = (-course.brake_m_s2 - needed) * course.h_m / truck.inertia(drive);
        (e1 + rest).max(e1)
    } else {
        e1
    };
    if reached != e1 {
        e1 = reached;
        demand = Demand::new(truck, course, k, drive, e0, e1);
    }
    let needed = demand.needed_m_s2;
    let time_s = duration_s(course.h_m, e0, e1);
    let p = needed.max(0.0).min(demand.limit_m_s2);
    // Rounding must not turn fuel cut-off into injection.
    let p = if p < 1e-7 { 0.0 } else { p };
    let brake = if needed < -1e-9 { -needed } else { 0.0 };
    let fuel_g_s = demand.at.map_or(truck.idle_fuel_g_s(), |at| at.fuel_g_s(p));
    let fuel_g = fuel_g_s * time_s;
    Leg { end_e_j_kg: e1, time_s, p_m_s2: p, brake_m_s2: brake, fuel_g }
}

/// Energy at the end of interval `k` without traction and brake, J/kg.
pub(crate) fn coast_energy(truck: &Truck, course: &Course, k: usize, drive: Drive, e0: f64) -> f64 {
    let mut e1 = e0;
    for _ in 0..20 {
        let demand = demand_m_s2(truck, course, k, drive, e0, e1);
        let step = -demand * course.h_m / truck.inertia(drive);
        e1 = (e1 + step).max(E_FLOOR);
        if step.abs() < 1e-12 * e1 {
            break;
        }
    }
    e1
}

/// Injection below this specific traction at a planned cut-off is the solver's rounding, m/s².
pub(crate) const CUT_ROUNDING: f64 = 4e-4;

/// Drives a whole profile of target energies (one per node) in the given gears. Where a target is
/// out of reach the truck does what it can and catches up later. `cut` marks intervals planned at
/// fuel cut-off (empty: none): there an interior-point solution's last trace of traction is left out.
#[must_use]
pub fn drive_profile(
    truck: &Truck,
    course: &Course,
    targets: &[f64],
    gears: &[Drive],
    cut: &[bool],
    shift_fuel_g: f64,
) -> Driven {
    let n = course.n();
    let mut d = Driven {
        e_j_kg: Vec::with_capacity(n + 1),
        time_s: Vec::with_capacity(n + 1),
        fuel_g: Vec::with_capacity(n + 1),
        drive: gears.to_vec(),
        p_m_s2: Vec::with_capacity(n),
        brake_m_s2: Vec::with_capacity(n),
    };
    let (mut e, mut time, mut fuel) = (targets[0].max(E_FLOOR), 0.0, 0.0);
    d.e_j_kg.push(e);
    d.time_s.push(0.0);
    d.fuel_g.push(0.0);
    for k in 0..n {
        let mut target = targets[k + 1];
        if cut.get(k).copied().unwrap_or(false) {
            let demand = demand_m_s2(truck, course, k, gears[k], e, target);
            if demand > 0.0 && demand < CUT_ROUNDING {
                target = coast_energy(truck, course, k, gears[k], e);
            }
        }
        let leg = drive_leg(truck, course, k, gears[k], e, target);
        if k > 0 && gears[k] != gears[k - 1] {
            fuel += shift_fuel_g;
        }
        e = leg.end_e_j_kg;
        time += leg.time_s;
        fuel += leg.fuel_g;
        d.e_j_kg.push(e);
        d.time_s.push(time);
        d.fuel_g.push(fuel);
        d.p_m_s2.push(leg.p_m_s2);
        d.brake_m_s2.push(leg.brake_m_s2);
    }
    d
}
