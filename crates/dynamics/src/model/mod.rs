//! The truck: all effects in one step.
//!
//! ```text
//! m_eff dv/dt = F_drive - F_retarder - F_brake - F_roll - F_air - F_grade - F_curve + F_table
//! ```
//! with the paths of `effects`: pedal → engine → clutch → gearbox → wheels, demand → pressure →
//! force, wind and road → resistance; yaw and sideslip from [`crate::lateral`]. The step is a pure
//! function; it is cut into substeps of [`SUBSTEP_S`], so that the result does not depend on how
//! often it is called. At standstill brakes and rolling resistance hold the truck up to what they
//! can, and no force moves it through zero backwards other than the grade and the driveline.

mod balance;
mod powertrain;

use tractrix_core::{BrakeMode, Command, Curve, RPM_PER_RAD_S};

use crate::effects::brake::{BrakeParameters, GROUPS};
use crate::effects::cooling::HeatSources;
use crate::effects::engine::Engine;
use crate::effects::shift::ShiftState;
use crate::effects::table::{self, TableSignal};
use crate::lateral::{GROUP_AXLES, LateralInputs, LateralModel, LateralOutputs, LateralState};
use crate::state::{Forces, RoadPatch, SUBSTEP_S, TruckState};
use crate::{DynamicsError, TruckParameters};

/// Speed below which static friction decides, m/s.
const STANDSTILL_M_S: f64 = 1e-3;
/// Coolant of a truck file without a cooling block: time constant, s, rise per indicated power, K/W,
/// level at no load above air, K.
const COOLANT: (f64, f64, f64) = (240.0, 9.0e-5, 60.0);

/// A truck in one loading state.
#[derive(Debug, Clone)]
pub struct TruckModel {
    pub(crate) parameters: TruckParameters,
    pub(crate) engine: Engine,
    pub(crate) lateral: LateralModel,
    pub(crate) mass_kg: f64,
    /// Share of braking per axle group: its share of the load.
    pub(crate) brake_share: [f64; GROUPS],
    /// Pressure over deceleration of the steer, drive and trailer axles.
    brake_tables: Option<[Curve; GROUPS]>,
    tables: Vec<(TableSignal, Curve)>,
    /// Engine speed per road speed in each gear, rad/m.
    ratio_rad_m: Vec<f64>,
    /// Efficiency engine to wheel in each gear.
    efficiency_frac: Vec<f64>,
    pedal_steps: u8,
    brake_steps: u8,
}

impl TruckModel {
    /// A truck whose load sheet says a payload.
    ///
    /// # Errors
    /// [`DynamicsError::OutOfBounds`] if the payload or a parameter cannot be used.
    pub fn new(mut parameters: TruckParameters, payload_kg: f64) -> Result<Self, DynamicsError> {
        let refuse = |name: &str, why: String| DynamicsError::OutOfBounds {
            name: name.to_owned(),
            violations: vec![why],
        };
        parameters.lateral.payload.mass_kg = 0.0;
        let empty_kg = parameters.lateral.total_mass_kg();
        parameters.lateral.payload.mass_kg =
            parameters.instruments.true_payload_kg(empty_kg, payload_kg);
        let name = parameters.name.clone();
        let lateral =
            LateralModel::new(&parameters.lateral).map_err(|e| refuse(&name, e.to_string()))?;
        let engine =
            Engine::new(parameters.engine.clone()).map_err(|e| refuse(&name, e.to_string()))?;
        let brake_tables = parameters
            .brake
            .pressure_tables(parameters.lateral.total_mass_kg())
            .map_err(|e| refuse(&name, e.to_string()))?;
        let tables: Result<Vec<_>, _> =
            parameters.table_effects.iter().map(table::TableEffect::curve).collect();
        let tables = tables.map_err(|e| refuse(&name, e.to_string()))?;
        let axle_load_n = parameters.lateral.static_axle_load_n();
        let total: f64 = axle_load_n.iter().sum();
        let gears = 1..=parameters.driveline.top_gear();
        let steps = |s: f64| libm::round(s / SUBSTEP_S).clamp(0.0, 127.0) as u8;
        Ok(Self {
            mass_kg: parameters.lateral.total_mass_kg(),
            brake_share: GROUP_AXLES.map(|r| axle_load_n[r].iter().sum::<f64>() / total),
            ratio_rad_m: gears
                .clone()
                .map(|g| parameters.driveline.engine_speed_rad_s(1.0, g))
                .collect(),
            efficiency_frac: gears.map(|g| parameters.driveline.efficiency_frac(g)).collect(),
            pedal_steps: steps(parameters.engine.pedal_delay_s),
            brake_steps: steps(parameters.brake.dead_time_s),
            engine,
            lateral,
            brake_tables,
            tables,
            parameters,
        })
    }

