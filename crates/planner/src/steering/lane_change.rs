//! Planning of a lane change: quintic paths sampled over duration and end speed, kept if the loaded
//! truck can drive them and its trailer stays inside the lanes, chosen by cost, passed by the gate.
//!
//! Limits per sample, with `q` the lateral offset over station and `v` the planned speed:
//! `|v² q''| <= a_y`, `|v³ q'''| <= j_y`, path curvature within the steering, load-transfer ratio
//! `RA |v² k - g bank| / a_rollover` below its bound (`RA`: rearward amplification), and the corners
//! of tractor and trailer inside the two lanes. The trailer follows by the paper's Eq. 1.

use super::corners::Posed;
use super::path::{Lateral, LateralPath, Quintic, bend, lane_centre, off_centre};
use crate::error::config_in;
use crate::safety::{Gate, SpeedCourse, Strictness};
use crate::{LaneChoice, PlannerError};
use road::{LaneKind, Road};
use serde::{Deserialize, Serialize};
use tractrix_core::{EgoState, GRAVITY_M_S2, LaneChangeRefusal, VehicleLimits};

/// Rearward amplification of lateral acceleration that the load-transfer bound allows for.
const REARWARD_AMPLIFICATION: f64 = 1.15;
/// Step of the checks, s.
const STEP_S: f64 = 0.25;
/// The target lane must go on for so long after the change, s.
const LANE_AFTER_S: f64 = 5.0;
/// Speed below which the truck stands, m/s.
pub(super) const STANDS_M_S: f64 = 0.3;
/// Lengths of a change from standstill, m.
const PULL_AWAY_M: [f64; 4] = [25.0, 30.0, 35.0, 20.0];
/// Its acceleration, m/s²: what a loaded truck has in its low gears.
const PULL_AWAY_M_S2: f64 = 0.5;

/// Lane-change parameters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LaneChangeConfig {
    /// Shortest duration, s.
    pub duration_min_s: f64,
    /// Longest duration, s.
    pub duration_max_s: f64,
    /// Largest lateral acceleration of the change, m/s².
    pub lateral_accel_max_m_s2: f64,
    /// Largest lateral jerk of the change, m/s³.
    pub lateral_jerk_max_m_s3: f64,
    /// Largest lateral load-transfer ratio, road curvature included, 0 to 1.
    pub load_transfer_max_frac: f64,
    /// Largest acceleration during a change, m/s².
    pub accel_max_m_s2: f64,
    /// Largest deceleration planned for a change, m/s².
    pub decel_max_m_s2: f64,
    /// Room between the body and the outer lane edges, m.
    pub edge_margin_m: f64,
    /// Lowest speed for a change, m/s.
    pub speed_min_m_s: f64,
    /// Least time between two changes, s.
    pub cooldown_s: f64,
    /// Factor on the safe gaps of the target lane when a change starts.
    pub entry_gap_factor: f64,
    /// Least time to collision, s.
    pub time_to_collision_s: f64,
    /// Abort limits, as multiples of the lateral acceleration and jerk limits.
    pub abort_factor: f64,
    /// Courtesy: deceleration with which those behind in the target lane are counted on to ease off
    /// once they have seen the truck in their lane and reacted, m/s²; zero: they go on as they do.
    pub courtesy_decel_m_s2: f64,
    /// Where the truck's lane ends: deceleration with which those behind in the target lane are
    /// counted on to let it in once they have reacted to its indicator, m/s².
    pub yield_decel_m_s2: f64,
}

impl Default for LaneChangeConfig {
    fn default() -> Self {
        Self {
            duration_min_s: 6.0,
            duration_max_s: 10.0,
            lateral_accel_max_m_s2: 0.8,
            lateral_jerk_max_m_s3: 1.0,
            load_transfer_max_frac: 0.6,
            accel_max_m_s2: 0.3,
            decel_max_m_s2: 0.6,
            edge_margin_m: 0.1,
            speed_min_m_s: 5.0,
            cooldown_s: 4.0,
            entry_gap_factor: 1.05,
            time_to_collision_s: 4.0,
            abort_factor: 1.5,
            courtesy_decel_m_s2: 1.0,
            yield_decel_m_s2: 2.0,
        }
    }
}

