//! Fidelity of the whole truck model: measured inputs drive it in open loop, its outputs are
//! compared with the measured ones (Wang et al., Fig. 8 and 9).
//!
//! Inputs: pedal, deceleration demand (or brake pressure where no demand was logged), engine-brake
//! demand, hand wheel, gear (as a request; the model shifts by itself where none was logged),
//! grade, altitude, air. No measured output is fed back, so that a drift of speed over a whole
//! drive is expected; free runs that start anew from the measurement every minute show how far the
//! model may be trusted ahead.
//!
//! ```text
//! accuracy = 1 - mean |simulated - measured| / mean |measured|
//! ```

use dynamics::{RoadPatch, TruckModel, TruckParameters, TruckState};
use serde::Serialize;
use tractrix_core::{BrakeMode, Command, GearRequest, RPM_PER_RAD_S, ZERO_DEGC_K};

use crate::{Channel as C, DiagnosisError, Drive};

/// Lengths of the free runs that are judged, s.
pub const HORIZONS_S: [f64; 4] = [1.0, 10.0, 30.0, 60.0];
/// Time over which delay lines fill before a free run starts, s.
const LEAD_S: f64 = 1.0;
/// How well one signal is reproduced.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SignalFidelity {
    /// Column name, with its unit.
    pub quantity: &'static str,
    /// Length of the free runs, s; none = the whole drive in one.
    pub horizon_s: Option<f64>,
    /// Mean of |simulated − measured|, in the quantity's unit.
    pub mean_abs_error: f64,
    /// Mean of |measured|.
    pub mean_abs: f64,
    /// Root mean square error.
    pub rmse: f64,
    /// `1 - mean_abs_error / mean_abs`; none where nothing moved.
    pub accuracy_frac: Option<f64>,
    /// Samples that were compared.
    pub samples: usize,
}

/// One drive replayed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DriveFidelity {
    /// Name of the drive.
    pub drive: String,
    /// All signals over all horizons.
    pub signals: Vec<SignalFidelity>,
    /// Measured and simulated signals, for pictures.
    #[serde(skip)]
    pub replayed: Vec<Replayed>,
}

/// A signal at the drive's samples.
#[derive(Debug, Clone, PartialEq)]
pub struct Replayed {
    /// Column name, with its unit.
    pub quantity: &'static str,
    /// Measured.
    pub measured: Vec<f64>,
    /// The whole drive in one open loop.
    pub open_loop: Vec<f64>,
    /// Free runs of 60 s.
    pub free_runs: Vec<f64>,
}

/// Outputs that are compared.
const OUTPUTS: [C; 9] = [
    C::SpeedMS,
    C::EngineSpeedRpm,
    C::EngineTorquePercent,
    C::Gear,
    C::BrakePressureKpa,
    C::FuelRateGS,
    C::YawRateRadS,
    C::TrailerYawRateRadS,
    C::AccelYMS2,
];
type Outputs = [f64; OUTPUTS.len()];

/// Replays a drive with a truck.
///
/// # Errors
/// [`DiagnosisError::Column`] without pedal or speed, [`DiagnosisError::Truck`] if the truck cannot
/// carry the reported mass or its state does not stay finite.
pub fn fidelity(truck: &TruckParameters, drive: &Drive) -> Result<DriveFidelity, DiagnosisError> {
    let replay = Replay::new(truck, drive)?;
    let open_loop = replay.run(0, drive.len, replay.start(0))?;
    let mut free_runs = Vec::with_capacity(drive.len);
    let mut since = Vec::with_capacity(drive.len);
    let longest = samples(HORIZONS_S[HORIZONS_S.len() - 1]);
    for from in (0..drive.len).step_by(longest) {
        let to = (from + longest).min(drive.len);
        let lead = from.saturating_sub(samples(LEAD_S));
        let warm = replay.last(lead, from, replay.start(lead))?;
        free_runs.extend(replay.run(from, to, replay.reset(warm, from))?);
        since.extend(0..to - from);
    }
    let mut signals = Vec::new();
    let mut replayed = Vec::new();
    for (k, channel) in OUTPUTS.iter().enumerate() {
        let Some(measured) = drive.get(*channel) else { continue };
        let of = |runs: &[Outputs]| runs.iter().map(|o| o[k]).collect::<Vec<f64>>();
        let (whole, free) = (of(&open_loop), of(&free_runs));
        for horizon_s in HORIZONS_S {
            let within = |i: usize| since[i] < samples(horizon_s);
            signals.extend(compare(channel.name(), Some(horizon_s), measured, &free, within));
        }
        signals.extend(compare(channel.name(), None, measured, &whole, |_| true));
        replayed.push(Replayed {
            quantity: channel.name(),
            measured: measured.to_vec(),
            open_loop: whole,
            free_runs: free,
        });
    }
    Ok(DriveFidelity { drive: drive.name.clone(), signals, replayed })
}

