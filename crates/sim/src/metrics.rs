//! What a run is measured by: the keys of `summary.json`.

use std::collections::{HashSet, VecDeque};

use planner::safety::{RearResponse, RssConfig, SafeGap};
use road::{LaneKind, Road};
use serde::Serialize;
use tractrix_core::{
    EgoState, Geometry, Maneuver, Neighbour, Recorder, Scene, Tick, Time, VehicleClass,
    VehicleLimits,
};

use crate::{Footprint, footprints_overlap};

/// The figures of a run (contracts: `summary.json` of `run`, without the shell's own keys).
#[derive(Debug, Clone, PartialEq, Serialize, Default)]
pub struct Summary {
    /// Distance driven along the road, m.
    pub distance_m: f64,
    /// Simulated time, s.
    pub duration_s: f64,
    /// Mean speed, m/s.
    pub mean_speed_m_s: f64,
    /// Fuel used, g.
    pub fuel_g: f64,
    /// Energy turned into heat by the service brakes, J.
    pub brake_energy_j: f64,
    /// Lane changes begun.
    pub lane_changes: u32,
    /// Share of the distance driven in the rightmost through lane.
    pub keep_right_frac: f64,
    /// Collisions of the ego with other vehicles (each vehicle counts once per contact).
    pub collisions: u32,
    /// Smallest time to collision with the vehicle ahead in the ego's path, s; none if it never
    /// closed in on one.
    pub min_time_to_collision_s: Option<f64>,
    /// Seconds during which the gap ahead was below the responsibility-sensitive safe gap,
    /// counted once per entry.
    pub rss_violations: u32,
    /// Mean of (v_ref − v)/v_ref, v_ref the stack's reference speed before traffic.
    pub delta_speed_frac: f64,
    /// Largest distance of the reference point from the planned path, m.
    pub max_lateral_error_m: f64,
    /// Largest distance of the trailer's axle-group centre from the path planned there, m.
    pub max_trailer_lateral_error_m: f64,
    /// Other vehicles that have been around the ego.
    pub vehicles_met: usize,
    /// Ticks in which the guard changed the command.
    pub guard_activations: u64,
    /// Times that a wheel has left the paved lanes (shoulders are paved).
    pub off_road_events: u32,
    /// Time with a wheel beyond them, s.
    pub off_road_time_s: f64,
    /// Hash over every bit of every ego state of the run (FNV-1a, 64 bit, hexadecimal).
    pub state_hash: String,
}

/// Accumulates a [`Summary`] from the ticks of a run.
#[derive(Debug, Clone)]
pub struct Metrics {
    geometry: Geometry,
    rss: RssConfig,
    response: RearResponse,
    road: std::sync::Arc<Road>,
    start: Option<(Time, f64)>,
    last: Option<Time>,
    last_s_m: f64,
    fuel_start_g: f64,
    fuel_g: f64,
    speed_integral_m: f64,
    brake_energy_j: f64,
    delta_sum: f64,
    ticks: u64,
    lane_changes: u32,
    right_m: f64,
    last_maneuver: Maneuver,
    touching: Vec<u64>,
    met: HashSet<u64>,
    collisions: u32,
    min_ttc_s: f64,
    rss_below: bool,
    rss_violations: u32,
    max_lateral_error_m: f64,
    max_trailer_lateral_error_m: f64,
    guard_activations: u64,
    path_history: VecDeque<(f64, f64)>,
    hash: u64,
    only_collisions: bool,
}

impl Metrics {
    /// Metrics of a truck with these limits on this road; gaps are judged by `rss`.
    #[must_use]
    pub fn new(limits: &VehicleLimits, rss: &RssConfig, road: std::sync::Arc<Road>) -> Self {
        Self {
            geometry: limits.geometry,
            response: rss.ego_response(limits),
            rss: *rss,
            road,
            start: None,
            last: None,
            last_s_m: 0.0,
            fuel_start_g: 0.0,
            fuel_g: 0.0,
            speed_integral_m: 0.0,
            brake_energy_j: 0.0,
            delta_sum: 0.0,
            ticks: 0,
            lane_changes: 0,
            right_m: 0.0,
            last_maneuver: Maneuver::KeepLane,
            touching: Vec::new(),
            met: HashSet::new(),
            collisions: 0,
            min_ttc_s: f64::INFINITY,
            rss_below: false,
            rss_violations: 0,
            max_lateral_error_m: 0.0,
            max_trailer_lateral_error_m: 0.0,
            guard_activations: 0,
            path_history: VecDeque::new(),
            hash: FNV_OFFSET,
            only_collisions: false,
        }
    }

