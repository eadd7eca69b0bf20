//! One tick of native traffic: neighbours, accelerations, lane changes, motion, inflow, outflow.
//!
//! A tick is [`TICK_S`]. [`Engine::decide`] fixes every acceleration at the start of a tick from
//! the positions at that instant; [`Engine::commit`] moves the vehicles to its end. Between the
//! two, a vehicle's position at any instant is known in closed form. Only IEEE-exact operations
//! (`+ - * /`, comparison) and `libm` touch the state, so the same seed gives the same bits on every
//! machine. Sweeps over the fleet are done in pieces ([`super::workers`]).

use std::ops::Range;
use std::sync::Arc;

use driver_models::{Idm, ballistic};

use super::accelerations::Wanted;
use super::boundary::Boundary;
use super::changes::{DECISION_TICKS, EgoNeed, Wish, is_due};
use super::config::TrafficConfig;
use super::driver::Driver;
use super::ego::EgoSpans;
use super::fleet::Fleet;
use super::happenings::{Block, Plot, Rushing};
use super::human::{Mind, Minds};
use super::lanes::{LaneMap, NO_LANE};
use super::neighbours::{EGO, LEFT, Neighbourhood, OWN, RIGHT, Seen, Sides};
use super::window::{FAR_TICKS, Near, Stride};
use super::workers::{InTurn, PIECE, Workers, in_pieces};

/// Length of a tick, s.
pub(crate) const TICK_S: f64 = 0.1;
/// Rest between two lane changes of a driver, s.
const REST_S: f64 = 4.0;
/// Room for so many wishes in a tick from the beginning.
const WISHES: usize = 64;
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
    /// Arrivals at the entries, those that wait included.
    pub(crate) arrived: u64,
    /// Next arrival of a measured boundary, and those that wait for room.
    pub(crate) next_arrival: usize,
    pub(crate) late: Vec<usize>,
    /// Distance driven by all vehicles together, m.
    pub(crate) driven_m: f64,
    /// Lane changes begun.
    pub(crate) lane_changes: u64,
    /// What has happened so far.
    pub(crate) plot: Plot,
    /// Who is near the ego, where a window is wanted.
    pub(crate) near: Option<Near>,
}

impl Clone for State {
    fn clone(&self) -> Self {
        let mut copy = Self { fleet: self.fleet.clone(), ..Self::default() };
        copy.clone_from(self);
        copy
    }

    fn clone_from(&mut self, from: &Self) {
        self.fleet.clone_from(&from.fleet);
        self.tick = from.tick;
        self.next_id = from.next_id;
        self.waiting.clone_from(&from.waiting);
        self.arrived = from.arrived;
        self.next_arrival = from.next_arrival;
        self.late.clone_from(&from.late);
        self.driven_m = from.driven_m;
        self.lane_changes = from.lane_changes;
        self.plot.clone_from(&from.plot);
        self.near = from.near;
    }
}

/// The drivers' world. A copy has the memory of a tick to itself.
#[derive(Debug)]
pub(crate) struct Engine {
    pub(crate) config: Arc<TrafficConfig>,
    pub(crate) map: Arc<LaneMap>,
    pub(crate) state: State,
    pub(crate) ego: EgoSpans,
    /// Station of the ego, m; `None` before the first scene.
    pub(crate) ego_s_m: Option<f64>,
    pub(crate) near: Neighbourhood,
    /// What drivers want before this tick's lane changes.
    pub(super) wanted: Vec<Wanted>,
    /// Accelerations that vehicles do not exceed, to make room, m/s², and wishes to change lanes:
    /// memory of a tick.
    bounds: Vec<(usize, f64)>,
    wishes: Vec<Wish>,
    /// Stations at which changes into each lane began in this tick, m.
    pub(super) begun_m: Vec<f64>,
    /// Speed beyond the end of the road per lane, m/s; empty where the road goes on free.
    pub(super) beyond_m_s: Vec<f64>,
    /// Measured traffic at the rim, in place of drawn arrivals.
    pub(crate) boundary: Option<Arc<Boundary>>,
    /// How other drivers expect the ego to follow.
    pub(super) ego_driver: Idm,
    /// Where the ego needs room at this tick.
    pub(super) ego_need: Option<EgoNeed>,
    pub(super) minds: Minds,
    /// Who does the pieces of a tick, and how many vehicles a piece has.
    pub(super) workers: Arc<dyn Workers>,
    pub(super) piece: usize,
    /// Speed limit of the whole road at this tick, m/s.
    pub(super) limit_m_s: f64,
    /// Stretches that are in the way at this tick.
    pub(super) blocks: Vec<Block>,
    /// Emergency vehicles at this tick.
    pub(super) rushing: Vec<Rushing>,
}

