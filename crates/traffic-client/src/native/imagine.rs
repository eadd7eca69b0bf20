//! Traffic as somebody in it may think of it: cut out around a place, its drivers not known.

use driver_models::Idm;

use super::driver::Driver;
use super::engine::Engine;
use super::human::Mind;
use super::lanes::NO_LANE;

/// A driver who stands is thought to wish this speed at least, m/s.
const LEAST_WISH_M_S: f64 = 1.0;

impl Engine {
    /// Takes away who is not within this stretch, m.
    pub(super) fn keep_within(&mut self, from_m: f64, to_m: f64) {
        self.state.fleet.retain(|fleet, i| fleet.s_m[i] >= from_m && fleet.rear_m(i) <= to_m);
        // Who is near the ego has other places in the fleet now: all act next.
        self.state.near = None;
    }

    /// Puts the mean of its class in the place of every driver, who wishes the speed that he has
    /// and leaves nowhere. What can be seen stays: where everybody is, lengths, changes under way.
    pub(super) fn forget_drivers(&mut self) {
        let config = &self.config;
        let fleet = &mut self.state.fleet;
        let seen = fleet.v_m_s.iter().zip(&fleet.target);
        let unseen = fleet.driver.iter_mut().zip(&mut fleet.mind);
        for ((driver, mind), (&speed_m_s, &target)) in unseen.zip(seen) {
            let class = config.class(driver.class);
            let changing = target != NO_LANE;
            *driver = Driver {
                idm: Idm::new(
                    speed_m_s.max(LEAST_WISH_M_S),
                    class.headway_s,
                    class.min_gap_m,
                    class.accel_m_s2,
                    class.decel_m_s2,
                    class.max_decel_m_s2,
                ),
                limit_factor: 1.0,
                lane_change_s: if changing { driver.lane_change_s } else { class.lane_change_s },
                power_w_kg: class.power_w_kg,
                politeness_frac: class.politeness_frac,
                exit: NO_LANE,
                leaves_s_m: f64::INFINITY,
                stop_s_m: f64::INFINITY,
                ..*driver
            };
            *mind = Mind::default();
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use tractrix_core::{EgoState, Geometry, Time, TrafficSource};

    use crate::native::{NativeTraffic, TrafficConfig};

    fn traffic() -> (NativeTraffic, EgoState) {
        let road = Arc::new(road::builtin::flat(6000.0));
        let geometry = Geometry { front_m: 4.0, width_m: 2.5, ..Geometry::default() };
        let mut traffic = NativeTraffic::new(road, geometry, TrafficConfig::default()).unwrap();
        let ego = EgoState { s_m: 3000.0, d_m: -1.9, speed_m_s: 12.0, ..EgoState::default() };
        traffic.advance(Time::ZERO, &ego).unwrap();
        (traffic, ego)
    }

    #[test]
    fn what_is_cut_out_goes_on_as_on_the_whole_road_at_first() {
        let (mut whole, ego) = traffic();
        let mut cut = whole.clone();
        cut.keep_within(2400.0, 3600.0);
        assert!(cut.counts().vehicles * 3 < whole.counts().vehicles);
        assert!(!cut.scene().neighbours.is_empty());
        let at = Time::ZERO.plus_nanos(3_000_000_000);
        for n in 1..=30_i64 {
            let now = Time::ZERO.plus_nanos(n * 100_000_000);
            let ego = EgoState { s_m: ego.s_m + 1.2 * n as f64, ..ego };
            assert_eq!(whole.advance(now, &ego).unwrap(), cut.advance(now, &ego).unwrap());
        }
        assert_eq!(cut.scene().time, at);
    }

    #[test]
    fn forgotten_drivers_look_the_same_and_drive_otherwise() {
        let (mut known, ego) = traffic();
        let mut forgotten = known.clone();
        forgotten.forget_drivers();
        assert_eq!(
            known.advance(Time::ZERO, &ego).unwrap(),
            forgotten.advance(Time::ZERO, &ego).unwrap()
        );
        for n in 1..=50_i64 {
            let now = Time::ZERO.plus_nanos(n * 100_000_000);
            known.advance(now, &ego).unwrap();
            forgotten.advance(now, &ego).unwrap();
        }
        assert_ne!(known.fingerprint(), forgotten.fingerprint());
    }
}
