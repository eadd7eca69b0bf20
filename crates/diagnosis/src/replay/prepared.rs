//! A drive made ready for replay: channels with defaults, air density, masks per module.

use dynamics::effects::resistance::air_density_kg_m3;
use dynamics::effects::table::TableSignal;
use dynamics::lateral::TyreLaw;
use tractrix_core::{GRAVITY_M_S2, RPM_PER_RAD_S, ZERO_DEGC_K};

use super::co2;
use super::engaged::{engaged, runs, steady_ratio};
use super::grip::{Along, along, as_built};
use super::inputs::Inputs;
use super::profiles::Profiles;
use super::section::GradeBySection;
use super::smooth;
use super::{MODULES, Module as M};
use crate::{Channel as C, Drive, Plant};

/// A drive with everything that does not depend on the parameters.
pub(crate) struct Prepared {
    pub(crate) name: String,
    pub(crate) n: usize,
    pub(crate) mass_kg: f64,
    pub(crate) warm: bool,
    pub(crate) speed: Vec<f64>,
    pub(crate) gps: Vec<f64>,
    pub(crate) altitude: Vec<f64>,
    pub(crate) heading: Vec<f64>,
    /// Sine and cosine of the heading.
    pub(crate) course: Vec<(f64, f64)>,
    /// Cosine of the grade.
    pub(crate) slope: Vec<f64>,
    pub(crate) accel_x: Vec<f64>,
    pub(crate) pedal: Vec<f64>,
    pub(crate) torque: Vec<f64>,
    pub(crate) rpm: Vec<f64>,
    /// Engine speed, rad/s.
    pub(super) omega: Vec<f64>,
    /// The same without the noise of its message.
    pub(super) turning: Vec<f64>,
    pub(crate) gear: Vec<usize>,
    pub(crate) engine_brake: Vec<f64>,
    pub(crate) xbr: Vec<f64>,
    pub(crate) pressure: Vec<f64>,
    /// Pressure that brakes, finer than its message resolves.
    pub(crate) fine_pressure: Vec<f64>,
    pub(crate) steer: Vec<f64>,
    pub(crate) yaw: Vec<f64>,
    pub(crate) trailer_yaw: Vec<f64>,
    pub(crate) accel_y: Vec<f64>,
    pub(crate) fuel: Vec<f64>,
    pub(crate) co2: Vec<f64>,
    pub(crate) coolant: Vec<f64>,
    pub(crate) ambient: Vec<f64>,
    pub(crate) density: Vec<f64>,
    pub(crate) grade: Vec<f64>,
    pub(crate) curvature: Vec<f64>,
    pub(crate) s_map: Vec<f64>,
    pub(crate) grade_by_s: GradeBySection,
    /// Noise of the fuel rate and of the CO2 rate per row, g/s.
    fuel_noise_g_s: Vec<f64>,
    pub(super) co2_noise_g_s: Vec<f64>,
    /// Full-load torque at the engine speed of every sample, Nm.
    pub(super) full_load: Vec<f64>,
    pub(super) balance: Inputs,
    /// What is driven and braked, for tyres that saturate; else nothing.
    pub(super) along: Vec<Along>,
    pub(super) profiles: Profiles,
    /// The ratio of the driveline is that of engine and road speed: nobody logged the gear.
    pub(super) measured_ratio: bool,
    /// A logged coast-down: nothing but the road load acts.
    pub(crate) coasts: bool,
    /// Closed driveline without a shift near, per sample.
    pub(crate) engaged: Vec<bool>,
    /// Shifts as (first sample, number of samples).
    pub(crate) shifts: Vec<(usize, usize)>,
    /// Rows that count, per module.
    pub(crate) valid: [Vec<bool>; MODULES],
    pub(crate) available: [bool; MODULES],
    pub(crate) has: Vec<C>,
}

/// Rows of a logged coast-down are no further apart, s.
const LOGGED_S: f64 = 1.0;

