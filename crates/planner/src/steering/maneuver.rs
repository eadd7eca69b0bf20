//! The manoeuvre state machine: keep lane, change, abort. It starts a change that the gate passes,
//! checks it again on every call, aborts it while the truck is still inside its lane, and finishes
//! it otherwise.

use super::lane_change::{
    LaneChangeConfig, PlannedChange, STANDS_M_S, Start, plan_abort, plan_change, pulling_away,
    target_lane,
};
use super::path::{LateralPath, lane_centre};
use crate::decider::lane_ends_in_m;
use crate::safety::{Gate, GateView, RssConfig, SpeedCourse};
use crate::{LaneChoice, Situation};
use tractrix_core::{LaneChangeRefusal, Maneuver, Time};

/// Deceleration of a truck that stops again on its way out of a lane that ends, m/s².
const WAITS_DECEL_M_S2: f64 = 0.8;

/// What is being driven.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Phase {
    Keep,
    /// `waits`: pulling away at its lane's end, it stands inside its lane until the gap serves.
    Change {
        own: u16,
        choice: LaneChoice,
        course: SpeedCourse,
        began: Time,
        waits: bool,
    },
    Abort {
        target: u16,
    },
}

/// What the state machine looks at.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Outlook<'a> {
    /// The truck and what is around it.
    pub at: &'a Situation<'a>,
    /// Reference speed, m/s.
    pub reference_speed_m_s: f64,
}

/// The manoeuvre and its path.
#[derive(Debug, Clone)]
pub(crate) struct ManeuverPlanner {
    config: LaneChangeConfig,
    rss: RssConfig,
    phase: Phase,
    path: LateralPath,
    quiet_until: Time,
}

impl ManeuverPlanner {
    /// Starts on a path, in lane keeping.
    #[must_use]
    pub(crate) fn new(config: LaneChangeConfig, rss: RssConfig, path: LateralPath) -> Self {
        Self { config, rss, phase: Phase::Keep, path, quiet_until: Time(i64::MIN) }
    }

    /// The path.
    #[must_use]
    pub(crate) fn path(&self) -> &LateralPath {
        &self.path
    }

    /// The manoeuvre.
    #[must_use]
    pub(crate) fn maneuver(&self) -> Maneuver {
        match self.phase {
            Phase::Keep => Maneuver::KeepLane,
            Phase::Change { choice: LaneChoice::Left, .. } => Maneuver::ChangeLeft,
            Phase::Change { .. } => Maneuver::ChangeRight,
            Phase::Abort { .. } => Maneuver::AbortChange,
        }
    }

    /// The lane that the truck is in, or leaves.
    #[must_use]
    pub(crate) fn lane(&self) -> u16 {
        match self.phase {
            Phase::Change { own, .. } => own,
            Phase::Keep | Phase::Abort { .. } => self.path.lane,
        }
    }

    /// Planned speed, m/s, and acceleration, m/s², of a change under way.
    #[must_use]
    pub(crate) fn planned_speed(&self, now: Time) -> Option<(f64, f64)> {
        let Phase::Change { course, began, waits, .. } = self.phase else {
            return None;
        };
        if waits {
            return Some((0.0, -WAITS_DECEL_M_S2));
        }
        let time_s = now.seconds_since(began).max(0.0);
        let accel = if time_s < course.duration_s { course.accel_m_s2() } else { 0.0 };
        Some((course.at(time_s).0, accel))
    }

    /// The part of a change or of its way back that is driven, 0 to 1.
    #[must_use]
    pub(crate) fn progress_frac(&self, s_m: f64) -> f64 {
        let Some(q) = self.path.offset.filter(|_| self.phase != Phase::Keep) else { return 0.0 };
        (1.0 - (q.end_s_m() - s_m) / q.length_m()).clamp(0.0, 1.0)
    }

    /// Looks at a wish; starts the change if it can be driven safely.
    ///
    /// # Errors
    /// Why it is not driven.
    pub(crate) fn request(
        &mut self,
        choice: LaneChoice,
        out: &Outlook<'_>,
    ) -> Result<(), LaneChangeRefusal> {
        if let Some(PlannedChange { path, course }) = self.plan(choice, out)? {
            let own = self.path.lane;
            self.path = path;
            self.phase = Phase::Change { own, choice, course, began: out.at.now, waits: false };
        }
        Ok(())
    }

    /// Whether [`Self::request`] would start the change here.
    ///
    /// # Errors
    /// Why it would not be driven.
    pub(crate) fn would_pass(
        &self,
        choice: LaneChoice,
        out: &Outlook<'_>,
    ) -> Result<(), LaneChangeRefusal> {
        self.plan(choice, out).map(|_| ())
    }

