//! Samples from scenes: what every vehicle does at every look.
//!
//! Lanes are told by where a body's centre is, for measured and computed traffic alike. The
//! acceleration is the change of speed over one second, which noise of measured positions and
//! braking of single ticks hardly touch. A lane change counts once the new lane has been held for
//! a second.

use std::collections::HashMap;
use std::sync::Arc;

use road::Road;
use tractrix_core::{EgoState, Neighbour, Scene, Time, TrafficSource};

use crate::TrafficError;
use crate::replay::{Recording, ReplayConfig, ReplayTraffic};

/// Speed change over this is the acceleration, and a lane counts once it is held for this, s.
const SPAN_S: f64 = 1.0;
/// Slower vehicles have no time headway, m/s.
const SLOW_M_S: f64 = 1.0;
/// Longer headways and gaps belong to free driving and are not sampled.
const FREE_HEADWAY_S: f64 = 10.0;
const FREE_GAP_M: f64 = 150.0;
/// A vehicle that was not seen for this is a new one, s.
const LOST_S: f64 = 2.0;

/// What is sampled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Speed, m/s.
    Speed,
    /// Bumper-to-bumper gap to the vehicle ahead in the lane, m, up to 150 m.
    Gap,
    /// Front-to-front time headway to it, s, above 1 m/s and up to 10 s.
    Headway,
    /// Change of speed over one second, m/s².
    Accel,
    /// Speed at a lane change, m/s.
    LaneChangeSpeed,
    /// Gap to the new leader at a lane change, m.
    LaneChangeLead,
    /// Gap to the new follower at a lane change, m.
    LaneChangeLag,
}

/// All quantities, with their key (unit included) and title.
pub const QUANTITIES: [(Quantity, &str, &str); 7] = [
    (Quantity::Speed, "speed_m_s", "speed, m/s"),
    (Quantity::Gap, "gap_m", "gap, m"),
    (Quantity::Headway, "headway_s", "time headway, s"),
    (Quantity::Accel, "accel_m_s2", "acceleration over 1 s, m/s²"),
    (Quantity::LaneChangeSpeed, "lane_change_speed_m_s", "speed at a lane change, m/s"),
    (Quantity::LaneChangeLead, "lane_change_lead_gap_m", "gap to the new leader, m"),
    (Quantity::LaneChangeLag, "lane_change_lag_gap_m", "gap to the new follower, m"),
];

/// Samples of all quantities.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Samples {
    values: [Vec<f64>; QUANTITIES.len()],
    /// Lane changes counted.
    pub lane_changes: usize,
    /// Vehicles seen.
    pub vehicles: usize,
    /// Way of all vehicles together, km.
    pub driven_km: f64,
    /// Time of all vehicles together, h.
    pub driven_h: f64,
    /// Time that was observed, s.
    pub duration_s: f64,
    /// Smallest gap between two vehicles in one lane, m; negative after a collision, or where
    /// measured positions overlap.
    pub min_gap_m: f64,
}

impl Samples {
    /// Samples of one quantity.
    #[must_use]
    pub fn of(&self, quantity: Quantity) -> &[f64] {
        &self.values[quantity as usize]
    }

    /// Puts other samples in the place of those of one quantity.
    pub fn replace(&mut self, quantity: Quantity, values: Vec<f64>) {
        self.values[quantity as usize] = values;
    }

    /// Sorts the samples, for whoever compares with them again and again.
    pub fn sort(&mut self) {
        for values in &mut self.values {
            values.sort_by(f64::total_cmp);
        }
    }

    /// Samples of several observations of the same kind as those of one.
    #[must_use]
    pub fn pooled<'a>(each: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut each = each.into_iter();
        let mut all = each.next().cloned().unwrap_or_default();
        each.for_each(|other| all.append(other));
        all
    }

    fn append(&mut self, other: &Self) {
        for (mine, theirs) in self.values.iter_mut().zip(&other.values) {
            mine.extend_from_slice(theirs);
        }
        self.lane_changes += other.lane_changes;
        self.vehicles += other.vehicles;
        self.driven_km += other.driven_km;
        self.driven_h += other.driven_h;
        self.duration_s += other.duration_s;
        self.min_gap_m = self.min_gap_m.min(other.min_gap_m);
    }

    /// Lane changes per vehicle and km.
    #[must_use]
    pub fn lane_changes_1_km(&self) -> f64 {
        self.lane_changes as f64 / self.driven_km.max(1e-9)
    }

    /// Mean density on a road with this many metres of lanes, vehicles per km and lane.
    #[must_use]
    pub fn density_1_km(&self, lanes_m: f64) -> f64 {
        self.driven_h * 3600.0 / self.duration_s.max(1e-9) / (lanes_m * 1e-3).max(1e-9)
    }

    /// Mean flow (Edie, Proc. 2nd Int. Symp. on the Theory of Traffic Flow (1963) 139) on a road with
    /// this many metres of lanes, vehicles per hour and lane.
    #[must_use]
    pub fn flow_1_h(&self, lanes_m: f64) -> f64 {
        self.driven_km / (self.duration_s / 3600.0).max(1e-9) / (lanes_m * 1e-3).max(1e-9)
    }
}