fn samples(seconds: f64) -> usize {
    (seconds / Drive::STEP_S).round() as usize
}

/// One signal over the samples that lie `within`; none without such samples.
pub(crate) fn compare(
    quantity: &'static str,
    horizon_s: Option<f64>,
    measured: &[f64],
    simulated: &[f64],
    within: impl Fn(usize) -> bool,
) -> Option<SignalFidelity> {
    let mut s = [0.0; 4];
    for (i, (m, x)) in measured.iter().zip(simulated).enumerate() {
        if within(i) {
            let e = x - m;
            s = [s[0] + e.abs(), s[1] + m.abs(), s[2] + e * e, s[3] + 1.0];
        }
    }
    (s[3] > 0.0).then(|| SignalFidelity {
        quantity,
        horizon_s,
        mean_abs_error: s[0] / s[3],
        mean_abs: s[1] / s[3],
        rmse: (s[2] / s[3]).sqrt(),
        accuracy_frac: (s[1] > 1e-9 * s[3]).then(|| 1.0 - s[0] / s[1]),
        samples: s[3] as usize,
    })
}

/// A drive's inputs and the truck that they drive.
struct Replay<'a> {
    model: TruckModel,
    drive: &'a Drive,
    gear: Vec<GearRequest>,
}

impl<'a> Replay<'a> {
    fn new(truck: &TruckParameters, drive: &'a Drive) -> Result<Self, DiagnosisError> {
        let needed = |c: C| {
            drive.get(c).ok_or_else(|| DiagnosisError::Column {
                drive: drive.name.clone(),
                column: c.name(),
                why: "is missing".into(),
            })
        };
        needed(C::SpeedMS)?;
        needed(C::AcceleratorPedalFrac)?;
        let of = |payload_kg: f64| {
            TruckModel::new(truck.clone(), payload_kg)
                .map_err(|e| DiagnosisError::Truck(e.to_string()))
        };
        let payload_kg = match drive.reported_mass_kg {
            Some(total_kg) => {
                let mut sheet = truck.lateral;
                sheet.payload.mass_kg = 0.0;
                (total_kg - sheet.total_mass_kg()).max(0.0)
            }
            None => truck.lateral.payload.mass_kg,
        };
        Ok(Self { model: of(payload_kg)?, gear: requests(drive), drive })
    }

    fn value(&self, c: C, i: usize, default: f64) -> f64 {
        self.drive.get(c).and_then(|x| x.get(i)).copied().unwrap_or(default)
    }

    fn command(&self, i: usize) -> Command {
        let pressure_pa = 1e3 * self.value(C::BrakePressureKpa, i, 0.0);
        let brake = &self.model.parameters().brake;
        let by_pressure = pressure_pa * brake.gain_n_pa / self.model.mass_kg();
        let decel = self.value(C::XbrDecelMS2, i, by_pressure).max(0.0);
        Command {
            accelerator_pedal_frac: self.value(C::AcceleratorPedalFrac, i, 0.0),
            xbr_decel_m_s2: decel,
            brake_mode: if decel > 0.0 { BrakeMode::Addition } else { BrakeMode::Off },
            steering_wheel_rad: self.value(C::SteeringWheelRad, i, 0.0),
            retarder_frac: self.value(C::EngineBrakeFrac, i, 0.0),
            gear: self.gear[i],
        }
    }

