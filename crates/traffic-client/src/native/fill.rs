//! The first fill of the road: vehicles at the configured density, some of them in a queue.
//!
//! Density and flow of a stretch give the mean speed of its vehicles. If that is less than at its
//! ends, there is a wave of stop-and-go between them (vehicles that stand among others that move). It
//! does not come of itself within half a minute, so the stretch begins with it.

use super::driver::Driver;
use super::engine::Engine;
use super::fleet::Fleet;
use super::lanes::{Lane, LaneUse};
use crate::philox::{Draws, Stream};

/// Gap to the next one that nobody begins closer than, over his standstill gap.
const LEAST_GAP_FRAC: f64 = 1.5;
/// A queue takes up no more than this part of the road.
const LONGEST_FRAC: f64 = 0.9;

/// A vehicle of the first fill.
struct Start {
    s_m: f64,
    v_m_s: f64,
    lane: u16,
    id: u64,
    driver: Driver,
}

/// The queue that a lane begins with.
struct Queue {
    head_m: f64,
    vehicles: f64,
    /// Density before and behind it, vehicles per km.
    moving_1_km: f64,
}

impl Engine {
    /// The queue of a lane; it lies anywhere on the road, in all lanes alike.
    fn queue(&self, lane: &Lane, density_1_km: f64) -> Option<Queue> {
        let (config, standing_frac) = (&self.config, self.config.initial_standing_frac);
        if standing_frac <= 0.0 {
            return None;
        }
        let road_m = lane.s_end_m - lane.s_start_m;
        let vehicles = 0.001 * density_1_km * road_m;
        let each_m = config.car.length_m + LEAST_GAP_FRAC * config.car.min_gap_m;
        let queue_m = (standing_frac * vehicles * each_m).min(LONGEST_FRAC * road_m);
        let place_frac = Draws::new(config.seed, Stream::Fill, u64::MAX).uniform(0);
        Some(Queue {
            head_m: lane.s_start_m + queue_m + place_frac * (road_m - queue_m),
            vehicles: standing_frac * vehicles,
            moving_1_km: 1000.0 * (1.0 - standing_frac) * vehicles / (road_m - queue_m),
        })
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
            let queue = self.queue(lane, density);
            let moving_1_km = queue.as_ref().map_or(density, |q| q.moving_1_km);
            let mut front_m = lane.s_end_m - 1.0;
            let mut ahead: Option<(f64, f64)> = None;
            let mut standing = 0.0;
            for position in 0u64.. {
                let id = self.state.next_id;
                let driver = self.draw(id, front_m, k as u16);
                let stands =
                    queue.as_ref().is_some_and(|q| front_m < q.head_m && standing < q.vehicles);
                let draws = Draws::new(self.config.seed, Stream::Fill, position);
                let spacing = if stands {
                    0.0
                } else {
                    (0.3 + 1.4 * draws.uniform(k as u32)) * 1000.0 / moving_1_km
                };
                let desired =
                    driver.idm.desired_speed_m_s.min(lane.limit_m_s(front_m) * driver.limit_factor);
                let mut v_m_s = desired;
                if let Some((rear_m, speed_m_s)) = ahead {
                    let least_m = LEAST_GAP_FRAC * driver.idm.min_gap_m;
                    front_m = rear_m - (spacing - driver.length_m).max(least_m);
                    let gap = rear_m - front_m;
                    let own = (gap - driver.idm.min_gap_m) / driver.idm.headway_s;
                    v_m_s = desired.min(own).min(speed_m_s + 0.1 * gap);
                }
                if stands {
                    (v_m_s, standing) = (0.0, standing + 1.0);
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
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::super::config::TrafficConfig;
    use super::super::lanes::LaneMap;
    use super::*;

    fn filled(initial_standing_frac: f64, seed: u64) -> Fleet {
        let config = TrafficConfig {
            seed,
            initial_density_1_km: Some(50.0),
            initial_standing_frac,
            max_speed_m_s: 27.0,
            truck_share_frac: 0.0,
            ..TrafficConfig::default()
        };
        let map = LaneMap::straight(2, 1000.0, 3.75, 30.0);
        let mut engine = Engine::new(Arc::new(config), Arc::new(map));
        engine.fill();
        engine.state.fleet
    }

    /// Stations of the first and last that stand in a lane, m, and how many these are.
    fn queue(fleet: &Fleet, lane: u16) -> (f64, f64, usize) {
        let stands = |&i: &usize| fleet.lane[i] == lane && fleet.v_m_s[i] == 0.0;
        let at_m: Vec<f64> = (0..fleet.len()).filter(stands).map(|i| fleet.s_m[i]).collect();
        (at_m[0], at_m[at_m.len() - 1], at_m.len())
    }

    #[test]
    fn a_road_begins_with_a_queue_across_its_lanes_and_as_many_vehicles() {
        let (even, waved) = (filled(0.0, 1), filled(0.3, 1));
        assert!(even.v_m_s.iter().all(|&v| v > 0.0));
        assert!(even.len().abs_diff(waved.len()) < 8, "{} {}", even.len(), waved.len());
        for lane in [0, 1] {
            let (tail_m, head_m, count) = queue(&waved, lane);
            assert_eq!(count, 15, "0.3 of 50");
            assert!((90.0..150.0).contains(&(head_m - tail_m)), "{tail_m} to {head_m}");
        }
        let (left, right) = (queue(&waved, 1), queue(&waved, 0));
        assert!((left.1 - right.1).abs() < 40.0, "{left:?} {right:?}");
        let heads: Vec<f64> = (1..9).map(|seed| queue(&filled(0.3, seed), 0).1).collect();
        let (low, high) = (f64::min, f64::max);
        let span_m = heads.iter().copied().fold(0.0, high) - heads.iter().copied().fold(1e3, low);
        assert!(span_m > 300.0, "{heads:?}");
    }
}
