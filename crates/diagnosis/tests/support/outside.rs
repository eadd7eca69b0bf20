//! Effects that no catalogue has, in every channel.

use rand_chacha::ChaCha8Rng;

use super::effects::{Acting, Memory, Now, Shape};
use super::random::normal;

/// One effect outside the catalogue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Outside {
    CurveDrag,
    RpmForce,
    TimeForce,
    StepForce,
    PlaceForce,
    SpeedForce,
    ColdForce,
    TorqueDip,
    TorqueTime,
    PedalShape,
    FuelTime,
    FuelAltitude,
    FuelRpm,
    PressureSaturation,
    PressureAmbient,
    YawGain,
    YawNoise,
    TrailerYawGain,
    TrailerYawTime,
    AccelYGain,
    AccelYCoolant,
    GpsAltitude,
    GpsDropouts,
    ShiftTemperature,
    ShiftTime,
    Gusts,
}

use Outside as O;

const CURVE: &[&str] = &[
    "curvature_1_m",
    "steering_wheel_rad",
    "yaw_rate_rad_s",
    "accel_y_m_s2",
    "trailer_yaw_rate_rad_s",
];

/// All of them: usual size, quantity in which each shows, signals that count as right.
pub(crate) const OUTSIDE: &[(Outside, f64, &str, &[&str])] = &[
    (O::CurveDrag, 2000.0, "speed_m_s", CURVE),
    (O::RpmForce, 1500.0, "speed_m_s", &["engine_speed_rpm"]),
    (O::TorqueDip, 0.12, "engine_torque_percent", &["engine_speed_rpm"]),
    (O::FuelTime, 0.10, "fuel_rate_g_s", &["time_s"]),
    (O::PressureSaturation, 0.35, "brake_pressure_kpa", &["xbr_decel_m_s2"]),
    (O::Gusts, 4000.0, "yaw_rate_rad_s", &["yaw_rate_rad_s", "trailer_yaw_rate_rad_s"]),
    (O::AccelYGain, 0.12, "accel_y_m_s2", CURVE),
    (O::TrailerYawTime, 0.004, "trailer_yaw_rate_rad_s", &["time_s"]),
    (O::GpsDropouts, 0.5, "gps_speed_m_s", &["gps_speed_m_s"]),
    (O::StepForce, 1300.0, "speed_m_s", &["time_s"]),
    (O::PlaceForce, 1600.0, "speed_m_s", &["s_map_m", "time_s"]),
    (O::SpeedForce, 1200.0, "speed_m_s", &["speed_m_s"]),
    (O::ColdForce, 1300.0, "speed_m_s", &["ambient_temp_degc"]),
    (O::TorqueTime, 0.10, "engine_torque_percent", &["time_s"]),
    (O::PedalShape, 0.15, "engine_torque_percent", &["accelerator_pedal_frac"]),
    (O::FuelAltitude, 0.12, "fuel_rate_g_s", &["gps_altitude_m", "baro_pressure_pa"]),
    (O::FuelRpm, 0.12, "fuel_rate_g_s", &["engine_speed_rpm"]),
    (O::PressureAmbient, 12.0, "brake_pressure_kpa", &["ambient_temp_degc"]),
    (O::YawGain, 0.08, "yaw_rate_rad_s", CURVE),
    (O::YawNoise, 0.006, "yaw_rate_rad_s", &["yaw_rate_rad_s"]),
    (O::TrailerYawGain, 0.08, "trailer_yaw_rate_rad_s", CURVE),
    (O::AccelYCoolant, 0.08, "accel_y_m_s2", &["coolant_temp_degc"]),
    (O::GpsAltitude, 0.02, "gps_speed_m_s", &["gps_altitude_m", "baro_pressure_pa"]),
    (O::ShiftTemperature, 0.5, "shift_in_process", &["coolant_temp_degc"]),
    (O::ShiftTime, 0.6, "shift_in_process", &["time_s"]),
];