/// What is remembered of a vehicle.
#[derive(Debug, Clone)]
struct Known {
    seen_s: f64,
    /// Lane that counts.
    lane: u16,
    /// A lane that may come to count, since when, and the gaps then, m.
    next: Option<(u16, f64, Gaps)>,
    /// Time and speed of the looks of the last second.
    speeds: std::collections::VecDeque<(f64, f64)>,
    last_front_m: f64,
}

#[derive(Debug, Clone, Copy, Default)]
struct Gaps {
    lead_m: Option<f64>,
    lag_m: Option<f64>,
}

/// Looks at scenes and takes samples.
#[derive(Debug, Clone, Default)]
pub struct Observer {
    /// The samples so far.
    pub samples: Samples,
    known: HashMap<u64, Known>,
    last_s: Option<f64>,
    lanes: Vec<Option<u16>>,
}

impl Observer {
    /// Looks at a scene. Looks should be evenly spaced, 0.1 to 0.5 s apart.
    pub fn look(&mut self, scene: &Scene, road: &Road) {
        let now_s = scene.time.seconds();
        let step_s = self.last_s.map_or(0.0, |last| now_s - last);
        if self.last_s.is_none() {
            self.samples.min_gap_m = f64::INFINITY;
        }
        self.samples.duration_s += step_s;
        self.last_s = Some(now_s);
        self.lanes.clear();
        self.lanes.extend(
            scene.neighbours.iter().map(|n| road.lane_at(0.5 * (n.front_s_m + n.rear_s_m), n.d_m)),
        );
        for k in 0..scene.neighbours.len() {
            let (Some(n), Some(Some(lane))) = (scene.neighbours.get(k), self.lanes.get(k).copied())
            else {
                continue;
            };
            let ahead = self.nearest(scene, k, lane, true);
            self.sample(n, ahead);
            self.follow(n, lane, now_s, step_s, |observer| Gaps {
                lead_m: ahead.map(|a| a.rear_s_m - n.front_s_m),
                lag_m: observer.nearest(scene, k, lane, false).map(|b| n.rear_s_m - b.front_s_m),
            });
        }
        self.known.retain(|_, known| now_s - known.seen_s < LOST_S);
    }

    /// The nearest vehicle in a lane, ahead of or behind vehicle `k`. Scenes are sorted by front.
    fn nearest<'a>(
        &self,
        scene: &'a Scene,
        k: usize,
        lane: u16,
        ahead: bool,
    ) -> Option<&'a Neighbour> {
        let mut at = k;
        loop {
            at = if ahead { at + 1 } else { at.checked_sub(1)? };
            if *self.lanes.get(at)? == Some(lane) {
                return scene.neighbours.get(at);
            }
        }
    }

    fn add(&mut self, quantity: Quantity, value: f64) {
        self.samples.values[quantity as usize].push(value);
    }

    fn sample(&mut self, n: &Neighbour, ahead: Option<&Neighbour>) {
        self.add(Quantity::Speed, n.speed_m_s);
        let Some(ahead) = ahead else { return };
        let gap_m = ahead.rear_s_m - n.front_s_m;
        self.samples.min_gap_m = self.samples.min_gap_m.min(gap_m);
        if gap_m < FREE_GAP_M {
            self.add(Quantity::Gap, gap_m);
        }
        let headway_s = (ahead.front_s_m - n.front_s_m) / n.speed_m_s;
        if n.speed_m_s > SLOW_M_S && headway_s < FREE_HEADWAY_S {
            self.add(Quantity::Headway, headway_s);
        }
    }

    /// What needs a memory: way, acceleration, lane changes.
    fn follow(
        &mut self,
        n: &Neighbour,
        lane: u16,
        now_s: f64,
        step_s: f64,
        gaps: impl Fn(&Self) -> Gaps,
    ) {
        let Some(mut known) = self.known.remove(&n.id) else {
            self.samples.vehicles += 1;
            let speeds = [(now_s, n.speed_m_s)].into();
            let last_front_m = n.front_s_m;
            let known = Known { seen_s: now_s, lane, next: None, speeds, last_front_m };
            self.known.insert(n.id, known);
            return;
        };
        self.samples.driven_km += (n.front_s_m - known.last_front_m).max(0.0) * 1e-3;
        self.samples.driven_h += step_s / 3600.0;
        (known.seen_s, known.last_front_m) = (now_s, n.front_s_m);
        known.speeds.push_back((now_s, n.speed_m_s));
        while known.speeds.get(1).is_some_and(|&(t, _)| now_s - t > SPAN_S - 1e-6) {
            known.speeds.pop_front();
        }
        if let Some(&(t, v)) = known.speeds.front()
            && now_s - t > SPAN_S - 1e-6
        {
            self.add(Quantity::Accel, (n.speed_m_s - v) / (now_s - t));
        }
        match known.next {
            _ if lane == known.lane => known.next = None,
            Some((next, since_s, at)) if next == lane => {
                if now_s - since_s > SPAN_S - 1e-6 {
                    (known.lane, known.next) = (lane, None);
                    self.samples.lane_changes += 1;
                    self.add(Quantity::LaneChangeSpeed, n.speed_m_s);
                    for (quantity, gap) in
                        [(Quantity::LaneChangeLead, at.lead_m), (Quantity::LaneChangeLag, at.lag_m)]
                    {
                        if let Some(gap_m) = gap.filter(|gap_m| *gap_m < FREE_GAP_M) {
                            self.add(quantity, gap_m);
                        }
                    }
                }
            }
            _ => known.next = Some((lane, now_s, gaps(self))),
        }
        self.known.insert(n.id, known);
    }
}

