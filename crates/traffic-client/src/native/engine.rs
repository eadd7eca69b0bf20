//! One tick of native traffic: neighbours, accelerations, lane changes, motion, inflow, outflow.
//!
//! A tick is [`TICK_S`]. [`Engine::decide`] fixes every acceleration at the start of a tick from
//! the positions at that instant; [`Engine::commit`] moves the vehicles to its end. Between the
//! two, a vehicle's position at any instant is known in closed form. Only IEEE-exact operations
//! (`+ - * /`, comparison) touch the state, so the same seed gives the same bits on every machine.

use std::sync::Arc;

use driver_models::{Change, Idm, Mobil, ballistic};

use super::boundary::Boundary;
use super::config::{ClassConfig, TrafficConfig};
use super::ego::EgoSpans;
use super::fleet::Fleet;
use super::lanes::{LaneMap, NO_LANE};
use super::neighbours::{EGO, LEFT, NOBODY, Neighbourhood, OWN, RIGHT};

/// Length of a tick, s.
pub(crate) const TICK_S: f64 = 0.1;
/// A driver thinks about a lane change every so many ticks.
const DECISION_TICKS: u64 = 5;
/// Rest between two lane changes of a driver, s.
const REST_S: f64 = 4.0;
/// Within this distance before the point where a change must be done, drivers make room, m.
const MAKE_ROOM_M: f64 = 300.0;
/// Two changes into one lane in the same tick start at least this far apart, m: the later one
/// would decide on neighbours that are no longer right.
const APART_M: f64 = 150.0;
/// A vehicle stops this far before the end of its lane, m.
const END_MARGIN_M: f64 = 2.0;

/// Drivers adapt to the speed beyond the end of the road over this stretch before it, m.
pub(crate) const BEYOND_M: f64 = 60.0;

/// Everything that changes: what a snapshot holds.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct State {
    pub(crate) fleet: Fleet,
    /// Number of ticks done.
    pub(crate) tick: u64,
    /// Number of the next vehicle.
    pub(crate) next_id: u64,
    /// Arrivals that found no room yet, per lane.
    pub(crate) waiting: Vec<u32>,
    /// Next arrival of a measured boundary, and those that wait for room.
    pub(crate) next_arrival: usize,
    pub(crate) late: Vec<usize>,
    /// Distance driven by all vehicles together, m.
    pub(crate) driven_m: f64,
    /// Lane changes begun.
    pub(crate) lane_changes: u64,
}

impl Clone for State {
    fn clone(&self) -> Self {
        let mut copy = Self::default();
        copy.clone_from(self);
        copy
    }

    fn clone_from(&mut self, from: &Self) {
        self.fleet.clone_from(&from.fleet);
        self.tick = from.tick;
        self.next_id = from.next_id;
        self.waiting.clone_from(&from.waiting);
        self.next_arrival = from.next_arrival;
        self.late.clone_from(&from.late);
        self.driven_m = from.driven_m;
        self.lane_changes = from.lane_changes;
    }
}

/// The drivers' world.
#[derive(Debug, Clone)]
pub(crate) struct Engine {
    pub(crate) config: Arc<TrafficConfig>,
    pub(crate) map: Arc<LaneMap>,
    pub(crate) state: State,
    pub(crate) ego: EgoSpans,
    pub(crate) near: Neighbourhood,
    /// Accelerations before this tick's lane changes, m/s².
    raw_a_m_s2: Vec<f64>,
    /// Stations at which changes into each lane began in this tick, m.
    begun_m: Vec<f64>,
    /// Speed beyond the end of the road per lane, m/s; empty where the road goes on free.
    pub(super) beyond_m_s: Vec<f64>,
    /// Measured traffic at the rim, in place of drawn arrivals.
    pub(crate) boundary: Option<Arc<Boundary>>,
    /// How other drivers expect the ego to follow.
    ego_driver: Idm,
}

/// Does this vehicle think about a lane change in this tick?
fn is_due(tick: u64, id: u64) -> bool {
    (tick + id).is_multiple_of(DECISION_TICKS)
}

/// A lane change that has to be made.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Need {
    side: usize,
    distance_m: f64,
}

