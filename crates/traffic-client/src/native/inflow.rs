//! Where vehicles come from: the first fill of the road, and arrivals at the entries.

use tractrix_core::Scene;

use super::driver::Driver;
use super::engine::{Engine, TICK_S};
use super::fleet::Fleet;
use super::lanes::LaneUse;
use crate::philox::{Draws, Stream};

/// Arrivals that wait for room at one entry, at most.
const QUEUE: u32 = 50;

/// Room between the vehicles of a scene that is taken over and those of our own, m.
const SEAM_M: f64 = 60.0;

/// A vehicle of the first fill.
struct Start {
    s_m: f64,
    v_m_s: f64,
    lane: u16,
    id: u64,
    driver: Driver,
}

impl Engine {
    /// Off-ramps that begin after a station, nearest first.
    fn exits_after(&self, s_m: f64) -> impl Iterator<Item = u16> {
        let exits = self.map.exits.iter().copied();
        exits.filter(move |&k| self.map.lanes[k as usize].s_start_m > s_m)
    }

    fn draw(&self, id: u64, s_m: f64) -> Driver {
        Driver::draw(&self.config, id, self.exits_after(s_m))
    }

    /// Fills the through lanes with the configured density. Spacings vary by a factor; where they
    /// are short, speeds are those of the driver's own headway, so nobody starts in an emergency.
    pub(crate) fn fill(&mut self) {
        let density = self.config.start_density_1_km();
        if density <= 0.0 {
            return;
        }
        let mut starts = Vec::new();
        for (k, lane) in self.map.lanes.iter().enumerate() {
            if lane.usage != LaneUse::Through {
                continue;
            }
            let mut front_m = lane.s_end_m - 1.0;
            let mut ahead: Option<(f64, f64)> = None;
            for position in 0u64.. {
                let id = self.state.next_id;
                let driver = self.draw(id, front_m);
                let draws = Draws::new(self.config.seed, Stream::Fill, position);
                let spacing = (0.3 + 1.4 * draws.uniform(k as u32)) * 1000.0 / density;
                let desired =
                    driver.idm.desired_speed_m_s.min(lane.limit_m_s(front_m) * driver.limit_factor);
                let mut v_m_s = desired;
                if let Some((rear_m, speed_m_s)) = ahead {
                    front_m = rear_m - (spacing - driver.length_m).max(1.5 * driver.idm.min_gap_m);
                    let gap = rear_m - front_m;
                    let own = (gap - driver.idm.min_gap_m) / driver.idm.headway_s;
                    v_m_s = desired.min(own).min(speed_m_s + 0.1 * gap);
                }
                let rear_m = front_m - driver.length_m;
                if rear_m < lane.s_start_m {
                    break;
                }
                ahead = Some((rear_m, v_m_s));
                starts.push(Start { s_m: front_m, v_m_s, lane: k as u16, id, driver });
                self.state.next_id += 1;
            }
        }
        starts.sort_by(|a, b| a.s_m.total_cmp(&b.s_m));
        self.state.fleet = Fleet::default();
        for x in starts {
            self.state.fleet.insert(x.s_m, x.v_m_s, x.lane, x.id, x.driver);
        }
    }

    /// Puts the vehicles of a scene in the place of those on its stretch. Numbers of vehicles that
    /// come later are above all of theirs.
    pub(crate) fn adopt(&mut self, scene: &Scene) {
        let rears = scene.neighbours.iter().map(|n| n.rear_s_m);
        let fronts = scene.neighbours.iter().map(|n| n.front_s_m);
        let from_m = rears.fold(f64::INFINITY, f64::min) - SEAM_M;
        let to_m = fronts.fold(f64::NEG_INFINITY, f64::max) + SEAM_M;
        self.state.fleet.retain(|f, i| f.s_m[i] < from_m || f.rear_m(i) > to_m);
        let first = scene.neighbours.iter().map(|n| n.id + 1).max().unwrap_or(0);
        for id in &mut self.state.fleet.id {
            *id += first;
        }
        self.state.next_id += first;
        for n in &scene.neighbours {
            if usize::from(n.lane) >= self.map.lanes.len() {
                continue;
            }
            let exits = self.exits_after(n.front_s_m);
            let drawn = Driver::of_class(&self.config, n.id, n.class, exits);
            let driver = Driver { length_m: n.length_m(), ..drawn };
            self.state.fleet.insert(n.front_s_m, n.speed_m_s.max(0.0), n.lane, n.id, driver);
            let target = n.target_lane.filter(|&t| usize::from(t) < self.map.lanes.len());
            if let Some(target) = target {
                let i = self.state.fleet.id.iter().position(|&id| id == n.id).unwrap_or(0);
                self.state.fleet.target[i] = target;
            }
        }
    }

