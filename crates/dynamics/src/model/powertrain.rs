//! Demand to wheels: gearbox, engine, engine brake, retarder, clutch.

use tractrix_core::{Command, GearRequest, RPM_PER_RAD_S};

use super::{STANDSTILL_M_S, TruckModel};
use crate::effects::cooling::CoolingParameters;
use crate::effects::driveline::RELEASED_PEDAL_FRAC;
use crate::effects::shift::{ShiftPhase, ShiftState};
use crate::effects::tcu::{self, TcuView};
use crate::state::{SUBSTEP_S, TruckState};

/// Engine speed below which the idle governor works, relative to idle speed.
const GOVERNED_FRAC: f64 = 1.15;
/// Engine speed above which the clutch is closed after a shift, relative to that at which it opens.
const LOCKS_FRAC: f64 = 17.0 / 16.0;
/// Engine speed at which the clutch opens under a released pedal, relative to idle speed.
const RELEASE_FRAC: f64 = 1.05;

/// What the driveline does at the wheels: its force, and the gear whose inertia it carries (0 =
/// open or slipping).
pub(super) struct Wheel {
    pub(super) drive_n: f64,
    pub(super) gear: u8,
}

impl TruckModel {
    /// Gearbox: starts, advances and ends shifts.
    pub(super) fn shift(
        &self,
        s: &mut TruckState,
        pedal: f64,
        decel: f64,
        full_load_nm: f64,
        command: &Command,
    ) {
        let p = &self.parameters.shift;
        let view = self.tcu_view(s, pedal, decel, full_load_nm, command);
        let state = &mut s.shift;
        state.phase_s += SUBSTEP_S;
        state.since_shift_s += SUBSTEP_S;
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
                state.from = state.gear;
                state.gear = state.target;
                state.phase = ShiftPhase::RampUp;
                state.phase_s = 0.0;
                let geared = self.parameters.driveline.engine_speed_rad_s(s.speed_m_s, state.gear);
                let controlled = self.parameters.driveline.clutch_opens_rpm.is_none();
                let locks = LOCKS_FRAC * self.clutch_opens_rad_s();
                s.clutch_locked = state.gear > 0 && geared > locks;
                s.clutch_frac = if s.clutch_locked { 1.0 } else { 0.0 };
                if controlled && geared < GOVERNED_FRAC * self.engine.idle_rad_s {
                    // The idle governor has held the engine while the driveline was open.
                    s.engine_torque_nm = self.holding_nm(s);
                }
            }
            ShiftPhase::RampUp if state.phase_s >= p.phase_length_s(ShiftPhase::RampUp) => {
                state.phase = ShiftPhase::Engaged;
                state.phase_s = 0.0;
                state.since_shift_s = 0.0;
            }
            _ => {}
        }
    }

    /// What the gearbox's control unit knows.
    fn tcu_view<'a>(
        &'a self,
        s: &TruckState,
        pedal: f64,
        decel: f64,
        full_load_nm: f64,
        command: &Command,
    ) -> TcuView<'a> {
        let (e, d, f) = (&self.engine, &self.parameters.driveline, &s.forces);
        let n = s.engine_speed_rad_s;
        let demand = e.governed_nm(e.pedal_demand_nm(pedal, n, full_load_nm), n, full_load_nm);
        let free_n = f.effective_mass_kg * s.accel_m_s2 - f.drive_n;
        TcuView {
            speed_m_s: s.speed_m_s,
            accel_m_s2: s.accel_m_s2,
            open_accel_m_s2: free_n / self.mass_kg,
            mass_kg: self.mass_kg,
            efficiency_frac: &self.efficiency_frac,
            pedal_frac: pedal,
            retarder_frac: command.retarder_frac,
            brake_decel_m_s2: decel,
            demand_nm: demand - e.friction_nm(n),
            ratio_rad_m: &self.ratio_rad_m,
            full_load_nm: &e.full_load_nm,
            idle_rad_s: e.idle_rad_s,
            max_rad_s: e.max_rad_s,
            lowest_gear: d.launch_gear,
        }
    }

    /// Engine speed at which the clutch opens under power, rad/s.
    fn clutch_opens_rad_s(&self) -> f64 {
        let opens = self.parameters.driveline.clutch_opens_rpm;
        opens.map_or(self.engine.idle_rad_s, |rpm| rpm / RPM_PER_RAD_S)
    }

    /// Torque with which the idle governor holds the engine, Nm.
    fn holding_nm(&self, s: &TruckState) -> f64 {
        let n = s.engine_speed_rad_s;
        self.engine.friction_nm(n) + self.engine.auxiliary_nm(n, s.fan_on_frac)
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
            return tcu::gear_from_neutral(p, view);
        }
        if view.speed_m_s < STANDSTILL_M_S {
            return self.parameters.driveline.launch_gear;
        }
        let (wanted, down_hold_s) = p.wanted_gear(state, view);
        let wanted = wanted.max(self.parameters.driveline.launch_gear);
        let urgent = wanted < state.gear && speed_in(state.gear) < 1.1 * self.engine.idle_rad_s;
        if wanted < state.gear {
            state.down_s += SUBSTEP_S;
            if state.down_s < down_hold_s {
                return state.gear;
            }
        } else {
            state.down_s = 0.0;
        }
        if state.since_shift_s < p.hold_s && !urgent { state.gear } else { wanted }
    }

    /// Indicated torque after demand, governors, shift and lag; engine brake; retarder; fuel.
    pub(super) fn engine_torque(
        &self,
        s: &mut TruckState,
        pedal: f64,
        full_load_nm: f64,
        retarder: f64,
    ) {
        let (e, p) = (&self.engine, &self.parameters.engine);
        let n = s.engine_speed_rad_s;
        let holding = self.holding_nm(s);
        let wanted = e.pedal_demand_nm(pedal, n, full_load_nm);
        let mut demand = e.governed_nm(wanted, n, full_load_nm);
        let shift = &self.parameters.shift;
        demand *= shift.torque_frac(&s.shift);
        if let (ShiftPhase::RampDown, Some(floor)) = (s.shift.phase, shift.ramp_floor_nm) {
            demand = demand.min(floor);
        }
        let idle = holding + 6.0 * (e.idle_rad_s - n);
        let target = if n < GOVERNED_FRAC * e.idle_rad_s {
            demand.max(idle.clamp(0.0, 700.0))
        } else {
            demand
        };
        let rise = p.torque_rise_nm_s.map_or(f64::INFINITY, |r| r * SUBSTEP_S);
        let fall = p.torque_fall_nm_s.map_or(f64::INFINITY, |r| r * SUBSTEP_S);
        let lag = e.lag_s(s.engine_torque_nm, target, full_load_nm);
        let step = (target - s.engine_torque_nm) * (SUBSTEP_S / lag).min(1.0);
        s.engine_torque_nm = (s.engine_torque_nm + step.clamp(-fall, rise)).max(0.0);
        // Beyond its highest speed an engine is not injected, whatever its torque lags behind.
        if s.shift.phase == ShiftPhase::Open || n > e.most_rad_s() {
            s.engine_torque_nm = 0.0;
        }
        let braking = if s.clutch_locked && pedal < 0.01 { retarder } else { 0.0 };
        let brake_target = braking * e.engine_brake_nm(n);
        s.engine_brake_nm +=
            (brake_target - s.engine_brake_nm) * (SUBSTEP_S / p.engine_brake_lag_s).min(1.0);
        let d = &self.parameters.driveline;
        let available_nm = self.retarder_left_frac(s) * d.retarder_limit_nm(s.speed_m_s);
        let retarder_target = retarder * available_nm;
        s.retarder_nm = d.retarder_step_nm(s.retarder_nm, retarder_target, SUBSTEP_S);
        let burning = if s.shift.phase == ShiftPhase::Open { holding } else { s.engine_torque_nm };
        s.fuel_rate_g_s = e.fuel_rate_g_s(n, burning);
        s.fuel_g += s.fuel_rate_g_s * SUBSTEP_S;
    }

    /// Share of the retarder's torque that its coolant leaves, 0 to 1.
    #[must_use]
    pub fn retarder_left_frac(&self, s: &TruckState) -> f64 {
        let left = |c: &CoolingParameters| c.retarder_left_frac(s.coolant_k);
        self.parameters.cooling.as_ref().map_or(1.0, left)
    }

    /// Clutch, gears, wheels: force of the driveline, and the engine's speed when it is free.
    pub(super) fn driveline(&self, s: &mut TruckState, pedal: f64) -> Wheel {
        let d = &self.parameters.driveline;
        let inertia = self.parameters.engine.inertia_kg_m2;
        let gear = s.shift.gear;
        let n = s.engine_speed_rad_s;
        let crank_nm = s.engine_torque_nm
            - self.engine.friction_nm(n)
            - self.engine.auxiliary_nm(n, s.fan_on_frac)
            - s.engine_brake_nm;
        let geared = d.engine_speed_rad_s(s.speed_m_s, gear);
        let open = s.shift.phase == ShiftPhase::Open || gear == 0;
        // Released it opens early enough for the idle governor to catch the engine; driving it slips.
        let released = pedal <= RELEASED_PEDAL_FRAC;
        let controlled = d.clutch_opens_rpm.is_none();
        let early = if controlled && released { RELEASE_FRAC } else { 1.0 };
        if s.clutch_locked && geared < early * self.clutch_opens_rad_s() {
            s.clutch_locked = false;
            s.clutch_frac = if controlled && !released { 1.0 } else { 0.0 };
            if controlled && released {
                // The engine's control unit governs its idle speed before the clutch opens.
                s.engine_brake_nm = 0.0;
                s.engine_torque_nm = s.engine_torque_nm.max(self.holding_nm(s));
            }
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
        let closing = if released { -2.0 } else { 1.0 };
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
}
