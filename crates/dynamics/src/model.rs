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

use tractrix_core::{
    BrakeMode, Command, Curve, GRAVITY_M_S2, GearRequest, RPM_PER_RAD_S, ZERO_DEGC_K,
};

use crate::effects::brake::GROUPS;
use crate::effects::engine::Engine;
use crate::effects::resistance::{AirFlow, air_density_kg_m3, grade_n};
use crate::effects::shift::{ShiftPhase, ShiftState, TcuView};
use crate::effects::table::{self, TableSignal};
use crate::lateral::{AXLES, BodyForce, LateralInputs, LateralModel, LateralOutputs, LateralState};
use crate::state::{Forces, RoadPatch, SUBSTEP_S, TruckState};
use crate::{DynamicsError, TruckParameters};

/// Axles of each brake group: steer, drive, trailer.
const GROUP_AXLES: [core::ops::Range<usize>; GROUPS] = [0..1, 1..3, 3..6];
/// Speed below which static friction decides, m/s.
const STANDSTILL_M_S: f64 = 1e-3;
/// Coolant: time constant, s, rise per indicated power, K/W, level at no load above air, K.
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
    brake_table: Option<Curve>,
    tables: Vec<(TableSignal, Curve)>,
    /// Engine speed per road speed in each gear, rad/m.
    ratio_rad_m: Vec<f64>,
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
        let brake_table = parameters
            .brake
            .pressure_table(parameters.lateral.total_mass_kg())
            .map_err(|e| refuse(&name, e.to_string()))?;
        let tables: Result<Vec<_>, _> =
            parameters.table_effects.iter().map(table::TableEffect::curve).collect();
        let tables = tables.map_err(|e| refuse(&name, e.to_string()))?;
        let axle_load_n = parameters.lateral.static_axle_load_n();
        let total: f64 = axle_load_n.iter().sum();
        let gears = parameters.driveline.gear_ratios.len() as u8;
        let steps = |s: f64| libm::round(s / SUBSTEP_S).clamp(0.0, 127.0) as u8;
        Ok(Self {
            mass_kg: parameters.lateral.total_mass_kg(),
            brake_share: GROUP_AXLES.map(|r| axle_load_n[r].iter().sum::<f64>() / total),
            ratio_rad_m: (1..=gears)
                .map(|g| parameters.driveline.engine_speed_rad_s(1.0, g))
                .collect(),
            pedal_steps: steps(parameters.engine.pedal_delay_s),
            brake_steps: steps(parameters.brake.dead_time_s),
            engine,
            lateral,
            brake_table,
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
            engine_torque_nm: self.engine.friction_nm(idle),
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
                temperature_k: [293.15; GROUPS],
                reservoir_frac: 1.0,
                ..Default::default()
            },
            tyre_warmth: 0.0,
            coolant_k: 355.0,
            fan_runs: false,
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
        command.check_finite().map_err(|e| match e {
            tractrix_core::CoreError::NonFinite { field, value } => {
                DynamicsError::NonFinite { effect: "command", quantity: field, value }
            }
            _ => DynamicsError::NonFinite { effect: "command", quantity: "?", value: f64::NAN },
        })?;
        let mut s = *state;
        let patch = &self.true_patch(patch);
        for _ in 0..libm::round(duration_s / SUBSTEP_S).max(0.0) as u32 {
            self.substep(&mut s, command, patch);
        }
        check("longitudinal", "speed_m_s", s.speed_m_s)?;
        check("engine", "engine_speed_rad_s", s.engine_speed_rad_s)?;
        check("engine", "engine_torque_nm", s.engine_torque_nm)?;
        check("lateral", "yaw_rate_rad_s", s.lateral.yaw_rate_rad_s)?;
        check("lateral", "articulation_rad", s.lateral.articulation_rad)?;
        check("lateral", "x_m", s.lateral.x_m)?;
        check("lateral", "y_m", s.lateral.y_m)?;
        check("brake", "temperature_k", s.brake.temperature_k[1])?;
        Ok(s)
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
        );
        self.shift(s, pedal, decel, command);
        self.engine_torque(s, pedal, full_load_nm, command.retarder_frac.clamp(0.0, 1.0));
        let wheel = self.driveline(s, pedal);
        self.service_brakes(s, decel, patch);
        let inputs = self.longitudinal(s, command, patch, &wheel);
        s.lateral = self.lateral.step(&s.lateral, &inputs, SUBSTEP_S);
        self.slow_states(s, patch);
        s.substeps += 1;
    }

    /// Gearbox: starts, advances and ends shifts.
    fn shift(&self, s: &mut TruckState, pedal: f64, decel: f64, command: &Command) {
        let p = &self.parameters.shift;
        let state = &mut s.shift;
        state.phase_s += SUBSTEP_S;
        state.since_shift_s += SUBSTEP_S;
        let view = TcuView {
            speed_m_s: s.speed_m_s,
            pedal_frac: pedal,
            retarder_frac: command.retarder_frac,
            brake_decel_m_s2: decel,
            power_w: (s.engine_torque_nm - self.engine.friction_nm(s.engine_speed_rad_s)).max(0.0)
                * s.engine_speed_rad_s,
            ratio_rad_m: &self.ratio_rad_m,
            full_load_nm: &self.engine.full_load_nm,
            max_rad_s: self.engine.max_rad_s,
        };
        match state.phase {
            ShiftPhase::Engaged => {
                let wanted = self.wanted_gear(state, &view, command.gear);
                if wanted != state.gear {
                    state.target = wanted;
                    state.phase = ShiftPhase::RampDown;
                    state.phase_s = 0.0;
                    state.down_s = 0.0;
                }
            }
            ShiftPhase::RampDown if state.phase_s >= p.phase_length_s(ShiftPhase::RampDown) => {
                p.retarget(state, &view);
                state.phase = ShiftPhase::Open;
                state.phase_s = 0.0;
                s.clutch_locked = false;
                s.clutch_frac = 0.0;
            }
            ShiftPhase::Open if state.phase_s >= p.phase_length_s(ShiftPhase::Open) => {
                p.retarget(state, &view);
                state.gear = state.target;
                state.phase = ShiftPhase::RampUp;
                state.phase_s = 0.0;
                let geared = self.parameters.driveline.engine_speed_rad_s(s.speed_m_s, state.gear);
                s.clutch_locked = state.gear > 0 && geared > 0.85 * self.engine.idle_rad_s;
                s.clutch_frac = if s.clutch_locked { 1.0 } else { 0.0 };
            }
            ShiftPhase::RampUp if state.phase_s >= p.phase_length_s(ShiftPhase::RampUp) => {
                state.phase = ShiftPhase::Engaged;
                state.phase_s = 0.0;
                state.since_shift_s = 0.0;
            }
            _ => {}
        }
    }

    /// What request and schedule want, within the engine's range and the hold time.
    fn wanted_gear(&self, state: &mut ShiftState, view: &TcuView<'_>, request: GearRequest) -> u8 {
        let p = &self.parameters.shift;
        let speed_in = |g: u8| view.speed_m_s * view.ratio_rad_m[usize::from(g) - 1];
        let lowest = 0.85 * self.engine.idle_rad_s;
        match request {
            GearRequest::Neutral => return 0,
            GearRequest::Gear(g)
                if (1..=view.ratio_rad_m.len()).contains(&usize::from(g))
                    && speed_in(g) < view.max_rad_s
                    && speed_in(g) > 1.2 * lowest =>
            {
                return if state.since_shift_s < p.hold_s { state.gear } else { g };
            }
            _ => {}
        }
        if state.gear == 0 {
            let highest =
                (1..=view.ratio_rad_m.len() as u8).rev().find(|&g| speed_in(g) > 1.6 * lowest);
            return highest.unwrap_or(self.parameters.driveline.launch_gear);
        }
        if view.speed_m_s < STANDSTILL_M_S {
            return self.parameters.driveline.launch_gear;
        }
        let wanted = p.wanted_gear(state, view).max(self.parameters.driveline.launch_gear);
        let urgent = wanted < state.gear && speed_in(state.gear) < 1.1 * self.engine.idle_rad_s;
        if wanted < state.gear {
            state.down_s += SUBSTEP_S;
            let hold = p.speed_map.as_ref().map_or(0.0, |m| m.down_hold_s);
            if state.down_s < hold {
                return state.gear;
            }
        } else {
            state.down_s = 0.0;
        }
        if state.since_shift_s < p.hold_s && !urgent { state.gear } else { wanted }
    }

    /// Indicated torque after demand, governors, shift and lag; engine brake; retarder; fuel.
    fn engine_torque(&self, s: &mut TruckState, pedal: f64, full_load_nm: f64, retarder: f64) {
        let (e, p) = (&self.engine, &self.parameters.engine);
        let n = s.engine_speed_rad_s;
        let holding = e.friction_nm(n) + e.auxiliary_nm(n, s.fan_runs);
        let wanted = e.pedal_demand_nm(pedal, n, full_load_nm);
        let mut demand = e.governed_nm(wanted, n, full_load_nm);
        let shift = &self.parameters.shift;
        demand *= shift.torque_frac(&s.shift);
        if let (ShiftPhase::RampDown, Some(floor)) = (s.shift.phase, shift.ramp_floor_nm) {
            demand = demand.min(floor);
        }
        let idle = holding + 6.0 * (e.idle_rad_s - n);
        let target =
            if n < 1.15 * e.idle_rad_s { demand.max(idle.clamp(0.0, 700.0)) } else { demand };
        let rise = p.torque_rise_nm_s.map_or(f64::INFINITY, |r| r * SUBSTEP_S);
        let fall = p.torque_fall_nm_s.map_or(f64::INFINITY, |r| r * SUBSTEP_S);
        let lag = e.lag_s(s.engine_torque_nm, target, full_load_nm);
        let step = (target - s.engine_torque_nm) * (SUBSTEP_S / lag).min(1.0);
        s.engine_torque_nm = (s.engine_torque_nm + step.clamp(-fall, rise)).max(0.0);
        if s.shift.phase == ShiftPhase::Open {
            s.engine_torque_nm = 0.0;
        }
        let braking = if s.clutch_locked && pedal < 0.01 { retarder } else { 0.0 };
        let brake_target = braking * e.engine_brake_nm(n);
        s.engine_brake_nm +=
            (brake_target - s.engine_brake_nm) * (SUBSTEP_S / p.engine_brake_lag_s).min(1.0);
        let d = &self.parameters.driveline;
        let retarder_target = retarder * d.retarder_limit_nm(s.speed_m_s);
        s.retarder_nm = d.retarder_step_nm(s.retarder_nm, retarder_target, SUBSTEP_S);
        let burning = if s.shift.phase == ShiftPhase::Open { holding } else { s.engine_torque_nm };
        s.fuel_rate_g_s = e.fuel_rate_g_s(n, burning);
        s.fuel_g += s.fuel_rate_g_s * SUBSTEP_S;
    }

    /// Clutch, gears, wheels: force of the driveline, and the engine's speed when it is free.
    fn driveline(&self, s: &mut TruckState, pedal: f64) -> Wheel {
        let d = &self.parameters.driveline;
        let inertia = self.parameters.engine.inertia_kg_m2;
        let gear = s.shift.gear;
        let n = s.engine_speed_rad_s;
        let crank_nm = s.engine_torque_nm
            - self.engine.friction_nm(n)
            - self.engine.auxiliary_nm(n, s.fan_runs)
            - s.engine_brake_nm;
        let geared = d.engine_speed_rad_s(s.speed_m_s, gear);
        let open = s.shift.phase == ShiftPhase::Open || gear == 0;
        if s.clutch_locked && geared < 0.8 * self.engine.idle_rad_s {
            s.clutch_locked = false;
            s.clutch_frac = 0.0;
        }
        if s.clutch_locked && !open {
            return Wheel { drive_n: d.force_n(crank_nm, gear), gear };
        }
        if open {
            let goal =
                d.engine_speed_rad_s(s.speed_m_s, s.shift.target).max(self.engine.idle_rad_s);
            let rate = 3.0 / self.parameters.shift.phase_length_s(ShiftPhase::Open).max(0.1);
            s.engine_speed_rad_s += (goal - n) * (rate * SUBSTEP_S).min(1.0);
            return Wheel { drive_n: 0.0, gear: 0 };
        }
        let closing = if pedal > 0.01 { 1.0 } else { -2.0 };
        s.clutch_frac = (s.clutch_frac + closing * SUBSTEP_S / d.clutch_closing_s)
            .clamp(-d.clutch_delay_s / d.clutch_closing_s, 1.0);
        let held = crank_nm.max(0.0) + 15.0 * (n - self.engine.idle_rad_s);
        let passed = held.clamp(0.0, s.clutch_frac.max(0.0) * d.clutch_torque_nm);
        s.engine_speed_rad_s =
            (n + SUBSTEP_S * (crank_nm - passed) / inertia).max(0.5 * self.engine.idle_rad_s);
        s.clutch_heat_j += passed * (n - geared).max(0.0) * SUBSTEP_S;
        if s.clutch_frac > 0.05 && geared >= s.engine_speed_rad_s {
            s.clutch_locked = true;
            s.clutch_frac = 1.0;
        }
        Wheel { drive_n: d.force_n(passed, gear), gear: 0 }
    }

    /// Pressures towards the demand; forces follow in `longitudinal`.
    fn service_brakes(&self, s: &mut TruckState, decel: f64, patch: &RoadPatch) {
        let b = &self.parameters.brake;
        let demand = b
            .demand_pa(decel, self.mass_kg, self.brake_table.as_ref())
            .min(b.max_pressure_pa * s.brake.reservoir_frac);
        for g in 0..GROUPS {
            let before = s.brake.pressure_pa[g];
            let after = b.pressure_step_pa(before, demand, SUBSTEP_S);
            s.brake.pressure_pa[g] = after;
            let filled = (after - before).max(0.0) / b.max_pressure_pa * self.brake_share[g];
            s.brake.reservoir_frac -= b.air_per_fill_frac * filled;
        }
        let refill = b.refill_1_s * SUBSTEP_S;
        s.brake.reservoir_frac = (s.brake.reservoir_frac + refill).clamp(0.0, 1.0);
        for g in 0..GROUPS {
            let share = self.brake_share[g];
            let force = b.force_n(share, s.brake.pressure_pa[g], s.brake.temperature_k[g]);
            let power = force * s.speed_m_s.abs();
            s.brake.temperature_k[g] = b.temperature_step_k(
                s.brake.temperature_k[g],
                power,
                share,
                patch.air_temperature_k,
                SUBSTEP_S,
            );
        }
    }

    /// The force balance, standstill, speed; returns what the lateral model needs.
    fn longitudinal(
        &self,
        s: &mut TruckState,
        command: &Command,
        patch: &RoadPatch,
        wheel: &Wheel,
    ) -> LateralInputs {
        let (d, b, r) =
            (&self.parameters.driveline, &self.parameters.brake, &self.parameters.resistance);
        let v = s.speed_m_s;
        let (sin, cos) = libm::sincos(patch.grade_rad);
        let air = AirFlow::over(
            v,
            s.lateral.yaw_rad,
            (patch.wind_m_s.0 + r.wind_to_x_m_s, patch.wind_m_s.1 + r.wind_to_y_m_s),
            air_density_kg_m3(patch.air_pressure_pa, patch.air_temperature_k),
            (r.headwind_m_s, r.crosswind_to_left_m_s),
        );
        let grip = patch.adhesion_coeff;
        let mut axle_n = [0.0; AXLES];
        let mut brake_n = 0.0;
        for (g, axles) in GROUP_AXLES.into_iter().enumerate() {
            let share = self.brake_share[g];
            let wanted = b.force_n(share, s.brake.pressure_pa[g], s.brake.temperature_k[g]);
            let held = wanted.min(grip * share * self.mass_kg * GRAVITY_M_S2);
            brake_n += held;
            let count = axles.len() as f64;
            for a in axles {
                axle_n[a] -= held / count;
            }
        }
        let drive_limit = grip * self.brake_share[1] * self.mass_kg * GRAVITY_M_S2;
        let retarder_n = d.shaft_force_n(s.retarder_nm + d.hidden_retarder_nm(v)).min(drive_limit);
        let drive_n = wheel.drive_n.clamp(-drive_limit, drive_limit);
        axle_n[1] += 0.5 * (drive_n - retarder_n);
        axle_n[2] += 0.5 * (drive_n - retarder_n);
        let effective_mass_kg =
            self.mass_kg + d.rotating_mass_kg(self.parameters.engine.inertia_kg_m2, wheel.gear);
        let forces = Forces {
            table_n: effective_mass_kg * self.table_accel_m_s2(s, command, patch),
            drive_n,
            retarder_n,
            brake_n,
            rolling_n: r.rolling_n(self.mass_kg, v, cos, s.tyre_warmth),
            drag_n: r.drag_n(&air),
            grade_n: grade_n(self.mass_kg, sin),
            curve_n: self.curve_drag_n(s),
            effective_mass_kg,
        };
        let pushing = forces.drive_n - forces.drag_n - forces.grade_n + forces.table_n;
        let holding = forces.brake_n + forces.rolling_n + forces.retarder_n + forces.curve_n;
        let next = if v.abs() < STANDSTILL_M_S && pushing.abs() <= holding {
            0.0
        } else {
            let direction = if v.abs() < STANDSTILL_M_S { pushing } else { v };
            let force = pushing - if direction >= 0.0 { holding } else { -holding };
            let next = v + SUBSTEP_S * force / forces.effective_mass_kg;
            // friction stops the truck, it does not turn it round
            if v * next < 0.0 && pushing.abs() <= holding { 0.0 } else { next }
        };
        s.accel_m_s2 = (next - v) / SUBSTEP_S;
        s.distance_m += 0.5 * (v + next) * SUBSTEP_S;
        s.speed_m_s = next;
        s.forces = forces;
        if s.clutch_locked && wheel.gear > 0 {
            s.engine_speed_rad_s = d.engine_speed_rad_s(next, wheel.gear);
        }
        let (tractor_n, trailer_n) = if air.cross_m_s == 0.0 { (0.0, 0.0) } else { r.side_n(&air) };
        LateralInputs {
            speed_m_s: 0.5 * (v + next),
            accel_x_m_s2: s.accel_m_s2,
            steering_wheel_rad: command.steering_wheel_rad,
            grade_rad: patch.grade_rad,
            bank_rad: patch.bank_rad,
            tractor: BodyForce { side_n: tractor_n, yaw_moment_nm: 0.0 },
            trailer: BodyForce { side_n: trailer_n, yaw_moment_nm: 0.0 },
            axle_longitudinal_force_n: axle_n,
        }
    }

    /// Induced drag of the quasi-static side forces.
    fn curve_drag_n(&self, s: &TruckState) -> f64 {
        let stiffness: f64 = self.lateral.yaw_sideslip().stiffness_n_rad.iter().sum();
        let accel = s.speed_m_s * s.lateral.yaw_rate_rad_s;
        self.parameters.resistance.curve_n(self.mass_kg, accel, stiffness)
    }

    /// Fitted tables at the present signals.
    fn table_accel_m_s2(&self, s: &TruckState, command: &Command, patch: &RoadPatch) -> f64 {
        if self.tables.is_empty() {
            return 0.0;
        }
        let yaw_rate = s.lateral.yaw_rate_rad_s;
        let reference_nm = self.parameters.engine.reference_torque_nm;
        table::accel_m_s2(&self.tables, s.speed_m_s, |signal| match signal {
            TableSignal::EngineSpeedRpm => s.engine_speed_rad_s * RPM_PER_RAD_S,
            TableSignal::SpeedMS => s.speed_m_s,
            TableSignal::Curvature1M => (yaw_rate / s.speed_m_s.max(1.0)).abs(),
            TableSignal::GradeFrac => libm::tan(patch.grade_rad),
            TableSignal::AmbientTempDegc => patch.air_temperature_k - ZERO_DEGC_K,
            TableSignal::CoolantTempDegc => s.coolant_k - ZERO_DEGC_K,
            TableSignal::AcceleratorPedalFrac => command.accelerator_pedal_frac,
            TableSignal::BrakePressureKpa => 1e-3 * self.mean_pressure_pa(s),
            TableSignal::GpsAltitudeM => patch.altitude_m,
            TableSignal::Gear => f64::from(s.shift.gear),
            TableSignal::EngineTorquePercent => 100.0 * s.engine_torque_nm / reference_nm,
            TableSignal::EngineBrakeFrac => command.retarder_frac,
            TableSignal::XbrDecelMS2 => command.xbr_decel_m_s2,
            TableSignal::YawRateRadS => yaw_rate,
            TableSignal::AccelYMS2 => s.speed_m_s * yaw_rate,
            TableSignal::SteeringWheelRad => s.lateral.steering.wheel_rad,
        })
    }

    fn slow_states(&self, s: &mut TruckState, patch: &RoadPatch) {
        let r = &self.parameters.resistance;
        let rolling = if s.speed_m_s.abs() > 1.0 { 1.0 } else { 0.0 };
        s.tyre_warmth += (rolling - s.tyre_warmth) * SUBSTEP_S / r.tyre_warmup_s;
        let power = s.engine_torque_nm * s.engine_speed_rad_s;
        s.fan_runs = self.engine.fan_runs(s.fan_runs, s.coolant_k);
        let fan = if s.fan_runs { 12.0 } else { 0.0 };
        let level = patch.air_temperature_k + COOLANT.2 + COOLANT.1 * power - fan;
        s.coolant_k += (level.max(350.0) - s.coolant_k) * SUBSTEP_S / COOLANT.0;
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

/// What the driveline does at the wheels: its force, and the gear whose inertia it carries (0 =
/// open or slipping).
struct Wheel {
    drive_n: f64,
    gear: u8,
}

fn check(effect: &'static str, quantity: &'static str, value: f64) -> Result<(), DynamicsError> {
    if value.is_finite() {
        Ok(())
    } else {
        Err(DynamicsError::NonFinite { effect, quantity, value })
    }
}
