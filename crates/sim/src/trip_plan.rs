//! The fuel-optimal speed profile of a whole trip, from names of a truck and a road: what
//! `sim-server plan` and `tractrix.plan` report.

use dynamics::{TruckModel, TruckParameters};
use planner::pcc::model::profile_of;
use planner::pcc::solve::DefaultSolver;
use planner::pcc::trip::Trip;
use planner::pcc::{SpeedBand, TripRequest, TripResult, TripRow, TripTotals, Tuning};
use road::Road;
use serde::Serialize;
use tractrix_core::{Provenance, VehicleLimits};

use crate::SimError;

/// Spacing of the road's profile, m.
const PROFILE_STEP_M: f64 = 10.0;

/// Which trip is planned.
#[derive(Debug, Clone, PartialEq)]
pub struct TripPlan {
    /// A truck file, or a built-in name.
    pub truck: String,
    /// An `.xodr` or `.csv` file, or a built-in road.
    pub road: String,
    /// Total mass, kg.
    pub mass_kg: f64,
    /// Set speed, m/s: at both ends, and of the cruise controls.
    pub set_speed_m_s: f64,
    /// Lowest speed, m/s.
    pub speed_min_m_s: f64,
    /// Highest speed, m/s.
    pub speed_max_m_s: f64,
    /// Longest duration, s; that of the set-speed cruise control without one.
    pub trip_time_s: Option<f64>,
    /// Lets coasting phases open the driveline.
    pub eco_roll: bool,
}

/// A planned trip.
#[derive(Debug)]
pub struct PlannedTrip {
    /// The plan with its baselines.
    pub result: TripResult,
    /// The baseline with 5 km/h overspeed, one row per node.
    pub overspeed_rows: Vec<TripRow>,
    /// `plan.json`.
    pub report: TripReport,
}

/// `plan.json`.
#[derive(Debug, Serialize)]
pub struct TripReport {
    #[serde(flatten)]
    provenance: Provenance,
    truck: String,
    road: String,
    mass_kg: f64,
    /// Totals of the plan.
    #[serde(flatten)]
    pub plan: Totals,
    baseline_set_speed: Totals,
    baseline_overspeed_5_km_h: Totals,
    /// What it saves.
    pub saving_frac: Saving,
    /// How it was found.
    pub solver: Solver,
}

/// Totals of a driven trip.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Totals {
    /// Fuel, g, shifts included.
    pub fuel_g: f64,
    /// Duration, s.
    pub trip_time_s: f64,
    brake_energy_j: f64,
    shifts: usize,
}

/// Fuel saved at the baseline's trip time, fraction.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Saving {
    /// Against cruise control at the set speed.
    pub vs_set_speed: f64,
    /// Against cruise control that brakes 5 km/h above the set speed.
    pub vs_overspeed: f64,
}

/// How a plan was found.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Solver {
    /// Outcome in a word.
    pub status: &'static str,
    iterations: u32,
    sqp_iterations: u32,
    /// Time of the plan that is reported, ms: road sampled, baselines driven (their trip time is the
    /// plan's), solved.
    pub solve_time_ms: f64,
    /// The same with the second plan, that of the other baseline's trip time.
    total_time_ms: f64,
    max_violation: f64,
}

/// Columns of a plan, in the order of [`numbers`].
pub const COLUMNS: [&str; 8] =
    ["s_m", "v_m_s", "time_s", "gear", "drive_force_n", "brake_force_n", "fuel_g", "grade_rad"];

/// A row of a plan in the order of [`COLUMNS`].
#[must_use]
pub fn numbers(r: &TripRow) -> [f64; COLUMNS.len()] {
    let gear = f64::from(r.gear);
    [r.s_m, r.v_m_s, r.time_s, gear, r.drive_force_n, r.brake_force_n, r.fuel_g, r.grade_rad]
}

