//! The safety gate of a lane change: safe gaps on predicted states in both lanes (the paper's
//! Fig. 14 (b) and (c), with the check that its Algorithm 1 lacks).
//!
//! The ego is predicted along its planned change, the others with their present speed; a vehicle
//! ahead is also taken to go on braking as it does now, one behind to go on accelerating, both for
//! [`HOLD_S`]. From the last step before the truck's body reaches into the target lane until the
//! change is done and the reaction time has passed, and in the own lane from now on:
//! - target lane, ahead: `gap >= d_safe(ego, other)` and time to collision above the bound;
//! - target lane, behind, from the trailer's rear: `gap >= d_safe(other, ego)`, same bound;
//! - own lane, ahead: `gap >= d_safe(ego, other)` as long as the ego's body reaches into the
//!   other's.
//!
//! Those behind in the target lane are counted on to ease off, by a bounded deceleration and no
//! further than to the truck's speed, once they have seen it in their lane and reacted: so much
//! courtesy makes the change comfortable, not safe. Safe it is because the gap at entry is the safe
//! gap for the speed that the follower has there: whoever does not ease off, and brakes as the safe
//! gap assumes when it is undershot, stops behind the truck. Until shortly before entry the change
//! is checked again with what is seen then, and broken off if the gap will not serve. Where the
//! truck's lane ends those behind must let it in (StVO section 7 (4)): they are taken to react to
//! its indicator, and a truck that pulls away there may begin with somebody alongside, because it
//! can stop before it enters.
//!
//! A lane in which an emergency vehicle comes from behind within [`KEEP_CLEAR_M`] counts as occupied.

use super::rss::{RssConfig, SafeGap};
use super::surroundings::{EgoExtent, in_lane, reaches};
use crate::steering::{Lateral, LateralPath};
use driver_models::ballistic;
use road::Road;
use tractrix_core::{EgoState, LaneChangeRefusal, Neighbour, Scene, VehicleClass, VehicleLimits};

/// Present acceleration is held for so long, s.
const HOLD_S: f64 = 1.5;
/// Step of the prediction, s.
const STEP_S: f64 = 0.5;
/// Vehicles alongside within this distance of either bumper occupy the lane, m.
const ALONGSIDE_M: f64 = 2.0;
/// A lane is kept clear of the ego while an emergency vehicle comes in it from within this, m.
const KEEP_CLEAR_M: f64 = 200.0;

/// The ego's planned speed: constant acceleration to the end speed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SpeedCourse {
    /// Speed now, m/s.
    pub start_m_s: f64,
    /// Speed at the end of the change, m/s.
    pub end_m_s: f64,
    /// Time from now to the end of the change, s.
    pub duration_s: f64,
}

impl SpeedCourse {
    /// Acceleration, m/s².
    #[must_use]
    pub fn accel_m_s2(&self) -> f64 {
        (self.end_m_s - self.start_m_s) / self.duration_s.max(0.1)
    }

    /// Speed, m/s, and distance travelled, m, at a time from now in s.
    #[must_use]
    pub fn at(&self, time_s: f64) -> (f64, f64) {
        let a = self.accel_m_s2();
        let t = time_s.min(self.duration_s);
        let distance = self.start_m_s * t + 0.5 * a * t * t;
        (self.start_m_s + a * t, distance + self.end_m_s * (time_s - t))
    }
}

/// How strictly the gaps are asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strictness {
    /// Factor on the safe gaps in the target lane.
    pub target_factor: f64,
    /// Factor on the safe gap in the own lane.
    pub own_factor: f64,
    /// Least time to collision, s.
    pub time_to_collision_s: f64,
    /// Deceleration with which those behind in the target lane ease off once they have reacted,
    /// m/s²; zero: they go on as they do.
    pub yield_decel_m_s2: f64,
    /// They react to the truck's indicator, not only to its body in their lane.
    pub yield_to_indicator: bool,
    /// Somebody alongside does not stop the change from beginning: the truck can stop.
    pub may_stop: bool,
}

/// How somebody behind makes room.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Yielding {
    /// When there is something to react to, s from now.
    seen_s: f64,
    /// It is the indicator: they have begun already, as their braking shows.
    to_indicator: bool,
    decel_m_s2: f64,
    /// No slower than this, m/s.
    down_to_m_s: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Role {
    TargetAhead,
    TargetBehind,
    OwnAhead,
}

/// A neighbour that a change has to do with.
#[derive(Debug, Clone, Copy)]
struct Concern {
    role: Role,
    neighbour: Neighbour,
    reaction_s: f64,
    safe: SafeGap,
}

