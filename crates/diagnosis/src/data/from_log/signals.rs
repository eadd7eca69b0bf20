//! Which messages of a truck's bus fill which column of a drive: the one table of it.

use std::borrow::Cow;

use j1939::message::{
    Amb, Ccvs1, Cvw, Ebc2, Ebc3, Eec1, Eec2, Erc1, Et1, Etc1, Etc2, Hrw, Lfe1, Sas, Tco1, Tsc1,
    Vdc2, Vds, Vp1, Xbr,
};
use j1939::{Id, Message, Slot};
use tractrix_core::{RPM_PER_RAD_S, ZERO_DEGC_K};

use super::dbc::DbcSignal;
use crate::Channel;

/// What a signal is wanted for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum What {
    /// A column of the drive.
    Column(Channel),
    /// Who asks the engine for torque: 0 nobody, 1 the pedal, other numbers somebody else.
    TorqueMode,
    /// Latitude, deg.
    Latitude,
    /// Longitude, deg.
    Longitude,
    /// Mass of the combination, kg.
    Mass,
}

/// What a signal says when nobody sends it any more.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Silence {
    /// Nothing is known.
    Unknown,
    /// Nothing is asked for: requests are sent only while there is one.
    Zero,
}

/// A signal that can fill a place, in the unit of its column.
#[derive(Debug, Clone)]
pub(super) struct Candidate {
    pub(super) what: What,
    pub(super) pgn: u32,
    /// The signals, for people.
    pub(super) signal: Cow<'static, str>,
    /// Addresses (destinations of requests) it counts from; empty: any.
    pub(super) only: Vec<u8>,
    pub(super) silence: Silence,
    /// A flow of fuel in m³/s, of which the truck's fuel makes a mass.
    pub(super) is_volume: bool,
    pub(super) read: Read,
}

/// How the value is found in a message.
#[derive(Debug, Clone)]
pub(super) enum Read {
    /// By the table of the standard's messages.
    Standard(fn(Id, &[u8]) -> Option<f64>),
    /// By the user's DBC.
    Dbc(Box<DbcSignal>),
}

impl Candidate {
    pub(super) fn value(&self, id: Id, bytes: &[u8]) -> Option<f64> {
        match &self.read {
            Read::Standard(read) => read(id, bytes),
            Read::Dbc(signal) => signal.value(bytes),
        }
    }
}

/// Retarders: of the engine, of the driveline, of the exhaust (J1939-81, B2).
const RETARDERS: [u8; 3] = [0x0F, 0x10, 0x29];

/// A candidate that counts from anywhere.
macro_rules! from_any {
    ($what:expr, $message:ident, $signal:literal, $read:expr) => {
        Candidate {
            what: $what,
            pgn: $message::TABLE.pgn,
            signal: Cow::Borrowed($signal),
            only: Vec::new(),
            silence: Silence::Unknown,
            is_volume: false,
            read: Read::Standard(|id, bytes| {
                let read: fn($message) -> Option<f64> = $read;
                read($message::decode(id, bytes).ok()?)
            }),
        }
    };
}