impl Clone for Engine {
    fn clone(&self) -> Self {
        let mut copy = Self::new(Arc::clone(&self.config), Arc::clone(&self.map));
        copy.state = self.state.clone();
        copy.clone_from(self);
        copy
    }

    fn clone_from(&mut self, from: &Self) {
        // Destructured, so that no new part is forgotten.
        let Self {
            config,
            map,
            state,
            ego,
            ego_s_m,
            near: _,
            wanted: _,
            bounds: _,
            wishes: _,
            begun_m: _,
            beyond_m_s,
            boundary,
            ego_driver,
            ego_need,
            minds,
            workers,
            piece,
            limit_m_s,
            blocks,
            rushing,
        } = from;
        self.config.clone_from(config);
        self.map.clone_from(map);
        self.state.clone_from(state);
        self.ego.clone_from(ego);
        self.beyond_m_s.clone_from(beyond_m_s);
        self.boundary.clone_from(boundary);
        self.workers.clone_from(workers);
        self.blocks.clone_from(blocks);
        self.rushing.clone_from(rushing);
        (self.ego_s_m, self.ego_need, self.limit_m_s) = (*ego_s_m, *ego_need, *limit_m_s);
        (self.ego_driver, self.minds, self.piece) = (*ego_driver, *minds, *piece);
    }
}

/// A piece of the fleet, to be moved: station and speed, lane and target, clock and mind; driver and
/// number; acceleration.
type Chunk<'a> = (
    (
        ((&'a mut [f64], &'a mut [f64]), (&'a mut [u16], &'a mut [u16])),
        (&'a mut [f64], &'a mut [Mind]),
    ),
    ((&'a [Driver], &'a [u64]), &'a [f64]),
);

/// What moving a piece gave.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Moved {
    pub(super) driven_m: f64,
    pub(super) somebody_leaves: bool,
}

impl Moved {
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            driven_m: self.driven_m + other.driven_m,
            somebody_leaves: self.somebody_leaves || other.somebody_leaves,
        }
    }
}

/// Has the vehicle left the road?
pub(super) fn is_out(map: &LaneMap, s_m: f64, lane: u16, driver: &Driver) -> bool {
    let lane = &map.lanes[lane as usize];
    let left_road = s_m - driver.length_m > map.s_end_m || s_m > driver.leaves_s_m;
    left_road || lane.leaves && s_m > lane.s_end_m
}

impl Engine {
    pub(crate) fn new(config: Arc<TrafficConfig>, map: Arc<LaneMap>) -> Self {
        let waiting = vec![0; map.lanes.len()];
        Self {
            minds: Minds::new(&config.human, config.seed, TICK_S, DECISION_TICKS),
            config,
            map,
            state: State { waiting, ..State::default() },
            ego: EgoSpans::default(),
            ego_s_m: None,
            near: Neighbourhood::default(),
            wanted: Vec::new(),
            bounds: Vec::with_capacity(WISHES),
            wishes: Vec::with_capacity(WISHES),
            begun_m: Vec::new(),
            beyond_m_s: Vec::new(),
            boundary: None,
            workers: Arc::new(InTurn),
            piece: PIECE,
            ego_need: None,
            ego_driver: Idm::new(25.0, 1.5, 3.0, 0.6, 1.5, 6.0),
            limit_m_s: f64::INFINITY,
            blocks: Vec::new(),
            rushing: Vec::new(),
        }
    }

    /// Draws are those of another seed from now on.
    pub(crate) fn reseed(&mut self, seed: u64) {
        Arc::make_mut(&mut self.config).seed = seed;
        self.minds = Minds::new(&self.config.human, seed, TICK_S, DECISION_TICKS);
    }

