//! One closed-loop drive: a driver in the truck model on a drawn road.

use diagnosis::Drive;
use dynamics::effects::shift::ShiftPhase;
use dynamics::{RoadPatch, TruckModel, TruckParameters};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use tractrix_core::{BrakeMode, Command, GRAVITY_M_S2, RPM_PER_RAD_S};

use super::effects::{self, Effect, Memory, Now};
use super::logger::{LOGGED, log};
use super::road::{Road, between, normal};

/// Control step, s.
const STEP_S: f64 = 0.01;

/// Where, when and with what a drive goes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Setting {
    pub(crate) payload_kg: f64,
    pub(crate) altitude_m: f64,
    pub(crate) air_degc: f64,
    pub(crate) hilliness: f64,
    pub(crate) warm: bool,
    pub(crate) yaw_rad: f64,
}

/// Factors and offsets within tolerance, drawn per drive.
struct Tolerances {
    truck: TruckParameters,
    sheet_frac: f64,
    gyro: [f64; 2],
    accel: [f64; 2],
    wind: (f64, f64),
}

fn tolerances(truck: &TruckParameters, scale: f64, rng: &mut ChaCha8Rng) -> Tolerances {
    let mut t = truck.clone();
    let mut n = |sigma: f64| scale * sigma * normal(rng);
    t.resistance.rolling_coeff *= 1.0 + n(0.02);
    t.resistance.drag_area_m2 *= 1.0 + n(0.015);
    t.resistance.headwind_m_s += n(0.3);
    t.resistance.crosswind_to_left_m_s += n(0.3);
    t.engine.friction_scale_coeff *= 1.0 + n(0.015);
    t.engine.fuel.per_kw_g_s *= 1.0 + n(0.005);
    t.engine.slow_lag_s = (t.engine.slow_lag_s + n(0.01)).max(0.02);
    t.engine.engine_brake_constant_nm *= 1.0 + n(0.02);
    t.brake.gain_scale_coeff *= 1.0 + n(0.015);
    t.instruments.grade_bias_frac += n(1.5e-4);
    t.instruments.bank_offset_rad += n(4e-4);
    t.instruments.speed_scale_coeff *= 1.0 + n(0.001);
    t.instruments.yaw_rate_bias_rad_s += n(3e-4);
    t.instruments.map_shift_m += n(3.0);
    t.lateral.steering.offset_rad += n(0.005);
    t.lateral.steering.ratio *= 1.0 + n(0.004);
    for c in &mut t.lateral.tyres.stiffness_scale {
        *c *= 1.0 + n(0.01);
    }
    let sheet_frac = 1.0 + n(0.005);
    let (gyro, accel) = ([0.0, n(3e-4)], [n(0.02), n(0.02)]);
    Tolerances { truck: t, sheet_frac, gyro, accel, wind: (n(0.2), n(0.2)) }
}

