//! Whole-trip planning: the paper's use (Eq. 18 and 19), against two cruise controls.

use alloc::vec::Vec;

use road::ProfilePoint;
use tractrix_core::VehicleLimits;

use super::tube::settle_in_tubes;
use crate::pcc::error::{PccError, check};
use crate::pcc::model::{
    Course, Drive, Driven, MIN_SPEED_M_S, SpeedBand, Truck, Tuning, cruise_energies, cruise_trip,
    drive_profile,
};
use crate::pcc::search::{EngineTables, GearChoice, choose_gears};
use crate::pcc::solve::{
    CutModel, Iterations, Problem, Profile, SolveStatus, Solver, Terminal, TimeRule, eco_roll,
    iterate, refined_gears,
};

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

/// Successive linearisations with gears from a search: the first over the whole band, the others in
/// a tube around the best so far.
const TUBE_ROUNDS: usize = 2;

/// The same with an open driveline.
const ROLL_ROUNDS: usize = 3;

/// Most subproblems that only tell the price of time, which the gear search is asked again with.
const PROBES: usize = 2;

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
    /// Intervals in which the driveline may be open, if it may be at all.
    pub may_roll: Vec<bool>,
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
            may_roll: eco_roll::may_roll(&truck, &course, &e_max, &cruise.e_j_kg),
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
            may_roll: Vec::new(),
        }
    }

    /// Price of time at the set speed on the flat, g/s: marginal fuel × drag slope × v³.
    #[must_use]
    pub fn beta_guess(&self) -> f64 {
        let v = self.set_m_s;
        self.truck.marginal_fuel_g_j_kg(v) * self.truck.drag_1_m * v * v * v
    }

    /// Solves for one trip time. The plan returned is driven, not promised: energies that the truth
    /// reaches. The profile's iterations and subproblems are all that it took to find it.
    pub fn solve(
        &self,
        trip_time_s: f64,
        end_e: f64,
        solver: &mut Solver<'_>,
    ) -> (Driven, Profile) {
        self.solve_near(trip_time_s, end_e, None, solver)
    }

    /// [`Trip::solve`], told the plan of a similar trip time.
    pub fn solve_near(
        &self,
        trip_time_s: f64,
        end_e: f64,
        near: Option<&Profile>,
        solver: &mut Solver<'_>,
    ) -> (Driven, Profile) {
        let (mut iterations, mut subproblems) = (0, 0);
        let (driven, mut profile) = self.solve_with(trip_time_s, end_e, near, &mut |a, b, c, d| {
            let found = solver(a, b, c, d);
            iterations += found.iterations;
            subproblems += 1;
            found
        });
        (profile.iterations, profile.subproblems) = (iterations, subproblems);
        (driven, profile)
    }

    fn solve_with(
        &self,
        trip_time_s: f64,
        end_e: f64,
        near: Option<&Profile>,
        solver: &mut Solver<'_>,
    ) -> (Driven, Profile) {
        let mut problem = self.problem(trip_time_s, end_e);
        let mut best = Best { trip: self, trip_time_s, kept: None };
        let guess = self.first_guess(&problem, near, solver);
        self.settle_gears(&problem, guess, &mut best, solver);
        self.settle_part_load(&mut problem, &mut best, solver);
        if self.eco_roll {
            self.open_driveline(&mut problem, &mut best, solver);
        }
        settle_in_tubes(&problem, &mut best);
        match best.kept {
            Some(kept) => (self.or_cruise(kept.driven, trip_time_s, end_e), kept.profile),
            None => (self.cruise.clone(), Profile::failed(self.cruising())),
        }
    }

    /// Energies and gears of the set-speed cruise control.
    fn cruising(&self) -> (&[f64], &[Drive]) {
        (&self.cruise.e_j_kg, &self.cruise.drive)
    }

    /// A profile with gears from a search over the whole band, and a price of time that fits it.
    fn first_guess(
        &self,
        problem: &Problem<'_>,
        near: Option<&Profile>,
        solver: &mut Solver<'_>,
    ) -> Guess {
        let probe = Iterations { most: 1, ..Iterations::TRIP };
        let searched = |beta| problem.first_profile(&self.tables, beta, 1.0, self.cruising());
        let mut beta = near.map_or_else(|| self.beta_guess(), |plan| plan.beta_g_s);
        let (mut e, mut gears) = match near {
            Some(plan) => (plan.e_j_kg.clone(), plan.gears.clone()),
            None => searched(beta),
        };
        for _ in 0..PROBES {
            let first = iterate(problem, &e, &gears, beta, probe, solver);
            let settled = (first.beta_g_s - beta).abs() < 0.1 * beta;
            beta = first.beta_g_s;
            if settled {
                break;
            }
            (e, gears) = searched(beta);
        }
        Guess { e_j_kg: e, gears, beta_g_s: beta }
    }

    /// Solves, refines the places of the shifts, and searches the gears anew around the best so far
    /// at the course's own step.
    fn settle_gears(
        &self,
        problem: &Problem<'_>,
        mut guess: Guess,
        best: &mut Best<'_>,
        solver: &mut Solver<'_>,
    ) {
        for round in 0..TUBE_ROUNDS {
            let Guess { e_j_kg, gears, beta_g_s } = &guess;
            let profile = iterate(problem, e_j_kg, gears, *beta_g_s, Iterations::TRIP, solver);
            let refined = refined_gears(problem, &profile);
            let (centre, beta) = (profile.e_j_kg.clone(), profile.beta_g_s);
            let other = (refined != profile.gears)
                .then(|| iterate(problem, &centre, &refined, beta, Iterations::TRIP, solver));
            best.offer(problem, profile);
            if let Some(other) = other {
                best.offer(problem, other);
            }
            if round + 1 == TUBE_ROUNDS {
                break;
            }
            let Some(again) = best.searched_around(problem) else { break };
            guess = again;
        }
    }

    /// Part load below zero wheel force: either charged as it is, or cut where it is least.
    fn settle_part_load(
        &self,
        problem: &mut Problem<'_>,
        best: &mut Best<'_>,
        solver: &mut Solver<'_>,
    ) {
        for cut in [CutModel::Charged, CutModel::Hull] {
            let Some(kept) = &best.kept else { break };
            problem.cut = cut;
            if cut == CutModel::Hull {
                problem.forced_cut = self.light_load(&kept.driven);
            }
            let Profile { e_j_kg, gears, beta_g_s, .. } = &kept.profile;
            let other = iterate(problem, e_j_kg, gears, *beta_g_s, Iterations::TRIP, solver);
            best.offer(problem, other);
        }
        problem.cut = CutModel::Hull;
        problem.forced_cut.clear();
    }

    /// The same searches with the open driveline as one more gear.
    fn open_driveline(
        &self,
        problem: &mut Problem<'_>,
        best: &mut Best<'_>,
        solver: &mut Solver<'_>,
    ) {
        let Some(kept) = &best.kept else { return };
        problem.may_roll.clone_from(&self.may_roll);
        let mut beta = kept.profile.beta_g_s;
        let (mut e, mut gears) = problem.first_profile(&self.tables, beta, 1.0, self.cruising());
        for round in 0..ROLL_ROUNDS {
            let mut solve = |e: &[f64], gears: &[Drive], beta| {
                eco_roll::rolled(problem, e, gears, beta, Iterations::ROLLING_TRIP, solver)
            };
            if let Some(profile) = solve(&e, &gears, beta) {
                let refined = refined_gears(problem, &profile);
                let other = (refined != profile.gears)
                    .then(|| solve(&profile.e_j_kg, &refined, profile.beta_g_s))
                    .flatten();
                best.offer(problem, profile);
                if let Some(other) = other {
                    best.offer(problem, other);
                }
            }
            if round + 1 == ROLL_ROUNDS {
                break;
            }
            let Some(again) = best.searched_around(problem) else { break };
            (e, gears, beta) = (again.e_j_kg, again.gears, again.beta_g_s);
        }
    }

    /// Cruise control is a plan too: where nothing can be gained (a flat road) it is driven.
    fn or_cruise(&self, mut driven: Driven, trip_time_s: f64, end_e: f64) -> Driven {
        for other in [&self.cruise, &self.overspeed] {
            if other.trip_time_s() <= trip_time_s * (1.0 + 1e-9)
                && other.e_j_kg[other.e_j_kg.len() - 1] >= end_e - 1e-9
                && other.total_fuel_g() <= driven.total_fuel_g() * (1.0 + LEAST_GAIN)
                && self.violation(other) < 1e-6
            {
                driven = other.clone();
            }
        }
        driven
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
}

