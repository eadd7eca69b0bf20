//! Hidden effects: every cause of the catalogue with shapes of its own, and effects outside it.

use dynamics::TruckParameters;
use dynamics::catalogue::{Estimate, cause};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::road::between;

/// What is wrong with the truck, beyond its tolerances.
#[derive(Debug, Clone)]
pub(crate) enum Effect {
    /// A cause of the catalogue: id, size in the catalogue's unit, and a drawn shape.
    Cause { id: &'static str, size: f64, shape: Shape },
    /// An effect that the catalogue does not have.
    Outside { kind: Outside, size: f64 },
}

/// How an effect looks beyond what the truck file can say.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Shape {
    /// Variant where the effect has several forms.
    pub(crate) variant: u8,
    /// Offset of the threshold, in prior spreads of the catalogue.
    pub(crate) threshold: f64,
    /// Factor on the width, the time constant or the knee.
    pub(crate) width: f64,
    /// Direction of a vector, rad.
    pub(crate) angle: f64,
}

impl Shape {
    pub(crate) fn draw(rng: &mut ChaCha8Rng) -> Self {
        Self {
            variant: rng.random::<u8>(),
            threshold: between(rng, -1.0, 1.0),
            width: between(rng, -0.4, 0.4).exp(),
            angle: between(rng, 0.0, core::f64::consts::TAU),
        }
    }
}

/// Effects outside the catalogue: channel in which it shows, signal that it follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Outside {
    /// Drag force with the square of the curvature.
    CurveDrag,
    /// Force near one engine speed.
    RpmForce,
    /// Force that grows along the drive.
    TimeForce,
    /// Force on one stretch of ambient temperature.
    AltitudeForce,
    /// Torque dip near one engine speed.
    TorqueDip,
    /// Torque falls along the drive.
    TorqueTime,
    /// Fuel grows with the ambient temperature or altitude.
    FuelAltitude,
    /// Fuel has a bump over the engine speed.
    FuelRpm,
    /// Brake pressure falls short at large demand.
    PressureSaturation,
    /// Yaw sensor gain.
    YawGain,
    /// Trailer gyro gain.
    TrailerYawGain,
    /// Lateral accelerometer gain.
    AccelYGain,
    /// GPS speed off with the altitude.
    GpsAltitude,
    /// Shifts slower when the coolant is cold.
    ShiftTemperature,
    /// Side gusts.
    Gusts,
}

/// All of them, with the quantity in which each shows and signals that count as right.
pub(crate) const OUTSIDE: &[(Outside, f64, &str, &[&str])] = &[
    (
        Outside::CurveDrag,
        2500.0,
        "speed_m_s",
        &["curvature_1_m", "steering_wheel_rad", "yaw_rate_rad_s", "accel_y_m_s2"],
    ),
    (Outside::RpmForce, 1500.0, "speed_m_s", &["engine_speed_rpm"]),
    (Outside::TimeForce, 1500.0, "speed_m_s", &["time_s"]),
    (Outside::AltitudeForce, 1500.0, "speed_m_s", &["gps_altitude_m"]),
    (Outside::TorqueDip, 0.12, "engine_torque_percent", &["engine_speed_rpm"]),
    (Outside::TorqueTime, 0.10, "engine_torque_percent", &["time_s"]),
    (Outside::FuelAltitude, 0.12, "fuel_rate_g_s", &["gps_altitude_m"]),
    (Outside::FuelRpm, 0.12, "fuel_rate_g_s", &["engine_speed_rpm"]),
    (
        Outside::PressureSaturation,
        0.35,
        "brake_pressure_kpa",
        &["xbr_decel_m_s2", "brake_pressure_kpa"],
    ),
    (
        Outside::YawGain,
        0.08,
        "yaw_rate_rad_s",
        &["yaw_rate_rad_s", "curvature_1_m", "steering_wheel_rad", "accel_y_m_s2"],
    ),
    (
        Outside::TrailerYawGain,
        0.08,
        "trailer_yaw_rate_rad_s",
        &[
            "trailer_yaw_rate_rad_s",
            "yaw_rate_rad_s",
            "curvature_1_m",
            "steering_wheel_rad",
            "accel_y_m_s2",
        ],
    ),
    (
        Outside::AccelYGain,
        0.10,
        "accel_y_m_s2",
        &["accel_y_m_s2", "yaw_rate_rad_s", "curvature_1_m", "steering_wheel_rad"],
    ),
    (Outside::GpsAltitude, 0.02, "gps_speed_m_s", &["gps_altitude_m"]),
    (Outside::ShiftTemperature, 0.5, "shift_in_process", &["coolant_temp_degc", "time_s"]),
    (Outside::Gusts, 3000.0, "yaw_rate_rad_s", &["gusts"]),
];