fn bump(x: f64, middle: f64, width: f64) -> f64 {
    let z = (x - middle) / width;
    (-0.5 * z * z).exp()
}

/// Adds an effect to what acts; `dt` since the last call, s.
pub(crate) fn act(
    a: &mut Acting,
    m: &mut Memory,
    (kind, x, shape): (Outside, f64, &Shape),
    now: &Now,
    rng: &mut ChaCha8Rng,
    dt: f64,
) {
    let late = now.time_s / 1500.0;
    match kind {
        O::CurveDrag => {
            let power = shape.at(0, 1.0, 2.0);
            a.force_n += x * (now.curvature.abs() / 0.002).powf(power);
        }
        O::RpmForce => {
            a.force_n += x * bump(now.rpm, shape.at(0, 1150.0, 1450.0), shape.at(1, 50.0, 110.0));
        }
        O::TimeForce => a.force_n += x * late.powf(shape.at(0, 1.0, 2.0)),
        O::StepForce => a.force_n += if late > shape.at(0, 0.3, 0.7) { x } else { 0.0 },
        O::PlaceForce => {
            a.force_n += x * bump(now.place_m, shape.at(0, 5e3, 18e3), shape.at(1, 500.0, 2500.0));
        }
        O::SpeedForce => {
            a.force_n += x * bump(now.speed, shape.at(0, 12.0, 19.0), shape.at(1, 0.8, 1.8));
        }
        O::ColdForce => a.force_n += x * (1.0 - now.ambient_degc / 20.0).clamp(0.0, 1.0),
        O::TorqueDip => {
            a.demand *=
                1.0 - x * bump(now.rpm, shape.at(0, 1150.0, 1400.0), shape.at(1, 40.0, 90.0));
        }
        O::TorqueTime => a.demand *= 1.0 - x * late.min(1.0),
        O::PedalShape => a.demand *= 1.0 - x * 4.0 * now.pedal * (1.0 - now.pedal),
        O::FuelTime => a.fuel *= 1.0 + x * late,
        O::FuelAltitude => a.fuel *= 1.0 + x * now.altitude_m / 1500.0,
        O::FuelRpm => {
            a.fuel *= 1.0 + x * bump(now.rpm, shape.at(0, 1100.0, 1400.0), 100.0);
        }
        O::PressureSaturation => a.pressure[0] *= 1.0 - x * (now.xbr / 1.2).min(1.0),
        O::PressureAmbient => a.pressure[1] += x * ((25.0 - now.ambient_degc) / 20.0).max(0.0),
        O::YawGain => a.yaw[0] *= 1.0 + x,
        O::YawNoise => {
            if (now.time_s / 60.0) as usize % 4 == shape.choice(0, 4) {
                a.yaw[1] += x * normal(rng);
            }
        }
        O::TrailerYawGain => a.trailer_yaw[0] *= 1.0 + x,
        O::TrailerYawTime => a.trailer_yaw[1] += x * late,
        O::AccelYGain => a.accel_y[0] *= 1.0 + x,
        O::AccelYCoolant => a.accel_y[1] += x * (now.coolant_degc - 88.0) / 10.0,
        O::GpsAltitude => a.gps[0] *= 1.0 + x * now.altitude_m / 1500.0,
        O::GpsDropouts => {
            if (now.time_s / 7.0) as usize % 9 == shape.choice(0, 9) {
                a.gps[1] -= x * (1.0 + normal(rng));
            }
        }
        O::ShiftTemperature => a.shift_s += x * ((92.0 - now.coolant_degc) / 10.0).clamp(0.0, 1.0),
        O::ShiftTime => a.shift_s += x * late,
        O::Gusts => {
            let tau = shape.at(0, 0.8, 3.0);
            m.gust += -dt * m.gust / tau + (2.0 * dt / tau).sqrt() * normal(rng);
            a.side_n[0] += 0.25 * x * m.gust;
            a.side_n[1] += 0.75 * x * m.gust;
        }
    }
}
