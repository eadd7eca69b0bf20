//! How a truck is driven: shifts, engine speed, acceleration, jerk, what it does to those behind.
//!
//! | figure | rule |
//! |---|---|
//! | shift | another gear is engaged than the last one that was; neutral in between does not count |
//! | up-shift while slowing | a shift to a higher gear begins although the truck is slower than a second ago by more than 0.05 m/s |
//! | shift taken back | the gear before the last shift is engaged again within 8 s |
//! | lugging | clutch locked, pedal above 80 %, engine below the truck's lugging limit |
//! | jerk | change of the acceleration over one second, as ISO 15622 averages it; from standstill to standstill |
//! | hard braking caused | of a vehicle behind ([`Behind`]) |

use std::collections::VecDeque;

use hdrhistogram::Histogram;
use planner::safety::RssConfig;
use serde::Serialize;
use tractrix_core::{RPM_PER_RAD_S, Recorder, Tick, Time, VehicleLimits};

use crate::behind::Behind;

/// A shift is taken back when its reverse comes within this time, s.
const TAKEN_BACK_S: f64 = 8.0;
/// Pedal from which low engine speed is lugging.
const LUGGING_PEDAL_FRAC: f64 = 0.8;
/// Loss of speed over a second from which the truck is slowing, m/s.
const SLOWING_M_S: f64 = 0.05;
/// Ego states kept, s.
const MEMORY_S: f64 = 1.0;
/// Spacing of the samples of acceleration and jerk, s.
const SAMPLE_S: f64 = 0.1;

/// Largest values and percentiles of a quantity's amount.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Spread {
    /// Median.
    pub p50: f64,
    /// 95th percentile.
    pub p95: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Largest.
    pub max: f64,
}

/// Amounts with three significant digits, in thousandths.
#[derive(Debug, Clone)]
struct Amounts(Histogram<u64>);

impl Amounts {
    #[expect(clippy::expect_used, reason = "constant bounds that the crate accepts")]
    fn new() -> Self {
        Self(Histogram::new_with_bounds(1, 1_000_000, 3).expect("valid bounds"))
    }

    fn join(&mut self, other: &Self) {
        // Both have the same bounds, which is all that can fail.
        let _ = self.0.add(&other.0);
    }

    fn add(&mut self, amount: f64) {
        self.0.saturating_record((amount.abs() * 1e3) as u64);
    }

    fn spread(&self) -> Spread {
        let at = |q: f64| self.0.value_at_quantile(q) as f64 * 1e-3;
        Spread { p50: at(0.5), p95: at(0.95), p99: at(0.99), max: self.0.max() as f64 * 1e-3 }
    }
}

/// The figures.
#[derive(Debug, Clone, PartialEq, Serialize, Default)]
pub struct Drive {
    /// Simulated time, s.
    pub duration_s: f64,
    /// Distance driven, m.
    pub distance_m: f64,
    /// Shifts.
    pub shifts: u32,
    /// Shifts that were taken back within 8 s.
    pub taken_back: u32,
    /// Shifts up while slowing.
    pub up_while_slowing: u32,
    /// Stops: from moving to standstill.
    pub stops: u32,
    /// Lowest engine speed, rpm.
    pub min_engine_rpm: f64,
    /// Time more than 1 % below idle speed, s.
    pub below_idle_s: f64,
    /// Time of lugging, s.
    pub lugging_s: f64,
    /// Acceleration forward, m/s².
    pub accel_m_s2: Spread,
    /// Deceleration, m/s², positive.
    pub decel_m_s2: Spread,
    /// Amount of the jerk, m/s³.
    pub jerk_m_s3: Spread,
    /// Amount of the rate at which the wanted acceleration changes, m/s³.
    pub wanted_jerk_m_s3: Spread,
    /// Smallest gap to a vehicle ahead in the lane while moving, m; none if there never was one.
    pub min_gap_m: Option<f64>,
    /// Largest gap to the vehicle that is followed, m.
    pub max_gap_m: Option<f64>,
    /// Hard braking of others that the truck has caused.
    pub hard_braking_caused: u32,
}

