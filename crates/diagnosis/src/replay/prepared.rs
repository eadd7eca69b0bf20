//! A drive made ready for replay: channels with defaults, air density, masks per module.

use dynamics::effects::driveline::RELEASED_PEDAL_FRAC;
use dynamics::effects::resistance::air_density_kg_m3;
use dynamics::effects::table::TableSignal;
use tractrix_core::{GRAVITY_M_S2, RPM_PER_RAD_S, ZERO_DEGC_K};

use super::co2;
use super::inputs::Inputs;
use super::profiles::Profiles;
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

/// Grade over the position, on a uniform grid.
pub(crate) struct GradeBySection {
    start_m: f64,
    values: Vec<f64>,
}

const SECTION_M: f64 = 4.0;

impl GradeBySection {
    fn new(s: &[f64], grade: &[f64]) -> Self {
        let (lo, hi) =
            s.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |a, x| (a.0.min(*x), a.1.max(*x)));
        let cells = (((hi - lo) / SECTION_M) as usize + 2).min(1_000_000);
        let (mut sum, mut count) = (vec![0.0; cells], vec![0.0; cells]);
        for (s, g) in s.iter().zip(grade) {
            let i = (((s - lo) / SECTION_M) as usize).min(cells - 1);
            sum[i] += g;
            count[i] += 1.0;
        }
        let mut last = grade.first().copied().unwrap_or(0.0);
        let values = sum
            .iter()
            .zip(&count)
            .map(|(s, c)| {
                if *c > 0.0 {
                    last = s / c;
                }
                last
            })
            .collect();
        Self { start_m: lo, values }
    }

    pub(crate) fn at(&self, s_m: f64) -> f64 {
        let x = ((s_m - self.start_m) / SECTION_M - 0.5).max(0.0);
        let i = (x as usize).min(self.values.len() - 1);
        let j = (i + 1).min(self.values.len() - 1);
        self.values[i] + (x - i as f64).min(1.0) * (self.values[j] - self.values[i])
    }
}

/// Indicated torque up to which a message of 1 % a bit with its noise may be zero, percent of the
/// reference torque: what burns no more than this is not judged.
const CUT_OFF_PERCENT: f64 = 2.5;
/// Torque above which nobody brakes who has a foot on the accelerator, percent, and samples until brakes that were on are off.
const PULLS: f64 = 3.0;
const RELEASE: i32 = 30;

/// Fuel rate below which an engine that runs may be said not to burn any, g/s: half of idling.
const LEAST_FUEL_G_S: f64 = 0.2;

/// Samples after which a pressure that rests under a demand that rests says nothing new: a truck
/// that is held for an hour repeats the rounding of one message.
const RESTS: usize = 20;

/// Without a gear, a driveline counts from this engine speed over idling and this speed on, m/s, where
/// their ratio changes by less than a part in the margin of a shift.
const OVER_IDLE: f64 = 1.15;
const LEAST_M_S: f64 = 2.5;
const RESTS_FRAC: f64 = 0.03;

/// Rows of a logged coast-down are no further apart, s.
const LOGGED_S: f64 = 1.0;

