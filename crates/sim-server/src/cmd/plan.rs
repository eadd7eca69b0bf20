//! `plan`: the fuel-optimal speed profile of a whole trip, against both cruise controls.

use std::time::Instant;

use clap::Parser;
use dynamics::{TruckModel, TruckParameters};
use planner::pcc::model::profile_of;
use planner::pcc::solve::DefaultSolver;
use planner::pcc::trip::Trip;
use planner::pcc::{SpeedBand, TripRequest, TripResult, TripRow, TripTotals, Tuning};
use road::Road;
use serde::Serialize;
use tractrix_core::VehicleLimits;

use crate::cli::positive;
use crate::failure::Failure;
use crate::out_folder::Out;
use crate::output;
use crate::picture::{Line, Strip, Style, page};
use crate::progress::Stages;
use crate::provenance::Provenance;

/// Writes plan.csv, plan.json and a picture of the trip, plan.html.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// A truck file, or a built-in name.
    #[arg(long)]
    truck: String,
    /// An .xodr or .csv file, or a built-in road.
    #[arg(long)]
    road: String,
    /// Total mass.
    #[arg(long, value_name = "M", value_parser = positive)]
    mass_kg: f64,
    /// Set speed: at both ends, and of the cruise controls.
    #[arg(long, value_name = "V", value_parser = positive)]
    set_speed_m_s: f64,
    /// Lowest speed.
    #[arg(long, value_name = "A", value_parser = positive)]
    speed_min_m_s: f64,
    /// Highest speed.
    #[arg(long, value_name = "B", value_parser = positive)]
    speed_max_m_s: f64,
    /// Longest duration [default: that of the set-speed cruise control].
    #[arg(long, value_name = "T", value_parser = positive)]
    trip_time_s: Option<f64>,
    /// Lets coasting phases open the driveline.
    #[arg(long)]
    eco_roll: bool,
    #[command(flatten)]
    out: Out,
    /// Prints plan.json on stdout instead of a sentence.
    #[arg(long)]
    json: bool,
}

/// `plan.json`.
#[derive(Debug, Serialize)]
struct PlanJson {
    #[serde(flatten)]
    provenance: Provenance,
    truck: String,
    road: String,
    mass_kg: f64,
    #[serde(flatten)]
    plan: Totals,
    baseline_set_speed: Totals,
    baseline_overspeed_5_km_h: Totals,
    saving_frac: Saving,
    solver: Solver,
}

/// Totals of a driven trip.
#[derive(Debug, Clone, Copy, Serialize)]
struct Totals {
    fuel_g: f64,
    trip_time_s: f64,
    brake_energy_j: f64,
    shifts: usize,
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

/// Fuel saved at the baseline's trip time.
#[derive(Debug, Serialize)]
struct Saving {
    vs_set_speed: f64,
    vs_overspeed: f64,
}

#[derive(Debug, Serialize)]
struct Solver {
    status: &'static str,
    iterations: u32,
    sqp_iterations: u32,
    /// Time of the plan that is reported: road sampled, baselines driven (their trip time is the
    /// plan's), solved.
    solve_time_ms: f64,
    /// The same with the second plan, that of the other baseline's trip time.
    total_time_ms: f64,
    max_violation: f64,
}

/// Spacing of the road's profile, m.
const PROFILE_STEP_M: f64 = 10.0;

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let out = args.out.folder(&["plan.csv", "plan.json", "plan.html"])?;
    let limits = truck_at_mass(&args.truck, args.mass_kg)?;
    let road = Road::load(&args.road).map_err(Failure::input)?;
    let profile = profile_of(&road, PROFILE_STEP_M);
    let request = TripRequest {
        profile: &profile,
        truck: &limits,
        band: SpeedBand {
            set_m_s: args.set_speed_m_s,
            min_m_s: args.speed_min_m_s,
            max_m_s: args.speed_max_m_s,
        },
        trip_time_s: args.trip_time_s,
        eco_roll: args.eco_roll,
        tuning: Tuning::default(),
    };
    #[expect(clippy::disallowed_methods, reason = "the shell owns the clock")]
    let start = Instant::now();
    let since_ms = || start.elapsed().as_secs_f64() * 1e3;
    let stages = Stages::start();
    stages.show("planning the trip");
    let trip = Trip::new(&request).map_err(Failure::input)?;
    let mut default = DefaultSolver::default();
    let mut solver =
        |sub: &_, end, time, fence: Option<&[f64]>| default.solve(sub, end, time, fence);
    let plan = trip.plan(args.trip_time_s, &mut solver);
    let solve_time_ms = since_ms();
    let result = trip.compared(plan, &mut solver);
    let total_time_ms = since_ms();
    stages.finish();
    let report = report(args, &result, [solve_time_ms, total_time_ms]);
    let json = serde_json::to_string_pretty(&report).map_err(Failure::work)?;
    let title = format!("{} on {}, {:.1} t", args.truck, args.road, args.mass_kg * 1e-3);
    let overspeed = trip.rows(&trip.overspeed);
    out.write("plan.csv", csv(&result.rows))?;
    out.write("plan.json", &json)?;
    let picture = page(&title, &sentence(&report), "distance, km", &strips(&result, &overspeed));
    out.write("plan.html", picture)?;
    out.keep();
    output::result(if args.json { json } else { sentence(&report) }.as_str())
}