impl TripPlan {
    /// Plans the trip; `elapsed_ms` is a clock of the shell.
    ///
    /// # Errors
    /// [`SimError`] for a truck, road or number that cannot be used: it names it.
    pub fn plan(
        &self,
        provenance: Provenance,
        elapsed_ms: &dyn Fn() -> f64,
    ) -> Result<PlannedTrip, SimError> {
        let positive = [
            ("mass_kg", Some(self.mass_kg)),
            ("set_speed_m_s", Some(self.set_speed_m_s)),
            ("speed_min_m_s", Some(self.speed_min_m_s)),
            ("speed_max_m_s", Some(self.speed_max_m_s)),
            ("trip_time_s", self.trip_time_s),
        ];
        for (option, value) in positive {
            if value.is_some_and(|x| !(x.is_finite() && x > 0.0)) {
                let value = format!("{}", value.unwrap_or_default());
                let why = "a positive number is wanted".to_owned();
                return Err(SimError::Override { option, value, why });
            }
        }
        let limits = self.truck_at_mass()?;
        let road = Road::load(&self.road)?;
        let profile = profile_of(&road, PROFILE_STEP_M);
        let start_ms = elapsed_ms();
        let trip = Trip::new(&TripRequest {
            profile: &profile,
            truck: &limits,
            band: SpeedBand {
                set_m_s: self.set_speed_m_s,
                min_m_s: self.speed_min_m_s,
                max_m_s: self.speed_max_m_s,
            },
            trip_time_s: self.trip_time_s,
            eco_roll: self.eco_roll,
            tuning: Tuning::default(),
        })?;
        let mut default = DefaultSolver::default();
        let mut solver =
            |sub: &_, end, time, fence: Option<&[f64]>| default.solve(sub, end, time, fence);
        let plan = trip.plan(self.trip_time_s, &mut solver);
        let solve_time_ms = elapsed_ms() - start_ms;
        let result = trip.compared(plan, &mut solver);
        let total_time_ms = elapsed_ms() - start_ms;
        let report = self.report(provenance, &result, solve_time_ms, total_time_ms);
        Ok(PlannedTrip { overspeed_rows: trip.rows(&trip.overspeed), result, report })
    }

    /// What the truck says about itself when it weighs this much in all.
    fn truck_at_mass(&self) -> Result<VehicleLimits, SimError> {
        let parameters = TruckParameters::load(&self.truck)?;
        let empty = TruckModel::new(parameters.clone(), 0.0)?;
        let payload_kg = self.mass_kg - empty.mass_kg();
        if payload_kg < 0.0 {
            return Err(SimError::Override {
                option: "mass_kg",
                value: format!("{}", self.mass_kg),
                why: format!("{} weighs {:.0} kg without payload", self.truck, empty.mass_kg()),
            });
        }
        Ok(TruckModel::new(parameters, payload_kg)?.vehicle_limits()?)
    }

    fn report(
        &self,
        provenance: Provenance,
        result: &TripResult,
        solve_time_ms: f64,
        total_time_ms: f64,
    ) -> TripReport {
        TripReport {
            provenance,
            truck: self.truck.clone(),
            road: self.road.clone(),
            mass_kg: self.mass_kg,
            plan: result.plan.into(),
            baseline_set_speed: result.baseline_set_speed.into(),
            baseline_overspeed_5_km_h: result.baseline_overspeed_5_km_h.into(),
            saving_frac: Saving {
                vs_set_speed: result.saving_vs_set_speed_frac,
                vs_overspeed: result.saving_vs_overspeed_frac,
            },
            solver: Solver {
                status: result.status.word(),
                iterations: result.solver.iterations,
                sqp_iterations: result.solver.sqp_iterations,
                solve_time_ms,
                total_time_ms,
                max_violation: result.solver.max_violation,
            },
        }
    }
}

impl From<TripTotals> for Totals {
    fn from(t: TripTotals) -> Self {
        Self {
            fuel_g: t.fuel_g,
            trip_time_s: t.trip_time_s,
            brake_energy_j: t.brake_energy_j,
            shifts: t.shifts,
        }
    }
}
