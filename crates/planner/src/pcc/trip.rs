//! Whole-trip planning: the paper's use (Eq. 18 and 19), against two cruise controls.

use alloc::vec::Vec;

use road::ProfilePoint;
use tractrix_core::VehicleLimits;

use super::course::{Course, MIN_SPEED_M_S, SpeedBand, Tuning};
use super::cruise::{cruise_energies, cruise_trip};
use super::drive::{Driven, drive_profile};
use super::eco_roll;
use super::error::{PccError, check};
use super::gears::{GearChoice, choose_gears};
use super::lin::{Terminal, TimeRule};
use super::search::EngineTables;
use super::solution::SolveStatus;
use super::solver::DefaultSolver;
use super::sqp::{CutModel, Iterations, Problem, Profile, Solver, iterate, refined_gears};
use super::truck::{Drive, Truck};

/// A trip to plan.
#[derive(Debug, Clone)]
pub struct TripRequest<'a> {
    /// The road, at least two points.
    pub profile: &'a [ProfilePoint],
    /// The truck as it reports itself, mass included.
    pub truck: &'a VehicleLimits,
    /// Set speed and band.
    pub band: SpeedBand,
    /// Longest duration, s; `None`: that of the set-speed cruise control.
    pub trip_time_s: Option<f64>,
    /// Whether coasting phases may open the driveline.
    pub eco_roll: bool,
    /// Tuning.
    pub tuning: Tuning,
}

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

/// Successive linearisations with gears from a search: the first over the whole band, the others in
/// a tube around the best so far.
const TUBE_ROUNDS: usize = 2;

/// Gain of a plan over cruise control, relative, below which cruise control is driven.
const LEAST_GAIN: f64 = 1e-4;

/// Overspeed of the second baseline, m/s.
const OVERSPEED_M_S: f64 = 5.0 / 3.6;

/// A request checked and sampled, ready to be solved for several trip times.
#[derive(Debug, Clone)]
pub struct Trip {
    /// Longitudinal truck.
    pub truck: Truck,
    /// Sampled road.
    pub course: Course,
    /// Tuning.
    pub tuning: Tuning,
    /// Lowest energy per node, J/kg.
    pub e_min: Vec<f64>,
    /// Highest energy per node, J/kg.
    pub e_max: Vec<f64>,
    /// Set-speed cruise control.
    pub cruise: Driven,
    /// Cruise control with 5 km/h overspeed.
    pub overspeed: Driven,
    /// Fastest possible trip, s.
    pub fastest_s: f64,
    tables: EngineTables,
    eco_roll: bool,
    set_m_s: f64,
}

impl Trip {
    /// Checks and samples a request, drives both baselines.
    ///
    /// # Errors
    /// [`PccError`] names the quantity that is not usable, or the place that cannot be driven.
    pub fn new(request: &TripRequest<'_>) -> Result<Self, PccError> {
        let truck = Truck::new(request.truck)?;
        let tuning = request.tuning;
        let course = Course::new(request.profile, request.truck, &tuning)?;
        let band = request.band;
        check("speed_max_m_s", band.max_m_s, MIN_SPEED_M_S, 60.0, "1 to 60 m/s")?;
        check("set_speed_m_s", band.set_m_s, MIN_SPEED_M_S, band.max_m_s, "1 m/s to the maximum")?;
        check("speed_min_m_s", band.min_m_s, 0.0, band.set_m_s, "0 to the set speed")?;
        if let Some(t) = request.trip_time_s {
            check("trip_time_s", t, 0.1, 1e7, "0.1 to 1e7 s")?;
        }
        let approach = tuning.approach_decel_m_s2;
        let top = truck.top_speed_m_s() * 0.999;
        let cap = |v: f64| course.ceiling(&truck, v.min(top), approach);
        let hold = cap(band.set_m_s)?;
        let over_cap = cap(band.set_m_s + OVERSPEED_M_S)?;
        let e_max = cap(band.max_m_s)?;
        let shift = tuning.shift_fuel_g;
        let start = hold[0];
        let cruise = cruise_trip(&truck, &course, start, &hold, &hold, shift)?;
        let overspeed = cruise_trip(&truck, &course, start, &hold, &over_cap, shift)?;
        let fast = cruise_energies(&truck, &course, start, &e_max, &e_max)?;
        let gears = choose_gears(&truck, &course, &fast, &GearChoice::follow(shift));
        let fastest_s = drive_profile(&truck, &course, &fast, &gears, &[], shift).trip_time_s();
        let lowest = 0.5 * band.min_m_s.max(MIN_SPEED_M_S) * band.min_m_s.max(MIN_SPEED_M_S);
        let e_min = cruise
            .e_j_kg
            .iter()
            .map(|&e| {
                let v = (libm::sqrt(2.0 * e) - tuning.relax_m_s).max(0.8 * MIN_SPEED_M_S);
                lowest.min(0.5 * v * v)
            })
            .collect();
        let tables = EngineTables::new(&truck, e_max.iter().copied().fold(0.0, f64::max));
        Ok(Self {
            truck,
            tables,
            course,
            tuning,
            e_min,
            e_max,
            cruise,
            overspeed,
            fastest_s,
            eco_roll: request.eco_roll,
            set_m_s: band.set_m_s,
        })
    }

