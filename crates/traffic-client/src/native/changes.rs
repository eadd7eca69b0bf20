//! Lane changes: who has to, who wants to, who makes room, and what a change does to the others.
//!
//! A driver thinks about it twice a second. A needed change (the lane ends, the exit comes) is made
//! as soon as MOBIL's safety criterion allows it; another one if MOBIL's incentive is positive and
//! it does not undo the last one. Needed changes follow LMRS (Schakel, Knoop, van Arem, Transp. Res.
//! Record 2316 (2012) 47): the nearer their end comes, the shorter gaps and the harder braking are
//! accepted; who has to change adapts to the new leader ahead of time (synchronization), the new
//! follower lets one in (cooperation), and both go back to their own headways slowly (relaxation).
//! Who takes longer to change begins as much earlier, each driver by his own time: trucks that need
//! the room of three cars would else get it where everybody else merges, and cars would all merge at
//! one metre, where each stops those behind; either holds up the whole queue.

use driver_models::{Change, Mobil};
use tractrix_core::VehicleClass;

use super::engine::Engine;
use super::lanes::NO_LANE;
use super::neighbours::{EGO, LEFT, NOBODY, OWN, RIGHT};

/// A driver thinks about a lane change every so many ticks.
pub(super) const DECISION_TICKS: u64 = 5;
/// From this desire on drivers adapt to the lane that they need, and others let them in.
const COOPERATES: f64 = 0.5;
/// However little a change is needed yet, this part of the safe braking is accepted.
const LEAST_DESIRE: f64 = 0.2;
/// Room that is left behind the truck when it is let in, m.
const ROOM_FOR_EGO_M: f64 = 3.0;
/// Nobody changes into the lane that the truck needs so far behind it, m.
const KEPT_M: f64 = 50.0;
/// Two changes into one lane in the same tick start at least this far apart, m: the later one
/// would decide on neighbours that are no longer right.
const APART_M: f64 = 150.0;

/// Does this vehicle think about a lane change in this tick?
pub(super) fn is_due(tick: u64, id: u64) -> bool {
    (tick + id).is_multiple_of(DECISION_TICKS)
}

/// A lane change that has to be made.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Need {
    side: usize,
    distance_m: f64,
}

/// The lane that the ego has to get into, and where it is, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct EgoNeed {
    lane: u16,
    rear_m: f64,
    front_m: f64,
}

/// A driver and the changes that would pay or are needed: side, lane, incentive, m/s².
#[derive(Debug, Clone, Copy)]
pub(super) struct Wish {
    i: usize,
    options: [Option<(usize, u16, f64)>; 2],
}

impl Engine {
    /// Whether anybody may have to change lanes in this tick.
    pub(super) fn has_needs(&self) -> bool {
        self.map.has_needs() || self.is_eventful()
    }

    /// The lane change that vehicle `i` has to make, if any.
    #[inline]
    fn need(&self, i: usize) -> Option<Need> {
        if self.has_needs() { self.need_here(i) } else { None }
    }

    fn need_here(&self, i: usize) -> Option<Need> {
        let fleet = &self.state.fleet;
        if self.is_eventful()
            && let Some((side, distance_m)) = self.happening_need(i)
        {
            return Some(Need { side, distance_m });
        }
        let (lane, s, exit) = (fleet.lane[i], fleet.s_m[i], fleet.driver[i].exit);
        if exit == NO_LANE && !self.map.ends_early(lane) {
            return None;
        }
        let here = &self.map.lanes[lane as usize];
        let ahead = self.ahead_m(fleet.driver[i].lane_change_s);
        if exit != NO_LANE && lane != exit {
            let out = &self.map.lanes[exit as usize];
            if s < out.s_end_m && s > out.s_start_m - ahead {
                let at = s.max(out.s_start_m);
                let right = out.center_d_m(at) < here.center_d_m(s);
                let side = if right { RIGHT } else { LEFT };
                return Some(Need { side, distance_m: out.s_end_m - s });
            }
        }
        if lane != exit && self.map.ends_early(lane) && s > here.s_end_m - ahead {
            let reach = |side: usize| match self.near.sides[i].lanes[side] {
                NO_LANE => f64::NEG_INFINITY,
                k if self.map.is_open_to(k, exit) => self.map.lanes[k as usize].s_end_m,
                _ => f64::NEG_INFINITY,
            };
            let side = if reach(LEFT) >= reach(RIGHT) { LEFT } else { RIGHT };
            return Some(Need { side, distance_m: here.s_end_m - s });
        }
        None
    }

    fn least_frac(&self, i: usize) -> f64 {
        self.minds.least_frac(self.state.fleet.driver[i].idm.headway_s)
    }

