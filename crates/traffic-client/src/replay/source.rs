//! A recording as a [`TrafficSource`].

use std::sync::Arc;

use road::Road;
use tractrix_core::{EgoState, Neighbour, Scene, Time, TrafficSource, VehicleClass};

use super::ReplayError;
use super::recording::{Frame, Recording};
use crate::TrafficError;

/// What a user sets about a replay.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReplayConfig {
    /// Time of the recording at which the run starts, s.
    pub start_s: f64,
    /// Start again at the end; vehicles jump there.
    pub repeat: bool,
    /// Vehicles further away than this along the road are not published, m.
    pub scene_radius_m: f64,
    /// Shift of the recording along the road, m (for recordings in road coordinates).
    pub shift_s_m: f64,
}

impl Default for ReplayConfig {
    fn default() -> Self {
        Self { start_s: 0.0, repeat: false, scene_radius_m: 300.0, shift_s_m: 0.0 }
    }
}

/// One sample on the road.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Point {
    s_m: f64,
    d_m: f64,
    speed_m_s: f64,
    lane: u16,
}

#[derive(Debug, Clone, PartialEq)]
struct Tracked {
    id: u64,
    class: VehicleClass,
    length_m: f64,
    width_m: f64,
    first: usize,
    points: Vec<Point>,
}

/// Recorded traffic on a road.
#[derive(Debug, Clone)]
pub struct ReplayTraffic {
    road: Arc<Road>,
    config: ReplayConfig,
    step_s: f64,
    steps: usize,
    tracks: Vec<Tracked>,
    start: Option<Time>,
    scene: Scene,
}

impl ReplayTraffic {
    /// Matches a recording to a road: every sample is projected onto it; stretches on no lane of it
    /// are left out.
    ///
    /// # Errors
    /// [`ReplayError::NotOnRoad`] if nothing is left.
    pub fn new(
        road: Arc<Road>,
        recording: &Recording,
        config: ReplayConfig,
    ) -> Result<Self, TrafficError> {
        let mut tracks = Vec::new();
        for track in &recording.tracks {
            let mut hint = None;
            let points: Vec<Option<Point>> = track
                .samples
                .iter()
                .map(|sample| {
                    let (s_m, d_m) = match recording.frame {
                        Frame::Road => (sample.x_m + config.shift_s_m, sample.y_m),
                        Frame::Map => {
                            let at = road.project(sample.x_m, sample.y_m, hint)?;
                            (at.s_m, at.d_m)
                        }
                    };
                    let lane = road.lane_at(s_m, d_m);
                    hint = lane.map(|_| s_m);
                    Some(Point { s_m, d_m, speed_m_s: sample.speed_m_s, lane: lane? })
                })
                .collect();
            // A vehicle that leaves the road and comes back is two tracks.
            for part in points.chunk_by(|a, b| a.is_some() == b.is_some()) {
                let offset = part.as_ptr_range().start as usize - points.as_ptr() as usize;
                let first = track.first + offset / size_of::<Option<Point>>();
                let points: Vec<Point> = part.iter().copied().flatten().collect();
                if points.len() > 1 {
                    tracks.push(Tracked {
                        id: track.id,
                        class: track.class,
                        length_m: track.length_m,
                        width_m: track.width_m,
                        first,
                        points,
                    });
                }
            }
        }
        if tracks.is_empty() {
            return Err(ReplayError::NotOnRoad {
                name: recording.name.clone(),
                tracks: recording.tracks.len(),
                road: road.name().to_owned(),
            }
            .into());
        }
        tracks.sort_by_key(|t| (t.first, t.id));
        Ok(Self {
            road,
            config,
            step_s: recording.step_s,
            steps: recording.steps,
            tracks,
            start: None,
            scene: Scene::default(),
        })
    }

    /// Length of the recording, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.steps as f64 * self.step_s
    }

    /// Time in the recording at `now`, s; `None` after its end.
    fn recorded_s(&self, now: Time, start: Time) -> Option<f64> {
        let t = self.config.start_s + now.seconds_since(start);
        let end = (self.steps.max(2) - 1) as f64 * self.step_s;
        if t <= end {
            Some(t)
        } else if self.config.repeat {
            Some(t - end * libm::floor(t / end))
        } else {
            None
        }
    }
}

impl Tracked {
    /// The vehicle at a time, `step + f` steps into the recording.
    fn at(&self, step: usize, f: f64, step_s: f64, road: &Road) -> Option<Neighbour> {
        let k = step.checked_sub(self.first)?;
        let (a, b) = (self.points.get(k)?, self.points.get(k + 1)?);
        let s_m = a.s_m + f * (b.s_m - a.s_m);
        let d_m = a.d_m + f * (b.d_m - a.d_m);
        let speed_m_s = a.speed_m_s + f * (b.speed_m_s - a.speed_m_s);
        let lateral_speed_m_s = (b.d_m - a.d_m) / step_s;
        let at = road.at(s_m, d_m);
        let half = 0.5 * self.length_m;
        Some(Neighbour {
            id: self.id,
            class: self.class,
            front_s_m: s_m + half,
            rear_s_m: s_m - half,
            d_m,
            width_m: self.width_m,
            speed_m_s,
            lateral_speed_m_s,
            accel_m_s2: (b.speed_m_s - a.speed_m_s) / step_s,
            lane: a.lane,
            target_lane: (b.lane != a.lane).then_some(b.lane),
            x_m: at.x_m,
            y_m: at.y_m,
            yaw_rad: at.heading_rad + libm::atan2(lateral_speed_m_s, speed_m_s.max(1.0)),
        })
    }
}

impl TrafficSource for ReplayTraffic {
    type Error = TrafficError;

    fn advance(&mut self, now: Time, ego: &EgoState) -> Result<&Scene, TrafficError> {
        ego.check_finite()?;
        let start = *self.start.get_or_insert(now);
        if now < start {
            let (asked_s, reached_s) = (now.seconds(), start.seconds());
            return Err(TrafficError::TimeBackwards { asked_s, reached_s });
        }
        self.scene.time = now;
        self.scene.neighbours.clear();
        let Some(t) = self.recorded_s(now, start) else { return Ok(&self.scene) };
        let x = t / self.step_s;
        let step = x as usize;
        let f = x - step as f64;
        for track in self.tracks.iter().take_while(|track| track.first <= step) {
            if let Some(n) = track.at(step, f, self.step_s, &self.road)
                && n.rear_s_m < ego.s_m + self.config.scene_radius_m
                && n.front_s_m > ego.s_m - self.config.scene_radius_m
            {
                self.scene.neighbours.push(n);
            }
        }
        self.scene
            .neighbours
            .sort_unstable_by(|a, b| a.front_s_m.total_cmp(&b.front_s_m).then(a.id.cmp(&b.id)));
        Ok(&self.scene)
    }
}