impl LaneChangeConfig {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`PlannerError::Config`] names the key.
    pub fn check(&self) -> Result<(), PlannerError> {
        config_in("lane_change.duration_min_s", self.duration_min_s, 2.0, 20.0)?;
        config_in("lane_change.duration_max_s", self.duration_max_s, self.duration_min_s, 30.0)?;
        config_in("lane_change.lateral_accel_max_m_s2", self.lateral_accel_max_m_s2, 0.1, 3.0)?;
        config_in("lane_change.lateral_jerk_max_m_s3", self.lateral_jerk_max_m_s3, 0.1, 10.0)?;
        config_in("lane_change.load_transfer_max_frac", self.load_transfer_max_frac, 0.1, 0.9)?;
        config_in("lane_change.accel_max_m_s2", self.accel_max_m_s2, 0.0, 2.0)?;
        config_in("lane_change.decel_max_m_s2", self.decel_max_m_s2, 0.0, 3.0)?;
        config_in("lane_change.edge_margin_m", self.edge_margin_m, 0.0, 1.0)?;
        config_in("lane_change.speed_min_m_s", self.speed_min_m_s, 1.0, 30.0)?;
        config_in("lane_change.cooldown_s", self.cooldown_s, 0.0, 60.0)?;
        config_in("lane_change.entry_gap_factor", self.entry_gap_factor, 1.0, 3.0)?;
        config_in("lane_change.time_to_collision_s", self.time_to_collision_s, 0.0, 20.0)?;
        config_in("lane_change.abort_factor", self.abort_factor, 1.0, 3.0)?;
        config_in("lane_change.courtesy_decel_m_s2", self.courtesy_decel_m_s2, 0.0, 2.0)?;
        config_in("lane_change.yield_decel_m_s2", self.yield_decel_m_s2, 0.0, 4.0)
    }

    /// Gaps asked for when a change starts at a speed, m/s; `lane_ends`: others must make room.
    #[must_use]
    pub fn entry(&self, lane_ends: bool, start_m_s: f64) -> Strictness {
        Strictness {
            target_factor: self.entry_gap_factor,
            own_factor: 1.0,
            time_to_collision_s: self.time_to_collision_s,
            yield_decel_m_s2: if lane_ends {
                self.yield_decel_m_s2
            } else {
                self.courtesy_decel_m_s2
            },
            yield_to_indicator: lane_ends,
            may_stop: lane_ends && start_m_s < self.speed_min_m_s,
        }
    }

    /// Gaps below which a change that is under way is no longer safe.
    #[must_use]
    pub fn under_way(&self, lane_ends: bool, start_m_s: f64) -> Strictness {
        Strictness {
            target_factor: 1.0,
            own_factor: 0.9,
            time_to_collision_s: 0.75 * self.time_to_collision_s,
            ..self.entry(lane_ends, start_m_s)
        }
    }
}

/// A planned lane change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlannedChange {
    /// The path.
    pub path: LateralPath,
    /// The speed that goes with it.
    pub course: SpeedCourse,
}

/// The drivable lane on the wished side, if it exists there now and long enough (Fig. 14 (a)).
///
/// # Errors
/// [`LaneChangeRefusal::NoTargetLane`].
pub(super) fn target_lane(
    road: &Road,
    lane: u16,
    wish: LaneChoice,
    s_m: f64,
    speed_m_s: f64,
    config: &LaneChangeConfig,
) -> Result<u16, LaneChangeRefusal> {
    let beside = match wish {
        LaneChoice::Left => road.left_of(lane, s_m),
        LaneChoice::Right => road.right_of(lane, s_m),
        LaneChoice::Keep => None,
    };
    let id = beside.ok_or(LaneChangeRefusal::NoTargetLane)?;
    let needed = s_m + speed_m_s * (config.duration_max_s + LANE_AFTER_S);
    let good = road.lanes().get(usize::from(id)).is_some_and(|l| {
        l.kind == LaneKind::Driving && l.exists_at(s_m) && l.exists_at(needed.min(road.length_m()))
    });
    if good { Ok(id) } else { Err(LaneChangeRefusal::NoTargetLane) }
}

