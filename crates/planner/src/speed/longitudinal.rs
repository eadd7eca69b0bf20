//! Speed control: inverse-model feed-forward plus PI, and the choice between pedal, coasting,
//! retarder and service brake.
//!
//! Wanted acceleration `a = a_ref + K (v_ref - v) + I`, limited by what traffic allows; wanted wheel
//! force `F = m_eff a + resistance(v, grade)`. The pedal delivers every `F` above the engine's drag,
//! the retarder what is below it, the service brake (XBR) what the retarder cannot. Changing
//! between driving and braking needs a margin (`band_m_s2`) and a dwell time, except in an
//! emergency. The integrator rests while an actuator is at its end, while traffic rules and while
//! the gearbox shifts (anti-windup). The wanted acceleration changes at most with the jerk that
//! traffic allows, the comfortable one by default. At standstill the brakes hold the truck until the
//! clutch carries it.

use super::road_load::{InGear, effective_mass_kg, road_under};
use crate::PlannerError;
use crate::error::config_in;
use serde::{Deserialize, Serialize};
use tractrix_core::{BrakeMode, EgoState, GRAVITY_M_S2, VehicleLimits};

/// A rolling truck is this much faster or slower than its reference before it brakes or drives,
/// m/s. The next plan starts from where it is.
const COAST_FAST_M_S: f64 = 0.3;
/// See [`COAST_FAST_M_S`].
const COAST_SLOW_M_S: f64 = 0.5;
/// Speed below which the brakes hold the truck, m/s.
const STANDS_M_S: f64 = 0.1;
/// Deceleration that holds it on the level, m/s².
const HOLD_M_S2: f64 = 0.4;

/// Speed-control parameters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LongitudinalConfig {
    /// Proportional gain, 1/s.
    pub gain_1_s: f64,
    /// Integral time, s.
    pub integral_time_s: f64,
    /// Limit of the integral part, m/s².
    pub integral_limit_m_s2: f64,
    /// Largest acceleration, m/s².
    pub accel_max_m_s2: f64,
    /// Largest deceleration for the reference speed, m/s²; traffic may ask for more.
    pub decel_max_m_s2: f64,
    /// Margin for changing between driving and braking, m/s².
    pub band_m_s2: f64,
    /// Least time between two such changes, s.
    pub dwell_s: f64,
    /// A wanted deceleration from which on margin and dwell do not count, m/s².
    pub urgent_decel_m_s2: f64,
    /// Largest rate of the pedal, 1/s.
    pub pedal_rate_1_s: f64,
    /// Share of the retarder used before the service brake helps, 0 to 1.
    pub retarder_use_frac: f64,
    /// Comfortable jerk: rate at which the wanted acceleration changes while nothing presses, m/s³.
    pub jerk_m_s3: f64,
}

impl Default for LongitudinalConfig {
    fn default() -> Self {
        Self {
            gain_1_s: 0.5,
            integral_time_s: 8.0,
            integral_limit_m_s2: 0.3,
            accel_max_m_s2: 0.8,
            decel_max_m_s2: 1.2,
            band_m_s2: 0.06,
            dwell_s: 0.5,
            urgent_decel_m_s2: 1.0,
            pedal_rate_1_s: 1.2,
            retarder_use_frac: 0.95,
            jerk_m_s3: 0.8,
        }
    }
}