    /// The planning problem for one trip time and end energy.
    #[must_use]
    pub fn problem(&self, trip_time_s: f64, end_e: f64) -> Problem<'_> {
        Problem {
            truck: &self.truck,
            course: &self.course,
            tuning: &self.tuning,
            e_min: self.e_min.clone(),
            e_max: self.e_max.clone(),
            start_e: self.cruise.e_j_kg[0],
            terminal: Terminal::Fixed(end_e),
            time: TimeRule::AtMost(trip_time_s),
            fence_s: None,
            start_gear: None,
            cut: CutModel::Hull,
            forced_cut: Vec::new(),
        }
    }

    /// Price of time at the set speed on the flat, g/s: marginal fuel × drag slope × v³.
    #[must_use]
    pub fn beta_guess(&self) -> f64 {
        let v = self.set_m_s;
        let g = self.truck.strongest_gear(v);
        let phi = self.truck.traction_m_s2(g, v);
        let drive = Drive::Gear(g as u8);
        let q = (self.truck.fuel_g_s(drive, v, phi) - self.truck.fuel_g_s(drive, v, 0.5 * phi))
            / (0.5 * phi * v);
        q * self.truck.drag_1_m * v * v * v
    }

    /// Solves for one trip time. The plan returned is driven, not promised: energies that the truth
    /// reaches.
    pub fn solve(
        &self,
        trip_time_s: f64,
        end_e: f64,
        solver: &mut Solver<'_>,
    ) -> (Driven, Profile) {
        self.solve_near(trip_time_s, end_e, self.beta_guess(), solver)
    }

    /// [`Trip::solve`] with a guess of the price of time, g/s, from a similar trip time.
    pub fn solve_near(
        &self,
        trip_time_s: f64,
        end_e: f64,
        beta_g_s: f64,
        solver: &mut Solver<'_>,
    ) -> (Driven, Profile) {
        let mut problem = self.problem(trip_time_s, end_e);
        let cruise = (self.cruise.e_j_kg.as_slice(), self.cruise.drive.as_slice());
        let mut beta = beta_g_s;
        let mut best: Option<(f64, Driven, Profile)> = None;
        let (mut e, mut gears) = problem.first_profile(&self.tables, beta, 1.0, cruise);
        for _ in 0..2 {
            // One subproblem tells the price of time, which the gear search is asked again with.
            let probe = Iterations { most: 1, ..Iterations::TRIP };
            let first = iterate(&problem, &e, &gears, beta, probe, solver);
            let settled = (first.beta_g_s - beta).abs() < 0.1 * beta;
            beta = first.beta_g_s;
            if settled {
                break;
            }
            (e, gears) = problem.first_profile(&self.tables, beta, 1.0, cruise);
        }
        for round in 0..TUBE_ROUNDS {
            let profile = iterate(&problem, &e, &gears, beta, Iterations::TRIP, solver);
            beta = profile.beta_g_s;
            let refined = refined_gears(&problem, &profile);
            let centre = profile.e_j_kg.clone();
            let other = (refined != profile.gears)
                .then(|| iterate(&problem, &centre, &refined, beta, Iterations::TRIP, solver));
            self.keep_better(&problem, trip_time_s, profile, &mut best);
            if let Some(other) = other {
                self.keep_better(&problem, trip_time_s, other, &mut best);
            }
            // Around the best so far the gears are searched anew, at the course's own step.
            let Some((_, driven, kept)) = best.as_ref().filter(|_| round + 1 < TUBE_ROUNDS) else {
                break;
            };
            let found = problem.tube_profile(&self.tables, kept.beta_g_s, &driven.e_j_kg);
            let Some(found) = found.filter(|(_, g)| *g != kept.gears) else { break };
            beta = kept.beta_g_s;
            (e, gears) = found;
        }
        // Part load below zero wheel force: either charged as it is, or cut where it is least.
        problem.cut = CutModel::Charged;
        for _ in 0..2 {
            let Some((_, driven, kept)) = &best else { break };
            if matches!(problem.cut, CutModel::Hull) {
                problem.forced_cut = self.light_load(driven);
            }
            let (e, gears, beta) = (kept.e_j_kg.clone(), kept.gears.clone(), kept.beta_g_s);
            let other = iterate(&problem, &e, &gears, beta, Iterations::TRIP, solver);
            self.keep_better(&problem, trip_time_s, other, &mut best);
            problem.cut = CutModel::Hull;
        }
        problem.forced_cut.clear();
        let rolling = best.as_ref().filter(|_| self.eco_roll).and_then(|(_, driven, kept)| {
            eco_roll::opened(&problem, kept, driven, Iterations::TRIP, solver)
        });
        if let Some(other) = rolling {
            self.keep_better(&problem, trip_time_s, other, &mut best);
        }
        let Some((_, driven, profile)) = best else {
            return (self.cruise.clone(), Profile::failed(cruise));
        };
        // Cruise control is a plan too: where nothing can be gained (a flat road) it is driven.
        let mut driven = driven;
        for other in [&self.cruise, &self.overspeed] {
            if other.trip_time_s() <= trip_time_s * (1.0 + 1e-9)
                && other.e_j_kg[other.e_j_kg.len() - 1] >= end_e - 1e-9
                && other.total_fuel_g() <= driven.total_fuel_g() * (1.0 + LEAST_GAIN)
                && self.violation(other) < 1e-6
            {
                driven = other.clone();
            }
        }
        (driven, profile)
    }

    /// Intervals that inject less than half of what the engine's own drag takes.
    fn light_load(&self, driven: &Driven) -> Vec<bool> {
        (0..self.course.n())
            .map(|k| match driven.drive[k] {
                Drive::Gear(g) => {
                    let v = libm::sqrt(driven.e_j_kg[k] + driven.e_j_kg[k + 1]);
                    driven.p_m_s2[k] < 0.5 * self.truck.overrun_m_s2(g as usize, v)
                }
                Drive::Neutral => false,
            })
            .collect()
    }

    /// Drives a profile and keeps it if it costs less than the best so far: fuel, and the price of
    /// time for what it is late or lies below the minimum speed, tenfold so that such a plan wins
    /// only where there is no other.
    fn keep_better(
        &self,
        problem: &Problem<'_>,
        trip_time_s: f64,
        profile: Profile,
        best: &mut Option<(f64, Driven, Profile)>,
    ) {
        if !matches!(profile.status, SolveStatus::Solved | SolveStatus::AlmostSolved) {
            return;
        }
        let driven = drive_profile(
            problem.truck,
            problem.course,
            &profile.e_j_kg,
            &profile.gears,
            &profile.cut,
            problem.tuning.shift_fuel_g,
        );
        let price = profile.beta_g_s.max(self.beta_guess());
        let late = (driven.trip_time_s() - trip_time_s * (1.0 + 1e-5)).max(0.0);
        let slow: f64 = driven
            .e_j_kg
            .iter()
            .zip(&self.e_min)
            .filter(|(e, low)| **e < **low * (1.0 - 1e-3))
            .map(|(e, low)| self.course.h_m / libm::sqrt(2.0 * e) * (1.0 - libm::sqrt(e / low)))
            .sum();
        let cost = driven.total_fuel_g() + 10.0 * price * (late + slow);
        if best.as_ref().is_none_or(|(least, ..)| cost < *least) {
            *best = Some((cost, driven, profile));
        }
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
}

