//! What one plan of the receding horizon is made from: truck model, course, bounds, candidates.

use alloc::vec::Vec;

use tractrix_core::VehicleLimits;

use super::fence::{Fence, LeadAhead};
use super::planner::{HorizonConfig, HorizonFailure, HorizonPlan, HorizonRequest};
use crate::pcc::error::PccError;
use crate::pcc::model::{
    Course, Drive, Driven, MIN_SPEED_M_S, Truck, Tuning, cruise_energies, drive_profile,
};
use crate::pcc::search::{EngineTables, GearChoice, choose_gears};
use crate::pcc::solve::{CutModel, Problem, Profile, Terminal, TimeRule, eco_roll};

/// Worth of a joule at the horizon's end relative to its fuel: missing, spare.
const END_WORTH: (f64, f64) = (1.15, 0.85);
/// Shortest stretch of road that is planned, m.
const SHORTEST_M: f64 = 150.0;
/// Fineness of the gear search relative to that of a whole trip.
const SEARCH_FINENESS: f64 = 0.6;

/// Truck model and engine tables, kept while the truck is the same.
#[derive(Debug, Clone)]
pub(super) struct Known {
    limits: VehicleLimits,
    top_e: f64,
    /// The model.
    pub(super) truck: Truck,
    tables: EngineTables,
}

impl Known {
    fn top_e(request: &HorizonRequest<'_>, config: &HorizonConfig) -> f64 {
        let top = request.set_speed_m_s.max(request.speed_m_s) + config.above_m_s + 1.0;
        0.5 * top * top
    }

    /// Whether truck and speeds are those of these tables.
    pub(super) fn fits(&self, request: &HorizonRequest<'_>, config: &HorizonConfig) -> bool {
        Self::top_e(request, config) <= 1.05 * self.top_e && self.limits == *request.limits
    }

    /// Model and tables of a request.
    pub(super) fn new(
        request: &HorizonRequest<'_>,
        config: &HorizonConfig,
    ) -> Result<Self, PccError> {
        let truck = Truck::new(request.limits)?;
        let top_e = Self::top_e(request, config);
        let tables = EngineTables::new(&truck, 1.05 * top_e);
        Ok(Self { limits: request.limits.clone(), top_e, truck, tables })
    }

    /// Price of time at the set speed on the flat, g/s: marginal fuel × drag slope × v³.
    pub(super) fn beta_guess(&self, set_m_s: f64) -> f64 {
        self.truck.marginal_fuel_g_j_kg(set_m_s) * self.truck.drag_1_m * set_m_s * set_m_s * set_m_s
    }
}

/// A candidate: what the iteration ended with, and what driving it gives.
pub(super) struct Candidate {
    /// The iteration's end.
    pub(super) profile: Profile,
    /// The profile driven.
    pub(super) driven: Driven,
    /// Fuel, price of time and worth of the end energy, g.
    pub(super) cost_g: f64,
}

/// Course and bounds of one plan.
pub(super) struct Setting {
    /// The road.
    pub(super) course: Course,
    /// Highest energies of cruise control at the set speed, J/kg per node.
    pub(super) hold: Vec<f64>,
    /// What the soft end is.
    pub(super) terminal: Terminal,
    /// Energy at node 0, J/kg.
    pub(super) start_e: f64,
    cruise: Vec<f64>,
    e_min: Vec<f64>,
    e_max: Vec<f64>,
}

impl Setting {
    /// The setting of a request.
    pub(super) fn new(
        known: &Known,
        request: &HorizonRequest<'_>,
        config: &HorizonConfig,
        tuning: &Tuning,
    ) -> Result<Self, HorizonFailure> {
        let points = request.profile;
        let length_m = match (points.first(), points.last()) {
            (Some(a), Some(b)) => b.s_m - a.s_m,
            _ => 0.0,
        };
        if length_m.is_nan() || length_m < SHORTEST_M {
            return Err(HorizonFailure::RoadEnds { length_m });
        }
        let truck = &known.truck;
        let course = Course::new(points, request.limits, tuning)?;
        let top = truck.top_speed_m_s() * 0.999;
        let approach = tuning.approach_decel_m_s2;
        let cap = |v: f64| course.ceiling(truck, v.clamp(MIN_SPEED_M_S, top), approach);
        let set = request.set_speed_m_s;
        let hold = cap(set)?;
        let mut e_max = cap(set + config.above_m_s)?;
        let start_e = 0.5 * request.speed_m_s * request.speed_m_s;
        // A truck that is too fast slows down as lower limits are approached.
        let mut e = start_e;
        for (k, ceiling) in e_max.iter_mut().enumerate() {
            if e <= *ceiling {
                break;
            }
            *ceiling = e;
            let i = k.min(course.n() - 1);
            let held = course.brake_m_s2 + truck.resistance_m_s2(e, &course.road[i]);
            e -= 0.8 * (0.9 * held).min(approach).max(0.01) * course.h_m;
        }
        let cruise = cruise_energies(truck, &course, start_e, &hold, &e_max)?;
        let low = (set - config.below_m_s).max(MIN_SPEED_M_S);
        let e_min = cruise
            .iter()
            .map(|&e| {
                let v = (libm::sqrt(2.0 * e) - tuning.relax_m_s).max(0.8 * MIN_SPEED_M_S);
                (0.5 * low * low).min(0.5 * v * v)
            })
            .collect();
        let worth = known.truck.marginal_fuel_g_j_kg(set);
        let terminal = Terminal::Soft {
            reference: cruise[course.n()].min(hold[course.n()]),
            pay: END_WORTH.0 * worth,
            credit: END_WORTH.1 * worth,
        };
        Ok(Self { course, hold, terminal, start_e, cruise, e_min, e_max })
    }

