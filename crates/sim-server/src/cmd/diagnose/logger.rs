//! A simulated drive as a truck's logger would have it: what J1939 messages and sensors make of
//! the true state.
//!
//! Resolutions are those of SAE J1939-71 (wheel speed 1/256 km/h, torque 1 %, engine speed
//! 0.125 rpm, pedal 0.4 %, yaw rate 1/8192 rad/s, ...); noise is that of ordinary truck sensors.
//! Left out: messages slower than the table, delays of the bus.

use std::sync::Arc;

use dynamics::{TruckModel, TruckParameters};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use road::Road;
use sim::{Scenario, Status, World};
use tractrix_core::{BrakeMode, Command, EgoState, GRAVITY_M_S2, RPM_PER_RAD_S, Recorder, Tick};

use super::folder::{STEP_S, Table};
use crate::failure::Failure;

const COLUMNS: [&str; 23] = [
    "time_s",
    "s_map_m",
    "speed_m_s",
    "gps_speed_m_s",
    "gps_altitude_m",
    "heading_rad",
    "accel_x_m_s2",
    "accelerator_pedal_frac",
    "engine_torque_percent",
    "engine_speed_rpm",
    "gear",
    "shift_in_process",
    "engine_brake_frac",
    "xbr_decel_m_s2",
    "brake_pressure_kpa",
    "steering_wheel_rad",
    "yaw_rate_rad_s",
    "trailer_yaw_rate_rad_s",
    "accel_y_m_s2",
    "fuel_rate_g_s",
    "coolant_temp_degc",
    "ambient_temp_degc",
    "grade_frac",
];
/// Column, standard deviation of its noise, resolution (0: none).
const SENSORS: [(&str, f64, f64); 18] = [
    ("s_map_m", 0.3, 0.0),
    ("speed_m_s", 0.01, 1.0 / 256.0 / 3.6),
    ("gps_speed_m_s", 0.03, 0.0),
    ("gps_altitude_m", 1.0, 0.0),
    ("heading_rad", 0.005, 0.0),
    ("accel_x_m_s2", 0.05, 0.0),
    ("accelerator_pedal_frac", 0.0, 0.004),
    ("engine_torque_percent", 0.5, 1.0),
    ("engine_speed_rpm", 1.5, 0.125),
    ("engine_brake_frac", 0.0, 0.004),
    ("xbr_decel_m_s2", 0.0, 1.0 / 2048.0),
    ("brake_pressure_kpa", 0.0, 4.0),
    ("steering_wheel_rad", 0.0, 1.0 / 1024.0),
    ("yaw_rate_rad_s", 8e-4, 1.0 / 8192.0),
    ("trailer_yaw_rate_rad_s", 8e-4, 1.0 / 8192.0),
    ("accel_y_m_s2", 0.05, 1.0 / 2048.0),
    ("fuel_rate_g_s", 0.0, 0.0116),
    ("coolant_temp_degc", 0.0, 1.0),
];
/// 0 °C in K.
const ZERO_DEGC_K: f64 = 273.15;

/// Seeded normal numbers.
pub(super) struct Draw(ChaCha8Rng);

impl Draw {
    pub(super) fn of_seed(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// Uniform in 0 to 1.
    pub(super) fn uniform(&mut self) -> f64 {
        f64::from(self.0.next_u32()) / f64::from(u32::MAX)
    }

    /// Normal with this standard deviation (sum of twelve uniform numbers).
    pub(super) fn normal(&mut self, sigma: f64) -> f64 {
        sigma * ((0..12).map(|_| self.uniform()).sum::<f64>() - 6.0)
    }
}

/// What the sensors and messages make of true values, column by column.
pub(super) fn as_logged(columns: &[&str], values: &mut [f64], draw: &mut Draw) {
    for (column, value) in columns.iter().zip(values) {
        if let Some((_, sigma, step)) = SENSORS.iter().find(|s| s.0 == *column) {
            if *sigma > 0.0 {
                *value += draw.normal(*sigma);
            }
            if *step > 0.0 {
                *value = (*value / step).round() * step;
            }
        }
    }
}

/// The state and command of the latest tick.
#[derive(Default)]
struct Latest {
    ego: EgoState,
    command: Command,
    now_s: f64,
}

impl Recorder for Latest {
    fn record(&mut self, tick: &Tick<'_>) {
        (self.ego, self.command, self.now_s) = (*tick.ego, tick.plan.command, tick.now.seconds());
    }
}

/// Drives a scenario with a truck and logs it.
///
/// # Errors
/// [`Failure::Work`] if the world fails.
pub(super) fn drive(
    name: String,
    scenario: &Scenario,
    road: &Arc<Road>,
    truck: &TruckParameters,
    reported_mass_kg: f64,
    seed: u64,
) -> Result<Table, Failure> {
    let model = TruckModel::new(truck.clone(), scenario.truck.payload_kg).map_err(Failure::work)?;
    let mut world = World::assemble(scenario, seed, Arc::clone(road), Arc::new(model))
        .map_err(Failure::work)?;
    let mut table = Table::new(name, &COLUMNS);
    table.reported_mass_kg = reported_mass_kg;
    let mut draw = Draw::of_seed(seed);
    let mut latest = Latest::default();
    let mut due_s = 0.0;
    while world.tick(&mut latest).map_err(Failure::work)? == Status::Running {
        if latest.now_s + 1e-6 >= due_s {
            due_s += STEP_S;
            let mut row = row(&world, &latest, truck);
            as_logged(&COLUMNS, &mut row, &mut draw);
            table.push(&row);
        }
    }
    Ok(table)
}

fn row(world: &World, latest: &Latest, truck: &TruckParameters) -> [f64; 23] {
    let e = world.truck().model().measured(&latest.ego);
    let (p, c) = (&e.powertrain, &latest.command);
    let patch = world.truck().patch();
    let on_map = world.road().at(latest.ego.s_m, latest.ego.d_m);
    [
        latest.now_s,
        latest.ego.s_m,
        e.speed_m_s,
        latest.ego.speed_m_s,
        patch.altitude_m,
        e.yaw_rad,
        e.accel_x_m_s2 + GRAVITY_M_S2 * patch.grade_rad.sin(),
        c.accelerator_pedal_frac,
        100.0 * p.engine_torque_nm / truck.engine.reference_torque_nm,
        p.engine_speed_rad_s * RPM_PER_RAD_S,
        f64::from(p.gear),
        f64::from(u8::from(p.shift_in_progress)),
        c.retarder_frac,
        if c.brake_mode == BrakeMode::Off { 0.0 } else { c.xbr_decel_m_s2 },
        p.brake_pressure_pa * 1e-3,
        e.steering_wheel_rad,
        e.yaw_rate_rad_s,
        e.trailer.yaw_rate_rad_s,
        e.accel_y_m_s2,
        p.fuel_rate_g_s,
        world.truck().plant().coolant_k - ZERO_DEGC_K,
        patch.air_temperature_k - ZERO_DEGC_K,
        on_map.grade_rad.tan(),
    ]
}