/// What a plan starts from.
#[derive(Debug, Clone, Copy)]
pub struct Start<'a> {
    /// The truck.
    pub ego: &'a EgoState,
    /// The path driven so far; the new one continues it without a jump up to the second derivative.
    pub path: &'a LateralPath,
    /// Reference speed, m/s: the end speed is not above it.
    pub reference_speed_m_s: f64,
    /// The truck's lane ends so far ahead, m, and must be left.
    pub lane_ends_in_m: Option<f64>,
    /// The road.
    pub road: &'a Road,
    /// The truck's limits.
    pub limits: &'a VehicleLimits,
}

/// Plans a change to `target`: the cheapest sampled course that the truck can drive and that the
/// gate passes.
///
/// # Errors
/// Why none is driven: the gate's reason for the cheapest course that it refuses, or
/// [`LaneChangeRefusal::NoFeasiblePath`].
pub fn plan_change(
    config: &LaneChangeConfig,
    start: &Start<'_>,
    target: u16,
    gate: &Gate,
) -> Result<PlannedChange, LaneChangeRefusal> {
    let v = start.ego.speed_m_s;
    let strictness = config.entry(start.lane_ends_in_m.is_some(), v);
    if gate.occupied(&strictness) {
        return Err(LaneChangeRefusal::Occupied);
    }
    let mut courses = Courses::default();
    if v >= config.speed_min_m_s {
        courses.sample(config, v, start.reference_speed_m_s);
    } else if start.lane_ends_in_m.is_some() {
        PULL_AWAY_M.into_iter().for_each(|length_m| courses.add(0.0, pulling_away(v, length_m)));
    }
    let room_m = start.lane_ends_in_m.unwrap_or(f64::INFINITY);
    let mut refusal = None;
    let from = beginning(start, target);
    let corridor = Corridor::new(start.road, start.path.lane, target);
    for course in courses.cheapest_first() {
        let length_m = course.at(course.duration_s).1;
        if length_m > room_m {
            continue;
        }
        let offset = Quintic::to_zero(from, start.ego.s_m, length_m);
        let path = LateralPath { lane: target, offset: Some(offset) };
        // The gate first: it usually answers within its first instant
        if let Err(reason) = gate.check(&course, &path, start.road, start.ego.s_m, &strictness) {
            refusal.get_or_insert(reason);
            continue;
        }
        let limits = (config.lateral_accel_max_m_s2, config.lateral_jerk_max_m_s3);
        if drivable(config, start, &path, &course, &corridor, limits) {
            return Ok(PlannedChange { path, course });
        }
    }
    Err(refusal.unwrap_or(LaneChangeRefusal::NoFeasiblePath))
}

/// Plans the way back to lane `own`: the shortest course within the abort limits, the longest one
/// if none is.
#[must_use]
pub(super) fn plan_abort(config: &LaneChangeConfig, start: &Start<'_>, own: u16) -> LateralPath {
    let v = start.ego.speed_m_s.max(1.0);
    let corridor = Corridor::new(start.road, own, start.path.lane);
    let f = config.abort_factor;
    let limits = (f * config.lateral_accel_max_m_s2, f * config.lateral_jerk_max_m_s3);
    let from = beginning(start, own);
    let mut duration_s = 3.0;
    loop {
        let course = SpeedCourse { start_m_s: v, end_m_s: v, duration_s };
        let offset = Quintic::to_zero(from, start.ego.s_m, v * duration_s);
        let path = LateralPath { lane: own, offset: Some(offset) };
        if duration_s >= config.duration_max_s
            || drivable(config, start, &path, &course, &corridor, limits)
        {
            return path;
        }
        duration_s += 0.5;
    }
}

