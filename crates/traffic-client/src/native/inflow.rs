//! Where vehicles come from: arrivals at the entries.

use tractrix_core::VehicleClass;

use super::driver::Driver;
use super::engine::{Engine, TICK_S};
use super::equilibrium::{easy_speed_m_s, is_critical_speed};
use super::lanes::LaneUse;
use crate::philox::{Draws, Stream};

impl Engine {
    /// Off-ramps that begin after a station, nearest first.
    pub(crate) fn exits_after(&self, s_m: f64) -> impl Iterator<Item = u16> {
        let exits = self.map.exits.iter().copied();
        exits.filter(move |&k| self.map.lanes[k as usize].s_start_m > s_m)
    }

    pub(super) fn draw(&self, id: u64, s_m: f64, lane: u16) -> Driver {
        let share = self.config.schedule.at(self.time_s(), None, |step| step.truck_share_frac);
        let share = share.unwrap_or(self.config.truck_share_frac);
        let share = self.truck_share_of_lane(share, s_m, lane);
        Driver::draw(&self.config, share, id, self.exits_after(s_m))
    }

    /// Share of trucks in a lane of which all lanes together have `share`: those that keep out of the
    /// left lane are in the others.
    fn truck_share_of_lane(&self, share: f64, s_m: f64, lane: u16) -> f64 {
        let map = &self.map;
        let through = || {
            let is_here = |&k: &u16| {
                let l = &map.lanes[k as usize];
                l.usage == LaneUse::Through && s_m >= l.s_start_m && s_m <= l.s_end_m
            };
            (0..map.lanes.len() as u16).filter(is_here)
        };
        if self.is_closed_to(lane, VehicleClass::Truck) {
            return 0.0;
        }
        let open = through().filter(|&k| !self.is_closed_to(k, VehicleClass::Truck)).count();
        let is_through = through().any(|k| k == lane);
        if is_through { (share * through().count() as f64 / open as f64).min(1.0) } else { share }
    }

    /// Draws the arrivals of the last `ticks` and lets in whom the traffic has room for.
    pub(crate) fn let_in(&mut self, ticks: u64) {
        for k in 0..self.map.lanes.len() {
            let Some(probability) = self.arrival_probability(k as u16) else { continue };
            for ago in (0..ticks).rev() {
                let tick = self.state.tick.saturating_sub(ago);
                let draws = Draws::new(self.config.seed, Stream::Arrival, tick);
                if draws.uniform(k as u32) < probability {
                    self.state.arrived += 1;
                    self.state.waiting[k] = self.state.waiting[k].saturating_add(1);
                }
            }
            if self.state.waiting[k] > 0 && self.enter(k as u16) {
                self.state.waiting[k] -= 1;
            }
        }
    }

    /// Probability that somebody comes to an entry in this tick; `None`: the lane is none.
    fn arrival_probability(&self, k: u16) -> Option<f64> {
        let lane = &self.map.lanes[k as usize];
        let (config, time_s) = (&self.config, self.time_s());
        let (probability, changed) = match lane.usage {
            LaneUse::Through if lane.s_start_m < self.map.s_start_m + 1.0 => {
                let flow = config.schedule.at(time_s, Some(k), |step| step.flow_veh_h_lane);
                (config.spawn_probability, flow)
            }
            LaneUse::Entry => {
                let flow = config.schedule.at(time_s, Some(k), |step| step.ramp_flow_veh_h);
                (config.ramp_spawn_probability, flow)
            }
            _ => return None,
        };
        let usual = probability * (TICK_S / config.spawn_interval_s);
        Some(changed.map_or(usual, |flow_veh_h| flow_veh_h * TICK_S / 3600.0))
    }

    /// Lets the next vehicle into a lane if there is room for it.
    fn enter(&mut self, k: u16) -> bool {
        let lane = &self.map.lanes[k as usize];
        let id = self.state.next_id;
        let driver = self.draw(id, lane.s_start_m, k);
        let s_m = lane.s_start_m + driver.length_m;
        let limit_m_s = lane.limit_m_s(s_m).min(self.limit_m_s);
        let desired = driver.idm.desired_speed_m_s.min(limit_m_s * driver.limit_factor);
        let ahead = self.leader_at(k, lane.s_start_m);
        let queued = match lane.usage {
            LaneUse::Through => self.before_m_s(k),
            _ => None,
        };
        let wished = queued.map_or(desired, |v| v.min(desired));
        let Some(v_m_s) = entry_speed_m_s(&driver, wished, desired, s_m, ahead) else {
            return false;
        };
        self.state.fleet.insert(s_m, v_m_s, k, id, driver);
        self.state.next_id += 1;
        true
    }

    /// Rear (station, m) and speed (m/s) of whoever is first in a lane from a station on.
    pub(super) fn leader_at(&self, lane: u16, s_m: f64) -> Option<(f64, f64)> {
        let fleet = &self.state.fleet;
        let from = fleet.s_m.partition_point(|&s| s < s_m);
        let first = (from..fleet.len()).find(|&i| fleet.occupies(i, lane));
        let ahead = first.map(|i| (fleet.rear_m(i), fleet.v_m_s[i]));
        let ego = self.ego.in_lane(lane).filter(|span| span.front_m >= s_m);
        let ego = ego.filter(|span| ahead.is_none_or(|(rear_m, _)| span.rear_m < rear_m));
        ego.map_or(ahead, |span| Some((span.rear_m, self.ego.speed_m_s)))
    }
}

/// Speed at which a driver comes in behind a leader (station of its rear, m, and speed, m/s);
/// `None`: they wait for room before the road.
///
/// They come in as they would have followed, at the speed that goes with the gap: nobody brakes for
/// having come in, so that no queue forms on the road that the road does not make itself. Where that
/// speed would be below the one at which most get through, and below the leader's, they let the gap
/// grow: out of a queue before the road comes as much as a lane carries.
pub(super) fn entry_speed_m_s(
    driver: &Driver,
    wished_m_s: f64,
    desired_m_s: f64,
    s_m: f64,
    ahead: Option<(f64, f64)>,
) -> Option<f64> {
    let Some((rear_m, leader_m_s)) = ahead else { return Some(wished_m_s) };
    let (idm, gap_m) = (&driver.idm, rear_m - s_m);
    if gap_m <= idm.min_gap_m {
        return None;
    }
    let easy_m_s = easy_speed_m_s(idm, desired_m_s, gap_m, leader_m_s).min(wished_m_s);
    let least_m_s = wished_m_s.min(leader_m_s);
    if easy_m_s >= least_m_s {
        return Some(easy_m_s);
    }
    is_critical_speed(idm, desired_m_s, driver.length_m, easy_m_s).then_some(easy_m_s)
}