    /// Fixes the accelerations and begins lane changes; the ego spans are those of this instant.
    pub(crate) fn decide(&mut self) {
        self.look_beyond();
        self.happen();
        self.ego_need = self.ego_need();
        let workers = Arc::clone(&self.workers);
        let piece = self.piece;
        let acting = self.settle();
        self.find_neighbours(&*workers, piece, &acting);
        let mut wanted = std::mem::take(&mut self.wanted);
        self.state.fleet.fit(&mut wanted, Wanted::default());
        // Who does not act goes on as before.
        let looked_at = self.looked_at(&acting);
        for i in (looked_at.start..acting.start).chain(acting.end..looked_at.end) {
            wanted[i] = Wanted { accel_m_s2: self.state.fleet.a_m_s2[i], free_m_s2: None };
        }
        let (first, has_needs) = (acting.start, self.has_needs());
        let mut bounds = std::mem::take(&mut self.bounds);
        let follow = |from: usize, wanted: &mut [Wanted], bounds: &mut Vec<(usize, f64)>| {
            for (i, wanted) in (from..).zip(wanted) {
                *wanted = self.follow_m_s2(i);
                if has_needs {
                    self.make_room(i, bounds);
                }
            }
        };
        if acting.len() <= piece {
            follow(first, &mut wanted[acting.clone()], &mut bounds);
        } else {
            let pieces = wanted[acting.clone()].chunks_mut(piece);
            let parts = in_pieces(&*workers, pieces, |k, wanted| {
                let mut bounds = Vec::new();
                follow(first + k * piece, wanted, &mut bounds);
                bounds
            });
            bounds.extend(parts.into_iter().flatten());
        }
        for (i, most_m_s2) in bounds.drain(..).chain(self.let_ego_in()) {
            wanted[i].accel_m_s2 = wanted[i].accel_m_s2.min(most_m_s2);
        }
        self.wanted = wanted;
        self.bounds = bounds;
        let mut a_m_s2 = std::mem::take(&mut self.state.fleet.a_m_s2);
        let mut wishes = std::mem::take(&mut self.wishes);
        let wish = |from: usize, a_m_s2: &mut [f64], wishes: &mut Vec<Wish>| {
            let range = from..from + a_m_s2.len();
            for (i, a) in range.clone().zip(a_m_s2) {
                *a = self.possible_m_s2(i);
            }
            wishes.extend(range.rev().filter_map(|i| self.wish(i)));
        };
        if acting.len() <= piece {
            wish(first, &mut a_m_s2[acting], &mut wishes);
        } else {
            let parts = in_pieces(&*workers, a_m_s2[acting].chunks_mut(piece), |k, a_m_s2| {
                let mut wishes = Vec::new();
                wish(first + k * piece, a_m_s2, &mut wishes);
                wishes
            });
            wishes.extend(parts.into_iter().rev().flatten());
        }
        self.state.fleet.a_m_s2 = a_m_s2;
        self.change_lanes(wishes.drain(..));
        self.wishes = wishes;
    }

    fn find_neighbours(&mut self, workers: &dyn Workers, piece: usize, acting: &Range<usize>) {
        let (fleet, map, tick) = (&self.state.fleet, &*self.map, self.state.tick);
        let (near, over) = (self.near(), self.looked_at(acting));
        let (eventful, has_needs) = (self.is_eventful(), map.has_needs());
        let looks_aside = |i: usize| {
            !near.contains(&i)
                || is_due(tick, fleet.id[i])
                || fleet.is_changing(i)
                || has_needs && (fleet.driver[i].exit != NO_LANE || map.ends_early(fleet.lane[i]))
                || eventful
        };
        let seen = Seen { fleet, map, ego: &self.ego };
        self.near.find(seen, &over, acting, workers, piece, looks_aside);
    }

    /// Moves every vehicle to the end of the tick, then lets vehicles out and in.
    pub(crate) fn commit(&mut self) {
        let (present, is_for_all) = (self.present(), self.is_for_all());
        let mut ticks = 1;
        let mut moved = self.move_on(present.clone(), Stride::TICK);
        if is_for_all && self.state.near.is_some() {
            ticks = FAR_TICKS;
            let awake = self.awake();
            moved = moved.and(self.move_on(awake.start..present.start, Stride::FAR));
            moved = moved.and(self.move_on(present.end..awake.end, Stride::FAR));
            moved = moved.and(self.move_asleep(awake));
        }
        self.state.driven_m += moved.driven_m;
        self.state.tick += 1;
        let fleet = &mut self.state.fleet;
        if !is_for_all {
            fleet.sort(present);
            return;
        }
        fleet.sort(0..fleet.len());
        if moved.somebody_leaves {
            let map = &self.map;
            fleet.retain(|f, i| !is_out(map, f.s_m[i], f.lane[i], &f.driver[i]));
        }
        match self.boundary.clone() {
            Some(boundary) => self.let_in_measured(&boundary),
            None => self.let_in(ticks),
        }
    }