impl LongitudinalConfig {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`PlannerError::Config`] names the key.
    pub fn check(&self) -> Result<(), PlannerError> {
        config_in("longitudinal.gain_1_s", self.gain_1_s, 0.0, 5.0)?;
        config_in("longitudinal.integral_time_s", self.integral_time_s, 0.5, 1e6)?;
        config_in("longitudinal.integral_limit_m_s2", self.integral_limit_m_s2, 0.0, 2.0)?;
        config_in("longitudinal.accel_max_m_s2", self.accel_max_m_s2, 0.05, 3.0)?;
        config_in("longitudinal.decel_max_m_s2", self.decel_max_m_s2, 0.1, 6.0)?;
        config_in("longitudinal.band_m_s2", self.band_m_s2, 0.0, 0.5)?;
        config_in("longitudinal.dwell_s", self.dwell_s, 0.0, 10.0)?;
        config_in("longitudinal.urgent_decel_m_s2", self.urgent_decel_m_s2, 0.1, 5.0)?;
        config_in("longitudinal.pedal_rate_1_s", self.pedal_rate_1_s, 0.05, 100.0)?;
        config_in("longitudinal.retarder_use_frac", self.retarder_use_frac, 0.0, 1.0)?;
        config_in("longitudinal.jerk_m_s3", self.jerk_m_s3, 0.1, 100.0)
    }
}

impl LongitudinalConfig {
    /// Acceleration that brings the truck to its reference speed, m/s².
    #[must_use]
    pub(crate) fn tracking_m_s2(&self, target: &SpeedTarget, speed_m_s: f64) -> f64 {
        target.accel_m_s2 + self.gain_1_s * (target.speed_m_s - speed_m_s)
    }

    /// What is asked for where `wanted_m_s2` would be good for the reference, m/s²; and that without
    /// traffic, m/s².
    #[must_use]
    pub(crate) fn asked_m_s2(&self, target: &SpeedTarget, wanted_m_s2: f64) -> (f64, f64) {
        let cruise = wanted_m_s2.clamp(-self.decel_max_m_s2, self.accel_max_m_s2);
        (cruise.min(target.traffic_accel_m_s2), cruise)
    }
}

/// What the speed controller is to follow.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct SpeedTarget {
    /// Reference speed, m/s.
    pub speed_m_s: f64,
    /// Reference acceleration, m/s².
    pub accel_m_s2: f64,
    /// Acceleration not to be exceeded because of traffic, m/s²; infinite without traffic.
    pub traffic_accel_m_s2: f64,
    /// Factor on the comfortable jerk with which traffic is answered, from 1; infinite in an
    /// emergency.
    pub haste: f64,
    /// Grade at the truck, rad, mean over its length.
    pub grade_rad: f64,
    /// Speed, m/s, and acceleration, m/s², from which on the truck brakes; up to there it rolls
    /// where it is faster than the reference. None: it brakes for the reference.
    pub brake_from: Option<(f64, f64)>,
    /// The reference is made for rolling on without fuel and brake.
    pub coast: bool,
}

/// Pedal, retarder and brake of one control step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct SpeedCommand {
    /// Accelerator pedal, 0 to 1.
    pub accelerator_pedal_frac: f64,
    /// Retarder demand, 0 to 1.
    pub retarder_frac: f64,
    /// Service-brake deceleration, m/s².
    pub xbr_decel_m_s2: f64,
    /// Brake mode that goes with it.
    pub brake_mode: BrakeMode,
    /// The acceleration that is asked for, m/s².
    pub accel_m_s2: f64,
    /// Traffic sets it, not the reference.
    pub traffic_rules: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Actuator {
    Drive,
    Brake,
}

/// The speed controller.
#[derive(Debug, Clone)]
pub(crate) struct LongitudinalController {
    config: LongitudinalConfig,
    integral_m_s2: f64,
    actuator: Actuator,
    in_actuator_s: f64,
    service_brake: bool,
    pedal_frac: f64,
    coasting: bool,
    /// The wanted acceleration of the last step, m/s².
    accel_m_s2: Option<f64>,
}

impl LongitudinalController {
    /// A controller at rest.
    #[must_use]
    pub(crate) fn new(config: LongitudinalConfig) -> Self {
        Self {
            config,
            integral_m_s2: 0.0,
            actuator: Actuator::Drive,
            in_actuator_s: 0.0,
            service_brake: false,
            pedal_frac: 0.0,
            coasting: false,
            accel_m_s2: None,
        }
    }

