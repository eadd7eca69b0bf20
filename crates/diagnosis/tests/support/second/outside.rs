//! Effects that no catalogue has, with two signals, memory, hysteresis, a place on the road, or a
//! factor on one part of the balance.

use super::super::effects::Shape;

use super::colour::{knee, towards};
use super::faults::Moment;

/// One effect outside the catalogue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SecondOutside {
    ChargeThin,
    FastAndHeavy,
    WetRoad,
    HotHubs,
    SluggishPedal,
    SoftSection,
    FrontFloats,
    TrailerTyresHeat,
    EngineBrakeTires,
    LiningsGlaze,
    FuelIsland,
    GyroUneven,
    ShiftUphill,
    EmptyReservoir,
}

use SecondOutside as O;

const CURVE: &[&str] = &[
    "curvature_1_m",
    "steering_wheel_rad",
    "yaw_rate_rad_s",
    "accel_y_m_s2",
    "trailer_yaw_rate_rad_s",
];

/// All of them: usual size, whether either sign occurs, signals that count as right.
pub(crate) const SECOND_OUTSIDE: &[(SecondOutside, f64, bool, &[&str])] = &[
    (O::ChargeThin, 0.35, false, &["engine_brake_frac", "gps_altitude_m", "baro_pressure_pa"]),
    (O::FastAndHeavy, 1500.0, false, &["speed_m_s"]),
    (O::WetRoad, 1800.0, false, &["s_map_m", "time_s"]),
    (O::HotHubs, 1800.0, false, &["brake_pressure_kpa", "xbr_decel_m_s2", "time_s"]),
    (O::SluggishPedal, 0.12, false, &["accelerator_pedal_frac", "engine_torque_percent"]),
    (O::SoftSection, 2200.0, false, &["s_map_m", "time_s"]),
    (
        O::FrontFloats,
        0.3,
        false,
        &["speed_m_s", "steering_wheel_rad", "curvature_1_m", "accel_y_m_s2"],
    ),
    (
        O::TrailerTyresHeat,
        0.3,
        false,
        &["time_s", "trailer_yaw_rate_rad_s", "curvature_1_m", "accel_y_m_s2"],
    ),
    (O::EngineBrakeTires, 0.4, false, &["engine_brake_frac", "time_s", "coolant_temp_degc"]),
    (O::LiningsGlaze, 0.3, true, &["speed_m_s", "brake_pressure_kpa", "xbr_decel_m_s2"]),
    (O::FuelIsland, 0.12, true, &["engine_torque_percent", "engine_speed_rpm"]),
    (O::GyroUneven, 0.12, true, CURVE),
    (
        O::ShiftUphill,
        0.7,
        false,
        &["grade_frac", "engine_torque_percent", "accelerator_pedal_frac"],
    ),
    (O::EmptyReservoir, 0.35, false, &["xbr_decel_m_s2", "brake_pressure_kpa", "time_s"]),
];

/// What an effect does now.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Outcome {
    /// Against the motion, N.
    pub(crate) force_n: f64,
    /// Factors on demanded torque, engine brake, brake pressure, brake friction, fuel, logged yaw.
    pub(crate) torque: f64,
    pub(crate) engine_brake: f64,
    pub(crate) pressure: f64,
    pub(crate) friction: f64,
    pub(crate) fuel: f64,
    pub(crate) yaw: f64,
    /// Factors on the stiffness of steer, drive and trailer axles.
    pub(crate) stiffness: [f64; 3],
    /// Extra length of a shift that begins now, s.
    pub(crate) shift_s: f64,
}

impl Outcome {
    pub(crate) const NOTHING: Self = Self {
        force_n: 0.0,
        torque: 1.0,
        engine_brake: 1.0,
        pressure: 1.0,
        friction: 1.0,
        fuel: 1.0,
        yaw: 1.0,
        stiffness: [1.0; 3],
        shift_s: 0.0,
    };
}