/// Effects whose shape the generator makes itself, so that it need not be the library's.
const OWN_SHAPE: &[&str] = &[
    "tyre_warmup",
    "fan_load",
    "altitude_derate",
    "heat_derate",
    "brake_fade",
    "hidden_retarder",
    "fuel_map_low_load",
];

/// The truck with the effects that its file can say.
pub(crate) fn truck(
    base: &TruckParameters,
    effects: &[Effect],
) -> Result<TruckParameters, dynamics::DynamicsError> {
    let mut truck = base.clone();
    for e in effects {
        let Effect::Cause { id, size, shape } = e else { continue };
        if OWN_SHAPE.contains(id) {
            continue;
        }
        let Some(c) = cause(id) else { continue };
        let sizes = match c.sizes.len() {
            2 => vec![size * shape.angle.cos(), size * shape.angle.sin()],
            _ => vec![*size],
        };
        let estimates: Vec<Estimate> =
            sizes.iter().map(|s| Estimate { size: *s, sigma: 0.0 }).collect();
        let overlay = c.overlay(&truck, &truck.name, &estimates, "hidden")?;
        truck = truck.with_overlay(&overlay)?;
    }
    Ok(truck)
}

/// What an effect may look at, at one moment of the drive.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Now {
    pub(crate) time_s: f64,
    pub(crate) speed: f64,
    pub(crate) rpm: f64,
    pub(crate) pedal: f64,
    pub(crate) stage: f64,
    pub(crate) xbr: f64,
    pub(crate) coolant_degc: f64,
    pub(crate) ambient_degc: f64,
    pub(crate) altitude_m: f64,
    pub(crate) curvature: f64,
    pub(crate) pressure_kpa: f64,
    pub(crate) mass_kg: f64,
    pub(crate) engaged: bool,
    pub(crate) warm: bool,
}

/// What the effects with shapes of their own do now.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Acting {
    /// Force against the motion, N.
    pub(crate) force_n: f64,
    /// Part of the full load that is lost.
    pub(crate) derate: f64,
    /// Factor on the pedal that the engine sees.
    pub(crate) pedal: f64,
    /// Factor on the pressure demand.
    pub(crate) pressure: f64,
    /// Factor on the logged fuel.
    pub(crate) fuel: f64,
    /// Factors on logged yaw rate, trailer yaw rate, lateral acceleration, GPS speed.
    pub(crate) yaw: f64,
    pub(crate) trailer_yaw: f64,
    pub(crate) accel_y: f64,
    pub(crate) gps: f64,
    /// Side force of gusts, N.
    pub(crate) side_n: f64,
}

/// Memory of the effects.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Memory {
    fan_on: bool,
    brake_k: f64,
    gust_n: f64,
}

fn knee(x: f64, width: f64) -> f64 {
    // soft maximum of zero and x
    0.5 * (x + (x * x + width * width).sqrt())
}

