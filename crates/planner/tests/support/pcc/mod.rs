//! What tests, benches and examples of the speed planner share: trucks, roads, requests, the
//! dynamic-programming reference.
#![allow(dead_code, clippy::unwrap_used, clippy::expect_used)]

pub(crate) mod corpus;
#[path = "../data_sheet.rs"]
pub(crate) mod data_sheet;
pub(crate) mod dp;
mod engines;
pub(crate) mod replan;

pub(crate) use engines::Engine;
use planner::pcc::model::{Drive, Driven};
use planner::pcc::solve::{DefaultSolver, Solver};
use planner::pcc::{SpeedBand, Trip, TripRequest, Tuning};
use road::ProfilePoint;
use tractrix_core::VehicleLimits;

/// Speed bands of the corpus around 72 km/h, km/h.
pub(crate) const BANDS_KM_H: [(f64, f64); 3] = [(65.0, 79.0), (60.0, 85.0), (50.0, 90.0)];
/// Masses of the corpus, kg.
pub(crate) const MASSES_KG: [f64; 2] = [19_000.0, 55_000.0];

/// The data sheet's truck at a mass, with an engine.
pub(crate) fn truck(mass_kg: f64, engine: Engine) -> VehicleLimits {
    let mut limits = data_sheet::reference_limits();
    limits.road_load.mass_kg = mass_kg;
    engine.install(&mut limits.powertrain);
    limits
}

/// A trip at 72 km/h within a band in km/h, as long as cruise control takes, gears closed.
pub(crate) fn request<'a>(
    profile: &'a [ProfilePoint],
    truck: &'a VehicleLimits,
    (low, high): (f64, f64),
) -> TripRequest<'a> {
    TripRequest {
        profile,
        truck,
        band: SpeedBand { set_m_s: 20.0, min_m_s: low / 3.6, max_m_s: high / 3.6 },
        trip_time_s: None,
        eco_roll: false,
        tuning: Tuning::default(),
    }
}

/// The plan that takes as long as cruise control and ends as fast, and its price of time, g/s.
pub(crate) fn planned_by(trip: &Trip, solver: &mut Solver<'_>) -> (Driven, f64) {
    let end_e = trip.cruise.e_j_kg[trip.course.n()];
    let (driven, profile) = trip.solve(trip.cruise.trip_time_s(), end_e, solver);
    (driven, profile.beta_g_s)
}

/// [`planned_by`] the default solver.
pub(crate) fn planned(trip: &Trip) -> (Driven, f64) {
    let mut solver = DefaultSolver::default();
    planned_by(trip, &mut |a, b, c, d| solver.solve(a, b, c, d))
}

/// The same problem as the reference states it.
pub(crate) fn task<'a>(trip: &'a Trip, limits: &'a VehicleLimits) -> dp::Task<'a> {
    dp::Task {
        limits,
        h_m: trip.course.h_m,
        road: &trip.course.road,
        e_min: &trip.e_min,
        e_max: &trip.e_max,
        start_e: trip.cruise.e_j_kg[0],
        end_e: trip.cruise.e_j_kg[trip.course.n()],
        shift_g: trip.tuning.shift_fuel_g,
        accel_g: trip.tuning.accel_penalty_g_s3_m2,
        brake_m_s2: trip.course.brake_m_s2,
        charge_cut: true,
        may_roll: None,
    }
}

/// Where the reference may open the driveline: on every descent.
pub(crate) fn descents(trip: &Trip) -> Vec<bool> {
    trip.course.road.iter().map(|piece| piece.sin_grade < 0.0).collect()
}

/// Fuel, time and largest violation of a plan by the reference's own truck.
pub(crate) struct Audit {
    pub(crate) fuel_g: f64,
    pub(crate) time_s: f64,
    /// Beyond the ceiling in m/s, full load and brakes in m/s².
    pub(crate) violation: f64,
    /// Largest speed below the lowest one, which is a wish, m/s.
    pub(crate) below_m_s: f64,
}

/// Audits a plan.
pub(crate) fn audited(task: &dp::Task<'_>, driven: &Driven) -> Audit {
    let plant = dp::Plant::new(task);
    let v = |e: f64| (2.0 * e).sqrt();
    let mut audit = Audit { fuel_g: 0.0, time_s: 0.0, violation: 0.0f64, below_m_s: 0.0f64 };
    for k in 0..driven.drive.len() {
        let gear = match driven.drive[k] {
            Drive::Gear(gear) => gear as usize,
            Drive::Neutral => dp::NEUTRAL,
        };
        let (e0, e1) = (driven.e_j_kg[k], driven.e_j_kg[k + 1]);
        let edge = plant.exact_edge(k, gear, e0, e1).expect("a gear that may be driven");
        if gear == dp::NEUTRAL {
            audit.violation = audit.violation.max(-edge.need);
        }
        if k > 0 && driven.drive[k] != driven.drive[k - 1] {
            audit.fuel_g += task.shift_g;
        }
        audit.fuel_g += edge.fuel_g;
        audit.time_s += edge.time_s;
        audit.below_m_s = audit.below_m_s.max(v(task.e_min[k + 1]) - v(e1));
        let over = v(e1) - v(task.e_max[k + 1]);
        audit.violation = audit.violation.max(over).max(edge.need - edge.full);
        audit.violation = audit.violation.max(-edge.need - task.brake_m_s2);
    }
    audit
}
