//! A planned drive, driven in the truck model and logged.

use dynamics::effects::resistance::air_above;
use dynamics::{RoadPatch, TruckModel, TruckParameters};
use tractrix_core::{BrakeMode, Command, ZERO_DEGC_K};

use super::manoeuvre::{Foot, Plan, Until};
use crate::studies::logger::{Draw, ON_BOARD, Sample, as_logged};
use crate::{Channel, DiagnosisError, Drive};

/// Payload that "loaded" means, kg.
const FULL_PAYLOAD_KG: f64 = 34_000.0;
/// Step of the driver, s.
const CONTROL_S: f64 = 0.01;
/// Pedal per m/s of speed error, and per m of distance error.
const DRIVER: (f64, f64) = (0.4, 0.05);
/// How fast the pedal moves, 1/s.
const FOOT_RATE_1_S: f64 = 2.5;
/// Air of the standard atmosphere at sea level, K and Pa (ISO 2533).
const SEA_LEVEL: (f64, f64) = (288.15, 101_325.0);

/// Drives a plan with the truck of the truck file, as a logger has it.
pub(super) fn drive(
    name: String,
    truck: &TruckParameters,
    plan: &Plan,
    draw: &mut Draw,
) -> Result<Drive, DiagnosisError> {
    let failed = |e: dynamics::DynamicsError| DiagnosisError::Truck(e.to_string());
    let payload_kg = plan.payload_frac * FULL_PAYLOAD_KG;
    let model = TruckModel::new(truck.clone(), payload_kg).map_err(failed)?;
    let lateral = &truck.lateral;
    let base_m = lateral.tractor.steer_axle_ahead_of_cg_m + lateral.tractor.drive_group_behind_cg_m;
    let mut s = model.initial_state(0.0, 0.0, plan.heading_rad, plan.start_m_s);
    s.tyre_warmth = if plan.warm { 1.0 } else { 0.0 };
    let (mut foot, mut altitude_m) = (0.0_f64, plan.altitude_m);
    let mut rows: Vec<[f64; ON_BOARD]> = Vec::new();
    let mut control = 0_u64;
    for step in plan.steps {
        let mut wished_m = 0.0_f64;
        let steps = (step.longest_s / CONTROL_S) as u64;
        for k in 0..steps {
            let v = s.speed_m_s;
            let ended = match step.until {
                Until::Time => false,
                Until::Above(end) => v >= end,
                Until::Below(end) => v <= end,
            };
            if ended {
                break;
            }
            let wish = match step.foot {
                Foot::Pedal(frac) => frac,
                Foot::Speed(speed) => {
                    let error = speed - v;
                    wished_m = (wished_m + error * CONTROL_S).clamp(0.0, 20.0);
                    DRIVER.0 * error + DRIVER.1 * wished_m
                }
            };
            foot += (wish.clamp(0.0, 1.0) - foot)
                .clamp(-FOOT_RATE_1_S * CONTROL_S, FOOT_RATE_1_S * CONTROL_S);
            let decel_m_s2 = match step.foot {
                Foot::Speed(speed) if v < speed => 0.0,
                _ => step.decel_m_s2,
            };
            let phase = if step.period_s > 0.0 {
                let turns = k as f64 * CONTROL_S / step.period_s;
                (core::f64::consts::TAU * turns).sin()
            } else {
                1.0
            };
            let curvature_1_m = step.curvature_1_m * phase;
            let command = Command {
                accelerator_pedal_frac: foot,
                xbr_decel_m_s2: decel_m_s2,
                brake_mode: if decel_m_s2 > 0.0 { BrakeMode::Addition } else { BrakeMode::Off },
                steering_wheel_rad: lateral.steering.ratio * base_m * curvature_1_m,
                retarder_frac: step.engine_brake_frac,
                ..Command::default()
            };
            let grade_frac = grade(plan, s.distance_m);
            altitude_m += CONTROL_S * v * grade_frac.atan().sin();
            let patch = RoadPatch {
                grade_rad: grade_frac.atan(),
                altitude_m,
                air_temperature_k: plan.air_degc + ZERO_DEGC_K,
                air_pressure_pa: air_above(SEA_LEVEL, altitude_m).1,
                ..RoadPatch::default()
            };
            if control.is_multiple_of((Drive::STEP_S / CONTROL_S).round() as u64) {
                let mut ego = model.ego_state(&s, &patch);
                ego.s_m = s.distance_m;
                let sample = Sample {
                    model: &model,
                    ego: &ego,
                    command: &command,
                    patch: &patch,
                    coolant_k: s.coolant_k,
                    map_grade_frac: grade_frac,
                    map_curvature_1_m: curvature_1_m,
                };
                let mut row = sample.row();
                for (channel, x) in Channel::on_board().zip(&mut row) {
                    *x = as_logged(channel, *x, draw);
                }
                rows.push(row);
            }
            control += 1;
            s = model.step(&s, &command, &patch, CONTROL_S).map_err(failed)?;
        }
    }
    let mut out = Drive::new(&name, 0.0, rows.len());
    out.reported_mass_kg = Some(model.mass_kg() / model.parameters().instruments.mass_scale_coeff);
    out.tyres_warm_at_start = Some(plan.warm);
    for (k, channel) in Channel::on_board().enumerate() {
        out.set(channel, rows.iter().map(|r| r[k]).collect());
    }
    Ok(out)
}

/// Grade at a distance: constant, or up and down in half waves of a sine.
fn grade(plan: &Plan, distance_m: f64) -> f64 {
    if plan.wave_m > 0.0 {
        plan.grade_frac * (core::f64::consts::TAU * distance_m / plan.wave_m).sin()
    } else {
        plan.grade_frac
    }
}
