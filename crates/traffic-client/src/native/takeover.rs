//! Vehicles of another source in the place of our own, and room for the ego.
//!
//! Within the stretch that the other source showed, its vehicles are all that there is; ours go on
//! beyond it. Whoever of ours would have to brake hard for the ego, or make it brake hard, is taken
//! away: a start or a takeover never asks for more than [`ROOM_DECEL_M_S2`] after
//! [`ROOM_REACTION_S`] of anybody, the stopping distances of both taken to the end (as in RSS:
//! Shalev-Shwartz, Shammah, Shashua, arXiv:1708.06374, Eq. 2).

use tractrix_core::{Neighbour, Scene};

use super::driver::Driver;
use super::engine::Engine;
use super::lanes::{LaneUse, NO_LANE};
use super::publish::progress_of;

/// Room between the vehicles of a scene that is taken over and those of our own, m.
const SEAM_M: f64 = 60.0;
/// Braking that a start asks of who is behind, m/s²: what a loaded truck has on a wet road.
const ROOM_DECEL_M_S2: f64 = 3.0;
/// Hardest braking of who is ahead, m/s².
const AHEAD_DECEL_M_S2: f64 = 8.0;
/// Time before who is behind brakes, s.
const ROOM_REACTION_S: f64 = 1.0;
/// A vehicle this far beside the middle of its lane is between two lanes, m.
const BESIDE_M: f64 = 0.3;

/// Gap that keeps `behind` from touching `ahead` if that one brakes as hard as it can, m.
pub(crate) fn stopping_gap_m(behind_m_s: f64, ahead_m_s: f64) -> f64 {
    let (v, w) = (behind_m_s.max(0.0), ahead_m_s.max(0.0));
    let way = v * ROOM_REACTION_S + 0.5 * v * v / ROOM_DECEL_M_S2 - 0.5 * w * w / AHEAD_DECEL_M_S2;
    way.max(0.0)
}

impl Engine {
    /// Takes those of our vehicles away that would touch the ego or make anybody brake hard;
    /// vehicles numbered below `foreign` are another source's and stay.
    pub(crate) fn clear_around_ego(&mut self, foreign: u64) {
        let least_m = self.config.ego_clearance_m;
        let (ego, ego_m_s) = (self.ego.clone(), self.ego.speed_m_s);
        self.state.fleet.retain(|f, i| {
            let v_m_s = f.v_m_s[i];
            f.id[i] < foreign
                || !ego.spans().iter().any(|span| {
                    f.occupies(i, span.lane)
                        && f.s_m[i] > span.rear_m - least_m.max(stopping_gap_m(v_m_s, ego_m_s))
                        && f.rear_m(i) < span.front_m + least_m.max(stopping_gap_m(ego_m_s, v_m_s))
                })
        });
    }

    /// Puts the vehicles of a scene in the place of those on its stretch, which reaches as far
    /// around `ego_s_m` as scenes do. Numbers of our vehicles are above all of theirs: returns the
    /// first of ours.
    pub(crate) fn adopt(&mut self, scene: &Scene, ego_s_m: f64) -> u64 {
        let radius_m = self.config.scene_radius_m;
        let rears = scene.neighbours.iter().map(|n| n.rear_s_m);
        let fronts = scene.neighbours.iter().map(|n| n.front_s_m);
        let from_m = rears.fold(ego_s_m - radius_m, f64::min) - SEAM_M;
        let to_m = fronts.fold(ego_s_m + radius_m, f64::max) + SEAM_M;
        self.state.fleet.retain(|f, i| f.s_m[i] < from_m || f.rear_m(i) > to_m);
        let first = scene.neighbours.iter().map(|n| n.id + 1).max().unwrap_or(0);
        for id in &mut self.state.fleet.id {
            *id += first;
        }
        self.state.next_id += first;
        for n in &scene.neighbours {
            self.adopt_one(n);
        }
        first
    }

    /// One vehicle of a scene, where it is, also across the lanes.
    fn adopt_one(&mut self, n: &Neighbour) {
        let Some(lane) = self.map.lanes.get(usize::from(n.lane)) else { return };
        let leaves = lane.usage == LaneUse::Exit;
        let drawn = Driver::of_class(&self.config, n.id, n.class, self.exits_after(n.front_s_m));
        let exit = if leaves { n.lane } else { drawn.exit };
        let driver = Driver { length_m: n.length_m(), exit, ..drawn };
        let (lane, target, clock_s) = match self.between(n) {
            Some((from, to, part)) => (from, to, progress_of(part) * driver.lane_change_s),
            None => (n.lane, NO_LANE, 0.0),
        };
        let fleet = &mut self.state.fleet;
        fleet.insert(n.front_s_m, n.speed_m_s.max(0.0), lane, n.id, driver);
        if let Some(i) = fleet.id.iter().position(|&id| id == n.id) {
            (fleet.target[i], fleet.clock_s[i]) = (target, clock_s);
        }
    }

    /// The lane that a vehicle leaves, the one that it comes into, and the part of the way that it
    /// has done; `None` if it keeps its lane.
    fn between(&self, n: &Neighbour) -> Option<(u16, u16, f64)> {
        let middle_m = 0.5 * (n.front_s_m + n.rear_s_m);
        let center =
            |lane: u16| self.map.lanes.get(usize::from(lane)).map(|l| l.center_d_m(middle_m));
        let off_m = n.d_m - center(n.lane)?;
        let (left, right) = self.map.beside(n.lane, middle_m);
        let beside = if off_m > 0.0 { left } else { right };
        let announced = n.target_lane.filter(|&t| t == left || t == right);
        let other = announced.unwrap_or(beside);
        if other == NO_LANE || (announced.is_none() && off_m.abs() < BESIDE_M) {
            return None;
        }
        let way_m = center(other)? - center(n.lane)?;
        let part = (off_m / way_m).clamp(0.0, 1.0);
        // Without a word of where it goes, one that moves towards the middle of its lane comes in.
        let comes_in = announced.is_none() && n.lateral_speed_m_s * off_m <= 0.0;
        Some(if comes_in { (other, n.lane, 1.0 - part) } else { (n.lane, other, part) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_room_is_what_both_need_to_stop() {
        // 20 m/s behind a standing vehicle: 20 m of reaction and 400 / 6 m of braking.
        assert!((stopping_gap_m(20.0, 0.0) - (20.0 + 400.0 / 6.0)).abs() < 1e-9);
        assert_eq!(stopping_gap_m(0.0, 5.0), 0.0);
        assert!(stopping_gap_m(20.0, 20.0) > 20.0 && stopping_gap_m(20.0, 20.0) < 70.0);
    }
}
