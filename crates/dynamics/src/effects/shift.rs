//! Automated gearbox: when to shift (TCU) and how a shift interrupts the torque.
//!
//! A shift ramps the torque down, opens the driveline, changes the gear while the engine is
//! brought to its new speed, and ramps the torque up again. Two schedules: thresholds of engine
//! speed that rise with the pedal, judged by the speed that the truck will have after the shift
//! ([`super::tcu`]), or a map of road speed over gear and pedal. After a shift the gear is held.

use super::tcu::{self, TcuView};
use crate::bounds::Bounds;
use serde::{Deserialize, Serialize};

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
    /// Time for which a shift is not taken back, s, unless the engine would lug, stall or overspeed
    /// (schedule by engine speed).
    #[serde(default = "reversal_hold_s")]
    pub reversal_hold_s: f64,
    /// Lowest engine speed at which a gear is kept under power, rpm; none = 1.1 times the
    /// down-shift speed at pedal 0. Planners keep the same limit.
    #[serde(default)]
    pub lugging_speed_rpm: Option<f64>,
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
fn reversal_hold_s() -> f64 {
    8.0
}

/// Lugging limit of a truck file that gives none, relative to the down-shift speed at pedal 0.
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
    /// Gear before the last shift, 0 = none or neutral.
    pub from: u8,
    /// Phase of the shift.
    pub phase: ShiftPhase,
    /// Time in the phase, s.
    pub phase_s: f64,
    /// Time since the last shift ended, s.
    pub since_shift_s: f64,
    /// How long a down-shift condition has held, s.
    pub down_s: f64,
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
        b.within("reversal_hold_s", self.reversal_hold_s, 0.0, 60.0);
        for (key, pair) in [
            ("up_speed_rpm", self.up_speed_rpm),
            ("down_speed_rpm", self.down_speed_rpm),
            ("braking_speed_rpm", [self.braking_speed_rpm; 2]),
            ("lugging_speed_rpm", [self.lugging_rpm(); 2]),
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

    /// Lowest engine speed at which a gear is kept under power, rpm.
    #[must_use]
    pub fn lugging_rpm(&self) -> f64 {
        self.lugging_speed_rpm.unwrap_or(LUGGING_FACTOR * self.down_speed_rpm[0])
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

    /// The gear that the schedule wants now, the present one if nothing changes, and how long it
    /// must have wanted a lower one, s.
    #[must_use]
    pub(crate) fn wanted_gear(&self, state: &ShiftState, view: &TcuView<'_>) -> (u8, f64) {
        match &self.speed_map {
            Some(map) => (map.wanted_gear(state, view), map.down_hold_s),
            None => tcu::wanted_gear(self, state, view),
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
