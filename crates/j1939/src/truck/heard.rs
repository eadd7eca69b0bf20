//! The latest of every signal that driving needs, with the time at which it came.

use tractrix_core::{Fix, PowertrainLimits, SafetySignal, Stamped, Time};

use super::{BusTruckConfig, Torque};
use crate::ident::{self, Vin};
use crate::message::{
    Acc1, Adss, Cvw, Ebc1, Ebc3, Ebc5, Ec1, Eec1, Eec2, Eec3, Erc1, Etc1, Etc2, Hrw, Lfe1, Rc,
    Vdc2, Vds, Vp1,
};
use crate::{Frame, Id, J1939Error, Message, Slot, TpMessage};

/// The vehicle ahead as the truck's radar reports it (ACC1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lead {
    /// Distance, m, in steps of 1 m.
    pub distance_m: f64,
    /// Its speed, m/s, in steps of 1 km/h.
    pub speed_m_s: f64,
}

/// Everything heard so far. `None`: never.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Heard {
    pub engine_speed_rad_s: Option<Stamped<f64>>,
    /// Indicated torque as a fraction of the reference torque.
    pub engine_torque_frac: Option<Stamped<f64>>,
    pub friction_frac: Option<Stamped<f64>>,
    pub reference_nm: Option<Stamped<f64>>,
    pub fuel_rate_m3_s: Option<Stamped<f64>>,
    /// The farther of the pedals that the engine reports, and that the cab reports.
    accelerators: [Option<Stamped<f64>>; 2],
    pub brake_pedal_frac: Option<Stamped<f64>>,
    pub brake_pedal_pressed: bool,
    /// XBR state (SPN 2917): 0 every demand, 1 the first priority alone, 2 none.
    pub xbr_state: Option<Stamped<u8>>,
    pub brakes_act: bool,
    pub brake_pressure_pa: Option<Stamped<f64>>,
    pub gear: Option<Stamped<i16>>,
    pub shifting: bool,
    pub driveline_closed: Option<Stamped<bool>>,
    /// Mean of the rear wheels: the speed of the reference point.
    pub speed_m_s: Option<Stamped<f64>>,
    /// Filtered derivative of it.
    pub accel_m_s2: f64,
    pub steering_wheel_rad: Option<Stamped<f64>>,
    pub yaw_rate_rad_s: Option<Stamped<f64>>,
    pub accel_y_m_s2: Option<Stamped<f64>>,
    /// Torque of every retarder as a fraction of its reference torque.
    pub retarder_frac: [Option<Stamped<f64>>; 3],
    pub retarder_reference_nm: [Option<Stamped<f64>>; 3],
    pub engine_ready: Option<Stamped<bool>>,
    pub lead: Option<Stamped<Option<Lead>>>,
    pub fix: Option<Stamped<Fix>>,
    /// Told on request alone.
    pub vin: Option<Vin>,
    /// Mass of the combination, told on request alone.
    pub mass_kg: Option<Stamped<f64>>,
    /// Frames of others.
    pub frames: u64,
    bearing_rad: Option<Stamped<f64>>,
    /// Messages that were too short to decode.
    pub short: u64,
}

/// Stamps a number; what is no number leaves the old one to age.
fn take<T>(now: Time, slot: Slot<T>, field: &mut Option<Stamped<T>>) {
    if let Some(value) = slot.value() {
        *field = Some(Stamped { time: now, value });
    }
}

/// Two tellers of a pedal in turn: how long the word of one stands beside a newer one of the other,
/// s. Four messages of the slower.
const BOTH_TELL_S: f64 = 0.2;

impl Heard {
    /// The farther of the pedals that engine and cab report, as old as the newest report.
    pub(super) fn accelerator_frac(&self) -> Option<Stamped<f64>> {
        let told = || self.accelerators.into_iter().flatten();
        let time = told().map(|pedal| pedal.time).max()?;
        let fresh = told().filter(|pedal| time.seconds_since(pedal.time) <= BOTH_TELL_S);
        let value = fresh.map(|pedal| pedal.value).reduce(f64::max)?;
        Some(Stamped { time, value })
    }

