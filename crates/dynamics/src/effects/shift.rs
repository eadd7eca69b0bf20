//! Automated gearbox: when to shift (TCU) and how a shift interrupts the torque.
//!
//! A shift ramps the torque down, opens the driveline, changes the gear while the engine is
//! brought to its new speed, and ramps the torque up again. Two schedules: thresholds of engine
//! speed that rise with the pedal and look whether the new gear can carry the present power (so
//! that a loaded truck on a climb does not hunt), or a map of road speed over gear and pedal.
//! Skip shifts take the highest gear whose condition holds; after a shift the gear is held.

use serde::{Deserialize, Serialize};
use tractrix_core::{Curve, RPM_PER_RAD_S};

use crate::bounds::Bounds;

/// The shift block of a truck file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShiftParameters {
    /// Where the figures come from.
    pub source: String,
    /// Torque ramp down, s.
    pub ramp_down_s: f64,
    /// Driveline open, s.
    pub open_s: f64,
    /// Torque ramp up, s.
    pub ramp_up_s: f64,
    /// Factor on all three, 1 = as given.
    #[serde(default = "one")]
    pub duration_scale_coeff: f64,
    /// Torque that the engine holds while it ramps down, Nm; none = a ramp to zero.
    #[serde(default)]
    pub ramp_floor_nm: Option<f64>,
    /// Time for which a new gear is held, s.
    pub hold_s: f64,
    /// Up-shift speed at pedal 0 and at pedal 1, rpm.
    pub up_speed_rpm: [f64; 2],
    /// Down-shift speed at pedal 0 and at pedal 1, rpm.
    pub down_speed_rpm: [f64; 2],
    /// Engine speed that the gearbox keeps while the engine brake works, rpm.
    pub braking_speed_rpm: f64,
    /// Schedule by road speed instead.
    #[serde(default)]
    pub speed_map: Option<SpeedMap>,
}

/// Shift speeds over gear and pedal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpeedMap {
    /// Pedal positions, 0 to 1.
    pub pedal_frac: Vec<f64>,
    /// Road speed for the next gear up, m/s: one row per gear from the first.
    pub up_speed_m_s: Vec<Vec<f64>>,
    /// Road speed for the next gear down, m/s, from the second gear.
    pub down_speed_m_s: Vec<f64>,
    /// A down-shift condition must hold this long, s.
    pub down_hold_s: f64,
    /// From this pedal on, up-shifts skip a gear in the gears up to `skip_to_gear`.
    pub skip_pedal_frac: f64,
    /// Highest gear left by a skip shift.
    pub skip_to_gear: u8,
}

fn one() -> f64 {
    1.0
}

/// From this pedal on a gear does not rest: the driver or the planner wants power.
const KICK_DOWN_FRAC: f64 = 0.9;
/// Lowest engine speed at which a gear rests, relative to the down-shift speed at pedal 0.
const LUGGING_FACTOR: f64 = 1.1;

/// Where a shift stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum ShiftPhase {
    /// A gear is engaged and carries torque.
    #[default]
    Engaged,
    /// The torque is being taken away.
    RampDown,
    /// The driveline is open.
    Open,
    /// The torque is being given back.
    RampUp,
}

/// What the gearbox remembers.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ShiftState {
    /// Engaged gear, 0 = neutral.
    pub gear: u8,
    /// Gear being engaged.
    pub target: u8,
    /// Phase of the shift.
    pub phase: ShiftPhase,
    /// Time in the phase, s.
    pub phase_s: f64,
    /// Time since the last shift ended, s.
    pub since_shift_s: f64,
    /// How long a down-shift condition has held, s.
    pub down_s: f64,
}