/// Accumulates a [`Drive`] from the ticks of a run.
#[derive(Debug, Clone)]
pub struct Drivability {
    limits: VehicleLimits,
    rss: RssConfig,
    ratio_rad_m: Vec<f64>,
    out: Drive,
    accel: Amounts,
    decel: Amounts,
    jerk: Amounts,
    wanted_jerk: Amounts,
    /// Since the last second: time, speed, acceleration, wanted acceleration.
    memory: VecDeque<(Time, f64, f64, f64)>,
    last: Option<(Time, f64)>,
    sampled: Option<Time>,
    gear: u8,
    /// The truck was slowing when the shift under way began; none between shifts.
    slowing: Option<bool>,
    /// The last shift: from, to, when.
    shift: Option<(u8, u8, Time)>,
    moving: bool,
    behind: Behind,
}

impl Drivability {
    /// For a truck with these limits; safe gaps of those behind by `rss`.
    #[must_use]
    pub fn new(limits: &VehicleLimits, rss: &RssConfig) -> Self {
        let p = &limits.powertrain;
        let per_m = p.final_drive_ratio / p.wheel_radius_m;
        Self {
            limits: limits.clone(),
            rss: *rss,
            ratio_rad_m: p.gear_ratios.iter().map(|r| r * per_m).collect(),
            out: Drive { min_engine_rpm: f64::INFINITY, ..Drive::default() },
            accel: Amounts::new(),
            decel: Amounts::new(),
            jerk: Amounts::new(),
            wanted_jerk: Amounts::new(),
            memory: VecDeque::new(),
            last: None,
            sampled: None,
            gear: 0,
            slowing: None,
            shift: None,
            moving: true,
            behind: Behind::default(),
        }
    }

    /// The figures so far.
    #[must_use]
    pub fn figures(&self) -> Drive {
        Drive {
            accel_m_s2: self.accel.spread(),
            decel_m_s2: self.decel.spread(),
            jerk_m_s3: self.jerk.spread(),
            wanted_jerk_m_s3: self.wanted_jerk.spread(),
            ..self.out.clone()
        }
    }

    /// Takes another run's figures in.
    pub fn join(&mut self, other: &Self) {
        for (mine, its) in [
            (&mut self.accel, &other.accel),
            (&mut self.decel, &other.decel),
            (&mut self.jerk, &other.jerk),
            (&mut self.wanted_jerk, &other.wanted_jerk),
        ] {
            mine.join(its);
        }
        let (a, b) = (&mut self.out, &other.out);
        a.duration_s += b.duration_s;
        a.distance_m += b.distance_m;
        a.shifts += b.shifts;
        a.taken_back += b.taken_back;
        a.up_while_slowing += b.up_while_slowing;
        a.stops += b.stops;
        a.min_engine_rpm = a.min_engine_rpm.min(b.min_engine_rpm);
        a.below_idle_s += b.below_idle_s;
        a.lugging_s += b.lugging_s;
        a.min_gap_m = a.min_gap_m.into_iter().chain(b.min_gap_m).reduce(f64::min);
        a.max_gap_m = a.max_gap_m.into_iter().chain(b.max_gap_m).reduce(f64::max);
        a.hard_braking_caused += b.hard_braking_caused;
    }

    fn watch_gear(&mut self, tick: &Tick<'_>) {
        let (gear, speed_m_s) = (tick.ego.powertrain.gear, tick.ego.speed_m_s);
        let before_m_s = self.memory.front().map_or(speed_m_s, |m| m.1);
        let slowing = *self.slowing.get_or_insert(speed_m_s < before_m_s - SLOWING_M_S);
        if !tick.ego.powertrain.shift_in_progress {
            self.slowing = None;
        }
        if gear == 0 || gear == self.gear {
            return;
        }
        if self.gear != 0 {
            self.out.shifts += 1;
            if gear > self.gear && slowing {
                self.out.up_while_slowing += 1;
            }
            if let Some((from, to, when)) = self.shift
                && (from, to) == (gear, self.gear)
                && tick.now.seconds_since(when) < TAKEN_BACK_S
            {
                self.out.taken_back += 1;
            }
            self.shift = Some((self.gear, gear, tick.now));
        }
        self.gear = gear;
    }