/// What an iteration starts from.
struct Guess {
    e_j_kg: Vec<f64>,
    gears: Vec<Drive>,
    beta_g_s: f64,
}

/// A plan with what it costs.
pub(super) struct Kept {
    cost_g: f64,
    pub(super) driven: Driven,
    pub(super) profile: Profile,
}

/// The best plan so far.
pub(super) struct Best<'a> {
    trip: &'a Trip,
    trip_time_s: f64,
    pub(super) kept: Option<Kept>,
}

impl Best<'_> {
    /// Duration that counts as in time, s.
    fn latest_s(&self) -> f64 {
        self.trip_time_s * (1.0 + 1e-5)
    }

    /// What the best plan costs, g; infinite without one.
    pub(super) fn cost_g(&self) -> f64 {
        self.kept.as_ref().map_or(f64::INFINITY, |kept| kept.cost_g)
    }

    /// Whether a plan of this duration, s, comes too late.
    pub(super) fn is_late(&self, time_s: f64) -> bool {
        time_s > self.latest_s()
    }

    /// Drives a profile and keeps it if it costs less than the best so far: fuel, and the price of
    /// time for what it is late or lies below the minimum speed, tenfold so that such a plan wins
    /// only where there is no other.
    pub(super) fn offer(&mut self, problem: &Problem<'_>, profile: Profile) {
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
        let price = profile.beta_g_s.max(self.trip.beta_guess());
        let late = (driven.trip_time_s() - self.latest_s()).max(0.0);
        let h_m = problem.course.h_m;
        let slow: f64 = driven
            .e_j_kg
            .iter()
            .zip(&self.trip.e_min)
            .filter(|(e, low)| **e < **low * (1.0 - 1e-3))
            .map(|(e, low)| h_m / libm::sqrt(2.0 * e) * (1.0 - libm::sqrt(e / low)))
            .sum();
        let cost_g = driven.total_fuel_g() + 10.0 * price * (late + slow);
        if cost_g < self.cost_g() {
            self.kept = Some(Kept { cost_g, driven, profile });
        }
    }

    /// Energies and gears from a search in a tube around the best, if its gears are other ones.
    fn searched_around(&self, problem: &Problem<'_>) -> Option<Guess> {
        let Kept { driven, profile, .. } = self.kept.as_ref()?;
        let beta_g_s = profile.beta_g_s;
        let (e_j_kg, gears) = problem.tube_profile(&self.trip.tables, beta_g_s, &driven.e_j_kg)?;
        (gears != profile.gears).then_some(Guess { e_j_kg, gears, beta_g_s })
    }
}
