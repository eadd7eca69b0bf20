//! What a whole-trip plan comes to: totals, rows, and savings against both cruise controls.

use alloc::vec::Vec;

use super::planner::{Trip, TripRequest};
use crate::pcc::error::PccError;
use crate::pcc::model::{Drive, Driven};
use crate::pcc::solve::{DefaultSolver, Profile, SolveStatus, Solver};

/// Outcome of a valid request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TripStatus {
    /// Optimal within tolerance.
    Solved,
    /// Usable, but the solver stopped early.
    AlmostSolved,
    /// No profile within the band is as fast as asked; the fastest is returned.
    TripTimeNotReachable,
    /// The solver failed; the set-speed cruise control is returned.
    Fallback,
}

impl TripStatus {
    /// The status as one word for files and screens.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Solved => "solved",
            Self::AlmostSolved => "almost_solved",
            Self::TripTimeNotReachable => "trip_time_not_reachable",
            Self::Fallback => "fallback",
        }
    }
}

/// One row of `plan.csv`: state at `s_m`, forces and gear of the interval that begins there (the
/// last row repeats the last interval's).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TripRow {
    /// Station, m.
    pub s_m: f64,
    /// Speed, m/s.
    pub v_m_s: f64,
    /// Elapsed time, s.
    pub time_s: f64,
    /// Gear, 1-based, 0 = neutral.
    pub gear: u8,
    /// Wheel force of the driveline, N; negative in overrun.
    pub drive_force_n: f64,
    /// Brake force, N, positive slows.
    pub brake_force_n: f64,
    /// Fuel since the start, g.
    pub fuel_g: f64,
    /// Mean grade of the interval, rad.
    pub grade_rad: f64,
    /// Crank power, W.
    pub engine_power_w: f64,
}

/// Totals of a driven trip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TripTotals {
    /// Fuel, g, shifts included.
    pub fuel_g: f64,
    /// Duration, s.
    pub trip_time_s: f64,
    /// Energy taken by the brakes, J.
    pub brake_energy_j: f64,
    /// Gear changes.
    pub shifts: usize,
}

/// Effort and quality of the solution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolverReport {
    /// Interior-point iterations in all.
    pub iterations: u32,
    /// Subproblems solved.
    pub sqp_iterations: u32,
    /// Largest violation of speed limits (m/s), power or brakes (m/s²) in the driven plan.
    pub max_violation: f64,
}

/// A planned trip with its baselines.
#[derive(Debug, Clone)]
pub struct TripResult {
    /// Outcome.
    pub status: TripStatus,
    /// Solver figures.
    pub solver: SolverReport,
    /// Totals of the plan.
    pub plan: TripTotals,
    /// Cruise control at the set speed, brakes at the set speed.
    pub baseline_set_speed: TripTotals,
    /// Cruise control at the set speed, brakes 5 km/h above it.
    pub baseline_overspeed_5_km_h: TripTotals,
    /// Fuel saved against the first baseline at its trip time, fraction.
    pub saving_vs_set_speed_frac: f64,
    /// Fuel saved against the second baseline at its trip time, fraction.
    pub saving_vs_overspeed_frac: f64,
    /// The plan, one row per node.
    pub rows: Vec<TripRow>,
    /// Set-speed baseline, one row per node.
    pub baseline_rows: Vec<TripRow>,
    /// Price of time at the optimum, g/s.
    pub beta_g_s: f64,
    /// Highest energy per node that law, curves and band allow, J/kg.
    pub e_max_j_kg: Vec<f64>,
}

/// The plan of a request, before it is compared with the baselines.
#[derive(Debug, Clone)]
pub struct TripPlan {
    driven: Driven,
    profile: Profile,
    /// Trip time that it was made for, s.
    goal_s: f64,
}

impl TripPlan {
    /// Price of time, g/s: the multiplier of the trip time.
    #[must_use]
    pub fn price_of_time_g_s(&self) -> f64 {
        self.profile.beta_g_s
    }
}

impl Trip {
    /// Solves for the requested trip time, or for that of the set-speed cruise control.
    pub fn plan(&self, trip_time_s: Option<f64>, solver: &mut Solver<'_>) -> TripPlan {
        let goal_s = trip_time_s.unwrap_or(self.cruise.trip_time_s());
        let (driven, profile) = self.solve(goal_s, self.end_of(&self.cruise), solver);
        TripPlan { driven, profile, goal_s }
    }