    /// How many times as far ahead as the mean car somebody whose changes take `lane_change_s` begins
    /// to think of a needed one: as many times as long as it takes, and no less.
    pub(super) fn ahead_frac(&self, lane_change_s: f64) -> f64 {
        (lane_change_s / self.config.car.lane_change_s).max(1.0)
    }

    fn ahead_m(&self, lane_change_s: f64) -> f64 {
        self.config.mandatory_ahead_m * self.ahead_frac(lane_change_s)
    }

    /// How much a change is needed, 0 to 1: it grows from where drivers begin to think of it to the
    /// point where it must be done (LMRS, Eq. 4, by distance).
    fn desire(&self, lane_change_s: f64, distance_m: f64) -> f64 {
        (1.0 - distance_m / self.ahead_m(lane_change_s)).clamp(0.0, 1.0)
    }

    /// Part of their gap that drivers are content with at a desire (LMRS, Eq. 7).
    fn content_frac(&self, i: usize, desire: f64) -> f64 {
        let now = self.state.fleet.mind[i].headway_frac;
        now.min(1.0 - desire * (1.0 - self.least_frac(i)))
    }

    /// A vehicle that has to change adapts to its new leader, and its new follower lets it in:
    /// accelerations that they do not exceed, m/s².
    pub(super) fn make_room(&self, i: usize, bounds: &mut Vec<(usize, f64)>) {
        let fleet = &self.state.fleet;
        if fleet.is_changing(i) {
            return;
        }
        let Some(need) = self.need(i) else { return };
        let desire = self.desire(fleet.driver[i].lane_change_s, need.distance_m);
        if desire < COOPERATES {
            return;
        }
        let lane = self.near.sides[i].lanes[need.side];
        if lane == NO_LANE {
            return;
        }
        let comfortable = fleet.driver[i].idm.decel_m_s2;
        let leader = self.near.sides[i].leader[need.side];
        let taken = self.behind_at_m_s2(i, leader, lane, self.content_frac(i, desire));
        let own = fleet.driver[i].idm.lesser_m_s2(self.free_m_s2(i, fleet.lane[i]), taken);
        bounds.push((i, own.max(-comfortable)));
        let follower = self.near.sides[i].follower[need.side];
        if follower < EGO {
            let f = follower as usize;
            let yields = self.in_lane_m_s2(f, i as u32, lane, self.content_frac(f, desire));
            bounds.push((f, yields.max(-self.config.yield_decel_m_s2)));
        }
    }

    /// Where the ego needs room, if its lane ends: others let it in as anybody.
    pub(super) fn ego_need(&self) -> Option<EgoNeed> {
        let span = self.ego.spans().iter().find(|span| self.map.ends_early(span.lane))?;
        let distance_m = self.map.lanes[span.lane as usize].s_end_m - span.front_m;
        let (left, right) = self.map.beside(span.lane, span.front_m);
        let goes_on = |&lane: &u16| {
            lane != NO_LANE && self.map.is_open_to(lane, NO_LANE) && !self.map.ends_early(lane)
        };
        let lane = [left, right].into_iter().find(goes_on)?;
        let desire = self.desire(self.config.truck.lane_change_s, distance_m);
        let needed = desire >= COOPERATES && self.ego.in_lane(lane).is_none();
        needed.then_some(EgoNeed { lane, rear_m: span.rear_m, front_m: span.front_m })
    }

    /// The first driver behind the ego in the lane that it needs who can stay behind it comfortably
    /// lets it in: the driver and the acceleration not to exceed, m/s².
    pub(super) fn let_ego_in(&self) -> Option<(usize, f64)> {
        let need = self.ego_need?;
        let (fleet, most) = (&self.state.fleet, self.config.yield_decel_m_s2);
        let rear_m = need.rear_m - ROOM_FOR_EGO_M;
        let needed = |i: usize| {
            let closing = (fleet.v_m_s[i] - self.ego.speed_m_s).max(0.0);
            let room_m = rear_m - fleet.s_m[i];
            if room_m > 0.0 { closing * closing / (2.0 * room_m) } else { f64::INFINITY }
        };
        let can_stay_behind = |&i: &usize| fleet.occupies(i, need.lane) && needed(i) <= most;
        let f = self.near().rev().find(can_stay_behind)?;
        let seen = (rear_m, self.ego.speed_m_s);
        let taken = self.behind_that_m_s2(f, seen, fleet.mind[f].headway_frac);
        let follows = fleet.driver[f].idm.lesser_m_s2(self.free_m_s2(f, need.lane), taken);
        // Braking that is put off until more is needed than one gives would come to nothing.
        let in_time = if needed(f) > 0.5 * most { -needed(f) } else { f64::INFINITY };
        Some((f, follows.min(in_time).max(-most)))
    }