    /// Takes a frame, whatever it is.
    pub(super) fn on_frame(&mut self, now: Time, frame: &Frame, config: &BusTruckConfig) {
        self.frames += 1;
        let known = self.read(now, frame.id(), frame.bytes(), config);
        self.short += u64::from(known.is_err());
    }

    /// Takes a message of the transport, whatever it is.
    pub(super) fn on_message(&mut self, message: &TpMessage<'_>, config: &BusTruckConfig) {
        let id = Id::from_raw(message.pgn << 8 | u32::from(message.sa));
        let known = self.read(message.time, id, message.bytes, config);
        self.short += u64::from(known.is_err());
    }

    fn read(
        &mut self,
        now: Time,
        id: Id,
        bytes: &[u8],
        config: &BusTruckConfig,
    ) -> Result<(), J1939Error> {
        let retarder = config.retarders.iter().position(|sa| *sa == Some(id.sa()));
        match id.sa() {
            sa if sa == config.engine => self.read_engine(now, id, bytes)?,
            sa if sa == config.transmission => self.read_transmission(now, id, bytes)?,
            sa if sa == config.brakes => self.read_brakes(now, id, bytes, config)?,
            sa if sa == config.radar => self.read_radar(now, id, bytes)?,
            _ => {}
        }
        if let Some(index) = retarder {
            self.read_retarder(now, id, bytes, index)?;
        }
        match id.pgn() {
            pgn if pgn == Eec2::TABLE.pgn && [config.engine, config.cab].contains(&id.sa()) => {
                let pedals = Eec2::decode(id, bytes)?;
                let farther = [pedals.accelerator_pedal_frac, pedals.accelerator_pedal_2_frac]
                    .into_iter()
                    .filter_map(Slot::value)
                    .reduce(f64::max);
                if let Some(value) = farther {
                    let [engine, cab] = &mut self.accelerators;
                    let teller = if id.sa() == config.engine { engine } else { cab };
                    *teller = Some(Stamped { time: now, value });
                }
            }
            pgn if pgn == Vp1::TABLE.pgn => {
                let at = Vp1::decode(id, bytes)?;
                if let (Slot::Value(latitude), Slot::Value(longitude)) =
                    (at.latitude_rad, at.longitude_rad)
                {
                    let fresh = |b: &Stamped<f64>| now.seconds_since(b.time).abs() < 1.5;
                    let value = Fix {
                        latitude_deg: latitude.to_degrees(),
                        longitude_deg: longitude.to_degrees(),
                        course_rad: self.bearing_rad.filter(fresh).map(|b| b.value),
                    };
                    self.fix = Some(Stamped { time: now, value });
                }
            }
            pgn if pgn == Vds::TABLE.pgn => {
                take(now, Vds::decode(id, bytes)?.bearing_rad, &mut self.bearing_rad);
            }
            _ => {}
        }
        Ok(())
    }

    fn read_engine(&mut self, now: Time, id: Id, bytes: &[u8]) -> Result<(), J1939Error> {
        match id.pgn() {
            pgn if pgn == Eec1::TABLE.pgn => {
                let m = Eec1::decode(id, bytes)?;
                let torque = Torque { coarse_frac: m.torque_frac, fine_frac: m.torque_fine_frac };
                take(now, m.engine_speed_rad_s, &mut self.engine_speed_rad_s);
                if let Some(value) = torque.frac() {
                    self.engine_torque_frac = Some(Stamped { time: now, value });
                }
            }
            pgn if pgn == Eec3::TABLE.pgn => {
                take(now, Eec3::decode(id, bytes)?.friction_torque_frac, &mut self.friction_frac);
            }
            pgn if pgn == Ec1::TABLE.pgn => {
                take(now, Ec1::decode(id, bytes)?.reference_torque_nm, &mut self.reference_nm);
            }
            ident::VI => self.vin = Vin::of(id, bytes),
            pgn if pgn == Lfe1::TABLE.pgn => {
                take(now, Lfe1::decode(id, bytes)?.fuel_rate_m3_s, &mut self.fuel_rate_m3_s);
            }
            pgn if pgn == Adss::TABLE.pgn => {
                let ready = Adss::decode(id, bytes)?.tsc1_p7_readiness.map(|code| code == 1);
                take(now, ready, &mut self.engine_ready);
            }
            _ => {}
        }
        Ok(())
    }