impl Engine {
    pub(crate) fn new(config: Arc<TrafficConfig>, map: Arc<LaneMap>) -> Self {
        let waiting = vec![0; map.lanes.len()];
        Self {
            config,
            map,
            state: State { waiting, ..State::default() },
            ego: EgoSpans::default(),
            near: Neighbourhood::default(),
            raw_a_m_s2: Vec::new(),
            begun_m: Vec::new(),
            beyond_m_s: Vec::new(),
            boundary: None,
            ego_driver: Idm::new(25.0, 1.5, 3.0, 0.6, 1.5, 6.0),
        }
    }

    /// Fixes the accelerations and begins lane changes; the ego spans are those of this instant.
    pub(crate) fn decide(&mut self) {
        self.look_beyond();
        let (fleet, map, tick) = (&self.state.fleet, &self.map, self.state.tick);
        self.near.find(fleet, map, &self.ego, |i| {
            is_due(tick, fleet.id[i])
                || fleet.is_changing(i)
                || fleet.driver[i].exit != NO_LANE
                || map.ends_early(fleet.lane[i])
        });
        let n = fleet.len();
        self.raw_a_m_s2.clear();
        for i in 0..n {
            let a = self.follow_m_s2(i);
            self.raw_a_m_s2.push(a);
        }
        for i in 0..n {
            self.make_room(i);
        }
        self.change_lanes();
        for i in 0..n {
            let fleet = &self.state.fleet;
            let (driver, class) = (&fleet.driver[i], self.class(i));
            let power = driver.power_limit_m_s2(
                fleet.v_m_s[i],
                self.map.sin_grade(fleet.s_m[i]),
                class.rolling_coeff,
                class.drag_1_m,
            );
            let a = self.raw_a_m_s2[i].min(power).max(-driver.idm.max_decel_m_s2);
            self.state.fleet.a_m_s2[i] = a;
        }
    }

    fn class(&self, i: usize) -> &ClassConfig {
        self.config.class(self.state.fleet.driver[i].class)
    }

    /// Acceleration with nobody ahead in `lane`, m/s².
    fn free_m_s2(&self, i: usize, lane: u16) -> f64 {
        let fleet = &self.state.fleet;
        let limit = self.map.lanes[lane as usize].limit_m_s(fleet.s_m[i]);
        let driver = &fleet.driver[i];
        let mut wish_m_s = limit * driver.limit_factor;
        if fleet.s_m[i] > self.map.s_end_m - BEYOND_M
            && let Some(&beyond_m_s) = self.beyond_m_s.get(lane as usize)
        {
            wish_m_s = wish_m_s.min(beyond_m_s);
        }
        driver.idm.free_m_s2(fleet.v_m_s[i], wish_m_s)
    }

    /// What the leader in `lane` takes away, m/s².
    fn behind_m_s2(&self, i: usize, leader: u32, lane: u16) -> f64 {
        let Some((rear_m, speed_m_s)) = self.rear_and_speed(leader, lane) else { return 0.0 };
        let fleet = &self.state.fleet;
        let v = fleet.v_m_s[i];
        fleet.driver[i].idm.interaction_m_s2(v, rear_m - fleet.s_m[i], v - speed_m_s)
    }

    fn rear_and_speed(&self, who: u32, lane: u16) -> Option<(f64, f64)> {
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
    fn follow_m_s2(&self, i: usize) -> f64 {
        let fleet = &self.state.fleet;
        let lane = fleet.lane[i];
        let mut a = self.behind_m_s2(i, self.near.leader[i][OWN], lane);
        let mut driven = lane;
        if fleet.is_changing(i) {
            driven = fleet.target[i];
            let side = self.side_of(i, driven);
            a = a.min(self.behind_m_s2(i, self.near.leader[i][side], driven));
        }
        if self.map.ends_early(driven) && fleet.driver[i].exit != driven {
            let v = fleet.v_m_s[i];
            let gap = self.map.lanes[driven as usize].s_end_m - END_MARGIN_M - fleet.s_m[i];
            a = a.min(fleet.driver[i].idm.interaction_m_s2(v, gap, v));
        }
        a + self.free_m_s2(i, driven)
    }

    fn side_of(&self, i: usize, lane: u16) -> usize {
        if self.near.lanes[i][LEFT] == lane { LEFT } else { RIGHT }
    }

    /// The lane change that vehicle `i` has to make, if any.
    fn need(&self, i: usize) -> Option<Need> {
        let fleet = &self.state.fleet;
        let (lane, s, exit) = (fleet.lane[i], fleet.s_m[i], fleet.driver[i].exit);
        let here = &self.map.lanes[lane as usize];
        let ahead = self.config.mandatory_ahead_m;
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
            let reach = |side: usize| match self.near.lanes[i][side] {
                NO_LANE => f64::NEG_INFINITY,
                k if self.map.is_open_to(k, exit) => self.map.lanes[k as usize].s_end_m,
                _ => f64::NEG_INFINITY,
            };
            let side = if reach(LEFT) >= reach(RIGHT) { LEFT } else { RIGHT };
            return Some(Need { side, distance_m: here.s_end_m - s });
        }
        None
    }

