//! How each driver wants to accelerate: alone in a lane, behind somebody, and as far as the engine
//! gives it. All from the positions at the start of a tick.

use super::config::ClassConfig;
use super::engine::Engine;
use super::neighbours::{EGO, LEFT, NOBODY, OWN, RIGHT};

/// A driver takes the foot off the pedal for a lower limit ahead when it asks for this part of
/// comfortable braking.
const OFF_THE_PEDAL: f64 = 0.25;
/// A vehicle stops this far before the end of its lane, m.
const END_MARGIN_M: f64 = 2.0;
/// Drivers adapt to the speed beyond the end of the road over this stretch before it, m.
pub(crate) const BEYOND_M: f64 = 60.0;

/// What a driver wants in a tick, before its lane changes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Wanted {
    /// Acceleration, m/s².
    pub(super) accel_m_s2: f64,
    /// The same with nobody ahead in the lane that is driven or come into, m/s²; `None` of who does
    /// not act.
    pub(super) free_m_s2: Option<f64>,
}

impl Engine {
    /// The wanted acceleration as far as engine and tyres give it, m/s².
    pub(super) fn possible_m_s2(&self, i: usize) -> f64 {
        let fleet = &self.state.fleet;
        let (driver, class) = (&fleet.driver[i], self.class(i));
        let power = driver.power_limit_m_s2(
            fleet.v_m_s[i],
            self.map.sin_grade(fleet.s_m[i]),
            class.rolling_coeff,
            class.drag_1_m,
        );
        self.wanted[i].accel_m_s2.min(power).max(-driver.idm.max_decel_m_s2)
    }

    pub(super) fn class(&self, i: usize) -> &ClassConfig {
        self.config.class(self.state.fleet.driver[i].class)
    }

    /// Acceleration with nobody ahead in `lane`, m/s²: towards the desired speed and, where a lower
    /// limit comes, towards that at its start, `-b_kin²/b` with the braking `b_kin` that it takes
    /// (the IDM's own strategy, Treiber & Kesting 2013, Eq. 11.17).
    pub(super) fn free_m_s2(&self, i: usize, lane: u16) -> f64 {
        self.free_at_m_s2(i, lane, self.state.fleet.v_m_s[i])
    }

    /// The same at another speed.
    fn free_at_m_s2(&self, i: usize, lane: u16, v: f64) -> f64 {
        let fleet = &self.state.fleet;
        let s_m = fleet.s_m[i];
        let lane_map = &self.map.lanes[lane as usize];
        let driver = &fleet.driver[i];
        let section = lane_map.section(s_m);
        let mut wish_m_s = section.limit_m_s.min(self.limit_m_s) * driver.limit_factor;
        if s_m > self.map.s_end_m - BEYOND_M
            && let Some(&beyond_m_s) = self.beyond_m_s.get(lane as usize)
        {
            wish_m_s = wish_m_s.min(beyond_m_s);
        }
        let free = driver.idm.free_m_s2(v, wish_m_s);
        let (lower_at_m, lower_m_s) = section.lower;
        let lower_m_s = lower_m_s * driver.limit_factor;
        if v <= lower_m_s {
            return free;
        }
        let b = driver.idm.decel_m_s2;
        let needed = (v * v - lower_m_s * lower_m_s) / (2.0 * (lower_at_m - s_m).max(1.0));
        if needed < OFF_THE_PEDAL * b { free } else { free.min(-needed * needed / b) }
    }

    /// [`Self::free_m_s2`] once all have said what they want: from there where it is that.
    pub(super) fn known_free_m_s2(&self, i: usize, lane: u16) -> f64 {
        let known = self.wanted[i].free_m_s2;
        let is_one_rule = self.map.has_one_limit() && self.beyond_m_s.is_empty();
        let known = known.filter(|_| is_one_rule || lane == self.driven(i));
        known.unwrap_or_else(|| self.free_m_s2(i, lane))
    }

    /// The lane that vehicle `i` drives in, or comes into.
    #[inline]
    fn driven(&self, i: usize) -> u16 {
        let fleet = &self.state.fleet;
        if fleet.is_changing(i) { fleet.target[i] } else { fleet.lane[i] }
    }

    /// What the leader in `lane` takes away, m/s², for the headway that the driver keeps now.
    #[inline]
    pub(super) fn behind_m_s2(&self, i: usize, leader: u32, lane: u16) -> f64 {
        self.behind_at_m_s2(i, leader, lane, self.state.fleet.mind[i].headway_frac)
    }