    /// Counts nothing but collisions from now on.
    pub fn only_collisions(&mut self) {
        self.only_collisions = true;
    }

    /// The figures so far.
    #[must_use]
    pub fn summary(&self) -> Summary {
        let (start, start_s) = self.start.unwrap_or_default();
        let duration_s = self.last.map_or(0.0, |t| t.seconds_since(start));
        Summary {
            distance_m: self.last_s_m - start_s,
            duration_s,
            mean_speed_m_s: if duration_s > 0.0 { self.speed_integral_m / duration_s } else { 0.0 },
            fuel_g: self.fuel_g - self.fuel_start_g,
            brake_energy_j: self.brake_energy_j,
            lane_changes: self.lane_changes,
            keep_right_frac: self.right_m / (self.last_s_m - start_s).max(1e-9),
            collisions: self.collisions,
            min_time_to_collision_s: self.min_ttc_s.is_finite().then_some(self.min_ttc_s),
            rss_violations: self.rss_violations,
            delta_speed_frac: self.delta_sum / (self.ticks.max(1) as f64),
            max_lateral_error_m: self.max_lateral_error_m,
            max_trailer_lateral_error_m: self.max_trailer_lateral_error_m,
            vehicles_met: self.met.len(),
            guard_activations: self.guard_activations,
            off_road_events: 0,
            off_road_time_s: 0.0,
            state_hash: format!("{:016x}", self.hash),
        }
    }

    /// Collisions so far.
    #[must_use]
    pub const fn collisions(&self) -> u32 {
        self.collisions
    }

    /// Vehicles that touch the ego now; a new contact counts one collision.
    fn count_collisions(&mut self, tick: &Tick<'_>) {
        let near_m = touchable_m(&self.geometry);
        let mut ego = None;
        let mut touching = Vec::new();
        for n in &tick.scene.neighbours {
            if (n.front_s_m - tick.ego.s_m).abs() > near_m {
                continue;
            }
            let ego = ego.get_or_insert_with(|| Footprint::of_ego(tick.ego, &self.geometry));
            let body = Footprint::of_neighbour(n);
            if ego.iter().any(|part| footprints_overlap(part, &body)) {
                touching.push(n.id);
                if !self.touching.contains(&n.id) {
                    self.collisions += 1;
                }
            }
        }
        self.touching = touching;
    }

    /// Whether the truck is in the rightmost through lane.
    fn is_right(&self, ego: &EgoState) -> bool {
        let here = self.road.lane_at(ego.s_m, ego.d_m);
        let through = |l: &&road::LaneTrack| l.kind == LaneKind::Driving;
        here.is_some() && here == self.road.lanes_at(ego.s_m).find(through).map(|l| l.id)
    }

    /// Gap, time to collision and safe gap to the vehicle ahead in the ego's swept lane.
    fn watch_headway(&mut self, tick: &Tick<'_>) {
        let ego = tick.ego;
        let ahead = nearest_ahead(ego, &self.geometry, tick.scene);
        let Some(ahead) = ahead else {
            self.rss_below = false;
            return;
        };
        let gap_m = ahead.rear_s_m - (ego.s_m + self.geometry.front_m);
        let closing_m_s = ego.speed_m_s - ahead.speed_m_s;
        if closing_m_s > 0.1 {
            self.min_ttc_s = self.min_ttc_s.min((gap_m / closing_m_s).max(0.0));
        }
        let grade_rad = self.road.surface(ego.s_m, ego.d_m).grade_rad;
        let brake_m_s2 = self.rss.brake_max_m_s2(ahead.class);
        let safe_m = SafeGap::new(&self.response, brake_m_s2, grade_rad)
            .gap_m(ego.speed_m_s, ahead.speed_m_s);
        let below = gap_m < safe_m;
        if below && !self.rss_below {
            self.rss_violations += 1;
        }
        self.rss_below = below;
    }

    /// How far the trailer's axle group is from the path that the tractor was given there.
    fn watch_trailer(&mut self, tick: &Tick<'_>) {
        let (ego, g) = (tick.ego, &self.geometry);
        if self.path_history.back().is_none_or(|&(s, _)| ego.s_m > s + 0.25) {
            self.path_history.push_back((ego.s_m, tick.plan.target_d_m));
            while self.path_history.front().is_some_and(|&(s, _)| s < ego.s_m - 40.0) {
                self.path_history.pop_front();
            }
        }
        let (sin, cos) = libm::sincos(ego.yaw_rad);
        let (sin_t, cos_t) = libm::sincos(ego.yaw_rad + ego.trailer.articulation_rad);
        let x = ego.x_m + g.hitch_ahead_m * cos - g.hitch_to_trailer_axle_m * cos_t;
        let y = ego.y_m + g.hitch_ahead_m * sin - g.hitch_to_trailer_axle_m * sin_t;
        let Some(at) = self.road.project(x, y, Some(ego.s_m - g.hitch_to_trailer_axle_m)) else {
            return;
        };
        let behind = self.path_history.partition_point(|&(s, _)| s <= at.s_m);
        if behind > 0 && behind < self.path_history.len() {
            let ((s0, d0), (s1, d1)) = (self.path_history[behind - 1], self.path_history[behind]);
            let d = d0 + (d1 - d0) * (at.s_m - s0) / (s1 - s0);
            self.max_trailer_lateral_error_m =
                self.max_trailer_lateral_error_m.max((at.d_m - d).abs());
        }
    }