    /// Draws this tick's arrivals and lets in whom the traffic has room for.
    pub(crate) fn let_in(&mut self) {
        for k in 0..self.map.lanes.len() {
            let lane = &self.map.lanes[k];
            let probability = match lane.usage {
                LaneUse::Through if lane.s_start_m < self.map.s_start_m + 1.0 => {
                    self.config.spawn_probability
                }
                LaneUse::Entry => self.config.ramp_spawn_probability,
                _ => continue,
            } * (TICK_S / self.config.spawn_interval_s);
            let draws = Draws::new(self.config.seed, Stream::Arrival, self.state.tick);
            if draws.uniform(k as u32) < probability {
                self.state.waiting[k] = (self.state.waiting[k] + 1).min(QUEUE);
            }
            if self.state.waiting[k] > 0 && self.enter(k as u16) {
                self.state.waiting[k] -= 1;
            }
        }
    }

    /// Lets the next vehicle into a lane if nobody has to brake hard for it.
    fn enter(&mut self, k: u16) -> bool {
        let lane = &self.map.lanes[k as usize];
        let id = self.state.next_id;
        let driver = self.draw(id, lane.s_start_m);
        let s_m = lane.s_start_m + driver.length_m;
        let desired = driver.idm.desired_speed_m_s.min(lane.limit_m_s(s_m) * driver.limit_factor);
        let fleet = &self.state.fleet;
        let from = fleet.s_m.partition_point(|&s| s < lane.s_start_m);
        let mut ahead = (from..fleet.len())
            .find(|&i| fleet.occupies(i, k))
            .map(|i| (fleet.rear_m(i), fleet.v_m_s[i]));
        if let Some(span) = self.ego.in_lane(k)
            && span.front_m >= lane.s_start_m
            && ahead.is_none_or(|(rear_m, _)| span.rear_m < rear_m)
        {
            ahead = Some((span.rear_m, self.ego.speed_m_s));
        }
        let queued = match lane.usage {
            LaneUse::Through => self.before_m_s(k),
            _ => None,
        };
        let wished = queued.map_or(desired, |v| v.min(desired));
        // Out of a queue nobody comes closer than they would follow: otherwise those who come in
        // would brake, and the head of the queue would wander onto the road. The nearer the speed
        // is to the desired one, the less of a queue it is, and comfortable braking is right.
        let least_m_s2 = |v: f64| {
            let braking = -driver.idm.decel_m_s2;
            let part = queued.map_or(1.0, |_| v / desired.max(0.1));
            let part = part * part * part * part;
            part * braking - (1.0 - part) * driver.idm.free_m_s2(v, desired)
        };
        let comfortable = |v: f64| match ahead {
            None => true,
            Some((rear_m, speed_m_s)) => {
                let gap = rear_m - s_m;
                gap > driver.idm.min_gap_m
                    && driver.idm.interaction_m_s2(v, gap, v - speed_m_s) > least_m_s2(v)
            }
        };
        let matched = ahead.map_or(wished, |(_, v)| v.min(wished));
        let Some(v_m_s) = [wished, matched].into_iter().find(|&v| comfortable(v)) else {
            return false;
        };
        self.state.fleet.insert(s_m, v_m_s, k, id, driver);
        self.state.next_id += 1;
        true
    }
}