impl Prepared {
    pub(crate) fn new(drive: &Drive, plant: &Plant) -> Self {
        let n = drive.len;
        let get =
            |c: C, default: f64| drive.get(c).map_or_else(|| vec![default; n], <[f64]>::to_vec);
        let has: Vec<C> = C::all().filter(|c| drive.has(*c)).collect();
        let speed = get(C::SpeedMS, 0.0);
        let s_map = drive.get(C::SMapM).map_or_else(
            || {
                let mut s = 0.0;
                speed
                    .iter()
                    .map(|v| {
                        s += v * Drive::STEP_S;
                        s
                    })
                    .collect()
            },
            <[f64]>::to_vec,
        );
        let grade = get(C::GradeFrac, 0.0);
        let ambient = get(C::AmbientTempDegc, 15.0);
        let density = get(C::BaroPressurePa, 101_325.0)
            .iter()
            .zip(&ambient)
            .map(|(p, t)| air_density_kg_m3(*p, t + ZERO_DEGC_K))
            .collect();
        let rpm = get(C::EngineSpeedRpm, plant.truck.engine.idle_speed_rpm);
        let omega: Vec<f64> = rpm.iter().map(|n| n / RPM_PER_RAD_S).collect();
        let turning = smooth::running_mean(&omega, smooth::CRANK);
        let altitude = get(C::GpsAltitudeM, 0.0);
        let full_load = turning.iter().map(|n| plant.engine.full_load_nm.at(*n)).collect();
        let gear: Vec<usize> = get(C::Gear, 0.0).iter().map(|g| g.max(0.0) as usize).collect();
        let shifting: Vec<bool> = get(C::ShiftInProcess, 0.0).iter().map(|s| *s > 0.5).collect();
        let shifts = runs(&shifting);
        let engaged = if drive.gear_derived {
            steady_ratio(plant, &speed, &rpm)
        } else {
            engaged(plant, &speed, &rpm, &gear, &shifting)
        };
        let mut heading = get(C::HeadingRad, 0.0);
        unwrap(&mut heading);
        let mut d = Self {
            name: drive.name.clone(),
            n,
            mass_kg: drive.reported_mass_kg.unwrap_or(plant.mass_kg),
            warm: drive.tyres_warm_at_start.unwrap_or(true),
            gps: get(C::GpsSpeedMS, 0.0),
            altitude,
            course: heading.iter().map(|h| h.sin_cos()).collect(),
            slope: grade.iter().map(|g| 1.0 / (1.0 + g * g).sqrt()).collect(),
            heading,
            accel_x: get(C::AccelXMS2, 0.0),
            // Without the pedal, torque says whether the accelerator is released.
            pedal: match drive.get(C::AcceleratorPedalFrac) {
                Some(_) => get(C::AcceleratorPedalFrac, 0.0),
                None => get(C::EngineTorquePercent, 0.0).iter().map(|t| 0.01 * t).collect(),
            },
            torque: get(C::EngineTorquePercent, 0.0),
            engine_brake: get(C::EngineBrakeFrac, 0.0),
            xbr: get(C::XbrDecelMS2, 0.0),
            pressure: get(C::BrakePressureKpa, 0.0),
            fine_pressure: Vec::new(),
            steer: smooth::quadratic(&get(C::SteeringWheelRad, 0.0)),
            yaw: get(C::YawRateRadS, 0.0),
            trailer_yaw: get(C::TrailerYawRateRadS, 0.0),
            accel_y: get(C::AccelYMS2, 0.0),
            fuel: get(C::FuelRateGS, 0.0),
            co2: get(C::Co2RateGS, 0.0),
            coolant: smooth::running_mean(&get(C::CoolantTempDegc, 80.0), smooth::COOLANT),
            curvature: get(C::Curvature1M, 0.0),
            grade_by_s: GradeBySection::new(&s_map, &grade),
            fuel_noise_g_s: super::powertrain::noise_g_s(&get(C::FuelRateGS, 0.0)),
            co2_noise_g_s: co2::noise_g_s(&get(C::Co2RateGS, 0.0), &get(C::FuelRateGS, 0.0)),
            full_load,
            omega,
            turning,
            balance: Inputs::default(),
            along: Vec::new(),
            profiles: Profiles::default(),
            speed,
            rpm,
            gear,
            ambient,
            density,
            grade,
            s_map,
            measured_ratio: drive.gear_derived,
            coasts: drive.coast_down.as_ref().is_some_and(|c| c.step_s <= LOGGED_S),
            engaged,
            shifts,
            valid: Default::default(),
            available: [false; MODULES],
            has,
        };
        d.mask(plant);
        d.fine_pressure = super::brake::resolved(&d, plant);
        d.along = d.along(plant);
        d.balance = Inputs::new(&d, plant);
        d
    }