    /// Vehicles that have to change adapt to their new leader; their new follower lets them in.
    fn make_room(&mut self, i: usize) {
        let fleet = &self.state.fleet;
        if fleet.is_changing(i) {
            return;
        }
        let Some(need) = self.need(i).filter(|n| n.distance_m < MAKE_ROOM_M) else { return };
        let lane = self.near.lanes[i][need.side];
        if lane == NO_LANE {
            return;
        }
        let comfortable = fleet.driver[i].idm.decel_m_s2;
        let own = self.behind_m_s2(i, self.near.leader[i][need.side], lane)
            + self.free_m_s2(i, fleet.lane[i]);
        let follower = self.near.follower[i][need.side];
        self.raw_a_m_s2[i] = self.raw_a_m_s2[i].min(own.max(-comfortable));
        if follower < EGO {
            let f = follower as usize;
            let yields = self.behind_m_s2(f, i as u32, lane) + self.free_m_s2(f, lane);
            let bounded = yields.max(-self.config.yield_decel_m_s2);
            self.raw_a_m_s2[f] = self.raw_a_m_s2[f].min(bounded);
        }
    }

    fn change_lanes(&mut self) {
        self.begun_m.clear();
        self.begun_m.resize(self.map.lanes.len(), f64::INFINITY);
        for i in (0..self.state.fleet.len()).rev() {
            let fleet = &self.state.fleet;
            if !is_due(self.state.tick, fleet.id[i])
                || fleet.is_changing(i)
                || fleet.clock_s[i] < 0.0
            {
                continue;
            }
            if let Some(lane) = self.best_change(i) {
                self.begun_m[lane as usize] = self.state.fleet.s_m[i];
                self.state.fleet.target[i] = lane;
                self.state.fleet.clock_s[i] = 0.0;
                self.state.lane_changes += 1;
            }
        }
    }

    /// The lane to change to now: the needed one if it is safe, else the one that pays most.
    fn best_change(&self, i: usize) -> Option<u16> {
        if let Some(need) = self.need(i) {
            return self.change_m_s2(i, need.side, true).map(|(lane, _)| lane);
        }
        let mut best: Option<(u16, f64)> = None;
        for side in [LEFT, RIGHT] {
            if let Some((lane, gain)) = self.change_m_s2(i, side, false)
                && gain > best.map_or(0.0, |b| b.1)
            {
                best = Some((lane, gain));
            }
        }
        best.map(|b| b.0)
    }