/// Changes of speed that are sampled, m/s.
const CHANGES_M_S: [f64; 5] = [0.0, 1.0, 2.0, -1.0, -2.0];
/// Steps of the duration that are sampled, s, and how many at most.
const DURATION_STEP_S: f64 = 0.5;
const DURATIONS: usize = 41;

/// Sampled courses with their costs, on the stack.
struct Courses {
    list: [(f64, usize, SpeedCourse); DURATIONS * CHANGES_M_S.len()],
    count: usize,
}

impl Default for Courses {
    fn default() -> Self {
        let nothing = (0.0, 0, SpeedCourse::default());
        Self { list: [nothing; DURATIONS * CHANGES_M_S.len()], count: 0 }
    }
}

impl Courses {
    fn add(&mut self, cost: f64, course: SpeedCourse) {
        if let Some(place) = self.list.get_mut(self.count) {
            *place = (cost, self.count, course);
            self.count += 1;
        }
    }

    /// Adds what a truck at `v` may drive: short, at the reference speed, without speed change.
    fn sample(&mut self, config: &LaneChangeConfig, v: f64, reference_m_s: f64) {
        let range_s = config.duration_max_s - config.duration_min_s;
        let steps = libm::floor(range_s / DURATION_STEP_S) as usize;
        for i in 0..=steps.min(DURATIONS - 1) {
            let duration_s = config.duration_min_s + DURATION_STEP_S * i as f64;
            for change_m_s in CHANGES_M_S {
                let end = v + change_m_s;
                let accel = change_m_s / duration_s;
                let allowed = accel <= config.accel_max_m_s2 && accel >= -config.decel_max_m_s2;
                let wished = end <= reference_m_s || change_m_s <= 0.0;
                if allowed && wished && end >= config.speed_min_m_s {
                    let cost = 0.2 * (duration_s - 7.0) * (duration_s - 7.0)
                        + 0.1 * (reference_m_s - end).abs()
                        + 0.3 * change_m_s * change_m_s;
                    self.add(cost, SpeedCourse { start_m_s: v, end_m_s: end, duration_s });
                }
            }
        }
    }

    /// The courses, cheapest first; of equally dear ones the one that was added first.
    fn cheapest_first(&mut self) -> impl Iterator<Item = SpeedCourse> + '_ {
        type Entry = (f64, usize, SpeedCourse);
        let order = |a: &Entry, b: &Entry| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        let list = &mut self.list[..self.count];
        if let Some(first) = (0..list.len()).min_by(|&i, &j| order(&list[i], &list[j])) {
            list.swap(0, first);
        }
        // The first one often serves: the others are put in order when they are asked for.
        let mut next = 0;
        core::iter::from_fn(move || {
            if next == 1 {
                list[1..].sort_unstable_by(order);
            }
            let (_, _, course) = list.get(next)?;
            next += 1;
            Some(*course)
        })
    }
}

/// Course of a truck that stands or crawls at its lane's end: it pulls away as it moves over.
pub(super) fn pulling_away(v: f64, length_m: f64) -> SpeedCourse {
    let end = libm::sqrt(v * v + 2.0 * PULL_AWAY_M_S2 * length_m.max(0.0));
    SpeedCourse { start_m_s: v, end_m_s: end, duration_s: (end - v) / PULL_AWAY_M_S2 }
}

/// Where the paths to `lane` begin that leave the present one without a jump, relative to its centre.
fn beginning(start: &Start<'_>, lane: u16) -> Lateral {
    let s_m = start.ego.s_m;
    let mut from = start.path.at(start.road, s_m);
    if start.ego.speed_m_s < STANDS_M_S {
        // Who stands turns the wheels as they must be.
        from.second_1_m = 0.0;
    }
    off_centre(start.road, lane, from, s_m)
}