/// What the TCU looks at.
#[derive(Debug, Clone, Copy)]
pub struct TcuView<'a> {
    /// Road speed, m/s.
    pub speed_m_s: f64,
    /// Pedal, 0 to 1.
    pub pedal_frac: f64,
    /// Engine brake and retarder demand, 0 to 1.
    pub retarder_frac: f64,
    /// Service brake demand, m/s².
    pub brake_decel_m_s2: f64,
    /// Brake power that the engine gives now, W.
    pub power_w: f64,
    /// Engine speed per road speed in each gear, rad/m.
    pub ratio_rad_m: &'a [f64],
    /// Full-load brake torque over engine speed, Nm.
    pub full_load_nm: &'a Curve,
    /// Highest engine speed, rad/s.
    pub max_rad_s: f64,
}

impl ShiftParameters {
    pub(crate) fn violations(&self, gears: usize) -> Vec<String> {
        let mut b = Bounds::of("shift");
        b.within("ramp_down_s", self.ramp_down_s, 0.0, 5.0);
        b.within("open_s", self.open_s, 0.0, 5.0);
        b.within("ramp_up_s", self.ramp_up_s, 0.0, 5.0);
        b.within("duration_scale_coeff", self.duration_scale_coeff, 0.05, 10.0);
        b.within("ramp_floor_nm", self.ramp_floor_nm.unwrap_or(0.0), 0.0, 5_000.0);
        b.within("hold_s", self.hold_s, 0.0, 30.0);
        for (key, pair) in [
            ("up_speed_rpm", self.up_speed_rpm),
            ("down_speed_rpm", self.down_speed_rpm),
            ("braking_speed_rpm", [self.braking_speed_rpm; 2]),
        ] {
            for v in pair {
                b.within(key, v, 300.0, 5_000.0);
            }
        }
        if let Some(map) = &self.speed_map {
            b.require(
                map.up_speed_m_s.len() == gears && map.down_speed_m_s.len() + 1 == gears,
                format!(
                    "speed_map needs {gears} up-shift rows and {} down-shift speeds",
                    gears - 1
                ),
            );
            for row in &map.up_speed_m_s {
                b.curve("speed_map.up_speed_m_s", &map.pedal_frac, row);
            }
            b.within("speed_map.down_hold_s", map.down_hold_s, 0.0, 10.0);
            b.within("speed_map.skip_pedal_frac", map.skip_pedal_frac, 0.0, 2.0);
        }
        b.violations
    }

    /// Length of a phase, s.
    #[must_use]
    pub fn phase_length_s(&self, phase: ShiftPhase) -> f64 {
        self.duration_scale_coeff
            * match phase {
                ShiftPhase::Engaged => f64::INFINITY,
                ShiftPhase::RampDown => self.ramp_down_s,
                ShiftPhase::Open => self.open_s,
                ShiftPhase::RampUp => self.ramp_up_s,
            }
    }

    /// Share of the demanded torque that the engine may give in the present phase.
    #[must_use]
    pub fn torque_frac(&self, state: &ShiftState) -> f64 {
        let t = state.phase_s / self.phase_length_s(state.phase).max(1e-9);
        match state.phase {
            ShiftPhase::Engaged => 1.0,
            ShiftPhase::RampDown if self.ramp_floor_nm.is_some() => 1.0,
            ShiftPhase::RampDown => (1.0 - t).max(0.0),
            ShiftPhase::Open => 0.0,
            ShiftPhase::RampUp => t.min(1.0),
        }
    }

    /// The gear that the schedule wants now; the present one if nothing changes.
    #[must_use]
    pub fn wanted_gear(&self, state: &ShiftState, view: &TcuView<'_>) -> u8 {
        match &self.speed_map {
            Some(map) => map.wanted_gear(state, view),
            None => self.by_engine_speed(state, view),
        }
    }

    /// Asks a schedule by road speed again during a shift: the truck went on while the torque was
    /// away, and a further gear in the same direction may be due.
    pub(crate) fn retarget(&self, state: &mut ShiftState, view: &TcuView<'_>) {
        let Some(map) = &self.speed_map else { return };
        let again = map.wanted_gear(&ShiftState { gear: state.target, ..*state }, view);
        if again != state.target && (again > state.target) == (state.target > state.gear) {
            state.target = again;
        }
    }

