//! How fast the traffic before the start and beyond the end of the road is, which is not simulated.
//!
//! Both speeds go from lane to lane and in time around a mean: `v = mean + sigma b`, where b is a
//! draw with mean 0 and variance 1 per lane and period, with straight lines in between. Beyond the
//! end a slow one is a queue that reaches back; before the start it is a queue whose head the
//! stretch begins at, so that vehicles come in slowly and accelerate (Treiber & Kesting 2013,
//! ch. 8: upstream and downstream boundary). Measured traffic brings its own ([`super::Boundary`]).

use super::engine::{Engine, TICK_S};
use crate::philox::{Draws, Stream};

impl Engine {
    /// The speed at which traffic moves beyond the end of the road at this tick, per lane.
    pub(super) fn look_beyond(&mut self) {
        if let Some(boundary) = &self.boundary {
            self.beyond_m_s.clear();
            self.beyond_m_s.extend_from_slice(boundary.beyond_m_s(self.state.tick));
            return;
        }
        let Some(mean_m_s) = self.config.outflow_speed_m_s else { return };
        let sigma_m_s = self.config.outflow_sigma_m_s;
        self.beyond_m_s.clear();
        for lane in 0..self.map.lanes.len() as u16 {
            let speed_m_s = self.around(mean_m_s, sigma_m_s, Stream::Outflow, lane);
            self.beyond_m_s.push(speed_m_s);
        }
    }

    /// The speed at which traffic moves before the start of the road at this tick, m/s; `None`:
    /// as its drivers wish.
    pub(super) fn before_m_s(&self, lane: u16) -> Option<f64> {
        let schedule = &self.config.schedule;
        if let Some(v) = schedule.at(self.time_s(), Some(lane), |step| step.inflow_speed_m_s) {
            return Some(v.max(1.0));
        }
        let mean_m_s = self.config.inflow_speed_m_s?;
        Some(self.around(mean_m_s, self.config.inflow_sigma_m_s, Stream::Inflow, lane).max(1.0))
    }

    fn around(&self, mean_m_s: f64, sigma_m_s: f64, stream: Stream, lane: u16) -> f64 {
        let period = ((self.config.outflow_period_s / TICK_S) as u64).max(1);
        let (k, rest) = (self.state.tick / period, self.state.tick % period);
        let f = rest as f64 / period as f64;
        let seed = self.config.seed;
        let draw = |k| mean_m_s + sigma_m_s * Draws::new(seed, stream, k).bell(u32::from(lane));
        let (from, to) = (draw(k), draw(k + 1));
        (from + f * (to - from)).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use road::builtin;
    use tractrix_core::{EgoState, Geometry, Time, TrafficSource};

    use crate::native::{NativeTraffic, TrafficConfig};

    #[test]
    fn who_comes_out_of_a_queue_is_slow_at_the_start_and_as_many_come_as_are_asked_for() {
        // Once, those who came in behind slow ones were let in closer than they follow, braked, and
        // the queue's head stood on the road: 2 m/s at the start, two thirds of the flow.
        let mut config = TrafficConfig {
            spawn_probability: 0.045,
            initial_density_1_km: Some(33.0),
            max_speed_m_s: 28.0,
            inflow_speed_m_s: Some(10.0),
            inflow_sigma_m_s: 0.5,
            warm_up_s: 150.0,
            sees_ego: false,
            scene_radius_m: 1e5,
            truck_share_frac: 0.0,
            van_share_frac: 0.0,
            ..TrafficConfig::default()
        };
        (config.car.accel_m_s2, config.car.headway_s) = (0.4, 1.0);
        let road = Arc::new(builtin::flat(700.0));
        let mut traffic = NativeTraffic::new(road, Geometry::default(), config).unwrap();
        let entered = traffic.counts().entered;
        let (mut first, mut last) = ((0.0, 0.0), (0.0, 0.0));
        for k in 0..=3000 {
            let scene = traffic.advance(Time(k * 100_000_000), &EgoState::default()).unwrap();
            for n in &scene.neighbours {
                let at: &mut (f64, f64) = match n.front_s_m {
                    s if s < 60.0 => &mut first,
                    s if s > 640.0 => &mut last,
                    _ => continue,
                };
                *at = (at.0 + n.speed_m_s, at.1 + 1.0);
            }
        }
        let (first, last) = (first.0 / first.1, last.0 / last.1);
        assert!((first - 10.0).abs() < 1.0 && last > 16.0, "{first} {last}");
        // 0.045 per lane and 0.1 s over 300 s and two lanes.
        let came = (traffic.counts().entered - entered) as f64;
        assert!((came / 270.0 - 1.0).abs() < 0.1, "{came}");
    }
}