    /// Whether the traffic law keeps this class out of a lane that it does not need.
    pub(super) fn is_closed_to(&self, lane: u16, class: VehicleClass) -> bool {
        class == VehicleClass::Truck
            && self.config.trucks_keep_out_of_left_lane
            && self.map.is_left_of_three(lane)
    }

    /// Whether a lane at a station is kept free for the ego.
    fn is_kept_for_ego(&self, lane: u16, s_m: f64) -> bool {
        self.ego_need.is_some_and(|need| {
            need.lane == lane && s_m > need.rear_m - KEPT_M && s_m < need.front_m + ROOM_FOR_EGO_M
        })
    }

    /// Does vehicle `i` think about a lane change, acting in this tick? Those beyond the window do
    /// whenever they act.
    pub(super) fn is_due(&self, i: usize) -> bool {
        is_due(self.state.tick, self.state.fleet.id[i]) || !self.near().contains(&i)
    }

    /// What driver `i` would do about his lane in this tick.
    pub(super) fn wish(&self, i: usize) -> Option<Wish> {
        let fleet = &self.state.fleet;
        let stays = fleet.is_changing(i) || fleet.driver[i].stop_s_m.is_finite();
        if !self.is_due(i) || stays || fleet.clock_s[i] < 0.0 {
            return None;
        }
        let options = match self.need(i) {
            Some(need) => {
                let desire = self.desire(fleet.driver[i].lane_change_s, need.distance_m);
                let possible = self.change_m_s2(i, need.side, Some(desire));
                [possible.map(|(lane, _)| (need.side, lane, f64::INFINITY)), None]
            }
            None => [LEFT, RIGHT].map(|side| {
                if self.near.sides[i].lanes[side] == NO_LANE {
                    return None;
                }
                let possible = self.change_m_s2(i, side, None).filter(|&(_, gain)| gain > 0.0);
                possible.map(|(lane, gain)| (side, lane, gain))
            }),
        };
        options.iter().any(Option::is_some).then_some(Wish { i, options })
    }

    /// Begins changes, from the front, each that is far enough from those begun in this tick.
    pub(super) fn change_lanes(&mut self, wishes: impl Iterator<Item = Wish>) {
        self.begun_m.clear();
        self.begun_m.resize(self.map.lanes.len(), f64::INFINITY);
        for wish in wishes {
            let s_m = self.state.fleet.s_m[wish.i];
            let apart = |o: &&(usize, u16, f64)| self.begun_m[o.1 as usize] - s_m >= APART_M;
            let possible = wish.options.iter().flatten().filter(apart);
            // Of two that pay as much, the left one.
            let best = possible.reduce(|a, b| if b.2 > a.2 { b } else { a }).copied();
            if let Some((side, lane, _)) = best {
                self.begin(wish.i, side, lane);
            }
        }
    }

    /// Begins a change: the driver remembers why, and he and the new follower accept their gaps.
    fn begin(&mut self, i: usize, side: usize, lane: u16) {
        let (leader, follower) =
            (self.near.sides[i].leader[side], self.near.sides[i].follower[side]);
        let own_frac = self.steady_frac(i, leader, lane);
        let cut_in_on = (follower < EGO).then_some(follower as usize);
        let their_frac = cut_in_on.map(|f| self.steady_frac(f, i as u32, lane));
        let left_behind = self.number(self.near.sides[i].leader[OWN]);
        let (own_least, tick) = (self.least_frac(i), self.state.tick);
        if let (Some(f), Some(frac)) = (cut_in_on, their_frac) {
            let least = self.least_frac(f);
            self.state.fleet.mind[f].accept(frac, least);
        }
        let fleet = &mut self.state.fleet;
        let from = fleet.lane[i];
        let mind = &mut fleet.mind[i];
        mind.headway_frac = 1.0;
        mind.accept(own_frac, own_least);
        mind.changed(from, tick, left_behind);
        fleet.target[i] = lane;
        fleet.clock_s[i] = 0.0;
        self.begun_m[lane as usize] = fleet.s_m[i];
        self.state.lane_changes += 1;
    }

    /// Part of the own headway at which a driver would keep the gap that is there.
    fn steady_frac(&self, i: usize, leader: u32, lane: u16) -> f64 {
        let Some((rear_m, _)) = self.rear_and_speed(leader, lane) else { return 1.0 };
        let fleet = &self.state.fleet;
        let idm = &fleet.driver[i].idm;
        (rear_m - fleet.s_m[i]) / (idm.min_gap_m + fleet.v_m_s[i] * idm.headway_s)
    }

    /// Number of a vehicle, that of the ego being none that a vehicle has.
    fn number(&self, who: u32) -> Option<u64> {
        match who {
            NOBODY => None,
            EGO => Some(u64::MAX),
            j => Some(self.state.fleet.id[j as usize]),
        }
    }

