//! The whole loop on a built-in example: a simulated truck with a hidden effect is measured on the
//! built-in highway; after the diagnosis the truck file, the extended truck and the true truck
//! drive the same road in closed loop.
//!
//! Cause, size, loads, speeds, weather, traffic, tolerances and noise are drawn by the seed. The
//! diagnosis sees the drives only; `hidden.json` holds the answer.

use std::sync::Arc;

use diagnosis::collect;
use diagnosis::logger::Draw;
use dynamics::catalogue::{Cause, Estimate, cause};
use dynamics::{Overlay, TruckModel, TruckParameters};
use road::Road;
use serde::Serialize;
use sim::{Scenario, Status, TrafficKind, World};

use super::folder;
use super::logger::drive;
use crate::failure::Failure;
use crate::out_folder::OutFolder;
use crate::provenance::Provenance;
use shell::Threads;

/// Truck of the example, unless another is asked for.
pub(super) const TRUCK: &str = "reference";
/// Causes that the highway excites.
const CAUSES: [&str; 8] = [
    "rolling_resistance",
    "air_drag",
    "mass",
    "dragging_brake",
    "shift_duration",
    "turbo_lag",
    "steering_ratio",
    "cornering_stiffness_trailer",
];
/// Drives with the hidden effect, and drives in order.
const DRIVES: usize = 8;
const CLEAN_DRIVES: usize = 4;
/// Least payload of a truck that is lighter than modelled, in what it lacks: room for the scatter of
/// the load.
const SPARE: f64 = 1.25;
/// Payload of the trip that closes the loop, kg.
const TRIP_PAYLOAD_KG: f64 = 36_000.0;
/// Spacing of the trip's samples, m.
const TRIP_STEP_M: f64 = 50.0;

/// What was hidden.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Hidden {
    #[serde(skip)]
    truck: TruckParameters,
    /// Id of the cause.
    pub(super) id: &'static str,
    /// What it means.
    pub(super) meaning: &'static str,
    /// Size, in the catalogue's terms.
    pub(super) size: f64,
    /// Unit of the size.
    pub(super) unit: &'static str,
}

/// Measures the truck with a hidden effect, and the truck in order: writes `drives`, `baseline`
/// and `hidden.json` into `out`.
///
/// # Errors
/// [`Failure`] if a file cannot be written or a world fails.
pub(super) fn measure(
    out: &OutFolder,
    truck: &TruckParameters,
    seed: u64,
    threads: &Threads,
) -> Result<Hidden, Failure> {
    let drives_at = out.begin("drives")?;
    let hidden = hide(truck, seed)?;
    let scenario = Scenario::builtin("highway-sag").map_err(Failure::work)?;
    let road = Arc::new(Road::load(&scenario.road).map_err(Failure::work)?);
    let tables = collect(threads, DRIVES + CLEAN_DRIVES, |i| {
        let clean = i >= DRIVES;
        let of = if clean { truck } else { &hidden.truck };
        let name = if clean { format!("clean_{}", i - DRIVES) } else { format!("drive_{i}") };
        one_drive(name, &scenario, &road, of, seed, i as u64)
    });
    let mut tables: Vec<diagnosis::Table> = tables.into_iter().collect::<Result<_, _>>()?;
    let clean = tables.split_off(DRIVES);
    folder::write(&drives_at, &truck.name, &tables)?;
    folder::write(&out.begin("baseline")?, &truck.name, &clean)?;
    #[derive(Serialize)]
    struct Answer<'a> {
        #[serde(flatten)]
        provenance: Provenance,
        #[serde(flatten)]
        hidden: &'a Hidden,
    }
    let answer = Answer { provenance: Provenance::of_seed(seed), hidden: &hidden };
    let text = serde_json::to_string_pretty(&answer).map_err(Failure::work)?;
    out.write("hidden.json", text)?;
    Ok(hidden)
}

/// Draws a cause and its size: one to two of the catalogue's standard deviations, either sign
/// where the bounds allow it.
fn hide(truck: &TruckParameters, seed: u64) -> Result<Hidden, Failure> {
    let mut draw = Draw::of_seed(seed);
    let id = CAUSES[((draw.uniform() * CAUSES.len() as f64) as usize).min(CAUSES.len() - 1)];
    let unknown = || Failure::Work(format!("{id} is not in the catalogue"));
    let c: &Cause = cause(id).ok_or_else(unknown)?;
    let p = c.sizes.first().ok_or_else(unknown)?;
    let sign = if draw.uniform() < 0.5 && p.bounds[0] < 0.0 { -1.0 } else { 1.0 };
    let size = (sign * p.prior_sigma * (1.0 + draw.uniform())).clamp(p.bounds[0], p.bounds[1]);
    let overlay = c
        .overlay(truck, &truck.name, &[Estimate { size, sigma: 0.0 }], "hidden by the example")
        .map_err(Failure::work)?;
    Ok(Hidden {
        truck: truck.with_overlay(&overlay).map_err(Failure::work)?,
        id,
        meaning: if size >= 0.0 { c.higher } else { c.lower },
        size,
        unit: p.unit,
    })
}