    /// The truck file in use, with the payload.
    #[must_use]
    pub const fn parameters(&self) -> &TruckParameters {
        &self.parameters
    }

    /// Total mass, kg.
    #[must_use]
    pub const fn mass_kg(&self) -> f64 {
        self.mass_kg
    }

    /// The lateral model.
    #[must_use]
    pub const fn lateral(&self) -> &LateralModel {
        &self.lateral
    }

    /// A state at rest or rolling at `speed_m_s` in a fitting gear, straight, at a pose.
    #[must_use]
    pub fn initial_state(&self, x_m: f64, y_m: f64, yaw_rad: f64, speed_m_s: f64) -> TruckState {
        let idle = self.engine.idle_rad_s;
        let up = self.parameters.shift.up_speed_rpm[0] / RPM_PER_RAD_S;
        let fits = |i: &usize| speed_m_s * self.ratio_rad_m[*i] <= up;
        let top = self.ratio_rad_m.len() - 1;
        let first = usize::from(self.parameters.driveline.launch_gear) - 1;
        let index = (first..=top).find(fits).unwrap_or(top);
        let d = &self.parameters.driveline;
        let geared = speed_m_s * self.ratio_rad_m[index];
        let locked = geared > idle;
        TruckState {
            lateral: LateralState::at(x_m, y_m, yaw_rad),
            speed_m_s,
            accel_m_s2: 0.0,
            distance_m: 0.0,
            substeps: 0,
            engine_speed_rad_s: geared.max(idle),
            engine_torque_nm: self.engine.friction_nm(idle) + self.engine.auxiliary_nm(idle, 0.0),
            engine_brake_nm: 0.0,
            retarder_nm: 0.0,
            clutch_locked: locked,
            clutch_frac: if locked { 1.0 } else { -d.clutch_delay_s / d.clutch_closing_s },
            clutch_heat_j: 0.0,
            shift: ShiftState {
                gear: index as u8 + 1,
                target: index as u8 + 1,
                since_shift_s: self.parameters.shift.hold_s,
                ..ShiftState::default()
            },
            brake: crate::effects::brake::BrakeState {
                temperature_k: [BrakeParameters::START_K; GROUPS],
                lining_k: [BrakeParameters::START_K; GROUPS],
                reservoir_frac: 1.0,
                ..Default::default()
            },
            tyre_warmth: 0.0,
            coolant_k: 355.0,
            overheat_k: 0.0,
            fan_on_frac: 0.0,
            fuel_g: 0.0,
            fuel_rate_g_s: 0.0,
            forces: Forces::default(),
            pedal_line: crate::state::DelayLine::default(),
            brake_line: crate::state::DelayLine::default(),
        }
    }

    /// Moves the truck by `duration_s` (a multiple of [`SUBSTEP_S`]; rounded to one) under a
    /// command on a road patch.
    ///
    /// # Errors
    /// [`DynamicsError::NonFinite`] names the effect whose result is not finite.
    pub fn step(
        &self,
        state: &TruckState,
        command: &Command,
        patch: &RoadPatch,
        duration_s: f64,
    ) -> Result<TruckState, DynamicsError> {
        let mut s = *state;
        self.advance(&mut s, command, patch, duration_s)?;
        Ok(s)
    }

    /// As [`Self::step`], in place: after an error the state is what is not finite, or what it was.
    ///
    /// # Errors
    /// As [`Self::step`].
    pub fn advance(
        &self,
        s: &mut TruckState,
        command: &Command,
        patch: &RoadPatch,
        duration_s: f64,
    ) -> Result<(), DynamicsError> {
        command.check_finite().map_err(|e| match e {
            tractrix_core::CoreError::NonFinite { field, value } => {
                DynamicsError::NonFinite { effect: "command", quantity: field, value }
            }
            _ => DynamicsError::NonFinite { effect: "command", quantity: "?", value: f64::NAN },
        })?;
        let patch = &self.true_patch(patch);
        for _ in 0..libm::round(duration_s / SUBSTEP_S).max(0.0) as u32 {
            self.substep(s, command, patch);
        }
        check("longitudinal", "speed_m_s", s.speed_m_s)?;
        check("engine", "engine_speed_rad_s", s.engine_speed_rad_s)?;
        check("engine", "engine_torque_nm", s.engine_torque_nm)?;
        check("lateral", "yaw_rate_rad_s", s.lateral.yaw_rate_rad_s)?;
        check("lateral", "articulation_rad", s.lateral.articulation_rad)?;
        check("lateral", "x_m", s.lateral.x_m)?;
        check("lateral", "y_m", s.lateral.y_m)?;
        check("brake", "temperature_k", s.brake.temperature_k[1])
    }