    /// What is driven and braked by the truck as it was built; nothing where tyres do not saturate.
    fn along(&mut self, plant: &Plant) -> Vec<Along> {
        if plant.lateral.tyres.law == TyreLaw::Linear {
            return Vec::new();
        }
        // what could be built is built without what causes put on it, too
        let Ok(built) = Plant::of_truck(&as_built(&plant.truck)) else { return Vec::new() };
        self.balance = Inputs::new(self, &built);
        let along = along(self, &built);
        self.profiles = Profiles::default();
        along
    }

    /// The measured signal that a module explains; empty for shifts, which are events.
    pub(crate) fn measured(&self, m: M) -> &[f64] {
        match m {
            M::Force => &self.speed,
            M::Torque => &self.torque,
            M::Brake => &self.pressure,
            M::Shift => &[],
            M::Fuel => &self.fuel,
            M::Yaw => &self.yaw,
            M::TrailerYaw => &self.trailer_yaw,
            M::AccelY => &self.accel_y,
            M::Gps => &self.gps,
            M::Altitude => &self.altitude,
            M::Heading => &self.heading,
            M::Imu => &self.accel_x,
            M::Co2 => &self.co2,
        }
    }

    /// The unit of a row's residual in that of the module's quantity: rates come over a noise that
    /// grows with them.
    pub(crate) fn row_unit(&self, m: M, row: usize) -> f64 {
        let noise = match m {
            M::Fuel => &self.fuel_noise_g_s,
            M::Co2 => &self.co2_noise_g_s,
            _ => return 1.0,
        };
        noise.get(row).copied().unwrap_or(1.0)
    }

    /// The same on the average of the drive.
    pub(crate) fn mean_unit(&self, m: M) -> f64 {
        let noise = match m {
            M::Fuel => &self.fuel_noise_g_s,
            M::Co2 => &self.co2_noise_g_s,
            _ => return 1.0,
        };
        noise.iter().sum::<f64>() / noise.len().max(1) as f64
    }

    /// What a fitted table of the truck file follows.
    pub(super) fn signal(&self, signal: TableSignal, i: usize) -> f64 {
        match signal {
            TableSignal::EngineSpeedRpm => self.rpm[i],
            TableSignal::SpeedMS => self.speed[i],
            TableSignal::Curvature1M => self.curvature[i].abs(),
            TableSignal::GradeFrac => self.grade[i],
            TableSignal::AmbientTempDegc => self.ambient[i],
            TableSignal::CoolantTempDegc => self.coolant[i],
            TableSignal::AcceleratorPedalFrac => self.pedal[i],
            TableSignal::BrakePressureKpa => self.pressure[i],
            TableSignal::GpsAltitudeM => self.altitude[i],
            TableSignal::Gear => self.gear[i] as f64,
            TableSignal::EngineTorquePercent => self.torque[i],
            TableSignal::EngineBrakeFrac => self.engine_brake[i],
            TableSignal::XbrDecelMS2 => self.xbr[i],
            TableSignal::YawRateRadS => self.yaw[i],
            TableSignal::AccelYMS2 => self.accel_y[i],
            TableSignal::SteeringWheelRad => self.steer[i],
        }
    }

    pub(crate) fn has(&self, channels: &[C]) -> bool {
        channels.iter().all(|c| self.has.contains(c))
    }

    /// Gravity's component along the road per metre of grade error, m/s².
    pub(crate) fn gravity_along(grade_frac: f64) -> f64 {
        GRAVITY_M_S2 * grade_frac / (1.0 + grade_frac * grade_frac).sqrt()
    }
}

fn unwrap(angle: &mut [f64]) {
    let turn = 2.0 * core::f64::consts::PI;
    let mut add = 0.0;
    for i in 1..angle.len() {
        let raw = angle[i] + add;
        let jump = raw - angle[i - 1];
        add -= (jump / turn).round() * turn;
        angle[i] += add;
    }
}

/// Linear interpolation at a fractional index, held at the ends.
#[inline]
pub(super) fn at_index(x: &[f64], index: f64) -> f64 {
    if index <= 0.0 {
        return x[0];
    }
    let i = index as usize;
    if i + 1 >= x.len() {
        return x[x.len() - 1];
    }
    x[i] + (index - i as f64) * (x[i + 1] - x[i])
}

/// Running sum with a leading zero: `sum[j] - sum[i]` is the sum over `i..j`.
pub(super) fn running_sum(x: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut sum = 0.0;
    core::iter::once(0.0)
        .chain(x.map(|v| {
            sum += v;
            sum
        }))
        .collect()
}
