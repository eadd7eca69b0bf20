//! When to shift, by engine speed: the transmission control unit of trucks without a speed map.
//!
//! A shift costs its own torque gap and is held afterwards, so a gear is judged by the speed that
//! the truck will have then. With the open-driveline acceleration `a_0` (grade, rolling, air and
//! brakes as they are; a real unit has it from its torque and its acceleration), the demanded crank
//! torque `T` in gear `i`, and mass `m`:
//!
//! ```text
//! v_gap  = v + a_0 t_gap                      when the new gear takes hold
//! T_g    = min(T r_i / r_g, T_full(v_gap r_g))   the same wheel force, as far as there is torque
//! v_then = v_gap + (a_0 + T_g r_g eta / m) t_hold
//! ```
//!
//! | situation | rule |
//! |---|---|
//! | driving | up beyond the up-shift speed, or before where the gear rests at `v_gap` and `v_then`; the highest of three gears that fits; never while slowing; early not if the up-shift speed is near or a further gear is about to rest |
//! | driving | down below the down-shift speed unless the gear rests, or before it lugs; to the highest gear that fits at `v_then` |
//! | rolling out | down near idle, to the lowest gear below the up-shift speed at twice the hold; none if the truck is about to stop: the clutch opens |
//! | engine brake | down only to a gear that keeps the braking speed at `v_then`, once it has been wanted as long as a gear is held |
//! | any | a shift is not taken back for `reversal_hold_s` unless the engine would lug, stall or overspeed |
//!
//! A gear rests where its load leaves a reserve and its engine speed is above the lugging limit.

use tractrix_core::{Curve, RPM_PER_RAD_S};

use super::shift::{ShiftParameters, ShiftPhase, ShiftState};

/// Share of full load up to which a gear rests; above it the driver or the planner wants power.
const RESERVE_FRAC: f64 = 0.9;
/// Margin on load and speed for entering a gear early.
const ENTRY_MARGIN: f64 = 1.05;
/// Share of the engine's highest speed up to which a gear may be entered.
const BELOW_MAX: f64 = 0.97;
/// Lowest engine speed at which a gear may be taken up, relative to idle speed.
const LOWEST_FRAC: f64 = 1.2;
/// Deceleration from which the truck is slowing, m/s².
const SLOWING_M_S2: f64 = 0.02;
/// Retarder demand and service deceleration (m/s²) from which the engine is to brake along.
const BRAKING: (f64, f64) = (0.7, 0.8);
/// Deceleration up to which it is to hold the speed rather than to slow the truck, m/s².
const HOLDING_M_S2: f64 = 0.2;
/// Load up to which a gear may be taken below the lugging limit on the way up.
const LIGHT_FRAC: f64 = 0.6;
/// Load up to which a slowing truck is being let roll out.
const ROLLING_FRAC: f64 = 0.25;
/// Pedal from which low engine speed is lugging, and from which all power is wanted.
const LUGGING_PEDAL_FRAC: f64 = 0.75;
const FULL_PEDAL_FRAC: f64 = 0.95;
/// Gears that an up-shift may take at once.
const LONGEST_UP: usize = 3;

/// What the TCU looks at.
#[derive(Debug, Clone, Copy)]
pub struct TcuView<'a> {
    /// Road speed, m/s.
    pub speed_m_s: f64,
    /// Its change, m/s².
    pub accel_m_s2: f64,
    /// Acceleration that the truck would have with the driveline open, m/s².
    pub open_accel_m_s2: f64,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Efficiency engine to wheel in each gear.
    pub efficiency_frac: &'a [f64],
    /// Pedal, 0 to 1.
    pub pedal_frac: f64,
    /// Engine brake and retarder demand, 0 to 1.
    pub retarder_frac: f64,
    /// Service brake demand, m/s².
    pub brake_decel_m_s2: f64,
    /// Brake torque that the pedal asks of the engine in the present gear, Nm.
    pub demand_nm: f64,
    /// Engine speed per road speed in each gear, rad/m.
    pub ratio_rad_m: &'a [f64],
    /// Full-load brake torque over engine speed, Nm.
    pub full_load_nm: &'a Curve,
    /// Idle speed, rad/s.
    pub idle_rad_s: f64,
    /// Highest engine speed, rad/s.
    pub max_rad_s: f64,
    /// Lowest gear that the schedule chooses.
    pub lowest_gear: u8,
}

/// A schedule in a situation; gears are counted from 1.
struct Outlook<'a> {
    p: &'a ShiftParameters,
    view: &'a TcuView<'a>,
    now: usize,
    gap_m_s: f64,
}