/// Plans a trip and drives both baselines.
///
/// The plan meets the requested trip time, or that of the set-speed cruise control. Each saving is
/// that of a plan solved for the baseline's own trip time and end speed.
///
/// # Errors
/// [`PccError`] names the quantity of the request that is not usable, or the place that the truck
/// cannot drive.
pub fn plan_trip_with(
    request: &TripRequest<'_>,
    solver: &mut Solver<'_>,
) -> Result<TripResult, PccError> {
    let trip = Trip::new(request)?;
    let end = |d: &Driven| d.e_j_kg[d.e_j_kg.len() - 1];
    let against = |d: &Driven, beta_g_s: f64, solver: &mut Solver<'_>| {
        let (goal, end) = (d.trip_time_s(), end(d).min(trip.end_cap()));
        let (plan, profile) = trip.solve_near(goal, end, beta_g_s, solver);
        let saved = 1.0 - plan.total_fuel_g() / d.total_fuel_g().max(1e-9);
        (saved, plan, profile)
    };
    let (saving_cruise, mut plan, mut profile) = against(&trip.cruise, trip.beta_guess(), solver);
    let beta = if profile.beta_g_s > 0.0 { profile.beta_g_s } else { trip.beta_guess() };
    let (saving_over, ..) = against(&trip.overspeed, beta, solver);
    let goal = request.trip_time_s.unwrap_or(trip.cruise.trip_time_s());
    if request.trip_time_s.is_some() {
        (plan, profile) = trip.solve_near(goal, end(&trip.cruise), beta, solver);
    }
    let mut status = match profile.status {
        SolveStatus::Solved => TripStatus::Solved,
        SolveStatus::AlmostSolved => TripStatus::AlmostSolved,
        SolveStatus::Infeasible | SolveStatus::Failed => TripStatus::Fallback,
    };
    if status == TripStatus::Fallback {
        plan = trip.cruise.clone();
    }
    if plan.trip_time_s() > goal * 1.002 {
        status = TripStatus::TripTimeNotReachable;
    }
    Ok(TripResult {
        status,
        solver: SolverReport {
            iterations: profile.iterations,
            sqp_iterations: profile.subproblems,
            max_violation: trip.violation(&plan),
        },
        plan: trip.totals(&plan),
        baseline_set_speed: trip.totals(&trip.cruise),
        baseline_overspeed_5_km_h: trip.totals(&trip.overspeed),
        saving_vs_set_speed_frac: saving_cruise,
        saving_vs_overspeed_frac: saving_over,
        rows: trip.rows(&plan),
        baseline_rows: trip.rows(&trip.cruise),
        beta_g_s: profile.beta_g_s,
        e_max_j_kg: trip.e_max,
    })
}