    fn watch_engine(&mut self, tick: &Tick<'_>, dt_s: f64) {
        let (p, limits) = (&tick.ego.powertrain, &self.limits.powertrain);
        let n = p.engine_speed_rad_s;
        self.out.min_engine_rpm = self.out.min_engine_rpm.min(n * RPM_PER_RAD_S);
        if n < 0.99 * limits.idle_speed_rad_s {
            self.out.below_idle_s += dt_s;
        }
        let geared = usize::from(p.gear)
            .checked_sub(1)
            .and_then(|g| self.ratio_rad_m.get(g))
            .map_or(0.0, |r| r * tick.ego.speed_m_s);
        let locked = !p.shift_in_progress && (geared - n).abs() < 0.02 * n;
        let pedal = tick.plan.command.accelerator_pedal_frac;
        if locked && pedal > LUGGING_PEDAL_FRAC && n < limits.lugging_speed_rad_s {
            self.out.lugging_s += dt_s;
        }
    }

    fn watch_comfort(&mut self, tick: &Tick<'_>) {
        let (a, wanted) = (tick.ego.accel_x_m_s2, tick.plan.target_accel_m_s2);
        let moving = tick.ego.speed_m_s > 0.05;
        if self.moving && !moving {
            self.out.stops += 1;
        }
        self.moving = moving;
        let due = self.sampled.is_none_or(|t| tick.now.seconds_since(t) > SAMPLE_S - 1e-6);
        if !due {
            return;
        }
        self.sampled = Some(tick.now);
        (if a > 0.0 { &mut self.accel } else { &mut self.decel }).add(a);
        if let Some(&(then, _, a0, wanted0)) = self.memory.front() {
            let dt_s = tick.now.seconds_since(then);
            if dt_s > 0.9 * MEMORY_S {
                self.jerk.add((a - a0) / dt_s);
                self.wanted_jerk.add((wanted - wanted0) / dt_s);
            }
        }
    }

    fn watch_ahead(&mut self, tick: &Tick<'_>) {
        let (ego, g) = (tick.ego, &self.limits.geometry);
        let front_m = ego.s_m + g.front_m;
        let ahead = tick
            .scene
            .neighbours
            .iter()
            .filter(|n| n.rear_s_m > ego.s_m)
            .filter(|n| (n.d_m - ego.d_m).abs() < 0.5 * (n.width_m + g.width_m))
            .map(|n| n.rear_s_m - front_m)
            .min_by(f64::total_cmp);
        let Some(gap_m) = ahead else { return };
        if self.moving {
            self.out.min_gap_m = Some(self.out.min_gap_m.map_or(gap_m, |m| m.min(gap_m)));
        }
        if tick.plan.following.is_some() {
            self.out.max_gap_m = Some(self.out.max_gap_m.map_or(gap_m, |m| m.max(gap_m)));
        }
    }
}

impl Recorder for Drivability {
    fn record(&mut self, tick: &Tick<'_>) {
        let (dt_s, moved_m) = self
            .last
            .map_or((0.0, 0.0), |(t, s_m)| (tick.now.seconds_since(t), tick.ego.s_m - s_m));
        self.last = Some((tick.now, tick.ego.s_m));
        self.out.duration_s += dt_s;
        self.out.distance_m += moved_m;
        self.watch_gear(tick);
        self.watch_engine(tick, dt_s);
        self.watch_comfort(tick);
        self.watch_ahead(tick);
        let (ego, plan, geometry) = (tick.ego, tick.plan, &self.limits.geometry);
        let Tick { now, scene, .. } = *tick;
        let brakes =
            self.behind.begins_to_brake(now, ego, scene, plan.maneuver, geometry, &self.rss);
        self.out.hard_braking_caused += u32::from(brakes);
        self.memory.push_back((tick.now, ego.speed_m_s, ego.accel_x_m_s2, plan.target_accel_m_s2));
        while self.memory.front().is_some_and(|m| tick.now.seconds_since(m.0) >= MEMORY_S) {
            self.memory.pop_front();
        }
    }
}
