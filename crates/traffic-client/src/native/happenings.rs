//! What happens while traffic runs: limits, closed lanes, stopped vehicles, emergency vehicles.
//!
//! What is in the way is a [`Block`]: drivers leave its lane as they leave a lane that ends, from
//! where they see it on, and none comes into it. Before an emergency vehicle drivers go to the
//! right where there is room, and keep out of its lane (StVO § 38; SUMO's blue-light device does
//! the like).

use tractrix_core::VehicleClass;

use super::driver::Driver;
use super::engine::{Engine, TICK_S};
use super::inflow::entry_speed_m_s;
use super::lanes::{LaneUse, NO_LANE};
use super::neighbours::{LEFT, RIGHT};
use super::takeover::stopping_gap_m;
use crate::schedule::{EmergencyVehicle, Incident, IncidentKind, Schedule, Stage, has_room};

/// A vehicle that stands is seen from this far, m.
const SIGHT_M: f64 = 300.0;
/// Drivers make way this far ahead of an emergency vehicle, m.
pub(super) const WAY_M: f64 = 200.0;
/// Who has to brake harder than this for a lane that is being closed drives on through, m/s².
const LAST_THROUGH_M_S2: f64 = 4.0;
/// One that stands within this of where somebody should stand is the one, m.
const THERE_M: f64 = 10.0;
/// Nobody yet.
const NOBODY: u64 = u64::MAX;

/// Where the plot stands: what happened so far, and when the run began.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Plot {
    /// Tick and time (s) of the start of the run.
    pub(crate) start: (u64, f64),
    stage: Stage,
    /// The vehicle that stands for each incident.
    stopped: Vec<u64>,
    /// Emergency vehicles that have come.
    came: usize,
}

impl Plot {
    pub(crate) fn stage(&self) -> &Stage {
        &self.stage
    }

    /// Begins at a tick and time (s), after what has happened before.
    pub(crate) fn begin(&mut self, tick: u64, time_s: f64, schedule: &Schedule) {
        self.start = (tick, time_s);
        self.stopped.clear();
        let past = schedule.emergency_vehicles.iter().filter(|e| e.from_s < time_s);
        self.came = past.count();
    }
}

/// A stretch of a lane that is in the way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Block {
    pub(super) lane: u16,
    pub(super) from_m: f64,
    pub(super) to_m: f64,
    /// Drivers know of it this far before, m.
    ahead_m: f64,
    /// Barriers, before which drivers stop; a vehicle is its own reason to stop.
    is_closed: bool,
}

/// An emergency vehicle under way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rushing {
    lane: u16,
    target: u16,
    s_m: f64,
}

impl Engine {
    /// Time of the run at this tick, s; negative in the warm-up.
    pub(crate) fn time_s(&self) -> f64 {
        let (tick, time_s) = self.state.plot.start;
        time_s + TICK_S * (self.state.tick as f64 - tick as f64)
    }

    /// Whether anything is in the way in this tick, or an emergency vehicle under way.
    pub(super) fn is_eventful(&self) -> bool {
        !self.blocks.is_empty() || !self.rushing.is_empty()
    }

    /// Brings the plot up to this tick.
    pub(super) fn happen(&mut self) {
        self.blocks.clear();
        self.rushing.clear();
        if self.config.schedule.is_empty() {
            return;
        }
        let config = self.config.clone();
        let schedule = &config.schedule;
        let time_s = self.time_s();
        self.limit_m_s = schedule.limit_m_s(time_s).unwrap_or(f64::INFINITY);
        self.state.plot.stage.update(schedule, time_s, &self.ego);
        let ahead_m = self.config.mandatory_ahead_m;
        for (_, lane, from_m, to_m) in self.state.plot.stage.closures(schedule) {
            self.blocks.push(Block { lane, from_m, to_m, ahead_m, is_closed: true });
        }
        self.state.plot.stopped.resize(schedule.incidents.len(), NOBODY);
        for (k, incident) in schedule.incidents.iter().enumerate() {
            if incident.kind == IncidentKind::StoppedVehicle {
                self.stop_somebody(schedule, k, incident, time_s);
            }
        }
        let due =
            |came: usize| schedule.emergency_vehicles.get(came).filter(|e| e.from_s <= time_s);
        while let Some(vehicle) = due(self.state.plot.came) {
            if !self.send(vehicle) {
                break;
            }
            self.state.plot.came += 1;
        }
        let fleet = &self.state.fleet;
        for i in 0..fleet.len() {
            if fleet.driver[i].class == VehicleClass::Emergency {
                let (lane, target) = (fleet.lane[i], fleet.target[i]);
                self.rushing.push(Rushing { lane, target, s_m: fleet.s_m[i] });
            }
        }
    }