    fn patch(&self, i: usize) -> RoadPatch {
        let normal = RoadPatch::default();
        let air = self.drive.get(C::AmbientTempDegc).and_then(|x| x.get(i));
        RoadPatch {
            grade_rad: self.value(C::GradeFrac, i, 0.0).atan(),
            altitude_m: self.value(C::GpsAltitudeM, i, normal.altitude_m),
            air_temperature_k: air.map_or(normal.air_temperature_k, |t| t + ZERO_DEGC_K),
            air_pressure_pa: self.value(C::BaroPressurePa, i, normal.air_pressure_pa),
            ..normal
        }
    }

    /// A state that fits the measurement at a sample.
    fn start(&self, i: usize) -> TruckState {
        let heading = self.value(C::HeadingRad, i, 0.0);
        let s = self.model.initial_state(0.0, 0.0, heading, self.speed(i));
        self.reset(s, i)
    }

    /// True speed by the wheels.
    fn speed(&self, i: usize) -> f64 {
        let scale = self.model.parameters().instruments.speed_scale_coeff;
        (self.value(C::SpeedMS, i, 0.0) / scale).max(0.0)
    }

    /// The state with everything that is measured set to its measured value.
    fn reset(&self, mut s: TruckState, i: usize) -> TruckState {
        let p = self.model.parameters();
        s.speed_m_s = self.speed(i);
        let gears = p.driveline.gear_ratios.len();
        let gear = self.value(C::Gear, i, 0.0);
        let shifting = self.value(C::ShiftInProcess, i, 0.0) > 0.5;
        if gear >= 1.0 && gear <= gears as f64 && !shifting {
            let gear = gear as u8;
            let geared = p.driveline.engine_speed_rad_s(s.speed_m_s, gear);
            if geared > p.engine.idle_speed_rpm / RPM_PER_RAD_S {
                s.shift.gear = gear;
                s.shift.target = gear;
                s.shift.phase = dynamics::effects::shift::ShiftPhase::Engaged;
                s.clutch_locked = true;
                s.clutch_frac = 1.0;
                s.engine_speed_rad_s = geared;
            }
        }
        if let Some(percent) = self.drive.get(C::EngineTorquePercent) {
            s.engine_torque_nm = (0.01 * percent[i] * p.engine.reference_torque_nm).max(0.0);
        }
        if let Some(kpa) = self.drive.get(C::BrakePressureKpa) {
            s.brake.pressure_pa = [1e3 * kpa[i].max(0.0); 3];
        }
        if let Some(coolant) = self.drive.get(C::CoolantTempDegc) {
            s.coolant_k = coolant[i] + ZERO_DEGC_K;
        }
        if let Some(wheel) = self.drive.get(C::SteeringWheelRad) {
            s.lateral.steering.wheel_rad = wheel[i];
        }
        if let Some(yaw) = self.drive.get(C::YawRateRadS) {
            s.lateral.yaw_rate_rad_s = yaw[i] - p.instruments.yaw_rate_bias_rad_s;
        }
        if let Some(yaw) = self.drive.get(C::TrailerYawRateRadS) {
            s.lateral.trailer_yaw_rate_rad_s = yaw[i];
        }
        if self.drive.tyres_warm_at_start == Some(true) {
            s.tyre_warmth = 1.0;
        }
        s
    }

    /// Outputs at the samples `from..to`, the state being that at `from`.
    fn run(
        &self,
        from: usize,
        to: usize,
        mut s: TruckState,
    ) -> Result<Vec<Outputs>, DiagnosisError> {
        let mut out = Vec::with_capacity(to - from);
        for i in from..to {
            out.push(self.outputs(&s, i));
            s = self.step(s, i)?;
        }
        Ok(out)
    }

    /// The state at `to`.
    fn last(&self, from: usize, to: usize, s: TruckState) -> Result<TruckState, DiagnosisError> {
        (from..to).try_fold(s, |s, i| self.step(s, i))
    }

    fn step(&self, s: TruckState, i: usize) -> Result<TruckState, DiagnosisError> {
        self.model
            .step(&s, &self.command(i), &self.patch(i), Drive::STEP_S)
            .map_err(|e| DiagnosisError::Truck(format!("drive {}: {e}", self.drive.name)))
    }