    fn read_transmission(&mut self, now: Time, id: Id, bytes: &[u8]) -> Result<(), J1939Error> {
        match id.pgn() {
            pgn if pgn == Etc1::TABLE.pgn => {
                let m = Etc1::decode(id, bytes)?;
                self.shifting = m.shift_in_process == Slot::Value(1);
                take(now, m.driveline_engaged.map(|code| code == 1), &mut self.driveline_closed);
            }
            pgn if pgn == Etc2::TABLE.pgn => {
                take(now, Etc2::decode(id, bytes)?.current_gear, &mut self.gear);
            }
            _ => {}
        }
        Ok(())
    }

    fn read_brakes(
        &mut self,
        now: Time,
        id: Id,
        bytes: &[u8],
        config: &BusTruckConfig,
    ) -> Result<(), J1939Error> {
        match id.pgn() {
            pgn if pgn == Ebc1::TABLE.pgn => {
                let m = Ebc1::decode(id, bytes)?;
                take(now, m.brake_pedal_frac, &mut self.brake_pedal_frac);
                self.brake_pedal_pressed = m.brake_switch == Slot::Value(1);
            }
            pgn if pgn == Ebc3::TABLE.pgn => {
                let m = Ebc3::decode(id, bytes)?;
                let wheels = [
                    m.front_left_pressure_pa,
                    m.front_right_pressure_pa,
                    m.rear_1_left_pressure_pa,
                    m.rear_1_right_pressure_pa,
                ];
                if let Some(value) = mean(&wheels) {
                    self.brake_pressure_pa = Some(Stamped { time: now, value });
                }
            }
            pgn if pgn == Cvw::TABLE.pgn => {
                take(now, Cvw::decode(id, bytes)?.combination_mass_kg, &mut self.mass_kg);
            }
            pgn if pgn == Ebc5::TABLE.pgn => {
                let m = Ebc5::decode(id, bytes)?;
                take(now, m.xbr_state, &mut self.xbr_state);
                self.brakes_act = m.foundation_brake_use == Slot::Value(1);
            }
            pgn if pgn == Hrw::TABLE.pgn => {
                let m = Hrw::decode(id, bytes)?;
                if let Some(speed) = mean(&[m.rear_left_speed_m_s, m.rear_right_speed_m_s]) {
                    self.take_speed(now, speed, config);
                }
            }
            pgn if pgn == Vdc2::TABLE.pgn => {
                let m = Vdc2::decode(id, bytes)?;
                take(now, m.steering_wheel_rad, &mut self.steering_wheel_rad);
                take(now, m.yaw_rate_rad_s, &mut self.yaw_rate_rad_s);
                take(now, m.lateral_acceleration_m_s2, &mut self.accel_y_m_s2);
            }
            _ => {}
        }
        Ok(())
    }

    /// Wheel speeds are unsigned: they go backwards in a reverse gear.
    fn take_speed(&mut self, now: Time, speed: f64, config: &BusTruckConfig) {
        let backwards = self.gear.is_some_and(|gear| gear.value < 0);
        let value = if backwards { -speed } else { speed };
        match self.speed_m_s {
            Some(last) => {
                let dt_s = now.seconds_since(last.time);
                if dt_s > 0.0 && dt_s <= config.acceleration_filter_s {
                    let measured = (value - last.value) / dt_s;
                    let share = dt_s / (config.acceleration_filter_s + dt_s);
                    self.accel_m_s2 += share * (measured - self.accel_m_s2);
                } else if dt_s != 0.0 {
                    self.accel_m_s2 = 0.0;
                }
            }
            None => self.accel_m_s2 = 0.0,
        }
        self.speed_m_s = Some(Stamped { time: now, value });
    }