/// The outer edges of two lanes.
struct Corridor<'a> {
    lanes: [Option<&'a road::LaneTrack>; 2],
    /// The edges, m, where they are the same all along.
    throughout_m: Option<(f64, f64)>,
}

impl<'a> Corridor<'a> {
    fn new(road: &'a Road, a: u16, b: u16) -> Self {
        let lane = |id: u16| road.lanes().get(usize::from(id));
        let mut corridor = Self { lanes: [lane(a), lane(b)], throughout_m: None };
        let constant =
            |l: &road::LaneTrack| l.center.as_constant().and(l.width.as_constant()).is_some();
        if corridor.lanes.iter().flatten().all(|l| constant(l)) {
            corridor.throughout_m = Some(corridor.edges_m(0.0));
        }
        corridor
    }

    /// Right and left edge at a station, m.
    fn edges_m(&self, s_m: f64) -> (f64, f64) {
        if let Some(edges_m) = self.throughout_m {
            return edges_m;
        }
        self.lanes.iter().flatten().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), l| {
            let (centre, half) = (l.center_d_m(s_m), 0.5 * l.width_m(s_m));
            (low.min(centre - half), high.max(centre + half))
        })
    }
}

/// Whether the loaded truck can drive the course with its trailer inside the corridor.
fn drivable(
    config: &LaneChangeConfig,
    start: &Start<'_>,
    path: &LateralPath,
    course: &SpeedCourse,
    corridor: &Corridor<'_>,
    (accel_max, jerk_max): (f64, f64),
) -> bool {
    let (g, l) = (&start.limits.geometry, &start.limits.lateral);
    let sharpest = 0.8 * libm::tan(l.max_road_wheel_rad) / g.wheelbase_m;
    let mut fold_rad = -start.ego.trailer.articulation_rad; // tractor minus trailer heading
    let mut time_s = 0.0;
    while time_s <= course.duration_s + 1.0 {
        let (v, travelled) = course.at(time_s);
        let s_m = start.ego.s_m + travelled;
        let line = start.road.line();
        let (here_m, road_curvature_1_m) = line.curvature_1_m(s_m);
        let centre = lane_centre(start.road, path.lane, s_m);
        let (q, jerk) = path.offset.map_or((Lateral::default(), 0.0), |offset| {
            (offset.at(s_m), v * v * v * offset.third_1_m2(s_m))
        });
        let lateral = Lateral {
            d_m: centre.d_m + q.d_m,
            slope: centre.slope + q.slope,
            second_1_m: q.second_1_m,
        };
        let (tan, curvature) = bend(&lateral, road_curvature_1_m);
        let felt = v * v * curvature - GRAVITY_M_S2 * line.bank().at(here_m);
        let transfer = REARWARD_AMPLIFICATION * felt.abs() / l.rollover_accel_m_s2;
        if (v * v * q.second_1_m).abs() > accel_max
            || jerk.abs() > jerk_max
            || transfer > config.load_transfer_max_frac
            || curvature.abs() > sharpest
        {
            return false;
        }
        let (low, high) = corridor.edges_m(s_m);
        let (low, high) = (low + config.edge_margin_m, high - config.edge_margin_m);
        let posed = Posed { d_m: lateral.d_m, tan, fold_rad, road_curvature_1_m };
        if !posed.is_within(g, (low, high)) {
            return false;
        }
        // Eq. 1: the trailer's axle group moves along the trailer
        let turn = v * curvature;
        let (sin, cos) = libm::sincos(fold_rad);
        let pull = v * sin + g.hitch_ahead_m * turn * cos;
        fold_rad += (turn - pull / g.hitch_to_trailer_axle_m) * STEP_S;
        time_s += STEP_S;
    }
    true
}
