//! The vehicle ahead as the truck's radar tells it (ACC1), as a source of traffic.
//!
//! ACC1 comes at 10 Hz in steps of 1 m and 1 km/h. Between two messages the vehicle is moved on; a
//! message then holds the estimate within half a step of what it says, so that a vehicle that drives
//! evenly does not seem to jump. Nothing is known of other lanes: a decider must keep the lane.

use std::convert::Infallible;
use std::sync::Arc;

use j1939::truck::Lead;
use road::Road;
use tractrix_core::{EgoState, Neighbour, Scene, Stamped, Time, TrafficSource, VehicleClass};

/// Half a step of distance (SPN 1587), m, and of speed (SPN 1586), m/s.
const HALF_STEP: (f64, f64) = (0.5, 0.5 / 3.6);
/// What differs by more from what was expected is another vehicle: m, and m/s.
const ANOTHER: (f64, f64) = (6.0, 4.0);
/// Time constant of the filter that makes acceleration of speeds, s.
const ACCELERATION_FILTER_S: f64 = 0.5;
/// Hardest acceleration of a vehicle that is believed, m/s².
const ACCELERATION_MAX_M_S2: f64 = 10.0;
/// The radar tells no size; a car brakes hardest, which is the careful assumption. Length and
/// width, m.
const BODY_M: (f64, f64) = (4.5, 2.0);

/// The vehicle that is followed.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Track {
    id: u64,
    distance_m: f64,
    speed_m_s: f64,
    accel_m_s2: f64,
    /// Radar time of the last message.
    told: Time,
    /// Time up to which it is moved.
    until: Time,
}

/// The source.
#[derive(Debug)]
pub(crate) struct ForwardRadar {
    road: Arc<Road>,
    /// From the reference point to the front bumper, m.
    front_m: f64,
    told: Option<Stamped<Option<Lead>>>,
    track: Option<Track>,
    tracks: u64,
    scene: Scene,
}

impl ForwardRadar {
    pub(crate) fn new(road: Arc<Road>, front_m: f64) -> Self {
        let scene = Scene { time: NEVER, neighbours: Vec::with_capacity(1) };
        Self { road, front_m, told: None, track: None, tracks: 0, scene }
    }

    /// Takes what the radar has told last.
    pub(crate) const fn see(&mut self, told: Option<Stamped<Option<Lead>>>) {
        self.told = told;
    }

    /// The vehicle ahead: its distance, m, and speed, m/s.
    pub(crate) fn lead(&self) -> Option<(f64, f64)> {
        self.track.map(|track| (track.distance_m, track.speed_m_s))
    }

    fn follow(&mut self, now: Time, ego_m_s: f64) {
        if let Some(track) = &mut self.track {
            let dt_s = now.seconds_since(track.until).clamp(0.0, 0.5);
            track.until = now;
            track.distance_m += (track.speed_m_s - ego_m_s) * dt_s;
        }
        let Some(Stamped { time, value }) = self.told else { return };
        let Some(lead) = value else {
            self.track = None;
            return;
        };
        match &mut self.track {
            Some(track) if track.told == time => {}
            Some(track)
                if (lead.distance_m - track.distance_m).abs() < ANOTHER.0
                    && (lead.speed_m_s - track.speed_m_s).abs() < ANOTHER.1 =>
            {
                let dt_s = time.seconds_since(track.told).clamp(0.01, 1.0);
                // The message is older than now: it is held against where the vehicle was then
                let since_m = (track.speed_m_s - ego_m_s) * now.seconds_since(time).clamp(0.0, 0.5);
                let (least, most) = (lead.distance_m - HALF_STEP.0, lead.distance_m + HALF_STEP.0);
                track.distance_m = track.distance_m.clamp(least + since_m, most + since_m).max(0.0);
                let (least, most) = (lead.speed_m_s - HALF_STEP.1, lead.speed_m_s + HALF_STEP.1);
                let speed = track.speed_m_s.clamp(least, most).max(0.0);
                let measured = (speed - track.speed_m_s) / dt_s;
                let share = dt_s / (ACCELERATION_FILTER_S + dt_s);
                track.accel_m_s2 += share * (measured - track.accel_m_s2);
                track.accel_m_s2 =
                    track.accel_m_s2.clamp(-ACCELERATION_MAX_M_S2, ACCELERATION_MAX_M_S2);
                (track.speed_m_s, track.told) = (speed, time);
            }
            _ => {
                self.tracks += 1;
                self.track = Some(Track {
                    id: self.tracks,
                    distance_m: lead.distance_m,
                    speed_m_s: lead.speed_m_s,
                    accel_m_s2: 0.0,
                    told: time,
                    until: now,
                });
            }
        }
    }
}

/// The time of a scene before the radar has spoken: older than any guard takes.
const NEVER: Time = Time(i64::MIN / 2);

impl TrafficSource for ForwardRadar {
    type Error = Infallible;