    /// MOBIL for one side: lane and incentive, m/s², if the change is possible and safe.
    fn change_m_s2(&self, i: usize, side: usize, needed: bool) -> Option<(u16, f64)> {
        let fleet = &self.state.fleet;
        let (lane, s) = (self.near.lanes[i][side], fleet.s_m[i]);
        if lane == NO_LANE || !self.map.is_open_to(lane, fleet.driver[i].exit) {
            return None;
        }
        let to = &self.map.lanes[lane as usize];
        if !needed && self.map.ends_early(lane) && to.s_end_m - s < self.config.mandatory_ahead_m {
            return None;
        }
        if self.begun_m[lane as usize] - s < APART_M {
            return None;
        }
        let (leader, follower) = (self.near.leader[i][side], self.near.follower[i][side]);
        let (new_before, new_after) = match follower {
            NOBODY => (0.0, 0.0),
            EGO => (0.0, self.ego_behind_m_s2(i, lane)),
            f => {
                let (f, before) = (f as usize, self.raw_a_m_s2[f as usize]);
                let after = self.free_m_s2(f, lane) + self.behind_m_s2(f, i as u32, lane);
                (before, after.min(before))
            }
        };
        let (old_before, old_after) = match self.near.follower[i][OWN] {
            NOBODY | EGO => (0.0, 0.0),
            o => {
                let (o, before) = (o as usize, self.raw_a_m_s2[o as usize]);
                let own = fleet.lane[i];
                let after =
                    self.free_m_s2(o, own) + self.behind_m_s2(o, self.near.leader[i][OWN], own);
                (before, after.max(before))
            }
        };
        let change = Change {
            own_before_m_s2: self.raw_a_m_s2[i],
            own_after_m_s2: self.free_m_s2(i, lane) + self.behind_m_s2(i, leader, lane),
            new_follower_before_m_s2: new_before,
            new_follower_after_m_s2: new_after,
            old_follower_before_m_s2: old_before,
            old_follower_after_m_s2: old_after,
        };
        let class = self.class(i);
        let mobil = Mobil {
            politeness_frac: fleet.driver[i].politeness_frac,
            safe_decel_m_s2: class.safe_decel_m_s2,
            threshold_m_s2: class.threshold_m_s2,
            right_bias_m_s2: class.right_bias_m_s2,
        };
        mobil.is_safe(&change).then(|| (lane, mobil.incentive_m_s2(&change, side == RIGHT)))
    }

    /// Braking that a cut-in before the ego would ask of it, m/s².
    fn ego_behind_m_s2(&self, i: usize, lane: u16) -> f64 {
        let Some(span) = self.ego.in_lane(lane) else { return 0.0 };
        let (v, gap) = (self.ego.speed_m_s, self.state.fleet.rear_m(i) - span.front_m);
        self.ego_driver.interaction_m_s2(v, gap, v - self.state.fleet.v_m_s[i])
    }

    /// Moves every vehicle to the end of the tick, then lets vehicles out and in.
    pub(crate) fn commit(&mut self) {
        let state = &mut self.state;
        let fleet = &mut state.fleet;
        for i in 0..fleet.len() {
            let (v, distance) = ballistic(fleet.v_m_s[i], fleet.a_m_s2[i], TICK_S);
            fleet.v_m_s[i] = v;
            fleet.s_m[i] += distance;
            state.driven_m += distance;
            fleet.clock_s[i] += TICK_S;
            if fleet.target[i] == NO_LANE {
                fleet.clock_s[i] = fleet.clock_s[i].min(0.0);
            } else if fleet.clock_s[i] >= fleet.driver[i].lane_change_s {
                fleet.lane[i] = fleet.target[i];
                fleet.target[i] = NO_LANE;
                fleet.clock_s[i] = -REST_S;
            }
        }
        state.tick += 1;
        let map = &self.map;
        fleet.sort();
        fleet.retain(|f, i| {
            let lane = &map.lanes[f.lane[i] as usize];
            let left_road = f.rear_m(i) > map.s_end_m || f.s_m[i] > f.driver[i].leaves_s_m;
            !(left_road || lane.leaves && f.s_m[i] > lane.s_end_m)
        });
        match self.boundary.clone() {
            Some(boundary) => self.let_in_measured(&boundary),
            None => self.let_in(),
        }
    }

    /// Smallest bumper-to-bumper gap to a leader in any lane that a vehicle takes up, m; call it
    /// after [`Engine::decide`].
    pub(crate) fn min_gap_m(&self) -> f64 {
        let fleet = &self.state.fleet;
        let mut least = f64::INFINITY;
        for i in 0..fleet.len() {
            for side in [OWN, LEFT, RIGHT] {
                let (lane, leader) = (self.near.lanes[i][side], self.near.leader[i][side]);
                if leader < EGO && lane != NO_LANE && fleet.occupies(i, lane) {
                    least = least.min(fleet.rear_m(leader as usize) - fleet.s_m[i]);
                }
            }
        }
        least
    }
}
