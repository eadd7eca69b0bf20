//! Measured traffic at the rim of a stretch: who is on it at the start, who comes when, who leaves
//! where, and how fast the traffic beyond its end is.
//!
//! This is how microscopic models are validated (Treiber & Kesting 2013, ch. 16): the demand is the
//! measured one, what the drivers do with it between start and end is the model's. Lanes are those
//! of the road; stations are of front bumpers.

use std::sync::Arc;

use driver_models::Idm;
use road::Road;
use tractrix_core::{EgoState, Scene, Time, TrafficSource, VehicleClass};

use super::accelerations::BEYOND_M;
use super::driver::Driver;
use super::engine::{Engine, TICK_S};
use super::fleet::Fleet;
use crate::TrafficError;
use crate::replay::{Recording, ReplayConfig, ReplayTraffic};

/// A vehicle that is last seen this far before the end of the road left it sideways, m.
const SIDEWAYS_M: f64 = 30.0;
/// Who is met farther behind another one than this many times his own gap does not follow.
const FOLLOWS_FRAC: f64 = 3.0;
/// No gap is shorter than this part of the own one; recordings have some that are negative.
const LEAST_FRAC: f64 = 0.05;

/// A vehicle that comes, or is there at the start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Arrival {
    tick: u64,
    id: u64,
    class: VehicleClass,
    length_m: f64,
    s_m: f64,
    speed_m_s: f64,
    lane: u16,
    /// Station at which it leaves the road sideways, m; infinite: at the end.
    leaves_s_m: f64,
}

/// Start, arrivals, departures and the speed beyond the end, from a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Boundary {
    /// In order of their tick; tick 0 is the start.
    arrivals: Vec<Arrival>,
    /// Speed beyond the end by tick and lane, m/s; infinite where nobody was seen yet.
    beyond_m_s: Vec<Vec<f64>>,
}

impl Boundary {
    /// What a recording on a road says about the rim of it.
    ///
    /// # Errors
    /// [`TrafficError`] if the recording does not lie on the road.
    pub fn of(road: &Arc<Road>, recording: &Recording) -> Result<Self, TrafficError> {
        let config = ReplayConfig { scene_radius_m: f64::INFINITY, ..ReplayConfig::default() };
        let mut replay = ReplayTraffic::new(Arc::clone(road), recording, config)?;
        let ego = EgoState { s_m: 0.5 * road.length_m(), ..EgoState::default() };
        let (lanes, end_m) = (road.lanes().len(), road.length_m());
        let mut arrivals: Vec<Arrival> = Vec::new();
        let mut last_seen: Vec<(u64, f64)> = Vec::new();
        let mut beyond_m_s: Vec<Vec<f64>> = Vec::new();
        let mut held = vec![f64::INFINITY; lanes];
        let ticks = (recording.duration_s() / TICK_S) as u64;
        for tick in 0..ticks.saturating_sub(1) {
            let now = Time::from_seconds(tick as f64 * TICK_S);
            let scene: &Scene = replay.advance(now, &ego)?;
            let mut near_end = vec![(0.0, 0.0); lanes];
            for n in &scene.neighbours {
                match arrivals.iter().position(|a| a.id == n.id) {
                    Some(k) => last_seen[k] = (tick, n.front_s_m),
                    None => {
                        arrivals.push(Arrival {
                            tick,
                            id: n.id,
                            class: n.class,
                            length_m: n.length_m(),
                            s_m: n.front_s_m,
                            speed_m_s: n.speed_m_s.max(0.0),
                            lane: n.lane,
                            leaves_s_m: f64::INFINITY,
                        });
                        last_seen.push((tick, n.front_s_m));
                    }
                }
                if n.front_s_m > end_m - BEYOND_M
                    && let Some((sum, count)) = near_end.get_mut(usize::from(n.lane))
                {
                    (*sum, *count) = (*sum + n.speed_m_s, *count + 1.0);
                }
            }
            for (held, (sum, count)) in held.iter_mut().zip(near_end) {
                if count > 0.0 {
                    *held = sum / count;
                }
            }
            beyond_m_s.push(held.clone());
        }
        let last_tick = ticks.saturating_sub(2);
        for (arrival, (tick, s_m)) in arrivals.iter_mut().zip(last_seen) {
            if tick < last_tick && s_m < end_m - SIDEWAYS_M {
                arrival.leaves_s_m = s_m;
            }
        }
        Ok(Self { arrivals, beyond_m_s })
    }