/// What a truck says about itself when it weighs this much in all.
fn truck_at_mass(truck: &str, mass_kg: f64) -> Result<VehicleLimits, Failure> {
    let parameters = TruckParameters::load(truck).map_err(Failure::input)?;
    let empty = TruckModel::new(parameters.clone(), 0.0).map_err(Failure::input)?;
    let payload_kg = mass_kg - empty.mass_kg();
    if payload_kg < 0.0 {
        return Err(Failure::Input(format!(
            "--mass-kg {mass_kg}: {truck} weighs {:.0} kg without payload",
            empty.mass_kg()
        )));
    }
    let loaded = TruckModel::new(parameters, payload_kg).map_err(Failure::input)?;
    loaded.vehicle_limits().map_err(Failure::input)
}

fn report(args: &Args, result: &TripResult, times_ms: [f64; 2]) -> PlanJson {
    let [solve_time_ms, total_time_ms] = times_ms;
    PlanJson {
        provenance: Provenance::of_seed(0),
        truck: args.truck.clone(),
        road: args.road.clone(),
        mass_kg: args.mass_kg,
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

fn sentence(r: &PlanJson) -> String {
    format!(
        "{:.3} kg fuel in {:.1} s ({}); at equal trip time {:.2} % less than cruise control, \
         {:.2} % less than cruise control with 5 km/h overspeed; solved in {:.0} ms",
        r.plan.fuel_g * 1e-3,
        r.plan.trip_time_s,
        r.solver.status.replace('_', " "),
        100.0 * r.saving_frac.vs_set_speed,
        100.0 * r.saving_frac.vs_overspeed,
        r.solver.solve_time_ms,
    )
}

fn csv(rows: &[TripRow]) -> String {
    let mut text =
        "s_m,v_m_s,time_s,gear,drive_force_n,brake_force_n,fuel_g,grade_rad\n".to_owned();
    for r in rows {
        text.push_str(&format!(
            "{},{},{},{},{},{},{},{}\n",
            r.s_m,
            r.v_m_s,
            r.time_s,
            r.gear,
            r.drive_force_n,
            r.brake_force_n,
            r.fuel_g,
            r.grade_rad
        ));
    }
    text
}

/// The paper's Fig. 18: slope, speed, power, fuel, and the gear below.
fn strips(result: &TripResult, overspeed: &[TripRow]) -> Vec<Strip> {
    let drives: [(&str, &[TripRow], &'static str); 3] = [
        ("plan", &result.rows, "#0a7cc4"),
        ("cruise control", &result.baseline_rows, "#8a949e"),
        ("cruise control, 5 km/h overspeed", overspeed, "#e08a1e"),
    ];
    let each = |value: fn(&TripRow) -> f64, style: Style| {
        drives
            .iter()
            .map(|(name, rows, color)| Line {
                name: (*name).to_owned(),
                x: rows.iter().map(|r| r.s_m * 1e-3).collect(),
                y: rows.iter().map(value).collect(),
                color,
                style,
            })
            .collect()
    };
    let slope = Line {
        name: "slope".to_owned(),
        x: result.rows.iter().map(|r| r.s_m * 1e-3).collect(),
        y: result.rows.iter().map(|r| 100.0 * r.grade_rad.tan()).collect(),
        color: "#3a9d6e",
        style: Style::Area,
    };
    vec![
        Strip { title: "slope, %", lines: vec![slope] },
        Strip { title: "speed, km/h", lines: each(|r| r.v_m_s * 3.6, Style::Solid) },
        Strip { title: "power, kW", lines: each(|r| r.engine_power_w * 1e-3, Style::Steps) },
        Strip { title: "fuel, kg", lines: each(|r| r.fuel_g * 1e-3, Style::Solid) },
        Strip { title: "gear", lines: each(|r| f64::from(r.gear), Style::Steps) },
    ]
}
