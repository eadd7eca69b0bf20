//! Conventional cruise control on rails: the baselines that a plan is compared with, and the
//! speed that the truck can hold when it does nothing clever.
//!
//! The driver's set speed is held as far as full power allows; on descents the truck is let run up
//! to `brake_cap` and braked there. Limits and curves are approached in time, as by the planner.

use alloc::vec::Vec;

use super::course::Course;
use super::drive::{Driven, E_FLOOR, coast_energy, demand_m_s2, drive_leg, drive_profile};
use super::truck::{Drive, Truck};
use crate::pcc::error::PccError;
use crate::pcc::search::{GearChoice, choose_gears};

/// Energies of a cruise-controlled trip from `start_e`, J/kg per node: `hold` is driven where power
/// allows, `brake_cap` is never exceeded (both J/kg per node, `hold <= brake_cap`).
///
/// # Errors
/// [`PccError::TooSteep`] where full traction stalls the truck.
pub(crate) fn cruise_energies(
    truck: &Truck,
    course: &Course,
    start_e: f64,
    hold: &[f64],
    brake_cap: &[f64],
) -> Result<Vec<f64>, PccError> {
    let mut e = Vec::with_capacity(course.n() + 1);
    let mut now = start_e.min(brake_cap[0]).max(E_FLOOR);
    e.push(now);
    for k in 0..course.n() {
        let v = libm::sqrt(2.0 * now);
        let high = highest_gear(truck, v);
        let mut target = hold[k + 1].min(brake_cap[k + 1]);
        if demand_m_s2(truck, course, k, high, now, target) < 0.0 {
            // Fuel cut-off alone carries the truck above the target: roll, and brake at the cap.
            target = coast_energy(truck, course, k, high, now).max(target).min(brake_cap[k + 1]);
        }
        let mut leg = drive_leg(truck, course, k, high, now, target);
        if leg.end_e_j_kg < target * (1.0 - 1e-9) {
            // Full load in the highest gear is not enough: the best of all gears.
            for g in 0..truck.gears() {
                if truck.usable(g, v) || g == truck.strongest_gear(v) {
                    let other = drive_leg(truck, course, k, Drive::Gear(g as u8), now, target);
                    if other.end_e_j_kg > leg.end_e_j_kg {
                        leg = other;
                    }
                }
            }
        }
        if leg.end_e_j_kg <= 2.0 * E_FLOOR && leg.end_e_j_kg < target {
            return Err(PccError::TooSteep {
                s_m: course.s_m(k),
                grade_rad: libm::asin(course.road[k].sin_grade),
                mass_kg: truck.mass_kg,
            });
        }
        now = leg.end_e_j_kg;
        e.push(now);
    }
    Ok(e)
}

/// A cruise-controlled trip with fuel-optimal gears along it, by the same gear choice as a plan.
///
/// # Errors
/// As [`cruise_energies`].
pub(crate) fn cruise_trip(
    truck: &Truck,
    course: &Course,
    start_e: f64,
    hold: &[f64],
    brake_cap: &[f64],
    shift_fuel_g: f64,
) -> Result<Driven, PccError> {
    let targets = cruise_energies(truck, course, start_e, hold, brake_cap)?;
    let gears = choose_gears(truck, course, &targets, &GearChoice::follow(shift_fuel_g));
    Ok(drive_profile(truck, course, &targets, &gears, &[], shift_fuel_g))
}

/// Highest gear (smallest ratio) that drives at this speed.
fn highest_gear(truck: &Truck, v: f64) -> Drive {
    let g = (0..truck.gears())
        .filter(|&g| truck.usable(g, v))
        .max_by(|&a, &b| truck.speed_range_m_s(a).1.total_cmp(&truck.speed_range_m_s(b).1))
        .unwrap_or_else(|| truck.strongest_gear(v));
    Drive::Gear(g as u8)
}