    /// The plan's figures and savings. Each saving is that of a plan solved for the baseline's own
    /// trip time and end speed.
    pub fn compared(&self, plan: TripPlan, solver: &mut Solver<'_>) -> TripResult {
        let TripPlan { driven, profile, goal_s } = plan;
        let saved = |plan: &Driven, baseline: &Driven| {
            1.0 - plan.total_fuel_g() / baseline.total_fuel_g().max(1e-9)
        };
        let mut against = |baseline: &Driven| {
            if goal_s == baseline.trip_time_s() && core::ptr::eq(baseline, &self.cruise) {
                return saved(&driven, baseline);
            }
            let (goal_s, end) = (baseline.trip_time_s(), self.end_of(baseline));
            saved(&self.solve_near(goal_s, end, Some(&profile), solver).0, baseline)
        };
        let saving_vs_set_speed_frac = against(&self.cruise);
        let saving_vs_overspeed_frac = against(&self.overspeed);
        let mut status = match profile.status {
            SolveStatus::Solved => TripStatus::Solved,
            SolveStatus::AlmostSolved => TripStatus::AlmostSolved,
            SolveStatus::Infeasible | SolveStatus::Failed => TripStatus::Fallback,
        };
        if driven.trip_time_s() > goal_s * 1.002 {
            status = TripStatus::TripTimeNotReachable;
        }
        TripResult {
            status,
            solver: SolverReport {
                iterations: profile.iterations,
                sqp_iterations: profile.subproblems,
                max_violation: self.violation(&driven),
            },
            plan: self.totals(&driven),
            baseline_set_speed: self.totals(&self.cruise),
            baseline_overspeed_5_km_h: self.totals(&self.overspeed),
            saving_vs_set_speed_frac,
            saving_vs_overspeed_frac,
            rows: self.rows(&driven),
            baseline_rows: self.rows(&self.cruise),
            beta_g_s: profile.beta_g_s,
            e_max_j_kg: self.e_max.clone(),
        }
    }

    /// Energy at a baseline's end, as far as the plan may have it, J/kg.
    fn end_of(&self, baseline: &Driven) -> f64 {
        let n = self.course.n();
        baseline.e_j_kg[n].min(self.e_max[n])
    }

    /// Totals of a driven trip.
    #[must_use]
    pub fn totals(&self, d: &Driven) -> TripTotals {
        TripTotals {
            fuel_g: d.total_fuel_g(),
            trip_time_s: d.trip_time_s(),
            brake_energy_j: d.brake_energy_j(self.truck.mass_kg, self.course.h_m),
            shifts: d.shifts(),
        }
    }

    /// The trip as rows, one per node.
    #[must_use]
    pub fn rows(&self, d: &Driven) -> Vec<TripRow> {
        let n = self.course.n();
        let m = self.truck.mass_kg;
        (0..=n)
            .map(|k| {
                let i = k.min(n - 1);
                let v = libm::sqrt(d.e_j_kg[i] + d.e_j_kg[i + 1]);
                let overrun = match d.drive[i] {
                    Drive::Gear(g) => self.truck.overrun_m_s2(g as usize, v),
                    Drive::Neutral => 0.0,
                };
                TripRow {
                    s_m: self.course.s_m(k),
                    v_m_s: d.v_m_s(k),
                    time_s: d.time_s[k],
                    gear: d.drive[i].number(),
                    drive_force_n: m * (d.p_m_s2[i] - overrun),
                    brake_force_n: m * d.brake_m_s2[i],
                    fuel_g: d.fuel_g[k],
                    grade_rad: libm::asin(self.course.road[i].sin_grade),
                    engine_power_w: self.truck.engine_power_w(d.drive[i], v, d.p_m_s2[i]),
                }
            })
            .collect()
    }
}

/// Plans a trip and drives both baselines.
///
/// The plan meets the requested trip time, or that of the set-speed cruise control.
///
/// # Errors
/// [`PccError`] names the quantity of the request that is not usable, or the place that the truck
/// cannot drive.
pub fn plan_trip_with(
    request: &TripRequest<'_>,
    solver: &mut Solver<'_>,
) -> Result<TripResult, PccError> {
    let trip = Trip::new(request)?;
    let plan = trip.plan(request.trip_time_s, solver);
    Ok(trip.compared(plan, solver))
}

/// [`plan_trip_with`] the [`DefaultSolver`].
///
/// # Errors
/// As [`plan_trip_with`].
pub fn plan_trip(request: &TripRequest<'_>) -> Result<TripResult, PccError> {
    let mut solver = DefaultSolver::default();
    plan_trip_with(request, &mut |sub, end, time, fence| solver.solve(sub, end, time, fence))
}