    fn read_retarder(
        &mut self,
        now: Time,
        id: Id,
        bytes: &[u8],
        index: usize,
    ) -> Result<(), J1939Error> {
        if id.pgn() == Erc1::TABLE.pgn
            && let Some(field) = self.retarder_frac.get_mut(index)
        {
            take(now, Erc1::decode(id, bytes)?.torque_frac, field);
        }
        if id.pgn() == Rc::TABLE.pgn
            && let Some(field) = self.retarder_reference_nm.get_mut(index)
        {
            take(now, Rc::decode(id, bytes)?.reference_torque_nm, field);
        }
        Ok(())
    }

    fn read_radar(&mut self, now: Time, id: Id, bytes: &[u8]) -> Result<(), J1939Error> {
        if id.pgn() == Acc1::TABLE.pgn {
            let m = Acc1::decode(id, bytes)?;
            let lead = match (m.target_detected, m.lead_distance_m, m.lead_speed_m_s) {
                (Slot::Value(1), Slot::Value(distance_m), Slot::Value(speed_m_s)) => {
                    Slot::Value(Some(Lead { distance_m, speed_m_s }))
                }
                (Slot::Value(0), ..) => Slot::Value(None),
                _ => Slot::NotAvailable,
            };
            take(now, lead, &mut self.lead);
        }
        Ok(())
    }

    /// When a signal last came; of several that it is made of, the oldest.
    pub(super) fn time_of(&self, signal: SafetySignal) -> Option<Time> {
        let time = |field: Option<Stamped<f64>>| field.map(|f| f.time);
        match signal {
            SafetySignal::RoadSpeed => time(self.speed_m_s),
            SafetySignal::YawRate => time(self.yaw_rate_rad_s),
            SafetySignal::SteeringAngle => time(self.steering_wheel_rad),
            SafetySignal::Engine => {
                Some(time(self.engine_speed_rad_s)?.min(time(self.engine_torque_frac)?))
            }
            SafetySignal::Transmission => self.gear.map(|gear| gear.time),
            SafetySignal::Brakes => {
                Some(time(self.brake_pedal_frac)?.min(self.xbr_state.map(|state| state.time)?))
            }
            SafetySignal::Pedals => time(self.accelerator_frac()),
            SafetySignal::Pose => None,
        }
    }
}

/// Wheels and engine may differ by tyres, slip and filters: m/s, and as a share.
const SPEED_TOLERANCE: (f64, f64) = (0.5, 0.03);
/// Below this speed clutches slip, m/s.
const CLUTCH_CLOSED_FROM_M_S: f64 = 5.0;

impl Heard {
    /// Whether the wheel speed is another than the engine's through the closed driveline: it is
    /// frozen, or one of both is wrong.
    pub(super) fn speed_contradicts(&self, limits: &PowertrainLimits) -> bool {
        let (Some(speed), Some(engine), Some(gear), Some(closed)) =
            (self.speed_m_s, self.engine_speed_rad_s, self.gear, self.driveline_closed)
        else {
            return false;
        };
        let ratio = usize::try_from(gear.value - 1).ok().and_then(|i| limits.gear_ratios.get(i));
        let Some(ratio) = ratio.filter(|_| closed.value && !self.shifting) else { return false };
        let driven_m_s = engine.value * limits.wheel_radius_m / (ratio * limits.final_drive_ratio);
        let (least, share) = SPEED_TOLERANCE;
        driven_m_s.max(speed.value) > CLUTCH_CLOSED_FROM_M_S
            && (driven_m_s - speed.value).abs() > least + share * driven_m_s
    }
}

fn mean(slots: &[Slot<f64>]) -> Option<f64> {
    let numbers = || slots.iter().filter_map(|slot| slot.value());
    let count = numbers().count();
    (count > 0).then(|| numbers().sum::<f64>() / count as f64)
}