    fn outputs(&self, s: &TruckState, i: usize) -> Outputs {
        let e = self.model.measured(&self.model.ego_state(s, &self.patch(i)));
        let p = &e.powertrain;
        [
            e.speed_m_s,
            p.engine_speed_rad_s * RPM_PER_RAD_S,
            100.0 * p.engine_torque_nm / self.model.parameters().engine.reference_torque_nm,
            f64::from(p.gear),
            1e-3 * p.brake_pressure_pa,
            p.fuel_rate_g_s,
            e.yaw_rate_rad_s,
            e.trailer.yaw_rate_rad_s,
            e.accel_y_m_s2,
        ]
    }
}

/// The measured gear as a request: during a shift the gear that follows it.
fn requests(drive: &Drive) -> Vec<GearRequest> {
    let Some(gear) = drive.get(C::Gear) else {
        return vec![GearRequest::Automatic; drive.len];
    };
    let shifting = drive.get(C::ShiftInProcess);
    let mut next = GearRequest::Automatic;
    let mut out: Vec<GearRequest> = (0..drive.len)
        .rev()
        .map(|i| {
            let in_shift = shifting.is_some_and(|s| s[i] > 0.5);
            if !in_shift && gear[i] >= 1.0 {
                next = GearRequest::Gear(gear[i].min(255.0) as u8);
            }
            next
        })
        .collect();
    out.reverse();
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drive made by the model itself: constant pedal on the flat in a fixed gear.
    fn own_drive(truck: &TruckParameters) -> Drive {
        let model = TruckModel::new(truck.clone(), 20_000.0).unwrap();
        let mut s = model.initial_state(0.0, 0.0, 0.0, 20.0);
        let command = Command {
            accelerator_pedal_frac: 0.45,
            gear: GearRequest::Gear(s.shift.gear),
            ..Command::default()
        };
        let n = 2400;
        let mut columns = vec![Vec::new(); 4];
        for _ in 0..n {
            let e = model.ego_state(&s, &RoadPatch::default());
            let torque = 100.0 * s.engine_torque_nm / truck.engine.reference_torque_nm;
            for (c, x) in columns.iter_mut().zip([
                e.speed_m_s,
                e.powertrain.engine_speed_rad_s * RPM_PER_RAD_S,
                torque,
                f64::from(s.shift.gear),
            ]) {
                c.push(x);
            }
            s = model.step(&s, &command, &RoadPatch::default(), Drive::STEP_S).unwrap();
        }
        let mut drive = Drive::new("own", 0.0, n);
        for (c, x) in
            [C::SpeedMS, C::EngineSpeedRpm, C::EngineTorquePercent, C::Gear].iter().zip(columns)
        {
            drive.set(*c, x);
        }
        drive.set(C::AcceleratorPedalFrac, vec![0.45; n]);
        drive.reported_mass_kg = Some(model.mass_kg());
        drive
    }

    #[test]
    fn a_drive_of_the_model_itself_is_reproduced_and_a_wrong_truck_is_not() {
        let truck = TruckParameters::load("reference").unwrap();
        let drive = own_drive(&truck);
        let speed = |t: &TruckParameters, horizon_s| {
            let f = fidelity(t, &drive).unwrap();
            let is = |s: &&SignalFidelity| s.quantity == "speed_m_s" && s.horizon_s == horizon_s;
            *f.signals.iter().find(is).unwrap()
        };
        assert!(speed(&truck, None).accuracy_frac.unwrap() > 0.9999);
        assert!(speed(&truck, Some(60.0)).accuracy_frac.unwrap() > 0.9999);
        let worse = truck.with_parameter("resistance.rolling_coeff", 0.009).unwrap();
        assert!(speed(&worse, None).accuracy_frac.unwrap() < 0.99);
        assert!(speed(&worse, Some(60.0)).rmse > 2.0 * speed(&worse, Some(10.0)).rmse);
    }

    #[test]
    fn a_drive_without_pedal_names_the_column() {
        let truck = TruckParameters::load("reference").unwrap();
        let mut drive = own_drive(&truck);
        drive.remove(C::AcceleratorPedalFrac);
        let e = fidelity(&truck, &drive).unwrap_err().to_string();
        assert!(e.contains("accelerator_pedal_frac"), "{e}");
    }
}