/// The gear that the schedule by engine speed wants now, the present one if nothing changes, and
/// how long it must have wanted a lower one, s.
pub(crate) fn wanted_gear(
    p: &ShiftParameters,
    state: &ShiftState,
    view: &TcuView<'_>,
) -> (u8, f64) {
    let top = view.ratio_rad_m.len();
    let now = usize::from(state.gear).clamp(1, top);
    let gap_s = p.duration_scale_coeff * (0.5 * p.ramp_down_s + p.open_s + 0.5 * p.ramp_up_s);
    let gap_m_s = (view.speed_m_s + view.open_accel_m_s2 * gap_s).max(0.0);
    let o = Outlook { p, view, now, gap_m_s };
    let n = o.speed_in(now, view.speed_m_s);
    let braking = view.accel_m_s2 > -HOLDING_M_S2
        && (view.retarder_frac > BRAKING.0 || view.brake_decel_m_s2 > BRAKING.1);
    let wanted = if now < top && n > BELOW_MAX * view.max_rad_s {
        now + 1
    } else if braking {
        o.for_engine_brake()
    } else if view.pedal_frac > 0.0 && !o.rolls_out() || o.is_pushed() {
        o.up().or_else(|| o.down_under_power()).unwrap_or(now)
    } else {
        o.down_released()
    };
    if o.takes_back(state, wanted) {
        return (state.gear, 0.0);
    }
    (wanted as u8, if braking { p.hold_s } else { 0.0 })
}

/// The highest gear for a truck whose driveline is open, at its present speed.
pub(crate) fn gear_from_neutral(p: &ShiftParameters, view: &TcuView<'_>) -> u8 {
    let lugging = p.lugging_rpm() / RPM_PER_RAD_S;
    let fits = |g: &u8| view.speed_m_s * view.ratio_rad_m[usize::from(*g) - 1] > lugging;
    (view.lowest_gear..=view.ratio_rad_m.len() as u8).rev().find(fits).unwrap_or(view.lowest_gear)
}