    /// The change that a wish would start; none for a wish to keep the lane.
    fn plan(
        &self,
        choice: LaneChoice,
        out: &Outlook<'_>,
    ) -> Result<Option<PlannedChange>, LaneChangeRefusal> {
        if choice == LaneChoice::Keep {
            return Ok(None);
        }
        if self.phase != Phase::Keep || out.at.now < self.quiet_until {
            return Err(LaneChangeRefusal::Busy);
        }
        let own = self.path.lane;
        let (s_m, v) = (out.at.ego.s_m, out.at.ego.speed_m_s);
        let target = target_lane(out.at.road, own, choice, s_m, v, &self.config)?;
        let gate = self.gate(out, own, target);
        plan_change(&self.config, &self.start(out), target, &gate).map(Some)
    }

    /// Checks a change under way and ends what is complete. Returns the reason of an abort.
    pub(crate) fn update(&mut self, out: &Outlook<'_>) -> Option<LaneChangeRefusal> {
        let at = out.at;
        let done = self.path.offset.is_none_or(|q| at.ego.s_m >= q.end_s_m());
        if done {
            if self.phase != Phase::Keep {
                self.quiet_until = at.now.plus_nanos((self.config.cooldown_s * 1e9) as i64);
            }
            self.phase = Phase::Keep;
            self.path = LateralPath::keep(self.path.lane);
            return None;
        }
        if matches!(self.phase, Phase::Abort { .. }) && at.ego.speed_m_s < STANDS_M_S {
            // Its lane's end has stopped it: the way back is as far as it gets, and it may try again.
            self.phase = Phase::Keep;
        }
        let Phase::Change { own, choice, course, began, waits } = self.phase else {
            return None;
        };
        let (s_m, v) = (at.ego.s_m, at.ego.speed_m_s);
        let pulls_away = course.start_m_s < self.config.speed_min_m_s;
        // A truck that pulls away can stop, another one must still be inside when it turns back.
        let stops_m = if pulls_away { v * v / (2.0 * WAITS_DECEL_M_S2) } else { 0.0 };
        let ahead_m = if pulls_away { at.limits.geometry.front_m } else { 0.0 };
        if !self.inside(own, at, 0.5 * v + stops_m, ahead_m) && !waits {
            return None;
        }
        let target = self.path.lane;
        let time_s = at.now.seconds_since(began).max(0.0);
        let rest = if pulls_away {
            pulling_away(v, self.path.offset.map_or(0.0, |q| q.end_s_m() - s_m))
        } else {
            let duration_s = (course.duration_s - time_s).max(0.5);
            SpeedCourse { start_m_s: v, end_m_s: course.end_m_s, duration_s }
        };
        let gate = self.gate(out, own, target);
        let lane_ends = lane_ends_in_m(at.road, own, at.ego.s_m).is_some();
        let strictness = self.config.under_way(lane_ends, course.start_m_s);
        let verdict = gate.check(&rest, &self.path, at.road, s_m, &strictness);
        if pulls_away {
            self.phase = match verdict {
                Ok(()) if !waits => self.phase,
                Ok(()) => Phase::Change { own, choice, course: rest, began: at.now, waits: false },
                Err(_) => Phase::Change { own, choice, course, began, waits: true },
            };
            return verdict.err();
        }
        let reason = verdict.err()?;
        self.path = plan_abort(&self.config, &self.start(out), own);
        self.phase = Phase::Abort { target };
        Some(reason)
    }

    /// Whether the body, from the reference point to `ahead_m`, is still inside a lane, and stays so
    /// for the next `soon_m`.
    fn inside(&self, lane: u16, at: &Situation<'_>, soon_m: f64, ahead_m: f64) -> bool {
        let Some(track) = at.road.lanes().get(usize::from(lane)) else {
            return false;
        };
        let s_m = at.ego.s_m;
        let room = 0.5 * (track.width_m(s_m) - at.limits.geometry.width_m);
        let off = |s_m: f64| {
            let (is, centre) = (self.path.at(at.road, s_m), lane_centre(at.road, lane, s_m));
            let off_m = is.d_m - centre.d_m;
            off_m.abs().max((off_m + (is.slope - centre.slope) * ahead_m).abs())
        };
        off(s_m) < room && off(s_m + soon_m) < room
    }

    fn gate(&self, out: &Outlook<'_>, own: u16, target: u16) -> Gate {
        let Situation { ego, scene, road, limits, .. } = *out.at;
        let (rss, grade_rad) = (&self.rss, out.at.descent_rad());
        Gate::new(&GateView { rss, ego, scene, road, limits, grade_rad }, own, target)
    }

    fn start<'a>(&'a self, out: &Outlook<'a>) -> Start<'a> {
        let at = out.at;
        Start {
            ego: at.ego,
            path: &self.path,
            reference_speed_m_s: out.reference_speed_m_s,
            lane_ends_in_m: lane_ends_in_m(at.road, self.path.lane, at.ego.s_m),
            road: at.road,
            limits: at.limits,
        }
    }
}