/// Advances the memory by `dt` and says what acts.
pub(crate) fn act(
    effects: &[Effect],
    m: &mut Memory,
    now: &Now,
    rng: &mut ChaCha8Rng,
    dt: f64,
) -> Acting {
    let mut a = Acting {
        force_n: 0.0,
        derate: 0.0,
        pedal: 1.0,
        pressure: 1.0,
        fuel: 1.0,
        yaw: 1.0,
        trailer_yaw: 1.0,
        accel_y: 1.0,
        gps: 1.0,
        side_n: 0.0,
    };
    let service_n = 400.0 * now.pressure_kpa;
    m.brake_k += dt * (service_n * now.speed / 200e3 - m.brake_k / 600.0);
    let eta = 0.98 * 0.97;
    for e in effects {
        match e {
            Effect::Cause { id, size, shape } => match *id {
                "tyre_warmup" if !now.warm => {
                    let tau = 1500.0 * shape.width;
                    a.force_n += 0.0062 * 9.81 * now.mass_kg * size * (-now.time_s / tau).exp();
                }
                "fan_load" => {
                    let start = 94.0 + 3.0 * shape.threshold;
                    let hysteresis = if shape.variant % 2 == 0 { 3.0 * shape.width } else { 0.3 };
                    if now.coolant_degc > start {
                        m.fan_on = true;
                    }
                    if now.coolant_degc < start - hysteresis {
                        m.fan_on = false;
                    }
                    if m.fan_on && now.engaged && now.speed > 1.0 {
                        a.force_n += size / now.speed * eta;
                    }
                }
                "altitude_derate" => {
                    let over = now.altitude_m - 1500.0 - 400.0 * shape.threshold;
                    a.derate += size * knee(over, 150.0 * shape.width);
                }
                "heat_derate" => {
                    let over = if shape.variant % 2 == 0 {
                        knee(now.ambient_degc - 30.0 - 4.0 * shape.threshold, 1.0)
                    } else {
                        knee(now.coolant_degc - 97.0 - 2.0 * shape.threshold, 1.0)
                    };
                    a.derate += size * over;
                }
                "brake_fade" => {
                    let over = now.ambient_degc + m.brake_k - 150.0 - 40.0 * shape.threshold;
                    let loss = (size * knee(over, 15.0 * shape.width)).min(0.7);
                    a.force_n -= loss * service_n;
                }
                "hidden_retarder" => {
                    let on = match shape.variant % 3 {
                        0 => now.stage,
                        1 => f64::from(now.pedal < 0.01 && now.speed > 8.0),
                        _ => (now.xbr / 0.8).min(1.0),
                    };
                    a.force_n += on * size * 2.85 / 0.53 * (now.speed / 6.0).min(1.0);
                }
                _ => {}
            },
            Effect::Outside { kind, size } => match kind {
                Outside::CurveDrag => {
                    a.force_n += size * (now.curvature * now.curvature) / (0.0025 * 0.0025);
                }
                Outside::RpmForce => {
                    let x = (now.rpm - 1300.0) / 90.0;
                    if now.engaged {
                        a.force_n += size * (-0.5 * x * x).exp();
                    }
                }
                Outside::TimeForce => a.force_n += size * (now.time_s / 1500.0).powi(2),
                Outside::AltitudeForce => {
                    a.force_n += size * (now.altitude_m / 1500.0).clamp(0.0, 1.5);
                }
                Outside::TorqueDip => {
                    let x = (now.rpm - 1250.0) / 80.0;
                    a.pedal *= 1.0 - size * (-0.5 * x * x).exp();
                }
                Outside::TorqueTime => a.pedal *= 1.0 - size * (now.time_s / 1500.0).min(1.0),
                Outside::FuelAltitude => a.fuel *= 1.0 + size * now.altitude_m / 1500.0,
                Outside::FuelRpm => {
                    let x = (now.rpm - 1300.0) / 120.0;
                    a.fuel *= 1.0 + size * (-0.5 * x * x).exp();
                }
                Outside::PressureSaturation => {
                    a.pressure *= 1.0 - size * (now.xbr / 1.2).min(1.0);
                }
                Outside::YawGain => a.yaw *= 1.0 + size,
                Outside::TrailerYawGain => a.trailer_yaw *= 1.0 + size,
                Outside::AccelYGain => a.accel_y *= 1.0 + size,
                Outside::GpsAltitude => a.gps *= 1.0 + size * now.altitude_m / 1500.0,
                Outside::ShiftTemperature => {}
                Outside::Gusts => {
                    m.gust_n += dt * (-m.gust_n / 1.5)
                        + size * (2.0 * dt / 1.5).sqrt() * super::road::normal(rng);
                    a.side_n += m.gust_n;
                }
            },
        }
    }
    a
}

/// Factor of the low-load extra on the logged fuel.
pub(crate) fn low_load(effects: &[Effect], indicated_nm: f64, rpm: f64) -> f64 {
    let mut factor = 1.0;
    for e in effects {
        if let Effect::Cause { id: "fuel_map_low_load", size, shape } = e {
            let kw = indicated_nm * rpm / 9549.3;
            let x = if shape.variant % 2 == 0 {
                kw / (80.0 * shape.width)
            } else {
                indicated_nm / (700.0 * shape.width)
            };
            factor *= 1.0 + size * (1.0 - x).max(0.0);
        }
    }
    factor
}

/// Extra length of shifts at this coolant temperature, as a factor.
pub(crate) fn shift_factor(effects: &[Effect], coolant_degc: f64) -> f64 {
    effects
        .iter()
        .map(|e| match e {
            Effect::Outside { kind: Outside::ShiftTemperature, size } => {
                size * ((92.0 - coolant_degc) / 10.0).clamp(0.0, 1.0)
            }
            _ => 0.0,
        })
        .fold(1.0, |a, x| a + x)
}