    /// The same for another headway, as a part of the driver's own.
    #[inline]
    pub(super) fn behind_at_m_s2(&self, i: usize, leader: u32, lane: u16, frac: f64) -> f64 {
        let seen = self.rear_and_speed(leader, lane);
        seen.map_or(0.0, |seen| self.behind_that_m_s2(i, seen, frac))
    }

    /// The same behind somebody whose rear is there, m, and who has that speed, m/s.
    pub(super) fn behind_that_m_s2(&self, i: usize, seen: (f64, f64), frac: f64) -> f64 {
        self.behind_that_at_m_s2(i, seen, frac, self.state.fleet.v_m_s[i])
    }

    /// The same at another speed.
    #[inline]
    fn behind_that_at_m_s2(
        &self,
        i: usize,
        (rear_m, speed_m_s): (f64, f64),
        frac: f64,
        v: f64,
    ) -> f64 {
        let fleet = &self.state.fleet;
        let idm = &fleet.driver[i].idm;
        let (gap_m, closing_m_s) = fleet.mind[i].sees(rear_m - fleet.s_m[i], v - speed_m_s);
        idm.content_with(frac).interaction_m_s2(v, gap_m, closing_m_s)
    }

    /// Acceleration in `lane` behind `leader`, m/s², with a part of the driver's own headway.
    pub(super) fn in_lane_m_s2(&self, i: usize, leader: u32, lane: u16, frac: f64) -> f64 {
        let taken = self.behind_at_m_s2(i, leader, lane, frac);
        self.state.fleet.driver[i].idm.lesser_m_s2(self.free_m_s2(i, lane), taken)
    }

    #[inline]
    pub(super) fn rear_and_speed(&self, who: u32, lane: u16) -> Option<(f64, f64)> {
        match who {
            NOBODY => None,
            EGO => self.ego.in_lane(lane).map(|span| (span.rear_m, self.ego.speed_m_s)),
            j => {
                let fleet = &self.state.fleet;
                Some((fleet.rear_m(j as usize), fleet.v_m_s[j as usize]))
            }
        }
    }

    /// Car following in the lane, or in both lanes during a change, and the end of the lane.
    pub(super) fn follow_m_s2(&self, i: usize) -> Wanted {
        let fleet = &self.state.fleet;
        let (lane, driven) = (fleet.lane[i], self.driven(i));
        let mut a = self.behind_m_s2(i, self.near.sides[i].leader[OWN], lane);
        if fleet.is_changing(i) {
            let side = self.side_of(i, driven);
            a = a.min(self.behind_m_s2(i, self.near.sides[i].leader[side], driven));
        }
        if self.map.ends_early(driven) && fleet.driver[i].exit != driven {
            let v = fleet.v_m_s[i];
            let gap = self.map.lanes[driven as usize].s_end_m - END_MARGIN_M - fleet.s_m[i];
            a = a.min(fleet.driver[i].idm.interaction_m_s2(v, gap, v));
        }
        if !self.blocks.is_empty() {
            a = a.min(self.closure_m_s2(i, driven, END_MARGIN_M)).min(self.stop_m_s2(i));
        }
        let idm = &fleet.driver[i].idm;
        let free_m_s2 = self.free_m_s2(i, driven);
        let mut accel_m_s2 = idm.lesser_m_s2(free_m_s2, a);
        if self.stands(i, driven) {
            accel_m_s2 = accel_m_s2.min(if fleet.v_m_s[i] > 0.0 { -idm.decel_m_s2 } else { 0.0 });
        }
        Wanted { accel_m_s2, free_m_s2: Some(free_m_s2) }
    }

    /// Whether a driver stops, or stays where he stands: he is slower than anybody drives, and could
    /// not even drive that slowly ([`super::HumanConfig::creep_m_s`]).
    fn stands(&self, i: usize, driven: u16) -> bool {
        let (fleet, creep_m_s) = (&self.state.fleet, self.config.human.creep_m_s);
        if fleet.v_m_s[i] >= creep_m_s {
            return false;
        }
        let frac = fleet.mind[i].headway_frac;
        let taken = |side: usize, lane: u16| {
            let seen = self.rear_and_speed(self.near.sides[i].leader[side], lane);
            seen.map_or(0.0, |seen| self.behind_that_at_m_s2(i, seen, frac, creep_m_s))
        };
        let mut a = taken(OWN, fleet.lane[i]);
        if fleet.is_changing(i) {
            a = a.min(taken(self.side_of(i, driven), driven));
        }
        let free = self.free_at_m_s2(i, driven, creep_m_s);
        fleet.driver[i].idm.lesser_m_s2(free, a) < 0.0
    }

    fn side_of(&self, i: usize, lane: u16) -> usize {
        if self.near.sides[i].lanes[LEFT] == lane { LEFT } else { RIGHT }
    }
}