/// The two nearest vehicles of each role, those behind first: those beyond them cannot come closer
/// without passing.
#[derive(Debug, Clone, Copy, Default)]
struct Nearest<'a> {
    list: [Option<(Role, &'a Neighbour)>; 3 * PER_ROLE],
    count: usize,
}

/// Vehicles of each role that count.
const PER_ROLE: usize = 2;

impl<'a> Nearest<'a> {
    fn add(&mut self, role: Role, neighbour: &'a Neighbour) {
        let near = |(role, n): (Role, &Neighbour)| match role {
            Role::TargetBehind => -n.front_s_m,
            Role::TargetAhead | Role::OwnAhead => n.rear_s_m,
        };
        let own = near((role, neighbour));
        let entries = self.list[..self.count].iter().flatten().copied();
        let (mut place, mut alike, mut last_alike) = (self.count, 0, 0);
        for (i, entry) in entries.enumerate() {
            if entry.0 == role {
                (alike, last_alike) = (alike + 1, i);
            }
            if near(entry) > own {
                place = place.min(i);
            }
        }
        if alike == PER_ROLE {
            if place > last_alike {
                return;
            }
            self.list[last_alike..self.count].rotate_left(1);
            self.count -= 1;
        }
        self.list[self.count] = Some((role, neighbour));
        self.count += 1;
        self.list[place..self.count].rotate_right(1);
    }
}

impl Concern {
    /// Speed and distance travelled at a time from now; somebody behind eases off.
    fn at(&self, time_s: f64, yielding: &Yielding) -> (f64, f64) {
        let n = &self.neighbour;
        let behind = self.role == Role::TargetBehind;
        let braking_counts = if yielding.to_indicator { yielding.decel_m_s2 } else { 0.0 };
        let a = if behind { n.accel_m_s2.max(-braking_counts) } else { n.accel_m_s2.min(0.0) };
        let reacted_s = match (behind, yielding.seen_s + self.reaction_s) {
            (false, _) => f64::INFINITY,
            (true, reacted_s) if yielding.to_indicator => reacted_s,
            // To a whole step, so that the instant before the first easing is looked at.
            (true, reacted_s) => STEP_S * libm::ceil(reacted_s / STEP_S),
        };
        let before_s = time_s.min(reacted_s);
        let held_s = before_s.min(HOLD_S);
        let (v, held_m) = ballistic(n.speed_m_s.max(0.0), a, held_s);
        let on_m = held_m + v * (before_s - held_s);
        if time_s <= reacted_s || yielding.decel_m_s2 <= 0.0 {
            return (v, on_m + v * (time_s - before_s));
        }
        let eases_s =
            (time_s - reacted_s).min((v - yielding.down_to_m_s).max(0.0) / yielding.decel_m_s2);
        let (then, eased_m) = ballistic(v, -yielding.decel_m_s2, eases_s);
        (then, on_m + eased_m + then * (time_s - reacted_s - eases_s))
    }
}

/// What a gate looks at.
#[derive(Debug, Clone, Copy)]
pub struct GateView<'a> {
    /// Safe gaps.
    pub rss: &'a RssConfig,
    /// The truck.
    pub ego: &'a EgoState,
    /// The others.
    pub scene: &'a Scene,
    /// The road.
    pub road: &'a Road,
    /// The truck's limits.
    pub limits: &'a VehicleLimits,
    /// Steepest descent ahead, rad (uphill positive).
    pub grade_rad: f64,
}

/// The vehicles that a change from one lane to another has to do with.
#[derive(Debug, Clone)]
pub struct Gate {
    concerns: [Option<Concern>; 3 * PER_ROLE],
    extent: EgoExtent,
    reaction_s: f64,
    occupied: bool,
    /// The target lane is kept clear for an emergency vehicle.
    kept_clear: bool,
}

impl Gate {
    /// Sorts out the scene for a change from lane `own` to lane `target`.
    #[must_use]
    pub fn new(view: &GateView<'_>, own: u16, target: u16) -> Self {
        let GateView { rss, ego, scene, road, limits, grade_rad } = *view;
        let extent = EgoExtent::new(ego, &limits.geometry);
        let response = rss.ego_response(limits);
        let (mut occupied, mut kept_clear) = (false, false);
        let mut nearest = Nearest::default();
        for n in &scene.neighbours {
            let ahead = n.front_s_m > extent.front_s_m;
            let role = if in_lane(road, target, n, extent.width_m) {
                let emergency = n.class == VehicleClass::Emergency;
                let behind_m = if emergency { KEEP_CLEAR_M } else { ALONGSIDE_M };
                let there = n.front_s_m > extent.rear_s_m - behind_m
                    && n.rear_s_m < extent.front_s_m + ALONGSIDE_M;
                occupied |= there;
                kept_clear |= there && emergency;
                if ahead { Role::TargetAhead } else { Role::TargetBehind }
            } else if ahead && in_lane(road, own, n, extent.width_m) {
                Role::OwnAhead
            } else {
                continue;
            };
            nearest.add(role, n);
        }
        let concern = |(role, n): (Role, &Neighbour)| {
            let safe = match role {
                Role::TargetBehind => {
                    SafeGap::new(&rss.behind(n.class), rss.ego_brake_max_m_s2, grade_rad)
                }
                _ => SafeGap::new(&response, rss.brake_max_m_s2(n.class), grade_rad),
            };
            let reaction_s = rss.behind(n.class).reaction_s;
            Concern { role, neighbour: *n, reaction_s, safe }
        };
        Self {
            concerns: nearest.list.map(|entry| entry.map(concern)),
            extent,
            reaction_s: response.reaction_s,
            occupied,
            kept_clear,
        }
    }

