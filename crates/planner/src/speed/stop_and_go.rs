//! Driving in a jam: roll at the jam's mean speed behind a gap that breathes, no accordion.
//!
//! | symbol | unit | meaning |
//! |---|---|---|
//! | `v`, `v_f` | m/s | own speed, speed ahead |
//! | `v_m`, `sigma` | m/s | mean and standard deviation of `v_f` over the last minute |
//! | `s`, `s_0` | m | gap, gap at standstill |
//! | `s_j` | m | gap kept in the jam: the steady gap at `v_m` and room for the waves, `sigma T_w` |
//!
//! No faster than `v_m + (s - s_j)/T_c`, a little more where the gap has grown long: the gap takes
//! up the waves (Stern et al., Transp. Res. C 89 (2018) 205, "PI with saturation": the mean speed and
//! a catch-up that grows with the gap). A truck that stands starts when there is room to roll, and one that creeps up to a standing vehicle stops
//! instead of slipping its clutch. This only ever asks for less than car following does; braking
//! beyond easing off is car following's.

use super::following::{FollowingConfig, Lead};

/// Speed ahead, mean and present, below which traffic is a jam, m/s.
const JAM_M_S: f64 = 15.0;
/// Time over which speeds ahead are averaged, s.
const MEAN_S: f64 = 60.0;
/// Time over which they are averaged behind a vehicle that has just come into sight, s.
const FIRST_S: f64 = 5.0;
/// `T_w`: room for waves per standard deviation of the speed ahead, s, and its bound, m.
const WAVES: (f64, f64) = (11.0, 30.0);
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
/// Deceleration to a stop from creeping at least, and at standstill, m/s².
const STOP_M_S2: f64 = 0.3;

/// What has been seen of the traffic ahead.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct StopAndGo {
    /// Mean, m/s, and variance, m²/s², of the speed ahead, and for how long it has been seen, s;
    /// none without a vehicle ahead.
    seen: Option<(f64, f64, f64)>,
    standing: bool,
}

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
        if self.standing {
            let room_m = (room_m + 0.5 * config.standstill_gap_m).max(0.5);
            let stop = speed_m_s * speed_m_s / (2.0 * room_m);
            return -stop.max(STOP_M_S2);
        }
        if mean.max(ahead_m_s) > JAM_M_S {
            return f64::INFINITY;
        }
        let waves_m = (libm::sqrt(variance) * WAVES.0).min(WAVES.1);
        let jam_gap_m = steady_gap_m(mean) + waves_m;
        let beyond_m = lead.gap_m - jam_gap_m;
        let long = (beyond_m - LONG.0).max(0.0) / LONG.1;
        let rolling = (mean + beyond_m / CLOSING_S + long).max(CREEP_M_S);
        (GAIN_1_S * (rolling - speed_m_s)).clamp(ACCEL_M_S2.0, ACCEL_M_S2.1)
    }
}