/// Samples kept away from a shift on either side.
const SHIFT_MARGIN: usize = 12;

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
        d.balance = Inputs::new(&d, plant);
        d
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

    /// Where brakes that no channel shows may act: with the demand if that is there, otherwise
    /// wherever the engine does not pull.
    fn may_be_held(&self) -> Vec<bool> {
        let unseen = !self.has(&[C::BrakePressureKpa]);
        let demanded = unseen && self.has(&[C::XbrDecelMS2]);
        let coasting = unseen && !demanded || !self.has(&[C::EngineBrakeFrac]);
        let released = self.has(&[C::AcceleratorPedalFrac]);
        let mut left = 0;
        (0..self.n)
            .map(|i| {
                let pulls =
                    self.torque[i] >= PULLS && !(released && self.pedal[i] < RELEASED_PEDAL_FRAC);
                let held = demanded && self.xbr[i] > 0.0 || coasting && !pulls;
                left = if held { RELEASE } else { (left - 1).max(0) };
                left > 0
            })
            .collect()
    }

    fn mask(&mut self, plant: &Plant) {
        let n = self.n;
        let rows = |m: M, ok: &dyn Fn(usize, usize) -> bool| -> Vec<bool> {
            let step = m.row_step();
            (0..(n / step).saturating_sub(2)).map(|k| ok(k * step, (k + 1) * step)).collect()
        };
        let seconds =
            |m: M, ok: &dyn Fn(usize) -> bool| rows(m, &|a, b| (a..(b + 4).min(n)).all(ok));
        let mut valid: [Vec<bool>; MODULES] = Default::default();
        let pulled = self.has(&[C::EngineTorquePercent, C::EngineSpeedRpm, C::Gear]);
        if (pulled || self.coasts) && self.has(&[C::GradeFrac]) {
            let held = self.may_be_held();
            let rolls = |i: usize| self.coasts || self.engaged[i] && !held[i];
            valid[M::Force as usize] = seconds(M::Force, &|i| rolls(i) && self.speed[i] > 3.0);
        }
        if self.has(&[C::AcceleratorPedalFrac, C::EngineTorquePercent, C::EngineSpeedRpm]) {
            let idle = plant.truck.engine.idle_speed_rpm + 80.0;
            valid[M::Torque as usize] = rows(M::Torque, &|a, b| {
                (a..b).all(|i| self.engaged[i] && self.rpm[i] > idle && self.speed[i] > 3.0)
            });
        }
        if self.has(&[C::XbrDecelMS2, C::BrakePressureKpa]) {
            let tells: Vec<bool> = (0..n)
                .map(|i| {
                    let since = |samples: usize| i.saturating_sub(samples)..=i;
                    let held = since(RESTS).all(|j| {
                        self.pressure[j] == self.pressure[i] && self.xbr[j] == self.xbr[i]
                    });
                    !held && since(30).any(|j| self.xbr[j] > 0.0 || self.pressure[j] > 0.0)
                })
                .collect();
            valid[M::Brake as usize] = rows(M::Brake, &|a, b| (a..b).all(|i| tells[i]));
        }
        if self.has(&[C::ShiftInProcess]) {
            valid[M::Shift as usize] = vec![true; self.shifts.len()];
        }
        if self.has(&[C::FuelRateGS, C::EngineTorquePercent, C::EngineSpeedRpm]) {
            let reference_nm = plant.truck.engine.reference_torque_nm;
            let least_nm = 0.01 * CUT_OFF_PERCENT * reference_nm;
            let least_g_s: Vec<f64> = self
                .rpm
                .iter()
                .map(|rpm| plant.engine.fuel_rate_g_s(rpm / RPM_PER_RAD_S, least_nm))
                .collect();
            valid[M::Fuel as usize] = rows(M::Fuel, &|a, b| {
                // No fuel at all is the overrun cut-off of the engine control, not its map, and
                // near zero the torque message is cut at zero. Judged by the fuel: rows chosen by
                // a noisy torque are rows whose noise has one sign.
                (a..b)
                    .all(|i| self.engaged[i] && self.speed[i] > 3.0 && self.fuel[i] > least_g_s[i])
            });
        }
        if self.has(&[C::SteeringWheelRad]) {
            let moving: Vec<bool> = {
                let mut since = 0;
                self.speed
                    .iter()
                    .map(|v| {
                        since = if *v > 5.0 { since + 1 } else { 0 };
                        since > 80
                    })
                    .collect()
            };
            for (m, c) in [
                (M::Yaw, C::YawRateRadS),
                (M::TrailerYaw, C::TrailerYawRateRadS),
                (M::AccelY, C::AccelYMS2),
            ] {
                if self.has(&[c]) {
                    valid[m as usize] = rows(m, &|a, b| (a..b).all(|i| moving[i]));
                }
            }
        }
        if self.has(&[C::GpsSpeedMS]) {
            valid[M::Gps as usize] = rows(M::Gps, &|a, b| (a..b).all(|i| self.speed[i] > 2.0));
        }
        if self.has(&[C::GpsAltitudeM, C::GradeFrac]) {
            valid[M::Altitude as usize] = rows(M::Altitude, &|_, _| true);
        }
        if self.has(&[C::HeadingRad, C::YawRateRadS]) {
            valid[M::Heading as usize] = rows(M::Heading, &|_, _| true);
        }
        if self.has(&[C::AccelXMS2, C::GradeFrac]) {
            valid[M::Imu as usize] = seconds(M::Imu, &|i| self.speed[i] > 3.0);
        }
        if self.has(&[C::FuelRateGS, C::Co2RateGS]) {
            // An engine that stands still has no ratio, and what is measured first was burnt before
            // the log.
            let burns = |i: usize| self.fuel[i] > LEAST_FUEL_G_S;
            valid[M::Co2 as usize] = rows(M::Co2, &|a, b| a >= co2::TRANSPORT && (a..b).all(burns));
        }
        for (a, v) in self.available.iter_mut().zip(&valid) {
            *a = v.iter().filter(|x| **x).count() >= 8;
        }
        self.valid = valid;
    }
}

fn runs(on: &[bool]) -> Vec<(usize, usize)> {
    let mut out = Vec::new();
    let mut start = None;
    for (i, s) in on.iter().enumerate() {
        match (s, start) {
            (true, None) => start = Some(i),
            (false, Some(a)) => {
                out.push((a, i - a));
                start = None;
            }
            _ => {}
        }
    }
    out
}

/// In gear, clutch closed (engine speed fits the gear), no shift within the margin.
fn engaged(
    plant: &Plant,
    speed: &[f64],
    rpm: &[f64],
    gear: &[usize],
    shifting: &[bool],
) -> Vec<bool> {
    let n = speed.len();
    let mut near = vec![false; n];
    for i in 0..n {
        if shifting[i] || (i > 0 && gear[i] != gear[i - 1]) {
            let (a, b) = (i.saturating_sub(SHIFT_MARGIN), (i + SHIFT_MARGIN).min(n - 1));
            near[a..=b].fill(true);
        }
    }
    (0..n)
        .map(|i| {
            let in_gear = |g| plant.truck.driveline.engine_speed_rad_s(speed[i], g);
            let expected = u8::try_from(gear[i]).map_or(0.0, in_gear) * RPM_PER_RAD_S;
            expected != 0.0 && !near[i] && (rpm[i] - expected).abs() < 60.0 + 0.08 * expected
        })
        .collect()
}

/// Where no gear was logged: the engine pulls or is turned, and engine over road speed rests over the
/// margins of a shift, as it does in a gear whether or not a converter slips.
fn steady_ratio(plant: &Plant, speed: &[f64], rpm: &[f64]) -> Vec<bool> {
    let idle = plant.truck.engine.idle_speed_rpm;
    let ratio = |i: usize| {
        let turns = rpm[i] > OVER_IDLE * idle && speed[i] > LEAST_M_S;
        turns.then(|| (rpm[i] / speed[i]).ln())
    };
    let last = speed.len().saturating_sub(1);
    let around = |i: usize| [i.saturating_sub(SHIFT_MARGIN), i, (i + SHIFT_MARGIN).min(last)];
    (0..speed.len())
        .map(|i| {
            let [Some(before), Some(now), Some(after)] = around(i).map(ratio) else { return false };
            (now - before).abs() < RESTS_FRAC && (after - now).abs() < RESTS_FRAC
        })
        .collect()
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