    /// Moves a range of vehicles and lets their drivers get used to things and judge anew.
    fn move_on(&mut self, r: Range<usize>, stride: Stride) -> Moved {
        let (map, minds, tick) = (&*self.map, self.minds, self.state.tick + 1);
        let (f, piece) = (&mut self.state.fleet, self.piece);
        let motion = f.s_m[r.clone()].chunks_mut(piece).zip(f.v_m_s[r.clone()].chunks_mut(piece));
        let change = f.lane[r.clone()].chunks_mut(piece).zip(f.target[r.clone()].chunks_mut(piece));
        let inside =
            f.clock_s[r.clone()].chunks_mut(piece).zip(f.mind[r.clone()].chunks_mut(piece));
        let fixed = f.driver[r.clone()].chunks(piece).zip(f.id[r.clone()].chunks(piece));
        let is_one = r.len() <= piece;
        let items = motion.zip(change).zip(inside).zip(fixed.zip(f.a_m_s2[r].chunks(piece)));
        let go_on = |(((motion, change), inside), (fixed, a_m_s2)): Chunk<'_>| {
            let ((s_m, v_m_s), (lane, target), (clock_s, mind)) = (motion, change, inside);
            let (driver, id) = fixed;
            // All are as long, which saves looking at it for each.
            let n = s_m.len();
            let (v_m_s, a_m_s2, clock_s) = (&mut v_m_s[..n], &a_m_s2[..n], &mut clock_s[..n]);
            let (lane, target, mind) = (&mut lane[..n], &mut target[..n], &mut mind[..n]);
            let (driver, id) = (&driver[..n], &id[..n]);
            let mut moved = Moved::default();
            for i in 0..n {
                let (v, distance_m) = ballistic(v_m_s[i], a_m_s2[i], stride.step_s);
                v_m_s[i] = v;
                s_m[i] += distance_m;
                moved.driven_m += distance_m;
                clock_s[i] += stride.step_s;
                if target[i] == NO_LANE {
                    clock_s[i] = clock_s[i].min(0.0);
                } else if clock_s[i] >= driver[i].lane_change_s {
                    lane[i] = target[i];
                    target[i] = NO_LANE;
                    clock_s[i] = -REST_S;
                }
                if stride.is_far {
                    minds.relax_far(&mut mind[i]);
                } else {
                    minds.relax(&mut mind[i]);
                }
                if stride.is_far || is_due(tick, id[i]) {
                    minds.judge(&mut mind[i], id[i], tick);
                }
                moved.somebody_leaves |= is_out(map, s_m[i], lane[i], &driver[i]);
            }
            moved
        };
        if is_one {
            return items.map(go_on).fold(Moved::default(), Moved::and);
        }
        let parts = in_pieces(&*self.workers, items, |_, item| go_on(item));
        parts.into_iter().fold(Moved::default(), Moved::and)
    }

    /// Memory of a vehicle, bytes: state, what its driver wants, neighbours.
    pub(crate) fn bytes_per_vehicle() -> usize {
        Fleet::BYTES + size_of::<Wanted>() + size_of::<Sides>()
    }

    /// Smallest bumper-to-bumper gap to a leader in any lane that a vehicle takes up, m; call it
    /// after [`Engine::decide`].
    pub(crate) fn min_gap_m(&self) -> f64 {
        let fleet = &self.state.fleet;
        let mut least = f64::INFINITY;
        let known = self.near.sides.len().min(self.near().end);
        for i in self.near().start..known {
            for side in [OWN, LEFT, RIGHT] {
                let (lane, leader) =
                    (self.near.sides[i].lanes[side], self.near.sides[i].leader[side]);
                if leader < EGO && lane != NO_LANE && fleet.occupies(i, lane) {
                    least = least.min(fleet.rear_m(leader as usize) - fleet.s_m[i]);
                }
            }
        }
        least
    }
}
