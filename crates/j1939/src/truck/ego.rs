//! The ego state made of what the bus says, the pose and the truck's sheet.
//!
//! docs/truck.md has the table of sources, steps and ages.

use tractrix_core::{EgoState, Pose, PowertrainSignals, Stamped, TrailerState, VehicleLimits};

use super::heard::Heard;

/// Grams in a kilogram.
const G_PER_KG: f64 = 1e3;

/// The state as of what was heard last.
pub(super) fn ego_state(
    heard: &Heard,
    pose: &Pose,
    limits: &VehicleLimits,
    brake_demand_m_s2: f64,
    fuel_used_g: f64,
) -> EgoState {
    let number = |field: Option<Stamped<f64>>| field.map_or(0.0, |f| f.value);
    let (l, accel_y_m_s2) = (&limits.lateral, number(heard.accel_y_m_s2));
    let steering_wheel_rad = number(heard.steering_wheel_rad);
    EgoState {
        x_m: pose.x_m,
        y_m: pose.y_m,
        z_m: pose.z_m,
        yaw_rad: pose.yaw_rad,
        s_m: pose.s_m,
        d_m: pose.d_m,
        speed_m_s: number(heard.speed_m_s),
        lateral_speed_m_s: pose.lateral_speed_m_s,
        accel_x_m_s2: heard.accel_m_s2,
        accel_y_m_s2,
        yaw_rate_rad_s: number(heard.yaw_rate_rad_s),
        trailer: TrailerState {
            articulation_rad: pose.articulation_rad,
            yaw_rate_rad_s: pose.trailer_yaw_rate_rad_s,
        },
        road_wheel_rad: steering_wheel_rad / l.steering_ratio,
        steering_wheel_rad,
        load_transfer_ratio: (accel_y_m_s2 / l.rollover_accel_m_s2).clamp(-1.0, 1.0),
        powertrain: powertrain(heard, limits, brake_demand_m_s2, fuel_used_g),
    }
}

fn powertrain(
    heard: &Heard,
    limits: &VehicleLimits,
    brake_demand_m_s2: f64,
    fuel_used_g: f64,
) -> PowertrainSignals {
    let p = &limits.powertrain;
    let number = |field: Option<Stamped<f64>>| field.map_or(0.0, |f| f.value);
    let speed_rad_s = number(heard.engine_speed_rad_s);
    let reference_nm = number(heard.reference_nm);
    let engine_torque_nm = number(heard.engine_torque_frac) * reference_nm;
    // SPN 514 is a share of the reference torque as well; the sheet has it where the bus has not
    let friction_nm = match heard.friction_frac {
        Some(friction) if reference_nm > 0.0 => friction.value * reference_nm,
        _ => p.friction_nm.at(speed_rad_s),
    };
    let gear = heard.gear.map_or(0, |gear| u8::try_from(gear.value).unwrap_or(0));
    let index = usize::from(gear.max(1)) - 1;
    let ratio = p.gear_ratios.get(index).copied().unwrap_or(0.0);
    let leverage_1_m = ratio * p.final_drive_ratio / p.wheel_radius_m;
    let efficiency = p.gear_efficiency_frac.get(index).copied().unwrap_or(1.0);
    let closed = gear > 0 && heard.driveline_closed.is_none_or(|closed| closed.value);
    let net_nm = engine_torque_nm - friction_nm - p.auxiliary_power_w / speed_rad_s.max(1.0);
    let force_n = net_nm * leverage_1_m;
    let drive_force_n = match (closed, force_n >= 0.0) {
        (false, _) => 0.0,
        (true, true) => force_n * efficiency,
        (true, false) => force_n / efficiency,
    };
    let brake_n = if heard.brakes_act { limits.road_load.mass_kg * brake_demand_m_s2 } else { 0.0 };
    PowertrainSignals {
        engine_speed_rad_s: speed_rad_s,
        engine_torque_nm,
        engine_friction_torque_nm: friction_nm,
        drive_force_n,
        brake_force_n: brake_n,
        brake_pressure_pa: number(heard.brake_pressure_pa),
        retarder_force_n: retarder_force_n(heard, limits, leverage_1_m, closed),
        gear: if closed { gear } else { 0 },
        shift_in_progress: heard.shifting,
        fuel_rate_g_s: fuel_rate_g_s(heard, limits),
        fuel_used_g,
        engine_power_w: (engine_torque_nm - friction_nm) * speed_rad_s,
    }
}

/// Engine brakes act through the gearbox, a driveline retarder (address 10) behind it.
fn retarder_force_n(heard: &Heard, limits: &VehicleLimits, leverage_1_m: f64, closed: bool) -> f64 {
    let p = &limits.powertrain;
    let rear_1_m = p.final_drive_ratio / p.wheel_radius_m;
    let torque_nm = |index: usize| -> Option<f64> {
        let frac = heard.retarder_frac.get(index).copied().flatten()?.value;
        let reference_nm = heard.retarder_reference_nm.get(index).copied().flatten()?.value;
        Some((-frac).max(0.0) * reference_nm)
    };
    [0, 1, 2]
        .into_iter()
        .filter_map(|index| {
            let behind_gearbox = index == super::DRIVELINE_RETARDER;
            let leverage = if behind_gearbox { rear_1_m } else { leverage_1_m };
            Some(torque_nm(index)? * if behind_gearbox || closed { leverage } else { 0.0 })
        })
        .sum()
}

/// Fuel mass flow, g/s.
pub(super) fn fuel_rate_g_s(heard: &Heard, limits: &VehicleLimits) -> f64 {
    let volume_m3_s = heard.fuel_rate_m3_s.map_or(0.0, |rate| rate.value);
    volume_m3_s * limits.powertrain.fuel_density_kg_m3 * G_PER_KG
}