    /// The scene at `now` with the time of the radar's last message: a guard notices that it is
    /// silent.
    fn advance(&mut self, now: Time, ego: &EgoState) -> Result<&Scene, Infallible> {
        self.follow(now, ego.speed_m_s);
        self.scene.time = self.told.map_or(NEVER, |told| told.time);
        self.scene.neighbours.clear();
        if let Some(track) = &self.track {
            let rear_s_m = ego.s_m + self.front_m + track.distance_m;
            let (length_m, width_m) = BODY_M;
            let at = self.road.at(rear_s_m + 0.5 * length_m, ego.d_m);
            self.scene.neighbours.push(Neighbour {
                id: track.id,
                class: VehicleClass::Car,
                front_s_m: rear_s_m + length_m,
                rear_s_m,
                d_m: ego.d_m,
                width_m,
                speed_m_s: track.speed_m_s,
                lateral_speed_m_s: 0.0,
                accel_m_s2: track.accel_m_s2,
                lane: self.road.lane_at(rear_s_m, ego.d_m).unwrap_or_default(),
                target_lane: None,
                x_m: at.x_m,
                y_m: at.y_m,
                yaw_rad: at.heading_rad,
            });
        }
        Ok(&self.scene)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK: i64 = 10_000_000;

    fn radar() -> ForwardRadar {
        ForwardRadar::new(Arc::new(road::builtin::flat(2000.0)), 4.0)
    }

    /// Told as on the bus: whole metres and kilometres an hour.
    fn told(time: Time, distance_m: f64, speed_m_s: f64) -> Option<Stamped<Option<Lead>>> {
        let speed_m_s = (speed_m_s * 3.6).round() / 3.6;
        let value = Some(Lead { distance_m: distance_m.round(), speed_m_s });
        Some(Stamped { time, value })
    }

    #[test]
    fn a_vehicle_is_told_nearer_to_the_truth_than_the_bus_tells_it() {
        let mut radar = radar();
        let mut ego = EgoState { s_m: 100.0, d_m: -1.9, speed_m_s: 18.0, ..EgoState::default() };
        let (mut gap_m, mut speed_m_s) = (60.3, 20.0_f64);
        let mut last = 0.0;
        for tick in 0..2000_i64 {
            let now = Time(tick * TICK);
            if tick % 10 == 0 {
                radar.see(told(now, gap_m, speed_m_s));
            }
            let scene = radar.advance(now, &ego).unwrap();
            assert_eq!(scene.time.0, tick / 10 * 10 * TICK);
            let [n] = scene.neighbours[..] else { panic!("{scene:?}") };
            assert_eq!(n.id, 1);
            let off_m = n.rear_s_m - (ego.s_m + 4.0) - gap_m;
            assert!(off_m.abs() < 0.75, "{tick}: {off_m}");
            if tick > 0 {
                assert!((n.rear_s_m - last - speed_m_s * 0.01).abs() < HALF_STEP.0, "{tick}");
            }
            last = n.rear_s_m;
            // from 5 s on it brakes with 2 m/s²
            let braking = (500..900).contains(&tick);
            if braking && tick > 700 {
                assert!((n.accel_m_s2 + 2.0).abs() < 1.0, "{tick}: {}", n.accel_m_s2);
            }
            speed_m_s -= if braking { 0.02 } else { 0.0 };
            gap_m += (speed_m_s - ego.speed_m_s) * 0.01;
            ego.s_m += ego.speed_m_s * 0.01;
            if gap_m < 20.0 {
                ego.speed_m_s = speed_m_s;
            }
        }
    }

    #[test]
    fn another_vehicle_has_another_number_and_a_free_road_has_none() {
        let mut radar = radar();
        let ego = EgoState { s_m: 100.0, speed_m_s: 20.0, ..EgoState::default() };
        let mut ids = Vec::new();
        for (i, lead) in
            [Some((80.0, 20.0)), Some((79.0, 20.0)), None, Some((79.0, 20.0)), Some((30.0, 15.0))]
                .into_iter()
                .enumerate()
        {
            let now = Time(i as i64 * 10 * TICK);
            let value = lead.map(|(distance_m, speed_m_s)| Lead { distance_m, speed_m_s });
            radar.see(Some(Stamped { time: now, value }));
            ids.push(radar.advance(now, &ego).unwrap().neighbours.first().map(|n| n.id));
        }
        assert_eq!(ids, [Some(1), Some(1), None, Some(2), Some(3)]);
    }

    #[test]
    fn a_silent_radar_leaves_an_old_scene() {
        let mut radar = radar();
        let ego = EgoState::default();
        assert!(radar.advance(Time(0), &ego).unwrap().time.seconds() < -1e6);
        radar.see(told(Time(TICK), 50.0, 20.0));
        let age_s = |time: Time| Time(100 * TICK).seconds_since(time);
        let scene = radar.advance(Time(100 * TICK), &ego).unwrap();
        assert!(age_s(scene.time) > 0.9);
        assert_eq!(scene.neighbours.len(), 1);
    }
}