    /// Begins, keeps and ends a vehicle that stands.
    fn stop_somebody(&mut self, schedule: &Schedule, k: usize, incident: &Incident, time_s: f64) {
        let fleet = &mut self.state.fleet;
        let id = self.state.plot.stopped[k];
        let there = fleet.id.iter().position(|&other| other == id);
        if !incident.is_due(time_s) {
            if let Some(i) = there {
                fleet.driver[i].stop_s_m = f64::INFINITY;
            }
            self.state.plot.stopped[k] = NOBODY;
            return;
        }
        let Some(i) = there.or_else(|| self.find_one_to_stop(schedule, k, incident)) else {
            return;
        };
        let fleet = &mut self.state.fleet;
        fleet.driver[i].stop_s_m = incident.s_m;
        self.state.plot.stopped[k] = fleet.id[i];
        let to_m = incident.s_m;
        let from_m = to_m - fleet.driver[i].length_m;
        let lane = incident.lane;
        self.blocks.push(Block { lane, from_m, to_m, ahead_m: SIGHT_M, is_closed: false });
    }

    /// Who stands there already, a new vehicle where nobody has to brake for it, else the next one
    /// that can stop there comfortably.
    fn find_one_to_stop(
        &mut self,
        schedule: &Schedule,
        k: usize,
        incident: &Incident,
    ) -> Option<usize> {
        let (lane, s_m) = (incident.lane, incident.s_m);
        let (from_m, to_m) = incident.stretch_m();
        let fleet = &mut self.state.fleet;
        let stands = |i: &usize| {
            fleet.lane[*i] == lane && fleet.v_m_s[*i] < 0.5 && (fleet.s_m[*i] - s_m).abs() < THERE_M
        };
        if let Some(i) = (0..fleet.len()).find(stands) {
            return Some(i);
        }
        if self.state.tick == 0 {
            fleet.retain(|f, i| {
                let free_m = stopping_gap_m(f.v_m_s[i], 0.0);
                !f.occupies(i, lane) || f.s_m[i] < from_m - free_m || f.rear_m(i) > to_m + 5.0
            });
        }
        let is_free = !(0..fleet.len()).any(|i| {
            let free_m = stopping_gap_m(fleet.v_m_s[i], 0.0);
            fleet.occupies(i, lane)
                && fleet.s_m[i] > from_m - free_m
                && fleet.rear_m(i) < to_m + 5.0
        });
        if is_free && has_room(schedule, k, &self.ego) {
            let id = self.state.next_id;
            self.state.next_id += 1;
            let driver = Driver::of_class(&self.config, id, VehicleClass::Car, std::iter::empty());
            self.state.fleet.insert(s_m, 0.0, lane, id, driver);
            return self.state.fleet.id.iter().position(|&other| other == id);
        }
        let fleet = &self.state.fleet;
        (0..fleet.len()).rev().find(|&i| {
            let (v, b) = (fleet.v_m_s[i], fleet.driver[i].idm.decel_m_s2);
            fleet.lane[i] == lane
                && !fleet.is_changing(i)
                && fleet.driver[i].class != VehicleClass::Emergency
                && fleet.s_m[i] + v + 0.5 * v * v / b < s_m
                && fleet.s_m[i] > s_m - SIGHT_M
        })
    }

    /// Lets an emergency vehicle in at the start of the road, when there is room.
    fn send(&mut self, vehicle: &EmergencyVehicle) -> bool {
        let lanes = self.map.lanes.iter().enumerate();
        let at_start = lanes
            .filter(|(_, l)| l.usage == LaneUse::Through && l.s_start_m < self.map.s_start_m + 1.0);
        let leftmost = at_start.max_by(|a, b| {
            let d = |l: &super::lanes::Lane| l.center_d_m(l.s_start_m);
            d(a.1).total_cmp(&d(b.1))
        });
        let Some(lane) = vehicle.lane.or(leftmost.map(|(k, _)| k as u16)) else { return true };
        let id = self.state.next_id;
        let class = VehicleClass::Emergency;
        let mut driver = Driver::of_class(&self.config, id, class, std::iter::empty());
        driver.idm.desired_speed_m_s = vehicle.speed_m_s;
        let s_m = self.map.s_start_m + driver.length_m;
        let ahead = self.leader_at(lane, self.map.s_start_m);
        let wish_m_s = vehicle.speed_m_s;
        let Some(v_m_s) = entry_speed_m_s(&driver, wish_m_s, wish_m_s, s_m, ahead) else {
            return false;
        };
        self.state.next_id += 1;
        self.state.fleet.insert(s_m, v_m_s, lane, id, driver);
        true
    }