/// One drive with its own load, speed, weather, traffic and tolerances.
fn one_drive(
    name: String,
    scenario: &Scenario,
    road: &Arc<Road>,
    truck: &TruckParameters,
    seed: u64,
    index: u64,
) -> Result<diagnosis::Table, Failure> {
    let seed = seed.wrapping_mul(1_000).wrapping_add(index + 1);
    let mut draw = Draw::of_seed(seed ^ 0x5eed);
    let mut scenario = scenario.clone();
    let payload_kg = (draw.uniform() * 36_000.0 / 500.0).round() * 500.0;
    scenario.stack.set_speed_m_s = 18.0 + 5.0 * draw.uniform();
    scenario.weather.air_temperature_k = 278.15 + 25.0 * draw.uniform();
    let mut truck = truck.clone();
    truck.resistance.rolling_coeff *= 1.0 + draw.normal(0.01);
    truck.resistance.drag_area_m2 *= 1.0 + draw.normal(0.01);
    truck.resistance.headwind_m_s += draw.normal(0.3);
    truck.instruments.yaw_rate_bias_rad_s += draw.normal(2e-4);
    let mut sheet = truck.clone();
    sheet.instruments.mass_scale_coeff = 1.0;
    let of_sheet = |payload_kg| TruckModel::new(sheet.clone(), payload_kg).map_err(Failure::work);
    // A load sheet that says too much leaves something to carry.
    let tare_kg = of_sheet(0.0)?.mass_kg();
    let least_kg = tare_kg * (1.0 / truck.instruments.mass_scale_coeff - 1.0).max(0.0);
    let payload_kg = payload_kg.max(least_kg * SPARE);
    let reported = of_sheet(payload_kg)?.mass_kg();
    scenario.truck.payload_kg = payload_kg + draw.normal(0.004) * reported;
    scenario.truck.payload_kg = scenario.truck.payload_kg.max(least_kg);
    drive(name, &scenario, road, &truck, reported, seed)
}

/// The same trip with three trucks.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct ClosedLoop {
    road: String,
    payload_kg: f64,
    truck_file: Trip,
    extended_truck: Trip,
    true_truck: Trip,
    speed_rmse_m_s: Pair,
    trip_time_error_s: Pair,
    fuel_error_frac: Pair,
}

/// Error against the true truck.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Pair {
    before: f64,
    after: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct Trip {
    trip_time_s: f64,
    fuel_g: f64,
    s_m: Vec<f64>,
    speed_m_s: Vec<f64>,
}

/// Drives the highway in closed loop with the truck file, the extended truck and the true truck.
///
/// # Errors
/// [`Failure::Work`] if a world fails.
pub(super) fn close_the_loop(
    truck: &TruckParameters,
    hidden: &Hidden,
    overlay: Option<&Overlay>,
) -> Result<ClosedLoop, Failure> {
    let extended = overlay.map_or_else(|| Ok(truck.clone()), |o| truck.with_overlay(o));
    let mut scenario = Scenario::builtin("highway-sag").map_err(Failure::work)?;
    scenario.traffic.source = TrafficKind::None;
    scenario.truck.payload_kg = TRIP_PAYLOAD_KG;
    let road = Arc::new(Road::load(&scenario.road).map_err(Failure::work)?);
    let before = trip(&scenario, &road, truck)?;
    let after = trip(&scenario, &road, &extended.map_err(Failure::work)?)?;
    let real = trip(&scenario, &road, &hidden.truck)?;
    let pair = |f: &dyn Fn(&Trip) -> f64| Pair { before: f(&before), after: f(&after) };
    Ok(ClosedLoop {
        speed_rmse_m_s: pair(&|t| {
            let squares: Vec<f64> =
                t.speed_m_s.iter().zip(&real.speed_m_s).map(|(a, b)| (a - b) * (a - b)).collect();
            (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
        }),
        trip_time_error_s: pair(&|t| t.trip_time_s - real.trip_time_s),
        fuel_error_frac: pair(&|t| t.fuel_g / real.fuel_g - 1.0),
        road: scenario.road,
        payload_kg: TRIP_PAYLOAD_KG,
        truck_file: before,
        extended_truck: after,
        true_truck: real,
    })
}

fn trip(scenario: &Scenario, road: &Arc<Road>, truck: &TruckParameters) -> Result<Trip, Failure> {
    let model = TruckModel::new(truck.clone(), scenario.truck.payload_kg).map_err(Failure::work)?;
    let mut world =
        World::assemble(scenario, 1, Arc::clone(road), Arc::new(model)).map_err(Failure::work)?;
    let mut out = Trip { trip_time_s: 0.0, fuel_g: 0.0, s_m: Vec::new(), speed_m_s: Vec::new() };
    let mut due_m = scenario.ego.s_m;
    while world.tick(&mut ()).map_err(Failure::work)? == Status::Running {
        let ego = world.truck().state();
        if ego.s_m >= due_m {
            out.s_m.push(due_m);
            out.speed_m_s.push(ego.speed_m_s);
            due_m += TRIP_STEP_M;
        }
    }
    let summary = world.summary();
    (out.trip_time_s, out.fuel_g) = (summary.duration_s, summary.fuel_g);
    Ok(out)
}

impl ClosedLoop {
    /// The result as a sentence.
    pub(super) fn sentence(&self) -> String {
        format!(
            "The same trip in closed loop ({}, {:.0} t payload): fuel {:+.1} % off with the truck \
             file, {:+.1} % with the extended truck; trip time {:+.1} s and {:+.1} s",
            self.road,
            self.payload_kg * 1e-3,
            100.0 * self.fuel_error_frac.before,
            100.0 * self.fuel_error_frac.after,
            self.trip_time_error_s.before,
            self.trip_time_error_s.after,
        )
    }
}