    /// Time that it covers, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.beyond_m_s.len() as f64 * TICK_S
    }

    /// Vehicles that are there at the start.
    #[must_use]
    pub fn at_start(&self) -> usize {
        self.arrivals.iter().filter(|a| a.tick == 0).count()
    }

    /// Vehicles that come later.
    #[must_use]
    pub fn later(&self) -> usize {
        self.arrivals.len() - self.at_start()
    }

    /// Speeds at which vehicles come in at the start of the road, m/s.
    pub(crate) fn inflow_m_s(&self) -> impl Iterator<Item = f64> {
        let at_start = |a: &&Arrival| a.tick > 0 && a.s_m < BEYOND_M;
        self.arrivals.iter().filter(at_start).map(|a| a.speed_m_s)
    }

    /// Speeds at its end, of each lane and tick, m/s.
    pub(crate) fn outflow_m_s(&self) -> impl Iterator<Item = f64> {
        self.beyond_m_s.iter().flatten().copied().filter(|v| v.is_finite())
    }

    /// Speed beyond the end of each lane at a tick, m/s.
    pub(crate) fn beyond_m_s(&self, tick: u64) -> &[f64] {
        let k = (tick as usize).min(self.beyond_m_s.len().saturating_sub(1));
        self.beyond_m_s.get(k).map(Vec::as_slice).unwrap_or_default()
    }
}

impl Engine {
    /// Begins with the vehicles of a boundary, and lets in those that come later.
    pub(crate) fn bound(&mut self, boundary: Arc<Boundary>) {
        self.state.fleet = Fleet::default();
        (self.state.tick, self.state.next_arrival) = (0, boundary.at_start());
        // From the front: those behind are met behind those ahead.
        for a in boundary.arrivals.iter().filter(|a| a.tick == 0).rev() {
            self.put(a, a.speed_m_s);
        }
        self.boundary = Some(boundary);
    }

    /// Lets in who is due. A vehicle that finds no room waits for it where it came.
    pub(crate) fn let_in_measured(&mut self, boundary: &Boundary) {
        let mut late = std::mem::take(&mut self.state.late);
        while boundary
            .arrivals
            .get(self.state.next_arrival)
            .is_some_and(|a| a.tick <= self.state.tick)
        {
            late.push(self.state.next_arrival);
            self.state.arrived += 1;
            self.state.next_arrival += 1;
        }
        late.retain(|&k| {
            let Some(a) = boundary.arrivals.get(k) else { return false };
            let speed_m_s = self.speed_with_room(a);
            if let Some(speed_m_s) = speed_m_s {
                self.put(a, speed_m_s);
            }
            speed_m_s.is_none()
        });
        self.state.late = late;
    }

    /// Speed at which a vehicle can come in where it comes without hard braking by anyone: its own,
    /// or that of its leader if it is slower; `None`: there is no room.
    fn speed_with_room(&self, a: &Arrival) -> Option<f64> {
        let fleet = &self.state.fleet;
        let idm = self.measured_driver(a).idm;
        let place = fleet.s_m.partition_point(|&s| s <= a.s_m);
        let ahead = self.ahead_of(a);
        let behind = (0..place).rev().find(|&i| fleet.occupies(i, a.lane));
        let fits = |v: f64| {
            let ahead_fits = ahead.is_none_or(|i| {
                let gap = fleet.rear_m(i) - a.s_m;
                gap > idm.min_gap_m
                    && idm.interaction_m_s2(v, gap, v - fleet.v_m_s[i]) > -idm.decel_m_s2
            });
            let behind_fits = behind.is_none_or(|i| {
                let (gap, own) = (a.s_m - a.length_m - fleet.s_m[i], fleet.driver[i].idm);
                let own_v = fleet.v_m_s[i];
                gap > own.min_gap_m
                    && own.interaction_m_s2(own_v, gap, own_v - v) > -own.max_decel_m_s2
            });
            ahead_fits && behind_fits
        };
        let matched = ahead.map_or(a.speed_m_s, |i| fleet.v_m_s[i].min(a.speed_m_s));
        [a.speed_m_s, matched].into_iter().find(|&v| fits(v))
    }

    /// Whom a vehicle comes in behind, by index into the fleet.
    fn ahead_of(&self, a: &Arrival) -> Option<usize> {
        let fleet = &self.state.fleet;
        let place = fleet.s_m.partition_point(|&s| s <= a.s_m);
        (place..fleet.len()).find(|&i| fleet.occupies(i, a.lane))
    }

    /// The driver of a measured vehicle: drawn as any other, but who was measured at a speed wishes
    /// at least that speed, and who was met behind somebody tends to the gap that he was met with.
    fn measured_driver(&self, a: &Arrival) -> Driver {
        let drawn = Driver::of_class(&self.config, a.id, a.class, std::iter::empty());
        let met_m = self.ahead_of(a).map(|i| self.state.fleet.rear_m(i) - a.s_m);
        let mut idm = met_m.map_or(drawn.idm, |gap_m| met_at(drawn.idm, gap_m, a.speed_m_s));
        idm.desired_speed_m_s = idm.desired_speed_m_s.max(a.speed_m_s);
        Driver { idm, length_m: a.length_m, leaves_s_m: a.leaves_s_m, ..drawn }
    }