/// What the effects remember.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Memory {
    state: f64,
    slow: f64,
}

/// Adds an effect; `dt` since the last call, s.
pub(crate) fn act(
    o: &mut Outcome,
    m: &mut Memory,
    (kind, x, shape): (SecondOutside, f64, &Shape),
    now: &Moment,
    dt: f64,
) {
    match kind {
        O::ChargeThin => {
            // The engine brake needs air: less with every stage and with height.
            o.engine_brake *= (1.0 - x * now.stage * now.altitude_m / 1200.0).max(0.1);
        }
        O::FastAndHeavy => {
            let fast = (now.speed / 22.0).powf(shape.at(0, 2.0, 3.5));
            o.force_n += x * fast * (now.mass_kg - 19e3) / 25e3;
        }
        O::WetRoad => {
            // Wet from a place on; it dries.
            let from = shape.at(0, 4e3, 14e3);
            let wet = now.place_m > from && now.place_m < from + shape.at(1, 1e3, 4e3);
            let tau = if wet { 20.0 } else { shape.at(2, 150.0, 400.0) };
            towards(&mut m.state, f64::from(u8::from(wet)), dt, tau);
            o.force_n += x * m.state * (now.speed / 20.0);
        }
        O::HotHubs => {
            // Linings that touch for as long as the discs are hot.
            m.state += dt * (now.xbr * now.speed / 60.0 - m.state / shape.at(0, 60.0, 180.0));
            o.force_n += x * m.state.min(2.0);
        }
        O::SluggishPedal => {
            // Less torque on a falling pedal than on a rising one.
            towards(&mut m.slow, now.pedal, dt, 1.0);
            let way = now.pedal - m.slow;
            if way.abs() > 0.01 {
                m.state = way.signum();
            }
            o.torque *= 1.0 + 0.5 * x * (m.state - 1.0);
        }
        O::SoftSection => {
            let from = shape.at(0, 5e3, 15e3);
            let here = now.place_m > from && now.place_m < from + shape.at(1, 800.0, 3000.0);
            o.force_n += if here { x } else { 0.0 };
        }
        O::FrontFloats => {
            let fast = ((now.speed - 10.0) / 12.0).clamp(0.0, 1.2);
            o.stiffness[0] *= 1.0 - x * fast.powf(shape.at(0, 1.0, 2.0));
        }
        O::TrailerTyresHeat => {
            towards(&mut m.state, (now.speed / 20.0).min(1.2), dt, shape.at(0, 400.0, 900.0));
            o.stiffness[2] *= 1.0 - x * m.state;
        }
        O::EngineBrakeTires => {
            towards(&mut m.state, now.stage, dt, shape.at(0, 20.0, 80.0));
            o.engine_brake *= 1.0 - x * m.state;
        }
        O::LiningsGlaze => {
            let fast = ((now.speed - shape.at(0, 8.0, 14.0)) / 6.0).clamp(-1.0, 1.0);
            o.friction *= 1.0 - x * fast;
        }
        O::FuelIsland => {
            let load = (now.torque_nm - shape.at(0, 1400.0, 2100.0)) / 400.0;
            let fast = (now.rpm - shape.at(1, 1100.0, 1350.0)) / 130.0;
            o.fuel *= 1.0 + x * (-0.5 * (load * load + fast * fast)).exp();
        }
        O::GyroUneven => o.yaw *= if now.yaw_rate > 0.0 { 1.0 + x } else { 1.0 - 0.3 * x },
        O::ShiftUphill => {
            let steep = knee(now.grade - shape.at(0, 0.0, 0.01), 0.002) / 0.02;
            o.shift_s += x * steep.min(1.5);
        }
        O::EmptyReservoir => {
            // Every application takes air that the compressor brings back slowly.
            m.state += dt * (0.12 * now.xbr - m.state / shape.at(0, 30.0, 90.0));
            o.pressure *= 1.0 - x * m.state.clamp(0.0, 1.0);
        }
    }
}