/// Samples of a whole recording on a road: it is replayed, and every scene is looked at.
///
/// # Errors
/// [`TrafficError`] if the recording does not lie on the road.
pub fn observe_recording(road: &Arc<Road>, recording: &Recording) -> Result<Samples, TrafficError> {
    let config = ReplayConfig { scene_radius_m: f64::INFINITY, ..ReplayConfig::default() };
    let mut replay = ReplayTraffic::new(Arc::clone(road), recording, config)?;
    let ego = EgoState { s_m: 0.5 * road.length_m(), ..EgoState::default() };
    let mut observer = Observer::default();
    for k in 0..recording.steps.saturating_sub(1) {
        let now = Time::from_seconds(k as f64 * recording.step_s);
        observer.look(replay.advance(now, &ego)?, road);
    }
    Ok(observer.samples)
}

#[cfg(test)]
mod tests {
    use super::*;
    use road::builtin;

    /// Two cars on the flat road, 30 m from front to front at 15 m/s; the one behind changes to
    /// the left lane at 5 s, and speeds up by 1 m/s² from 8 s on.
    fn scene(road: &Road, t: f64) -> Scene {
        let left = usize::from(t >= 5.0);
        let more = (t - 8.0).max(0.0);
        let car = |id, front_s_m: f64, lane: usize, speed_m_s| Neighbour {
            id,
            front_s_m,
            rear_s_m: front_s_m - 5.0,
            d_m: road.lanes()[lane].center_d_m(front_s_m),
            speed_m_s,
            ..Neighbour::default()
        };
        let behind = car(1, 200.0 + 15.0 * t + 0.5 * more * more, left, 15.0 + more);
        let neighbours = vec![behind, car(2, 230.0 + 15.0 * t, 0, 15.0)];
        Scene { time: Time::from_seconds(t), neighbours }
    }

    #[test]
    fn speeds_gaps_headways_accelerations_and_changes_come_out_as_they_were_put_in() {
        let road = builtin::flat(2000.0);
        let mut observer = Observer::default();
        for k in 0..=100 {
            observer.look(&scene(&road, 0.1 * f64::from(k)), &road);
        }
        let s = observer.samples;
        assert_eq!((s.vehicles, s.lane_changes), (2, 1));
        assert!((s.driven_km - 0.302).abs() < 1e-6, "{}", s.driven_km);
        assert!((s.driven_h * 3600.0 - 20.0).abs() < 1e-6 && (s.min_gap_m - 25.0).abs() < 1e-9);
        assert_eq!(s.of(Quantity::Speed).len(), 202);
        assert_eq!(s.of(Quantity::Gap).len(), 50, "only while both are in one lane");
        assert!(s.of(Quantity::Gap).iter().all(|g| (g - 25.0).abs() < 1e-9));
        assert!(s.of(Quantity::Headway).iter().all(|h| (h - 2.0).abs() < 1e-9));
        let accel = s.of(Quantity::Accel);
        let most = accel.iter().copied().fold(0.0, f64::max);
        assert!((most - 1.0).abs() < 1e-9 && accel.iter().all(|a| *a > -1e-9));
        assert_eq!(s.of(Quantity::LaneChangeSpeed), [15.0]);
        assert!(s.of(Quantity::LaneChangeLead).is_empty(), "nobody in the new lane");
    }

    #[test]
    fn a_lane_that_is_only_touched_is_no_lane_change() {
        let road = builtin::flat(2000.0);
        let mut observer = Observer::default();
        for k in 0..100 {
            let mut scene = scene(&road, 0.1 * f64::from(k).min(4.9));
            scene.time = Time::from_seconds(0.1 * f64::from(k));
            if k % 8 == 0 {
                scene.neighbours[0].d_m = road.lanes()[1].center_d_m(0.0);
            }
            observer.look(&scene, &road);
        }
        assert_eq!(observer.samples.lane_changes, 0);
    }

    #[test]
    fn flow_is_density_times_speed() {
        let road = builtin::flat(2000.0);
        let mut observer = Observer::default();
        for k in 0..40 {
            observer.look(&scene(&road, 0.1 * f64::from(k)), &road);
        }
        let (density, flow) =
            (observer.samples.density_1_km(4000.0), observer.samples.flow_1_h(4000.0));
        assert!((density - 0.5).abs() < 1e-6 && (flow - 0.5 * 54.0).abs() < 1e-4, "{flow}");
    }
}