    fn put(&mut self, a: &Arrival, speed_m_s: f64) {
        if usize::from(a.lane) < self.map.lanes.len() {
            let driver = self.measured_driver(a);
            self.state.fleet.insert(a.s_m, speed_m_s, a.lane, a.id, driver);
            self.state.next_id = self.state.next_id.max(a.id + 1);
        }
    }
}

/// A driver who was drawn, and met at a gap, m, with a speed, m/s. What somebody is met with is half
/// his own and half of the moment: of the logarithm of the headway 0.5 is left after 10 to 15 s, in
/// pairs of vehicles of the I-80 and in recordings of two lanes alike. So he keeps the geometric mean
/// of what he was drawn with and what he was met with.
fn met_at(drawn: Idm, gap_m: f64, speed_m_s: f64) -> Idm {
    let frac = gap_m / drawn.wanted_gap_m(speed_m_s, 0.0);
    if frac > FOLLOWS_FRAC { drawn } else { drawn.content_with(libm::sqrt(frac.max(LEAST_FRAC))) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::native::{NativeTraffic, TrafficConfig};
    use crate::replay::{Frame, Row};
    use road::builtin;
    use tractrix_core::Geometry;

    #[test]
    fn who_is_met_close_behind_another_one_is_half_that_sort_of_driver() {
        let drawn = Idm::new(30.0, 1.5, 2.0, 1.0, 1.5, 8.0);
        // Own gap at 20 m/s: 32 m.
        let close = met_at(drawn, 8.0, 20.0);
        assert!((close.headway_s - 0.75).abs() < 1e-12 && (close.min_gap_m - 1.0).abs() < 1e-12);
        assert!((met_at(drawn, 64.0, 20.0).headway_s / 1.5 - 2f64.sqrt()).abs() < 1e-12);
        assert_eq!(met_at(drawn, 100.0, 20.0), drawn, "that one follows nobody");
        assert!(met_at(drawn, -1.0, 20.0).headway_s > 0.2, "overlapping in the recording");
    }

    #[test]
    fn vehicles_that_came_close_together_come_in_when_they_came() {
        // The story: drivers were drawn without a look at how they came. Who had drawn a longer
        // headway than he came with found no room: of 39 vehicles that came in half a minute, up to
        // 12 still waited at its end, and traffic behind them was too slow.
        let arrivals = (0..10).map(|k| Arrival {
            tick: 14 * k,
            id: k,
            class: VehicleClass::Car,
            length_m: 4.6,
            s_m: 5.0,
            speed_m_s: 15.0,
            lane: 0,
            leaves_s_m: f64::INFINITY,
        });
        let beyond_m_s = vec![vec![f64::INFINITY; 3]; 300];
        let boundary = Boundary { arrivals: arrivals.collect(), beyond_m_s };
        let mut config = TrafficConfig { max_speed_m_s: 16.0, ..TrafficConfig::default() };
        (config.car.headway_s, config.car.headway_sigma_frac) = (1.8, 0.0);
        (config.car.accel_m_s2, config.car.spread_frac) = (1.0, 0.0);
        let road = Arc::new(builtin::flat(700.0));
        let mut traffic =
            NativeTraffic::bounded(road, Geometry::default(), config, Arc::new(boundary)).unwrap();
        let mut waited = 0;
        for k in 0..150 {
            traffic.advance(Time(k * 100_000_000), &EgoState::default()).unwrap();
            waited += traffic.counts().waiting;
        }
        assert_eq!((traffic.counts().arrived, traffic.counts().vehicles), (9, 10));
        assert!(waited < 9, "{waited} ticks");
    }

    #[test]
    fn the_end_is_as_fast_as_it_was_measured_at_that_tick() {
        // The story: the speed at the end was averaged over 3 s, and traffic that braked together
        // from 13 to 5 m/s within 3 s was told so when the recording was over.
        let road = Arc::new(builtin::flat(700.0));
        let rows = (0..40).map(|k| {
            let t = 0.1 * f64::from(k);
            let (x_m, v) = (650.0 + 13.0 * t - 1.5 * t * t, 13.0 - 3.0 * t);
            let y_m = road.lanes()[0].center_d_m(x_m);
            Row { id: 1, time_s: t, x_m, y_m, speed_m_s: Some(v), ..Row::default() }
        });
        let recording =
            Recording::from_rows("brakes", Frame::Road, rows.collect(), TICK_S).unwrap();
        let boundary = Boundary::of(&road, &recording).unwrap();
        for tick in [0, 10, 30] {
            let measured_m_s = 13.0 - 0.3 * tick as f64;
            assert!((boundary.beyond_m_s(tick)[0] - measured_m_s).abs() < 1e-6, "{tick}");
        }
    }
}