/// Drives and logs; returns the drive as a logger has it.
pub(crate) fn drive(
    name: &str,
    base: &TruckParameters,
    hidden: &[Effect],
    setting: &Setting,
    duration_s: f64,
    tolerance: f64,
    rng: &mut ChaCha8Rng,
) -> Result<Drive, dynamics::DynamicsError> {
    let t = tolerances(base, tolerance, rng);
    let mut truck = t.truck;
    // Load sheet and tyres: the sheet's loads set the tyre stiffness, as in the reference data.
    let mut sheet = truck.clone();
    sheet.lateral.payload.mass_kg = setting.payload_kg;
    sheet.lateral.payload.cg_behind_hitch_m = 5.764;
    if rng.random::<f64>() < 0.5 {
        sheet.lateral.payload.cg_behind_hitch_m = truck.lateral.payload.cg_behind_hitch_m;
    }
    let mut tyres = sheet.lateral.tyres;
    tyres.stiffness_scale = [1.0; 3];
    truck.lateral.tyres.axle_stiffness_n_rad =
        Some(tyres.stiffness_n_rad(&sheet.lateral.static_axle_load_n()));
    truck.instruments.mass_scale_coeff *= t.sheet_frac;
    // Any course of the full load: lost part = altitude in km.
    truck.engine.derate_altitude_m = 0.0;
    truck.engine.derate_altitude_1_m = 1e-3;
    let mut models = Vec::new();
    for level in 0..5 {
        let mut p = truck.clone();
        let cold = 100.0 - 10.0 * f64::from(level);
        p.shift.duration_scale_coeff *= effects::shift_factor(hidden, cold);
        models.push(TruckModel::new(p, setting.payload_kg)?);
    }
    let sheet_kg = sheet.lateral.total_mass_kg();
    let instruments = truck.instruments;
    let road = Road::draw(rng, 25.0 * duration_s + 2000.0, setting.altitude_m, setting.hilliness);
    let mut s = models[0].initial_state(0.0, 0.0, setting.yaw_rad, 0.5);
    let mut memory = Memory::default();
    let samples = (duration_s / Drive::STEP_S) as usize;
    let mut truth: Vec<Vec<f64>> = (0..LOGGED).map(|_| Vec::with_capacity(samples)).collect();
    let (mut integral, mut course, mut offset, mut wheel, mut hand) =
        (0.0_f64, setting.yaw_rad, 0.0_f64, 0.0_f64, 0.0_f64);
    let (mut held_pedal, mut foot, mut slowing) = (0.0, 0.0, 0.0);
    let (mut swing_goal, mut swing) = (0.0, 0.0);
    let (mut last_vy, mut target) = (0.0, 10.0);
    let mut altitude = road.altitude(0.0);
    let air_k = setting.air_degc + 273.15;
    for i in 0..samples * 5 {
        let time_s = i as f64 * STEP_S;
        let place = s.distance_m;
        // The driver.
        let v = s.speed_m_s;
        if i % 10 == 0 {
            target = road.target(place, 0.45).min(24.3);
        }
        let error = target - v;
        integral = (integral + 0.04 * error * STEP_S).clamp(-0.2, 1.0);
        let wish = 0.35 * error + integral;
        let pedal = wish.clamp(0.0, 1.0);
        foot += (pedal - foot).clamp(-2.5 * STEP_S, 1.5 * STEP_S);
        if i % 5 == 0 {
            held_pedal = foot;
        }
        let stage =
            if wish < -0.15 && v > 6.0 { ((-wish - 0.15) * 1.2).clamp(0.0, 1.0) } else { 0.0 };
        let stage = (stage * 100.0).round() / 100.0;
        let xbr = if error < -0.8 { (0.35 * (-error - 0.8)).clamp(0.0, 2.0) } else { 0.0 };
        slowing += (xbr - slowing) * STEP_S / 0.3;
        let xbr = if slowing < 0.02 { 0.0 } else { (slowing * 2048.0_f64).round() / 2048.0 };
        if rng.random::<f64>() < STEP_S / 25.0 {
            swing_goal = between(rng, -0.8, 0.8);
        }
        swing += (swing_goal - swing) * STEP_S / 1.5;
        let ahead = road.curvature(place + 0.35 * v);
        let heading = s.lateral.yaw_rad - course;
        let behind = truck.lateral.tractor.drive_group_behind_cg_m * s.lateral.yaw_rate_rad_s;
        offset += STEP_S * (v * heading + s.lateral.cg_lateral_speed_m_s - behind);
        course += STEP_S * v * road.curvature(place);
        hand += STEP_S * (-hand / 0.4) + 0.006 * STEP_S.sqrt() * normal(rng);
        let steer = 4.37 * ahead - 0.0025 * (offset - swing) - 0.09 * heading;
        wheel += (24.0 * steer + hand - wheel) * STEP_S / 0.15;
        // The effects.
        let now = Now {
            time_s,
            speed: v,
            rpm: s.engine_speed_rad_s * RPM_PER_RAD_S,
            pedal: held_pedal,
            stage,
            xbr,
            coolant_degc: s.coolant_k - 273.15,
            ambient_degc: setting.air_degc,
            altitude_m: altitude,
            curvature: road.curvature(place),
            pressure_kpa: models[0].mean_pressure_pa(&s) * 1e-3,
            mass_kg: models[0].mass_kg(),
            engaged: s.shift.phase == ShiftPhase::Engaged,
            warm: setting.warm,
        };
        let a = effects::act(hidden, &mut memory, &now, rng, STEP_S);
        let pressure_pa = 101_325.0 * (-now.altitude_m / 8434.0).exp();
        let grade = road.grade(place) + instruments.grade_bias_frac;
        altitude += STEP_S * v * grade / (1.0 + grade * grade).sqrt();
        let force = a.force_n / (now.mass_kg * GRAVITY_M_S2);
        let side = a.side_n / (now.mass_kg * GRAVITY_M_S2);
        let patch = RoadPatch {
            grade_rad: (road.grade(place)).atan() + force,
            bank_rad: -side,
            wind_m_s: t.wind,
            air_temperature_k: air_k,
            air_pressure_pa: pressure_pa,
            altitude_m: 1e3 * a.derate,
            ..RoadPatch::default()
        };
        let command = Command {
            accelerator_pedal_frac: held_pedal * a.pedal,
            // the brake controller knows the load sheet only
            xbr_decel_m_s2: xbr * sheet_kg / now.mass_kg * a.pressure,
            brake_mode: BrakeMode::Addition,
            steering_wheel_rad: wheel,
            retarder_frac: stage,
            ..Command::default()
        };
        let level = ((100.0 - now.coolant_degc) / 10.0).clamp(0.0, 4.0) as usize;
        let model = &models[level];
        if i % 5 == 0 {
            let bank = instruments.bank_offset_rad - side;
            let ego = model.ego_state(&s, &patch);
            let measured = model.measured(&ego);
            let vy = s.lateral.cg_lateral_speed_m_s;
            let accel_y = if i == 0 { 0.0 } else { (vy - last_vy) / STEP_S };
            let torque = s.engine_torque_nm;
            let row = [
                instruments.map_position_m(place),
                measured.speed_m_s,
                v * a.gps,
                now.altitude_m,
                s.lateral.yaw_rad,
                s.accel_m_s2 + GRAVITY_M_S2 * grade / (1.0 + grade * grade).sqrt() + t.accel[0],
                held_pedal,
                torque / 27.0,
                now.rpm,
                f64::from(s.shift.gear),
                if now.engaged { 0.0 } else { 1.0 },
                stage,
                xbr,
                now.pressure_kpa,
                wheel,
                measured.yaw_rate_rad_s * a.yaw,
                (ego.trailer.yaw_rate_rad_s + t.gyro[1]) * a.trailer_yaw,
                (accel_y + v * s.lateral.yaw_rate_rad_s + GRAVITY_M_S2 * bank) * a.accel_y
                    + t.accel[1],
                fuel_g_s(&truck, torque, now.rpm)
                    * a.fuel
                    * effects::low_load(hidden, torque, now.rpm),
                now.coolant_degc,
                setting.air_degc - 0.0065 * (now.altitude_m - setting.altitude_m),
                pressure_pa,
                road.grade(instruments.map_position_m(place)),
                road.curvature(place),
            ];
            for (column, x) in truth.iter_mut().zip(row) {
                column.push(x);
            }
        }
        last_vy = s.lateral.cg_lateral_speed_m_s;
        s = model.step(&s, &command, &patch, STEP_S)?;
    }
    let mut out = Drive::new(name, 0.0, samples);
    out.reported_mass_kg = Some(sheet_kg.round());
    out.tyres_warm_at_start = Some(setting.warm);
    log(&mut out, &truth, rng);
    Ok(out)
}

/// The data sheet's fuel line, also at no torque (the reference data have no overrun cut-off).
fn fuel_g_s(truck: &TruckParameters, indicated_nm: f64, rpm: f64) -> f64 {
    let f = &truck.engine.fuel;
    f.constant_g_s + f.per_rpm_g_s * rpm + f.per_kw_g_s * indicated_nm * rpm / 9549.3
}