    fn hash_state(&mut self, tick: &Tick<'_>) {
        let e = tick.ego;
        for value in [
            e.x_m,
            e.y_m,
            e.z_m,
            e.yaw_rad,
            e.s_m,
            e.d_m,
            e.speed_m_s,
            e.lateral_speed_m_s,
            e.accel_x_m_s2,
            e.accel_y_m_s2,
            e.yaw_rate_rad_s,
            e.trailer.articulation_rad,
            e.trailer.yaw_rate_rad_s,
            e.road_wheel_rad,
            e.load_transfer_ratio,
            e.powertrain.engine_speed_rad_s,
            e.powertrain.engine_torque_nm,
            e.powertrain.brake_pressure_pa,
            e.powertrain.fuel_used_g,
            f64::from(e.powertrain.gear),
            tick.plan.command.accelerator_pedal_frac,
            tick.plan.command.xbr_decel_m_s2,
            tick.plan.command.steering_wheel_rad,
        ] {
            for byte in value.to_bits().to_le_bytes() {
                self.hash = (self.hash ^ u64::from(byte)).wrapping_mul(FNV_PRIME);
            }
        }
    }
}

/// A vehicle whose front is further from the reference point than this cannot touch the truck, m.
pub(crate) fn touchable_m(geometry: &Geometry) -> f64 {
    geometry.length_m() + 30.0
}

/// The nearest vehicle ahead in the ego's swept way.
pub(crate) fn nearest_ahead<'a>(
    ego: &EgoState,
    geometry: &Geometry,
    scene: &'a Scene,
) -> Option<&'a Neighbour> {
    scene
        .neighbours
        .iter()
        .filter(|n| n.rear_s_m > ego.s_m)
        .filter(|n| (n.d_m - ego.d_m).abs() < 0.5 * (n.width_m + geometry.width_m))
        .min_by(|a, b| a.rear_s_m.total_cmp(&b.rear_s_m))
}

const FNV_OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
const FNV_PRIME: u64 = 0x0000_0100_0000_01b3;

impl Recorder for Metrics {
    fn record(&mut self, tick: &Tick<'_>) {
        if self.only_collisions {
            self.count_collisions(tick);
            return;
        }
        let ego = tick.ego;
        let dt_s = self.last.map_or(0.0, |t| tick.now.seconds_since(t));
        if self.start.is_none() {
            self.start = Some((tick.now, ego.s_m));
            self.fuel_start_g = ego.powertrain.fuel_used_g;
        }
        if self.last.is_some() && self.is_right(ego) {
            self.right_m += ego.s_m - self.last_s_m;
        }
        self.last = Some(tick.now);
        self.last_s_m = ego.s_m;
        self.fuel_g = ego.powertrain.fuel_used_g;
        self.speed_integral_m += ego.speed_m_s * dt_s;
        self.brake_energy_j += ego.powertrain.brake_force_n * ego.speed_m_s.max(0.0) * dt_s;
        let reference = tick.plan.reference_speed_m_s;
        if reference > 0.0 {
            self.delta_sum += (reference - ego.speed_m_s) / reference;
        }
        self.ticks += 1;
        let maneuver = tick.plan.maneuver;
        if maneuver != self.last_maneuver
            && matches!(maneuver, Maneuver::ChangeLeft | Maneuver::ChangeRight)
        {
            self.lane_changes += 1;
        }
        self.last_maneuver = maneuver;
        self.max_lateral_error_m = self.max_lateral_error_m.max(tick.plan.lateral_error_m.abs());
        self.guard_activations += u64::from(!tick.plan.guard.is_empty());
        let vehicles = tick.scene.neighbours.iter().filter(|n| n.class != VehicleClass::Barrier);
        self.met.extend(vehicles.map(|n| n.id));
        self.count_collisions(tick);
        self.watch_headway(tick);
        self.watch_trailer(tick);
        self.hash_state(tick);
    }
}