impl Outlook<'_> {
    fn speed_in(&self, gear: usize, road_m_s: f64) -> f64 {
        road_m_s * self.view.ratio_rad_m[gear - 1]
    }

    /// Demanded torque over full load in a gear at a road speed.
    fn load_frac(&self, gear: usize, road_m_s: f64) -> f64 {
        let n = self.speed_in(gear, road_m_s).max(self.view.idle_rad_s);
        let step = self.view.ratio_rad_m[self.now - 1] / self.view.ratio_rad_m[gear - 1];
        self.view.demand_nm.max(0.0) * step / self.view.full_load_nm.at(n).max(1.0)
    }

    /// Speed after the shift into a gear and the time for which it is held, m/s.
    fn then_m_s(&self, gear: usize) -> f64 {
        let ratio = self.view.ratio_rad_m[gear - 1];
        let n = (self.gap_m_s * ratio).max(self.view.idle_rad_s);
        let load = self.load_frac(gear, self.gap_m_s).min(1.0);
        let efficiency = self.view.efficiency_frac[gear - 1];
        let force_n = load * self.view.full_load_nm.at(n) * ratio * efficiency;
        let accel = self.view.open_accel_m_s2 + force_n / self.view.mass_kg;
        (self.gap_m_s + accel * self.p.hold_s).max(0.0)
    }

    /// A line over the pedal, rad/s.
    fn line(pair: [f64; 2], load_frac: f64) -> f64 {
        (pair[0] + load_frac.clamp(0.0, 1.0) * (pair[1] - pair[0])) / RPM_PER_RAD_S
    }

    /// Whether a gear carries the demand with reserve and above lugging at a road speed.
    fn rests(&self, gear: usize, road_m_s: f64, margin: f64) -> bool {
        let lugging = self.p.lugging_rpm() / RPM_PER_RAD_S;
        self.load_frac(gear, road_m_s) * margin < RESERVE_FRAC
            && self.speed_in(gear, road_m_s) > margin * lugging
    }

    /// Whether a gear would not be left again after it has been held.
    fn fits_then(&self, gear: usize) -> bool {
        let then_m_s = self.then_m_s(gear);
        let down = Self::line(self.p.down_speed_rpm, self.load_frac(gear, then_m_s));
        self.speed_in(gear, then_m_s) > down || self.rests(gear, then_m_s, 1.0)
    }

    /// Whether the truck is being let slow down although the pedal is not quite released.
    fn rolls_out(&self) -> bool {
        self.view.accel_m_s2 < -SLOWING_M_S2
            && self.load_frac(self.now, self.view.speed_m_s) < ROLLING_FRAC
    }

    /// Whether the road pushes the truck, and nothing is to hold it.
    fn is_pushed(&self) -> bool {
        let view = self.view;
        view.accel_m_s2 > SLOWING_M_S2 && view.retarder_frac <= 0.0 && view.brake_decel_m_s2 <= 0.0
    }

    fn up(&self) -> Option<usize> {
        let (view, top) = (self.view, self.view.ratio_rad_m.len());
        if self.now == top || view.accel_m_s2 < -SLOWING_M_S2 {
            return None;
        }
        let highest = (self.now + LONGEST_UP).min(top);
        let late = Self::line(self.p.up_speed_rpm, view.pedal_frac);
        if self.speed_in(self.now, view.speed_m_s) > late {
            let lowest = LOWEST_FRAC * view.idle_rad_s;
            let lugging = self.p.lugging_rpm() / RPM_PER_RAD_S;
            let carries = |g: &usize| {
                let load = self.load_frac(*g, self.gap_m_s);
                let bottom = if load > LIGHT_FRAC { lugging } else { lowest };
                load < RESERVE_FRAC
                    && self.speed_in(*g, self.gap_m_s) > bottom
                    && self.fits_then(*g)
            };
            return (self.now + 1..=highest).rev().find(carries);
        }
        if view.pedal_frac <= 0.0 {
            return None;
        }
        // A truck that will soon be at the up-shift speed, or fit for a further gear, waits for it.
        let soon_m_s = self.then_m_s(self.now);
        let rests = |g: &usize| {
            self.rests(*g, self.gap_m_s, ENTRY_MARGIN)
                && self.rests(*g, self.then_m_s(*g), ENTRY_MARGIN)
        };
        let gear = (self.now + 1..=highest).rev().find(rests)?;
        let waits = self.speed_in(self.now, soon_m_s) > late
            || (gear + 1..=highest).any(|g| self.rests(g, soon_m_s, ENTRY_MARGIN));
        (!waits).then_some(gear)
    }

    /// Whether a wish would undo the last shift so soon that the driver feels hunting, and nothing
    /// presses.
    fn takes_back(&self, state: &ShiftState, wanted: usize) -> bool {
        let (view, from) = (self.view, usize::from(state.from));
        let up = wanted > self.now;
        let undoes =
            if up { from > self.now && wanted >= from } else { wanted <= from && from < self.now };
        if from == 0 || !undoes || state.since_shift_s > self.p.reversal_hold_s {
            return false;
        }
        let n = self.speed_in(self.now, view.speed_m_s);
        let presses = if up {
            n > self.p.up_speed_rpm[1] / RPM_PER_RAD_S
        } else {
            let lugs = n < 1.01 * self.p.lugging_rpm() / RPM_PER_RAD_S;
            let stalls = n < LOWEST_FRAC * view.idle_rad_s;
            let loses = view.pedal_frac > FULL_PEDAL_FRAC && view.accel_m_s2 < 0.0;
            stalls || loses || lugs && view.pedal_frac > LUGGING_PEDAL_FRAC
        };
        !presses
    }

    fn down_under_power(&self) -> Option<usize> {
        let view = self.view;
        let lowest = usize::from(view.lowest_gear);
        let n = self.speed_in(self.now, view.speed_m_s);
        let lugging = self.p.lugging_rpm() / RPM_PER_RAD_S;
        // The shift itself takes time in which a truck that is held back gets slower still.
        let ramp_s = self.p.phase_length_s(ShiftPhase::RampDown);
        let soon_m_s = view.speed_m_s + view.accel_m_s2.min(0.0) * ramp_s;
        let lugs = view.pedal_frac > LUGGING_PEDAL_FRAC
            && self.speed_in(self.now, soon_m_s) < 1.01 * lugging;
        let due = n < Self::line(self.p.down_speed_rpm, view.pedal_frac)
            && !self.rests(self.now, view.speed_m_s, 1.0);
        if self.now <= lowest || !(due || lugs) {
            return None;
        }
        let fits = |g: &usize| self.may(*g) && self.fits_then(*g);
        let any = || (lowest..self.now).find(|g| self.may(*g));
        (lowest..self.now).rev().find(fits).or_else(any)
    }

    /// The gear for a truck that is let roll out: the lowest that stays below the up-shift speed
    /// when it has been held twice as long, so that the next gears need not be gone through.
    fn down_released(&self) -> usize {
        let view = self.view;
        let lowest = usize::from(view.lowest_gear);
        let bottom = LOWEST_FRAC * view.idle_rad_s;
        if self.now <= lowest || self.speed_in(self.now, view.speed_m_s) >= bottom {
            return self.now;
        }
        let later_m_s = (2.0 * self.then_m_s(self.now) - self.gap_m_s).max(0.0);
        let top = self.p.up_speed_rpm[0] / RPM_PER_RAD_S;
        let fits = |g: &usize| {
            let n = self.speed_in(*g, later_m_s);
            n > bottom && n < top && self.may(*g)
        };
        (lowest..self.now).find(fits).unwrap_or(self.now)
    }

    /// Whether a lower gear does not overspeed the engine.
    fn may(&self, gear: usize) -> bool {
        let fastest_m_s = self.gap_m_s.max(self.view.speed_m_s);
        self.speed_in(gear, fastest_m_s) < BELOW_MAX * self.view.max_rad_s
    }

    fn for_engine_brake(&self) -> usize {
        let view = self.view;
        let lowest = usize::from(view.lowest_gear);
        let keep = self.p.braking_speed_rpm / RPM_PER_RAD_S;
        if self.now <= lowest || self.speed_in(self.now, view.speed_m_s) >= keep {
            return self.now;
        }
        let hold_s = self.p.hold_s;
        let then_m_s = (self.gap_m_s + view.accel_m_s2 * hold_s).max(0.0);
        let fits = |g: &usize| {
            self.speed_in(*g, view.speed_m_s) < BELOW_MAX * view.max_rad_s
                && self.speed_in(*g, then_m_s) >= keep
        };
        (lowest..self.now).rev().find(fits).unwrap_or_else(|| self.down_released())
    }
}