    /// One step of `dt_s`.
    #[must_use]
    pub(crate) fn step(
        &mut self,
        dt_s: f64,
        ego: &EgoState,
        target: &SpeedTarget,
        limits: &VehicleLimits,
    ) -> SpeedCommand {
        let c = self.config;
        let signals = &ego.powertrain;
        let in_gear = InGear::new(&limits.powertrain, signals.gear, ego.speed_m_s);
        let error = target.speed_m_s - ego.speed_m_s;
        let mass = effective_mass_kg(limits, &in_gear);
        let load = &limits.road_load;
        let road = road_under(load, ego, target.grade_rad);
        let resistance = load.resistance_n(ego.speed_m_s, &road);
        let coast = in_gear.coast_force_n();
        let asked = c.tracking_m_s2(target, ego.speed_m_s) + self.integral_m_s2;
        let wanted = target.brake_from.map_or(asked, |(speed_m_s, accel_m_s2)| {
            let braked = accel_m_s2 + c.gain_1_s * (speed_m_s - ego.speed_m_s);
            asked.max(braked.min((coast - resistance) / mass))
        });
        let (asked, cruise) = c.asked_m_s2(target, wanted);
        let traffic_rules = asked < cruise;
        let accel = self.smoothed(dt_s, asked, c.jerk_m_s3 * target.haste.max(1.0));
        self.coasting = target.coast && self.may_coast(error, target, ego.accel_x_m_s2);
        if self.coasting {
            return self.roll(dt_s, accel);
        }

        let force = mass * accel + resistance;
        self.choose_actuator(dt_s, force - coast, mass, accel);

        let (pedal, retarder_frac, xbr) = match self.actuator {
            Actuator::Drive => (in_gear.pedal_frac(force), 0.0, 0.0),
            Actuator::Brake => {
                let (retarder, xbr) = self.split_brakes(coast - force, &in_gear, mass, accel);
                (0.0, retarder, xbr)
            }
        };
        let step = c.pedal_rate_1_s * dt_s;
        self.pedal_frac = match self.actuator {
            Actuator::Drive => pedal.clamp(self.pedal_frac - step, self.pedal_frac + step),
            Actuator::Brake => 0.0,
        };

        let at_end = (force > in_gear.max_force_n() && error > 0.0)
            || (self.actuator == Actuator::Drive && force < coast && error < 0.0)
            || wanted != asked
            || wanted != cruise
            || traffic_rules;
        if !at_end && !signals.shift_in_progress && signals.gear > 0 {
            let slope = c.gain_1_s / c.integral_time_s * error;
            self.integral_m_s2 = (self.integral_m_s2 + slope * dt_s)
                .clamp(-c.integral_limit_m_s2, c.integral_limit_m_s2);
        }
        let xbr = self.hold(ego, target, limits, accel).map_or(xbr, |hold| xbr.max(hold));
        SpeedCommand {
            accelerator_pedal_frac: self.pedal_frac,
            retarder_frac,
            xbr_decel_m_s2: xbr,
            brake_mode: if xbr > 0.0 { BrakeMode::Maximum } else { BrakeMode::Off },
            accel_m_s2: accel,
            traffic_rules,
        }
    }

    /// The wanted acceleration after a step in which it may change with this jerk, m/s².
    fn smoothed(&mut self, dt_s: f64, asked_m_s2: f64, jerk_m_s3: f64) -> f64 {
        let step = jerk_m_s3 * dt_s;
        let from = self.accel_m_s2.unwrap_or(asked_m_s2);
        let accel = asked_m_s2.clamp(from - step, from + step);
        self.accel_m_s2 = Some(accel);
        accel
    }