    fn substep(&self, s: &mut TruckState, command: &Command, patch: &RoadPatch) {
        let pedal =
            s.pedal_line.pass(command.accelerator_pedal_frac.clamp(0.0, 1.0), self.pedal_steps);
        let decel = match command.brake_mode {
            BrakeMode::Off => 0.0,
            BrakeMode::Addition | BrakeMode::Maximum => command.xbr_decel_m_s2.clamp(0.0, 12.5),
        };
        let decel = s.brake_line.pass(decel, self.brake_steps);
        let full_load_nm = self.engine.full_load_at_nm(
            s.engine_speed_rad_s,
            patch.altitude_m,
            patch.air_temperature_k,
            s.overheat_k,
        );
        self.shift(s, pedal, decel, full_load_nm, command);
        self.engine_torque(s, pedal, full_load_nm, command.retarder_frac.clamp(0.0, 1.0));
        let wheel = self.driveline(s, pedal);
        self.service_brakes(s, decel, patch);
        let inputs = self.longitudinal(s, command, patch, &wheel);
        s.lateral = self.lateral.step(&s.lateral, &inputs, SUBSTEP_S);
        self.slow_states(s, patch);
        s.substeps += 1;
    }

    /// Tyres, coolant, fan.
    fn slow_states(&self, s: &mut TruckState, patch: &RoadPatch) {
        let r = &self.parameters.resistance;
        let rolling = if s.speed_m_s.abs() > 1.0 { 1.0 } else { 0.0 };
        s.tyre_warmth += (rolling - s.tyre_warmth) * SUBSTEP_S / r.tyre_warmup_s;
        let from = HeatSources {
            indicated_w: s.engine_torque_nm * s.engine_speed_rad_s,
            engine_brake_w: s.engine_brake_nm * s.engine_speed_rad_s,
            retarder_w: s.forces.retarder_heat_n * s.speed_m_s.abs(),
        };
        let air_k = patch.air_temperature_k;
        s.fan_on_frac = self.engine.fan_on_frac(s.fan_on_frac, s.coolant_k);
        s.coolant_k = self.coolant_step_k(s.coolant_k, s.fan_on_frac, &from, air_k, SUBSTEP_S);
        s.overheat_k = self.engine.overheat_step_k(s.overheat_k, s.coolant_k, SUBSTEP_S);
    }

    /// Coolant temperature after `dt_s`, K.
    fn coolant_step_k(
        &self,
        coolant_k: f64,
        fan_on_frac: f64,
        from: &HeatSources,
        air_k: f64,
        dt_s: f64,
    ) -> f64 {
        if let Some(cooling) = &self.parameters.cooling {
            return cooling.step_k(coolant_k, fan_on_frac, from, air_k, dt_s);
        }
        let fan_k = 12.0 * fan_on_frac;
        let level = air_k + COOLANT.2 + COOLANT.1 * from.indicated_w - fan_k;
        coolant_k + (level.max(350.0) - coolant_k) * dt_s / COOLANT.0
    }

    /// Mean power of the fan, W, in the second of two hours in which the engine, the fan not
    /// counted, gives `indicated_w` in air of `air_k`.
    pub(crate) fn mean_fan_w(&self, indicated_w: f64, air_k: f64) -> f64 {
        let fan_w = self.engine.parameters.fan_power_w;
        if fan_w == 0.0 {
            return 0.0;
        }
        let (mut coolant_k, mut on, mut sum) = (air_k + COOLANT.2, 0.0, 0.0);
        const HOUR_S: u32 = 3_600;
        for second in 0..2 * HOUR_S {
            on = self.engine.fan_on_frac(on, coolant_k);
            let indicated_w = indicated_w + on * fan_w;
            let from = HeatSources { indicated_w, ..HeatSources::default() };
            coolant_k = self.coolant_step_k(coolant_k, on, &from, air_k, 1.0);
            if second >= HOUR_S {
                sum += on;
            }
        }
        fan_w * sum / f64::from(HOUR_S)
    }

    /// The road under the truck where the map says `patch`.
    #[must_use]
    pub fn true_patch(&self, patch: &RoadPatch) -> RoadPatch {
        self.parameters.instruments.true_patch(patch)
    }

    /// What the lateral model tells about a state.
    #[must_use]
    pub fn lateral_outputs(&self, s: &TruckState, patch: &RoadPatch) -> LateralOutputs {
        let patch = self.true_patch(patch);
        self.lateral.outputs(
            &s.lateral,
            &LateralInputs {
                speed_m_s: s.speed_m_s,
                accel_x_m_s2: s.accel_m_s2,
                steering_wheel_rad: s.lateral.steering.wheel_rad,
                grade_rad: patch.grade_rad,
                bank_rad: patch.bank_rad,
                ..LateralInputs::default()
            },
        )
    }
}

fn check(effect: &'static str, quantity: &'static str, value: f64) -> Result<(), DynamicsError> {
    if value.is_finite() {
        Ok(())
    } else {
        Err(DynamicsError::NonFinite { effect, quantity, value })
    }
}
