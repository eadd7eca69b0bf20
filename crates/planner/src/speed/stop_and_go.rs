//! Driving in a jam: roll at the jam's mean speed behind a gap that breathes, no accordion.
//!
//! | symbol | unit | meaning |
//! |---|---|---|
//! | `v`, `v_f` | m/s | own speed, speed ahead |
//! | `v_m`, `sigma` | m/s | mean and standard deviation of `v_f` over the last minute |
//! | `s`, `s_0` | m | gap, gap at standstill |
//! | `s_j` | m | gap kept in the jam: the steady gap at `v_m` and room for the waves, `sigma T_w` |
//!
//! No faster than `v_m + k (v_f - v_m) + (s - s_j)/T_c`, a little more where the gap has grown long:
//! the truck goes along with a part of every wave, and the gap takes up the rest (Stern et al.,
//! Transp. Res. C 89 (2018) 205, "PI with saturation": the mean speed and a catch-up that grows with
//! the gap; there `k = 0`, with which the gap to a vehicle between standstill and 8 m/s grows to
//! 80 m and more). A truck that stands starts when there is room to roll, and one that creeps up to a
//! standing vehicle stops instead of slipping its clutch. This only ever asks for less than car
//! following does; braking beyond easing off is car following's.
//!
//! Waves are driven without shifting along: the engaged gear is kept as long as the engine may turn
//! in it, and left for one that is further away.

use super::following::{FollowingConfig, Lead};
use tractrix_core::{EgoState, GearRequest, VehicleLimits};

/// Speed ahead, mean and present, below which traffic is a jam, m/s.
const JAM_M_S: f64 = 15.0;
/// Time over which speeds ahead are averaged, s.
const MEAN_S: f64 = 60.0;
/// Time over which they are averaged behind a vehicle that has just come into sight, s.
const FIRST_S: f64 = 5.0;
/// `k`: the part of a wave that the truck goes along with. More asks for more shifts and stops.
const ALONG: f64 = 0.8;
/// `T_w`: room for waves per standard deviation of the speed ahead, s, and its bound, m.
const WAVES: (f64, f64) = (5.0, 14.0);
/// Gap beyond the jam's that is long, m, and the time in which what is beyond that is closed, s.
const LONG: (f64, f64) = (30.0, 10.0);
/// `T_c`: time in which a gap beyond the jam's is closed, s.
const CLOSING_S: f64 = 40.0;
/// Speed that the lowest gear rolls at with the clutch closed, m/s: no slower, other than to stop.
const CREEP_M_S: f64 = 1.2;
/// Room beyond the standstill gap for which a standing truck starts, m.
const START_M: f64 = 4.0;
/// Acceleration per excess of speed, 1/s; its bounds, m/s².
const GAIN_1_S: f64 = 0.3;
const ACCEL_M_S2: (f64, f64) = (-0.4, 0.4);
/// A gear is kept between this multiple of idle speed and this part of the highest speed, and up to
/// the second part while it is new.
const KEPT: (f64, f64, f64) = (1.03, 0.8, 0.95);
/// Time for which a gear is new, s.
const NEW_GEAR_S: f64 = 8.0;
/// Pedal from which low engine speed is lugging, and the margin over the lugging limit.
const LUGS: (f64, f64) = (0.75, 1.02);
/// Deceleration to a stop from creeping at least, and at standstill, m/s².
const STOP_M_S2: f64 = 0.3;

/// What has been seen of the traffic ahead.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct StopAndGo {
    /// Mean, m/s, and variance, m²/s², of the speed ahead, and for how long it has been seen, s;
    /// none without a vehicle ahead.
    seen: Option<(f64, f64, f64)>,
    standing: bool,
    /// It is a jam.
    jam: bool,
}

/// The gear engaged last, and for how long, s.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct KeptGear(u8, f64);

impl StopAndGo {
    /// Acceleration not to be exceeded, m/s²; infinite outside a jam. `steady_gap_m` is the gap
    /// that is kept at a steady speed.
    pub(crate) fn step(
        &mut self,
        dt_s: f64,
        config: &FollowingConfig,
        speed_m_s: f64,
        lead: Option<&Lead>,
        steady_gap_m: impl Fn(f64) -> f64,
    ) -> f64 {
        self.jam = false;
        let Some(lead) = lead else {
            *self = Self::default();
            return f64::INFINITY;
        };
        let ahead_m_s = lead.speed_m_s.max(0.0);
        let (mut mean, mut variance, age_s) = self.seen.unwrap_or((ahead_m_s, 0.0, 0.0));
        let share = dt_s / (FIRST_S + age_s).min(MEAN_S).max(dt_s);
        mean += (ahead_m_s - mean) * share;
        variance += ((ahead_m_s - mean) * (ahead_m_s - mean) - variance) * share;
        self.seen = Some((mean, variance, age_s + dt_s));
        let room_m = lead.gap_m - config.standstill_gap_m;
        self.standing = if self.standing {
            room_m < START_M && !(ahead_m_s > CREEP_M_S && room_m > 0.25 * START_M)
        } else {
            speed_m_s < CREEP_M_S && ahead_m_s < 0.25 * CREEP_M_S && room_m < 0.5 * START_M
        };
        self.jam = self.standing || mean.max(ahead_m_s) <= JAM_M_S;
        if self.standing {
            let room_m = (room_m + 0.5 * config.standstill_gap_m).max(0.5);
            let stop = speed_m_s * speed_m_s / (2.0 * room_m);
            return -stop.max(STOP_M_S2);
        }
        if !self.jam {
            return f64::INFINITY;
        }
        let waves_m = (libm::sqrt(variance) * WAVES.0).min(WAVES.1);
        let jam_gap_m = steady_gap_m(mean) + waves_m;
        let beyond_m = lead.gap_m - jam_gap_m;
        let long = (beyond_m - LONG.0).max(0.0) / LONG.1;
        let rolling = mean + ALONG * (ahead_m_s - mean) + beyond_m / CLOSING_S + long;
        let rolling = rolling.max(CREEP_M_S);
        (GAIN_1_S * (rolling - speed_m_s)).clamp(ACCEL_M_S2.0, ACCEL_M_S2.1)
    }

    /// Whether the last step was in a jam.
    pub(crate) fn is_jam(&self) -> bool {
        self.jam
    }
}

impl KeptGear {
    /// The gear to ask for: in a jam the engaged one, as long as the engine may turn in it.
    pub(crate) fn choose(
        &mut self,
        dt_s: f64,
        jam: bool,
        ego: &EgoState,
        limits: &VehicleLimits,
        pedal_frac: f64,
    ) -> GearRequest {
        let (p, gear) = (&limits.powertrain, ego.powertrain.gear);
        let Some(ratio) = usize::from(gear).checked_sub(1).and_then(|g| p.gear_ratios.get(g))
        else {
            return GearRequest::Automatic;
        };
        let for_s = if self.0 == gear { self.1 + dt_s } else { 0.0 };
        *self = Self(gear, for_s);
        let n = ego.speed_m_s * ratio * p.final_drive_ratio / p.wheel_radius_m;
        let lowest = if pedal_frac > LUGS.0 {
            LUGS.1 * p.lugging_speed_rad_s
        } else {
            KEPT.0 * p.idle_speed_rad_s
        };
        let part = if for_s < NEW_GEAR_S { KEPT.2 } else { KEPT.1 };
        let kept = jam && n > lowest && n < part * p.max_speed_rad_s;
        if kept { GearRequest::Gear(gear) } else { GearRequest::Automatic }
    }
}