    /// MOBIL for one side: lane and incentive, m/s², if the change is possible and safe.
    fn change_m_s2(&self, i: usize, side: usize, desire: Option<f64>) -> Option<(u16, f64)> {
        let fleet = &self.state.fleet;
        let (lane, s) = (self.near.sides[i].lanes[side], fleet.s_m[i]);
        if lane == NO_LANE || !self.map.is_open_to(lane, fleet.driver[i].exit) {
            return None;
        }
        if self.is_eventful() && self.keeps_out(i, lane) || self.is_kept_for_ego(lane, s) {
            return None;
        }
        if desire.is_none() && self.is_closed_to(lane, fleet.driver[i].class) {
            return None;
        }
        let to = &self.map.lanes[lane as usize];
        if desire.is_none()
            && self.map.ends_early(lane)
            && to.s_end_m - s < self.ahead_m(fleet.driver[i].lane_change_s)
        {
            return None;
        }
        let (leader, follower) =
            (self.near.sides[i].leader[side], self.near.sides[i].follower[side]);
        let mind = &fleet.mind[i];
        if desire.is_none()
            && mind.would_undo(&self.minds, lane, self.state.tick, || self.number(follower))
        {
            return None;
        }
        let frac =
            |i: usize| desire.map_or(fleet.mind[i].headway_frac, |d| self.content_frac(i, d));
        let class = self.class(i);
        let mobil = Mobil {
            politeness_frac: fleet.driver[i].politeness_frac,
            safe_decel_m_s2: class.safe_decel_m_s2 * desire.map_or(1.0, |d| d.max(LEAST_DESIRE)),
            threshold_m_s2: class.threshold_m_s2,
            right_bias_m_s2: class.right_bias_m_s2,
        };
        let pays = |c: &Change| desire.is_some() || mobil.incentive_m_s2(c, side == RIGHT) > 0.0;
        // Most changes do not pay even if nobody is ahead there, nobody minds, and whoever is behind
        // had a free road: what is less than that is worked out only where it may matter.
        let free_m_s2 = self.known_free_m_s2(i, lane);
        let mut change = Change {
            own_before_m_s2: self.wanted[i].accel_m_s2,
            own_after_m_s2: free_m_s2,
            ..Change::default()
        };
        let old_follower = Some(self.near.sides[i].follower[OWN]).filter(|&o| o < EGO);
        if let Some(o) = old_follower {
            let before = self.wanted[o as usize].accel_m_s2;
            change.old_follower_before_m_s2 = before;
            let at_most = self.known_free_m_s2(o as usize, fleet.lane[i]);
            change.old_follower_after_m_s2 = before.max(at_most);
        }
        if !pays(&change) {
            return None;
        }
        let taken = self.behind_at_m_s2(i, leader, lane, frac(i));
        change.own_after_m_s2 = fleet.driver[i].idm.lesser_m_s2(free_m_s2, taken);
        if !pays(&change) {
            return None;
        }
        let known_in_lane = |i: usize, leader: u32, lane: u16, frac: f64| {
            let taken = self.behind_at_m_s2(i, leader, lane, frac);
            fleet.driver[i].idm.lesser_m_s2(self.known_free_m_s2(i, lane), taken)
        };
        if let Some(o) = old_follower {
            let (o, ahead) = (o as usize, self.near.sides[i].leader[OWN]);
            let after = known_in_lane(o, ahead, fleet.lane[i], fleet.mind[o].headway_frac);
            change.old_follower_after_m_s2 = after.max(change.old_follower_before_m_s2);
            if !pays(&change) {
                return None;
            }
        }
        match follower {
            NOBODY => {}
            EGO => change.new_follower_after_m_s2 = self.ego_behind_m_s2(i, lane),
            f => {
                let (f, before) = (f as usize, self.wanted[f as usize].accel_m_s2);
                let after = known_in_lane(f, i as u32, lane, frac(f));
                change.new_follower_before_m_s2 = before;
                change.new_follower_after_m_s2 = after.min(before);
            }
        }
        mobil.is_safe(&change).then(|| (lane, mobil.incentive_m_s2(&change, side == RIGHT)))
    }

    /// Braking that a cut-in before the ego would ask of it, m/s².
    fn ego_behind_m_s2(&self, i: usize, lane: u16) -> f64 {
        let Some(span) = self.ego.in_lane(lane) else { return 0.0 };
        let (v, gap) = (self.ego.speed_m_s, self.state.fleet.rear_m(i) - span.front_m);
        self.ego_driver.interaction_m_s2(v, gap, v - self.state.fleet.v_m_s[i])
    }
}