    /// A vehicle is alongside in the target lane, or one must pass there.
    #[must_use]
    pub fn occupied(&self, strictness: &Strictness) -> bool {
        self.kept_clear || self.occupied && !strictness.may_stop
    }

    /// Whether the planned change is safe; otherwise the reason.
    ///
    /// # Errors
    /// The first violated condition in time.
    pub fn check(
        &self,
        course: &SpeedCourse,
        path: &LateralPath,
        road: &Road,
        s_m: f64,
        strictness: &Strictness,
    ) -> Result<(), LaneChangeRefusal> {
        if self.occupied(strictness) {
            return Err(LaneChangeRefusal::Occupied);
        }
        if self.concerns.iter().all(Option::is_none) {
            return Ok(());
        }
        let down_to_m_s = course.start_m_s.min(course.end_m_s);
        let (mut entry_s, mut time_s) = (None, 0.0);
        let mut here = path.at(road, s_m + course.at(time_s).1);
        while time_s <= course.duration_s + self.reaction_s {
            let (v, travelled) = course.at(time_s);
            let d_m = here.d_m;
            let next_s_m = s_m + course.at(time_s + STEP_S).1;
            here = path.at(road, next_s_m);
            if entry_s.is_none() && self.enters(road, path.lane, (next_s_m, &here), s_m) {
                entry_s = Some(time_s);
            }
            let to_indicator = strictness.yield_to_indicator;
            let entered_s = entry_s.filter(|_| !to_indicator).map(|entry_s| entry_s + STEP_S);
            let (seen_s, decel_m_s2) = (entered_s.unwrap_or(0.0), strictness.yield_decel_m_s2);
            let yielding = Yielding { seen_s, to_indicator, decel_m_s2, down_to_m_s };
            let counts = |c: &&Concern| c.role == Role::OwnAhead || entry_s.is_some();
            for c in self.concerns.iter().flatten().filter(counts) {
                let other = c.at(time_s, &yielding);
                self.check_one(c, other, (v, travelled), d_m, strictness)?;
            }
            time_s += STEP_S;
        }
        Ok(())
    }

    /// Whether the tractor reaches into a lane from where it is `at` a station; `s_m` is its station
    /// now.
    fn enters(&self, road: &Road, lane: u16, (at_m, at): (f64, &Lateral), s_m: f64) -> bool {
        road.lanes().get(usize::from(lane)).is_none_or(|track| {
            let centre_m = track.center_d_m(at_m);
            let front_d_m = at.d_m + at.slope * (self.extent.front_s_m - s_m);
            let reach_m = 0.5 * (track.width_m(at_m) + self.extent.width_m);
            (centre_m - at.d_m).abs().min((centre_m - front_d_m).abs()) < reach_m
        })
    }

    fn check_one(
        &self,
        c: &Concern,
        (v_n, moved): (f64, f64),
        (v, travelled): (f64, f64),
        d_m: f64,
        strictness: &Strictness,
    ) -> Result<(), LaneChangeRefusal> {
        let n = &c.neighbour;
        let ahead_m = n.rear_s_m + moved - (self.extent.front_s_m + travelled);
        let behind_m = self.extent.rear_s_m + travelled - (n.front_s_m + moved);
        let (gap, closing, safe, factor, refusal) = match c.role {
            Role::TargetAhead => (
                ahead_m,
                v - v_n,
                c.safe.gap_m(v, v_n),
                strictness.target_factor,
                LaneChangeRefusal::UnsafeFront,
            ),
            Role::TargetBehind => (
                behind_m,
                v_n - v,
                c.safe.gap_m(v_n, v),
                strictness.target_factor,
                LaneChangeRefusal::UnsafeRear,
            ),
            Role::OwnAhead => {
                if !reaches(n, d_m, self.extent.width_m) {
                    return Ok(());
                }
                (
                    ahead_m,
                    v - v_n,
                    c.safe.gap_m(v, v_n),
                    strictness.own_factor,
                    LaneChangeRefusal::UnsafeOwnLane,
                )
            }
        };
        let too_close = gap < safe * factor || gap < 2.0;
        let too_soon = closing > 0.1 && gap < closing * strictness.time_to_collision_s;
        if too_close || too_soon { Err(refusal) } else { Ok(()) }
    }
}