    /// Whether the schedule sees a reason to shift down (before any hold time).
    fn by_engine_speed(&self, state: &ShiftState, view: &TcuView<'_>) -> u8 {
        let gear = state.gear;
        let top = view.ratio_rad_m.len();
        let speed_in = |g: usize| view.speed_m_s * view.ratio_rad_m[g - 1];
        let at = |pair: [f64; 2]| (pair[0] + view.pedal_frac * (pair[1] - pair[0])) / RPM_PER_RAD_S;
        let now = usize::from(gear).clamp(1, top);
        let n = speed_in(now);
        let braking = view.retarder_frac > 0.3 || view.brake_decel_m_s2 > 0.8;
        let (up, down) = if braking {
            (0.97 * view.max_rad_s, self.braking_speed_rpm / RPM_PER_RAD_S)
        } else if view.retarder_frac > 0.0 {
            // A demand that has fallen because the lower gear brakes better is no reason to leave it.
            (0.97 * view.max_rad_s, at(self.down_speed_rpm))
        } else {
            (at(self.up_speed_rpm), at(self.down_speed_rpm))
        };
        let carries = |g: usize| {
            let n = speed_in(g);
            n > 1.0 && view.power_w / n < 0.92 * view.full_load_nm.at(n)
        };
        // A gear rests where it carries the present power without kick-down and above lugging. The
        // next gear is taken early if it would rest, and a gear that rests is kept.
        let rests_in = |g: usize, margin: f64| {
            let speed = speed_in(g);
            let pedal = view.pedal_frac * n / speed.max(1.0);
            let lugging = LUGGING_FACTOR * self.down_speed_rpm[0] / RPM_PER_RAD_S;
            !braking && pedal * margin < KICK_DOWN_FRAC && speed > margin * lugging && carries(g)
        };
        if now < top && n <= up && view.pedal_frac > 0.0 && rests_in(now + 1, 1.05) {
            return gear + 1;
        }
        if n < down && rests_in(now, 1.0) {
            return gear;
        }
        if n > up && now < top {
            let fits = |g: &usize| {
                speed_in(*g) > 1.03 * down && (carries(*g) || n > 0.96 * view.max_rad_s)
            };
            let highest = (now + 1..=(now + 2).min(top)).rev().find(fits);
            return highest.map_or(gear, |g| g as u8);
        }
        if n < down && now > 1 {
            let fits = |g: &usize| speed_in(*g) < 0.97 * up.min(view.max_rad_s);
            let lowest = (now.saturating_sub(2).max(1)..now).find(fits);
            let one = now - 1;
            let deep = if n < 0.9 * down { lowest } else { None };
            return deep.unwrap_or(one) as u8;
        }
        gear
    }
}

impl SpeedMap {
    fn wanted_gear(&self, state: &ShiftState, view: &TcuView<'_>) -> u8 {
        let now = usize::from(state.gear).max(1);
        let top = self.up_speed_m_s.len();
        let exceeded = |gear: usize| {
            interpolate(&self.pedal_frac, &self.up_speed_m_s[gear - 1], view.pedal_frac)
                < view.speed_m_s
        };
        if now < top && exceeded(now) {
            let skip = view.pedal_frac >= self.skip_pedal_frac;
            if skip && state.gear <= self.skip_to_gear {
                return (now + 2).min(top) as u8;
            }
            return (now + 1) as u8;
        }
        if now > 1 && view.speed_m_s < self.down_speed_m_s[now - 2] {
            return (now - 1) as u8;
        }
        state.gear
    }
}

fn interpolate(x: &[f64], y: &[f64], at: f64) -> f64 {
    let i = x.partition_point(|&v| v <= at);
    if i == 0 {
        return y[0];
    }
    if i == x.len() {
        return y[i - 1];
    }
    y[i - 1] + (y[i] - y[i - 1]) * (at - x[i - 1]) / (x[i] - x[i - 1])
}