    /// Cruise control at the set speed from the truck's speed on, J/kg per node.
    pub(super) fn cruise(&self) -> &[f64] {
        &self.cruise
    }

    /// Intervals in which the driveline may be open.
    pub(super) fn may_roll(&self, known: &Known) -> Vec<bool> {
        eco_roll::may_roll(&known.truck, &self.course, &self.e_max, &self.cruise)
    }

    /// Makes room for the profile behind a fence; without a library solver, which alone knows
    /// elapsed times, that profile is the ceiling.
    pub(super) fn stay_behind(&mut self, fence: &Fence, lead: &LeadAhead) {
        let slow = 0.45 * lead.speed_m_s * lead.speed_m_s;
        for (low, e) in self.e_min.iter_mut().zip(&fence.follow_e_j_kg) {
            *low = low.min(e * 0.98).min(slow);
        }
        #[cfg(not(feature = "solver"))]
        for (high, e) in self.e_max.iter_mut().zip(&fence.follow_e_j_kg) {
            *high = high.min(e * 1.005);
        }
    }

    /// The planning problem with a soft end.
    pub(super) fn problem<'a>(
        &'a self,
        known: &'a Known,
        tuning: &'a Tuning,
        time: TimeRule,
    ) -> Problem<'a> {
        Problem {
            truck: &known.truck,
            course: &self.course,
            tuning,
            e_min: self.e_min.clone(),
            e_max: self.e_max.clone(),
            start_e: self.start_e,
            terminal: self.terminal,
            time,
            fence_s: None,
            start_gear: None,
            cut: CutModel::Charged,
            forced_cut: Vec::new(),
            may_roll: Vec::new(),
        }
    }

    /// First profile and gears from the joint search, to the energy of cruise control at the end.
    pub(super) fn searched(
        &self,
        known: &Known,
        problem: &Problem<'_>,
        beta_g_s: f64,
    ) -> (Vec<f64>, Vec<Drive>) {
        let end = self.cruise[self.course.n()].min(self.e_max[self.course.n()]);
        let fixed = Problem { terminal: Terminal::Fixed(end), ..problem.clone() };
        let course = &self.course;
        let otherwise = alloc::vec![Drive::Neutral; course.n()];
        let (e, gears) = fixed.first_profile(
            &known.tables,
            beta_g_s,
            SEARCH_FINENESS,
            (&self.cruise, &otherwise),
        );
        if gears != otherwise {
            return (e, gears);
        }
        // No path in the grid: along cruise control.
        let gears = self.gears_along(known, problem, &self.cruise);
        (self.cruise.clone(), gears)
    }

    /// Gears that follow energies (per node) with the least fuel.
    pub(super) fn gears_along(
        &self,
        known: &Known,
        problem: &Problem<'_>,
        e_j_kg: &[f64],
    ) -> Vec<Drive> {
        let follow = GearChoice {
            start: problem.start_gear,
            ..GearChoice::follow(problem.tuning.shift_fuel_g)
        };
        choose_gears(&known.truck, &self.course, e_j_kg, &follow)
    }

    /// Energies and gears of the last plan at the nodes of this one; beyond its end as at its end.
    /// `None` if the plans do not overlap.
    pub(super) fn moved_on(&self, plan: &HorizonPlan) -> Option<(Vec<f64>, Vec<Drive>)> {
        let n = self.course.n();
        plan.at(self.course.s_m(0))?;
        let driven = &plan.driven;
        let mut e: Vec<f64> = (0..=n)
            .map(|k| {
                let end = driven.e_j_kg[driven.e_j_kg.len() - 1];
                let at = plan.at(self.course.s_m(k));
                let planned = at.map_or(end, |p| 0.5 * p.speed_m_s * p.speed_m_s);
                planned.min(self.e_max[k]).max(self.e_min[k])
            })
            .collect();
        e[0] = self.start_e;
        let last = *driven.drive.last()?;
        let gears = (0..n)
            .map(|k| {
                let at = plan.at(self.course.s_m(k) + 0.5 * self.course.h_m);
                at.map_or(last, |p| p.drive)
            })
            .collect();
        Some((e, gears))
    }

    /// Drives a profile and prices it.
    pub(super) fn driven(
        &self,
        problem: &Problem<'_>,
        profile: Profile,
        beta_g_s: f64,
    ) -> Candidate {
        let shift = problem.tuning.shift_fuel_g;
        let (truck, course) = (problem.truck, problem.course);
        let driven =
            drive_profile(truck, course, &profile.e_j_kg, &profile.gears, &profile.cut, shift);
        let first = match (problem.start_gear, driven.drive.first()) {
            (Some(a), Some(b)) if a != *b => shift,
            _ => 0.0,
        };
        let end = match self.terminal {
            Terminal::Soft { reference, pay, credit } => {
                let missing = reference - driven.e_j_kg[course.n()];
                if missing > 0.0 { pay * missing } else { credit * missing }
            }
            Terminal::Fixed(_) => 0.0,
        };
        let cost_g = driven.total_fuel_g() + first + beta_g_s * driven.trip_time_s() + end;
        Candidate { profile, driven, cost_g }
    }
}