    /// Brake that holds a standing truck, m/s²: while it is to stand, and uphill until the clutch
    /// carries it.
    fn hold(
        &mut self,
        ego: &EgoState,
        target: &SpeedTarget,
        limits: &VehicleLimits,
        accel_m_s2: f64,
    ) -> Option<f64> {
        let load = &limits.road_load;
        let slope_n = load.resistance_n(0.0, &road_under(load, ego, target.grade_rad));
        let stands = ego.speed_m_s.abs() < STANDS_M_S;
        let to_stand = accel_m_s2 <= 0.0;
        if to_stand && stands {
            self.pedal_frac = 0.0;
        }
        let sinks = target.grade_rad > 0.0 && ego.powertrain.drive_force_n < slope_n;
        let hold = stands && (to_stand || sinks);
        hold.then(|| HOLD_M_S2 + GRAVITY_M_S2 * libm::sin(target.grade_rad.abs()))
    }

    /// Whether the truck may roll on: near enough to the reference, a little too fast less than too
    /// slow, and traffic does not ask for more than rolling gives.
    fn may_coast(&self, error_m_s: f64, target: &SpeedTarget, accel_m_s2: f64) -> bool {
        let room = if self.coasting { 1.0 } else { 0.5 };
        error_m_s > -COAST_FAST_M_S * room
            && error_m_s < COAST_SLOW_M_S * room
            && target.traffic_accel_m_s2 > accel_m_s2 - self.config.band_m_s2
    }

    /// Neither pedal nor brake; the integrator rests.
    fn roll(&mut self, dt_s: f64, accel_m_s2: f64) -> SpeedCommand {
        self.accel_m_s2 = Some(accel_m_s2);
        self.in_actuator_s += dt_s;
        self.actuator = Actuator::Drive;
        self.service_brake = false;
        self.pedal_frac = (self.pedal_frac - self.config.pedal_rate_1_s * dt_s).max(0.0);
        SpeedCommand {
            accelerator_pedal_frac: self.pedal_frac,
            accel_m_s2,
            ..SpeedCommand::default()
        }
    }

    /// Driving or braking, with margin and dwell. `surplus_n` is the force above the engine's drag.
    fn choose_actuator(&mut self, dt_s: f64, surplus_n: f64, mass_kg: f64, accel_m_s2: f64) {
        let c = &self.config;
        self.in_actuator_s += dt_s;
        let margin_n = c.band_m_s2 * mass_kg;
        let next = if surplus_n < -margin_n {
            Actuator::Brake
        } else if surplus_n > margin_n {
            Actuator::Drive
        } else {
            self.actuator
        };
        let urgent = accel_m_s2 < -c.urgent_decel_m_s2 && surplus_n < 0.0;
        if next != self.actuator && (urgent || self.in_actuator_s >= c.dwell_s) {
            self.actuator = next;
            self.in_actuator_s = 0.0;
            self.pedal_frac = 0.0;
            self.service_brake = false;
        }
    }

    /// Retarder first, service brake for the rest; the service brake joins and leaves with margin.
    fn split_brakes(
        &mut self,
        brake_n: f64,
        in_gear: &InGear<'_>,
        mass_kg: f64,
        accel_m_s2: f64,
    ) -> (f64, f64) {
        let c = &self.config;
        let available = in_gear.max_retarder_force_n();
        let usable = c.retarder_use_frac * available;
        let brake_n = brake_n.max(0.0);
        let rest_m_s2 = (brake_n - usable).max(0.0) / mass_kg;
        self.service_brake = if accel_m_s2 < -c.urgent_decel_m_s2 {
            rest_m_s2 > 0.0
        } else if self.service_brake {
            brake_n > 0.8 * usable
        } else {
            rest_m_s2 > c.band_m_s2
        };
        let share = |force_n: f64| if available > 0.0 { force_n / available } else { 0.0 };
        if self.service_brake {
            (share(brake_n.min(usable)), rest_m_s2)
        } else {
            (share(brake_n.min(available)), 0.0)
        }
    }
}
