//! `plan`: the fuel-optimal speed profile of a whole trip, against both cruise controls.

use std::time::Instant;

use clap::Parser;
use planner::pcc::{TripResult, TripRow};
use sim::trip_plan::{COLUMNS, PlannedTrip, TripPlan, TripReport, numbers};

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

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let out = args.out.folder(&["plan.csv", "plan.json", "plan.html"])?;
    let spec = TripPlan {
        truck: args.truck.clone(),
        road: args.road.clone(),
        mass_kg: args.mass_kg,
        set_speed_m_s: args.set_speed_m_s,
        speed_min_m_s: args.speed_min_m_s,
        speed_max_m_s: args.speed_max_m_s,
        trip_time_s: args.trip_time_s,
        eco_roll: args.eco_roll,
    };
    #[expect(clippy::disallowed_methods, reason = "the shell owns the clock")]
    let start = Instant::now();
    let elapsed_ms = || start.elapsed().as_secs_f64() * 1e3;
    let stages = Stages::start();
    stages.show("planning the trip");
    let planned = spec.plan(Provenance::of_seed(0).into(), &elapsed_ms);
    stages.finish();
    let PlannedTrip { result, overspeed_rows, report } = planned.map_err(Failure::of_option)?;
    let json = serde_json::to_string_pretty(&report).map_err(Failure::work)?;
    let title = format!("{} on {}, {:.1} t", args.truck, args.road, args.mass_kg * 1e-3);
    out.write("plan.csv", csv(&result.rows))?;
    out.write("plan.json", &json)?;
    let picture =
        page(&title, &sentence(&report), "distance, km", &strips(&result, &overspeed_rows));
    out.write("plan.html", picture)?;
    out.keep();
    output::result(if args.json { json } else { sentence(&report) }.as_str())
}

fn sentence(r: &TripReport) -> String {
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
    let mut text = COLUMNS.join(",") + "\n";
    for row in rows {
        text.push_str(&numbers(row).map(|x| x.to_string()).join(","));
        text.push('\n');
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