/// [`plan_trip_with`] the [`DefaultSolver`].
///
/// # Errors
/// As [`plan_trip_with`].
pub fn plan_trip(request: &TripRequest<'_>) -> Result<TripResult, PccError> {
    let mut solver = DefaultSolver::default();
    plan_trip_with(request, &mut |sub, end, time, fence| solver.solve(sub, end, time, fence))
}

impl Trip {
    fn end_cap(&self) -> f64 {
        self.e_max[self.course.n()]
    }

    /// Largest violation of the speed ceiling (m/s), full load or planned brakes (m/s²). The
    /// minimum speed is a wish, relaxed where the truck cannot hold it.
    #[must_use]
    pub fn violation(&self, d: &Driven) -> f64 {
        let mut worst = 0.0f64;
        for k in 0..self.course.n() {
            let v = |e: f64| libm::sqrt(2.0 * e);
            worst = worst.max(d.v_m_s(k + 1) - v(self.e_max[k + 1]));
            let mean = v(0.5 * (d.e_j_kg[k] + d.e_j_kg[k + 1]));
            let top = match d.drive[k] {
                Drive::Gear(g) => self.truck.traction_m_s2(g as usize, mean),
                Drive::Neutral => 0.0,
            };
            worst = worst.max(d.p_m_s2[k] - top);
            worst = worst.max(d.brake_m_s2[k] - self.course.brake_m_s2);
        }
        worst
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
                    grade_rad: libm::asin(self.course.sin[i]),
                    engine_power_w: self.truck.engine_power_w(d.drive[i], v, d.p_m_s2[i]),
                }
            })
            .collect()
    }
}
