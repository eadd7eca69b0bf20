//! Vehicles that are far from the ego drive on at the speed that they have.
//!
//! Platoons stay platoons: who follows somebody has their speed. Nobody comes closer to who is ahead
//! than the gap `s0 + v T` of the own headway (Newell, Transp. Res. B 36 (2002) 195), and a lane
//! change that is under way is ended. Nobody begins one, speeds do not change: what holds for long
//! is the mix of speeds and gaps that they fell asleep with, and they have the way to the window to
//! find their places again.

use std::ops::Range;

use super::engine::{Engine, Moved, is_out};
use super::lanes::NO_LANE;
use super::window::Stride;

/// Rear, m, and speed, m/s, of the last in a lane so far.
type Last = Option<(f64, f64)>;
/// Lanes that are told apart; further ones have no order among those who sleep.
const LANES: usize = 8;

impl Engine {
    /// Moves all who are not `awake` for the time between two looks. Those that are awake have been
    /// moved.
    pub(super) fn move_asleep(&mut self, awake: Range<usize>) -> Moved {
        let all = self.state.fleet.len();
        if awake == (0..all) {
            return Moved::default();
        }
        let mut last = [None; LANES];
        let moved = self.drift(awake.end..all, &mut last);
        // Who sleeps behind follows the last of those who are awake.
        last = [None; LANES];
        let fleet = &self.state.fleet;
        for i in awake.clone().take(4 * LANES) {
            for lane in [fleet.lane[i], fleet.target[i]] {
                if let Some(last) = last.get_mut(usize::from(lane)).filter(|last| last.is_none()) {
                    *last = Some((fleet.rear_m(i), fleet.v_m_s[i]));
                }
            }
        }
        moved.and(self.drift(0..awake.start, &mut last))
    }

    fn drift(&mut self, asleep: Range<usize>, last: &mut [Last; LANES]) -> Moved {
        let (map, fleet) = (&*self.map, &mut self.state.fleet);
        let step_s = Stride::FAR.step_s;
        let mut moved = Moved::default();
        let r = asleep;
        let motion = fleet.s_m[r.clone()].iter_mut().zip(&fleet.v_m_s[r.clone()]);
        let change = fleet.lane[r.clone()].iter_mut().zip(&mut fleet.target[r.clone()]);
        let inside = fleet.a_m_s2[r.clone()].iter_mut().zip(&mut fleet.clock_s[r.clone()]);
        let each = motion.zip(change).zip(inside.zip(&fleet.driver[r]));
        for (((s_m, &v_m_s), (lane, target)), ((a_m_s2, clock_s), driver)) in each.rev() {
            let is_changing = *target != NO_LANE;
            let free_m = *s_m + v_m_s * step_s;
            let behind_last = |to_m: f64, last: &[Last; LANES], lane: u16| {
                let Some(&Some((rear_m, leader_m_s))) = last.get(usize::from(lane)) else {
                    return to_m;
                };
                let gap_m = driver.idm.min_gap_m + driver.idm.headway_s * leader_m_s;
                if rear_m - gap_m < to_m { rear_m - gap_m } else { to_m }
            };
            let mut to_m = behind_last(free_m, last, *lane);
            if is_changing {
                to_m = behind_last(to_m, last, *target);
            }
            let to_m = if to_m > *s_m { to_m } else { *s_m };
            moved.driven_m += to_m - *s_m;
            let own = Some((to_m - driver.length_m, v_m_s));
            if let Some(last) = last.get_mut(usize::from(*lane)) {
                *last = own;
            }
            if let Some(last) = last.get_mut(usize::from(*target)) {
                *last = own;
            }
            (*s_m, *a_m_s2) = (to_m, 0.0);
            *clock_s += step_s;
            if !is_changing {
                *clock_s = clock_s.min(0.0);
            } else if *clock_s >= driver.lane_change_s {
                *lane = *target;
                (*target, *clock_s) = (NO_LANE, 0.0);
            }
            moved.somebody_leaves |= is_out(map, to_m, *lane, driver);
        }
        moved
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use driver_models::Idm;

    use super::super::config::TrafficConfig;
    use super::super::driver::Driver;
    use super::super::lanes::LaneMap;
    use super::super::window::WindowConfig;
    use super::*;

    #[test]
    fn who_sleeps_keeps_the_speed_and_stays_behind_whoever_is_ahead() {
        let window = WindowConfig { awake_m: Some(500.0), ..WindowConfig::default() };
        let config = TrafficConfig {
            window: Some(window),
            spawn_probability: 0.0,
            ..TrafficConfig::default()
        };
        let map = LaneMap::straight(2, 6_000.0, 3.75, 30.0);
        let mut engine = Engine::new(Arc::new(config), Arc::new(map));
        engine.ego_s_m = Some(5_000.0);
        let mut driver = Driver::draw(&engine.config, 0.0, 0, std::iter::empty());
        driver.idm = Idm::new(30.0, 1.5, 2.0, 1.0, 2.0, 8.0);
        driver.length_m = 5.0;
        // A slow one, a fast one that comes up behind it, another in the other lane, and one that
        // moves over in front of the slow one.
        let fleet = &mut engine.state.fleet;
        for (id, (s_m, v_m_s, lane)) in
            [(900.0, 20.0, 1), (1_000.0, 20.0, 0), (1_100.0, 10.0, 0), (1_400.0, 10.0, 1)]
                .into_iter()
                .enumerate()
        {
            fleet.insert(s_m, v_m_s, lane, id as u64, driver);
        }
        (fleet.target[3], fleet.clock_s[3]) = (0, 1.0);
        // Others around the ego, slow enough to stay there.
        let mut slow = driver;
        slow.idm = Idm::new(2.0, 1.5, 2.0, 1.0, 2.0, 8.0);
        for k in 0..20_u32 {
            fleet.insert(4_510.0 + 40.0 * f64::from(k), 2.0, 0, 10 + u64::from(k), slow);
        }
        for _ in 0..100 {
            engine.decide();
            engine.commit();
        }
        let fleet = &engine.state.fleet;
        let of = |id: u64| (0..fleet.len()).find(|&i| fleet.id[i] == id).unwrap();
        let way_m = |id: u64, from_m: f64| fleet.s_m[of(id)] - from_m;
        assert!((way_m(2, 1_100.0) - 100.0).abs() < 1e-9, "10 m/s for 10 s");
        assert!((way_m(0, 900.0) - 200.0).abs() < 1e-9, "nobody is in its lane");
        assert!((fleet.rear_m(of(2)) - fleet.s_m[of(1)] - 17.0).abs() < 1e-9, "s0 + v T");
        assert_eq!(fleet.v_m_s[of(1)], 20.0, "as fast again once nobody is ahead");
        assert_eq!((fleet.lane[of(3)], fleet.target[of(3)]), (0, NO_LANE));
        assert_eq!(engine.awake().start, 4);
    }
}