fn mean(slots: &[Slot<f64>]) -> Option<f64> {
    let values: Vec<f64> = slots.iter().filter_map(|slot| slot.value()).collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn percent(slot: Slot<f64>) -> Option<f64> {
    slot.value().map(|frac| 100.0 * frac)
}

fn degc(slot: Slot<f64>) -> Option<f64> {
    slot.value().map(|k| k - ZERO_DEGC_K)
}

/// Every candidate of the standard's messages; of one column the better comes first: the finer step, the driven wheels, what is
/// asked for before what comes of it.
pub(super) fn standard() -> Vec<Candidate> {
    vec![
        from_any!(What::Column(Channel::SpeedMS), Hrw, "HRW rear wheels", |m| {
            mean(&[m.rear_left_speed_m_s, m.rear_right_speed_m_s])
        }),
        from_any!(What::Column(Channel::SpeedMS), Ebc2, "EBC2.front_axle_speed", |m| {
            m.front_axle_speed_m_s.value()
        }),
        from_any!(What::Column(Channel::SpeedMS), Ccvs1, "CCVS1.speed", |m| m.speed_m_s.value()),
        from_any!(What::Column(Channel::SpeedMS), Tco1, "TCO1.speed", |m| m.speed_m_s.value()),
        from_any!(What::Column(Channel::GpsSpeedMS), Vds, "VDS.speed", |m| m.speed_m_s.value()),
        from_any!(What::Column(Channel::GpsAltitudeM), Vds, "VDS.altitude", |m| m
            .altitude_m
            .value()),
        // clockwise from north becomes counter-clockwise from east
        from_any!(What::Column(Channel::HeadingRad), Vds, "VDS.bearing", |m| {
            m.bearing_rad.value().map(|rad| core::f64::consts::FRAC_PI_2 - rad)
        }),
        from_any!(What::Column(Channel::AccelXMS2), Vdc2, "VDC2.longitudinal_acceleration", |m| m
            .longitudinal_acceleration_m_s2
            .value()),
        from_any!(
            What::Column(Channel::AcceleratorPedalFrac),
            Eec2,
            "EEC2.accelerator_pedal",
            |m| m.accelerator_pedal_frac.value()
        ),
        from_any!(What::Column(Channel::EngineTorquePercent), Eec1, "EEC1.torque", |m| {
            let fine = m.torque_fine_frac.value().unwrap_or(0.0);
            percent(m.torque_frac.map(|coarse| coarse + fine))
        }),
        from_any!(What::Column(Channel::EngineSpeedRpm), Eec1, "EEC1.engine_speed", |m| {
            m.engine_speed_rad_s.value().map(|rad_s| rad_s * RPM_PER_RAD_S)
        }),
        from_any!(What::Column(Channel::Gear), Etc2, "ETC2.current_gear", |m| {
            m.current_gear.value().map(f64::from)
        }),
        from_any!(What::Column(Channel::ShiftInProcess), Etc1, "ETC1.shift_in_process", |m| {
            m.shift_in_process.value().map(|code| f64::from(u8::from(code == 1)))
        }),
        Candidate {
            only: RETARDERS.to_vec(),
            silence: Silence::Zero,
            ..from_any!(What::Column(Channel::EngineBrakeFrac), Tsc1, "TSC1 to a retarder", |m| {
                let asks = m.override_mode.value().is_some_and(|mode| mode != 0);
                if asks {
                    m.torque_request_frac.value().map(|frac| (-frac).max(0.0))
                } else {
                    Some(0.0)
                }
            })
        },
        Candidate {
            only: RETARDERS.to_vec(),
            ..from_any!(What::Column(Channel::EngineBrakeFrac), Erc1, "ERC1.torque", |m| {
                m.torque_frac.value().map(|frac| (-frac).max(0.0))
            })
        },
        Candidate {
            silence: Silence::Zero,
            ..from_any!(What::Column(Channel::XbrDecelMS2), Xbr, "XBR.acceleration_demand", |m| {
                let asks = m.control_mode.value().is_some_and(|mode| mode != 0);
                if asks { m.acceleration_demand_m_s2.value().map(|a| -a) } else { Some(0.0) }
            })
        },
        from_any!(
            What::Column(Channel::BrakePressureKpa),
            Ebc3,
            "EBC3 front axle and first rear axle",
            |m| {
                let front = mean(&[m.front_left_pressure_pa, m.front_right_pressure_pa]);
                let rear = mean(&[m.rear_1_left_pressure_pa, m.rear_1_right_pressure_pa]);
                let slot = |x: Option<f64>| x.map_or(Slot::NotAvailable, Slot::Value);
                mean(&[slot(front), slot(rear)]).map(|pa| 1e-3 * pa)
            }
        ),
        from_any!(What::Column(Channel::SteeringWheelRad), Vdc2, "VDC2.steering_wheel", |m| {
            m.steering_wheel_rad.value()
        }),
        from_any!(What::Column(Channel::SteeringWheelRad), Sas, "SAS.steering_wheel", |m| {
            m.steering_wheel_rad.value()
        }),
        from_any!(What::Column(Channel::YawRateRadS), Vdc2, "VDC2.yaw_rate", |m| {
            m.yaw_rate_rad_s.value()
        }),
        from_any!(What::Column(Channel::AccelYMS2), Vdc2, "VDC2.lateral_acceleration", |m| {
            m.lateral_acceleration_m_s2.value()
        }),
        // a volume here; the truck's fuel makes a mass of it
        Candidate {
            is_volume: true,
            ..from_any!(What::Column(Channel::FuelRateGS), Lfe1, "LFE1.fuel_rate", |m| {
                m.fuel_rate_m3_s.value()
            })
        },
        from_any!(What::Column(Channel::CoolantTempDegc), Et1, "ET1.coolant_temperature", |m| {
            degc(m.coolant_temperature_k)
        }),
        from_any!(What::Column(Channel::AmbientTempDegc), Amb, "AMB.ambient_temperature", |m| {
            degc(m.ambient_temperature_k)
        }),
        from_any!(What::Column(Channel::BaroPressurePa), Amb, "AMB.barometric_pressure", |m| {
            m.barometric_pressure_pa.value()
        }),
        from_any!(What::TorqueMode, Eec1, "EEC1.torque_mode", |m| m
            .torque_mode
            .value()
            .map(f64::from)),
        from_any!(What::Latitude, Vp1, "VP1.latitude", |m| m
            .latitude_rad
            .value()
            .map(f64::to_degrees)),
        from_any!(What::Longitude, Vp1, "VP1.longitude", |m| {
            m.longitude_rad.value().map(f64::to_degrees)
        }),
        from_any!(What::Mass, Cvw, "CVW.combination_mass", |m| m.combination_mass_kg.value()),
    ]
}