    /// The nearest stretch in the way ahead in a lane, of which driver `i` knows.
    pub(super) fn block_ahead(&self, i: usize, lane: u16) -> Option<&Block> {
        let s_m = self.state.fleet.s_m[i];
        let frac = self.ahead_frac(self.state.fleet.driver[i].lane_change_s);
        // Barriers are announced; a vehicle that stands is seen.
        let ahead_m = |b: &Block| if b.is_closed { b.ahead_m * frac } else { b.ahead_m };
        let known = |b: &&Block| b.lane == lane && s_m < b.to_m && s_m > b.from_m - ahead_m(b);
        let known = self.blocks.iter().filter(known);
        known.min_by(|a, b| a.from_m.total_cmp(&b.from_m))
    }

    /// What a closed lane ahead takes away, m/s², zero or negative: drivers stop before it, unless
    /// they could not any more when it was closed.
    pub(super) fn closure_m_s2(&self, i: usize, lane: u16, margin_m: f64) -> f64 {
        let fleet = &self.state.fleet;
        let (s_m, v, idm) = (fleet.s_m[i], fleet.v_m_s[i], &fleet.driver[i].idm);
        let closed = self.blocks.iter().filter(|b| b.is_closed && b.lane == lane && b.from_m > s_m);
        let Some(from_m) = closed.map(|b| b.from_m).min_by(f64::total_cmp) else { return 0.0 };
        let gap_m = from_m - margin_m - s_m;
        if 0.5 * v * v > LAST_THROUGH_M_S2 * gap_m.max(0.01) && v > 1.0 {
            return 0.0;
        }
        idm.interaction_m_s2(v, gap_m, v)
    }

    /// What a place to stop takes away, m/s².
    pub(super) fn stop_m_s2(&self, i: usize) -> f64 {
        let fleet = &self.state.fleet;
        let (driver, v) = (&fleet.driver[i], fleet.v_m_s[i]);
        if driver.stop_s_m.is_infinite() {
            return 0.0;
        }
        let gap_m = driver.stop_s_m + driver.idm.min_gap_m - fleet.s_m[i];
        driver.idm.interaction_m_s2(v, gap_m, v)
    }

    /// The side that a driver goes to because of what happens, and the way that is left, m.
    pub(super) fn happening_need(&self, i: usize) -> Option<(usize, f64)> {
        let fleet = &self.state.fleet;
        let (lane, s_m) = (fleet.lane[i], fleet.s_m[i]);
        let sides = |side: usize| self.near.sides[i].lanes[side];
        if let Some(block) = self.block_ahead(i, lane) {
            let reach = |side: usize| match sides(side) {
                NO_LANE => f64::NEG_INFINITY,
                k if !self.map.is_open_to(k, fleet.driver[i].exit) => f64::NEG_INFINITY,
                k => self.block_ahead(i, k).map_or(f64::INFINITY, |b| b.from_m),
            };
            let side = if reach(LEFT) >= reach(RIGHT) { LEFT } else { RIGHT };
            if reach(side) > block.from_m {
                return Some((side, (block.from_m - s_m).max(0.0)));
            }
            return None;
        }
        let is_before = |r: &&Rushing| {
            (r.lane == lane || r.target == lane) && s_m > r.s_m && s_m - r.s_m < WAY_M
        };
        let has_to = self.rushing.iter().any(|r| is_before(&r));
        let right = sides(RIGHT);
        let can = right != NO_LANE && self.map.is_open_to(right, fleet.driver[i].exit);
        (has_to && can).then_some((RIGHT, WAY_M))
    }

    /// Whether a driver keeps out of a lane because of what happens there.
    pub(super) fn keeps_out(&self, i: usize, lane: u16) -> bool {
        let s_m = self.state.fleet.s_m[i];
        self.block_ahead(i, lane).is_some()
            || self
                .rushing
                .iter()
                .any(|r| (r.lane == lane || r.target == lane) && s_m > r.s_m && s_m - r.s_m < WAY_M)
    }
}
