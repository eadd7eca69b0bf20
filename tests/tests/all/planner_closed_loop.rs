//! The planning stack in the full truck, 55 t, not on rails: lane changes, curves, speed on grades.

use std::sync::Arc;

use dynamics::{DynamicsError, TruckModel, TruckParameters};
use planner::{DeciderKind, LaneChoice, Stack, StackConfig, drive_tick};
use road::{Cubics, Line, Road, builtin};
use sim::{EgoStart, SimTruck, Weather};
use tractrix_core::{
    Command, EgoState, Maneuver, Plan, Scene, Stamped, Time, TrafficSource, Vehicle, VehicleLimits,
};

const PAYLOAD_KG: f64 = 36_000.0;

/// A truck that tells its planner something slightly wrong about itself.
struct Misinformed {
    truck: SimTruck,
    told: VehicleLimits,
}

impl Vehicle for Misinformed {
    type Error = DynamicsError;
    fn ego(&mut self, now: Time) -> Result<Stamped<EgoState>, DynamicsError> {
        self.truck.ego(now)
    }
    fn command(&mut self, now: Time, command: &Command) -> Result<(), DynamicsError> {
        self.truck.command(now, command)
    }
    fn limits(&self) -> &VehicleLimits {
        &self.told
    }
}

/// No other vehicles.
struct Alone(Scene);

impl TrafficSource for Alone {
    type Error = core::convert::Infallible;
    fn advance(&mut self, now: Time, _: &EgoState) -> Result<&Scene, Self::Error> {
        self.0.time = now;
        Ok(&self.0)
    }
}

fn truck(road: &Arc<Road>, speed_m_s: f64) -> SimTruck {
    let parameters = TruckParameters::load("reference").unwrap();
    let model = Arc::new(TruckModel::new(parameters, PAYLOAD_KG).unwrap());
    let start = EgoStart { s_m: 100.0, lane: Some(0), speed_m_s };
    SimTruck::new(model, Arc::clone(road), &start, &Weather::default()).unwrap()
}

/// The limits with mass and stiffness wrong by these factors.
fn told(limits: &VehicleLimits, mass: f64, stiffness: f64) -> VehicleLimits {
    let mut told = limits.clone();
    told.road_load.mass_kg *= mass;
    let l = &mut told.lateral;
    l.trailer_mass_kg *= mass;
    l.trailer_inertia_kg_m2 *= mass;
    l.tractor_mass_kg *= mass;
    l.tractor_inertia_kg_m2 *= mass;
    l.steer_stiffness_n_rad *= stiffness;
    l.drive_stiffness_n_rad *= stiffness;
    l.trailer_stiffness_n_rad *= stiffness;
    told
}

/// Drives for `seconds`; `look` sees every tick after `settle_s`.
fn drive(
    road: &Arc<Road>,
    config: StackConfig,
    vehicle: &mut Misinformed,
    seconds: f64,
    change_at_s: Option<f64>,
    mut look: impl FnMut(f64, &EgoState, &Plan),
) {
    let mut stack = Stack::new(config, &vehicle.told).unwrap();
    let mut traffic = Alone(Scene::default());
    for i in 0..(seconds * 100.0) as i64 {
        let time_s = i as f64 * 0.01;
        if change_at_s == Some(time_s) {
            stack.request_lane_change(LaneChoice::Left);
        }
        let now = Time(i * 10_000_000);
        let out = drive_tick(now, vehicle, &mut traffic, &mut stack, road, &mut ()).unwrap();
        assert!(!out.guarded, "guard at {time_s}: {:?}", stack.plan().guard);
        look(time_s, &out.ego.value, stack.plan());
    }
}

/// Trailer axle group in road coordinates.
fn trailer_at(road: &Road, limits: &VehicleLimits, ego: &EgoState) -> (f64, f64) {
    let g = &limits.geometry;
    let (s, c) = ego.yaw_rad.sin_cos();
    let (hx, hy) = (ego.x_m + g.hitch_ahead_m * c, ego.y_m + g.hitch_ahead_m * s);
    let (ts, tc) = (ego.yaw_rad + ego.trailer.articulation_rad).sin_cos();
    let l = g.hitch_to_trailer_axle_m;
    let p = road.project(hx - l * tc, hy - l * ts, Some(ego.s_m)).unwrap();
    (p.s_m, p.d_m)
}

/// Largest errors of tractor and trailer from the driven path, m.
fn lane_change_errors(mass: f64, stiffness: f64) -> (f64, f64) {
    let road = Arc::new(builtin::flat(3_000.0));
    let truck = truck(&road, 20.0);
    let limits = truck.limits().clone();
    let mut vehicle = Misinformed { told: told(&limits, mass, stiffness), truck };
    let config = StackConfig { decider: DeciderKind::External, ..StackConfig::default() };
    let (mut tractor, mut trailer, mut changed) = (0.0_f64, 0.0_f64, false);
    let mut path: Vec<(f64, f64)> = Vec::new();
    drive(&road, config, &mut vehicle, 30.0, Some(8.0), |time_s, ego, plan| {
        path.push((ego.s_m, plan.target_d_m));
        changed |= plan.maneuver == Maneuver::ChangeLeft;
        if time_s < 8.0 {
            return;
        }
        tractor = tractor.max(plan.lateral_error_m.abs());
        let (s, d) = trailer_at(&road, &limits, ego);
        let i = path.partition_point(|p| p.0 < s);
        trailer = trailer.max((d - path[i].1).abs());
    });
    assert!(changed);
    assert!((road.lanes()[1].center_d_m(0.0) - path.last().unwrap().1).abs() < 0.01);
    (tractor, trailer)
}

#[test]
fn a_lane_change_at_20_m_s_with_55_t_stays_within_10_cm_of_its_path() {
    let (tractor, trailer) = lane_change_errors(1.0, 1.0);
    assert!(tractor < 0.10 && trailer < 0.20, "tractor {tractor:.3} m, trailer {trailer:.3} m");
}

#[test]
fn with_mass_and_stiffness_wrong_by_20_per_cent_it_stays_within_15_cm() {
    for (mass, stiffness) in [(0.8, 0.8), (0.8, 1.2), (1.2, 0.8), (1.2, 1.2)] {
        let (tractor, trailer) = lane_change_errors(mass, stiffness);
        let case = format!("mass {mass} stiffness {stiffness}: {tractor:.3} m, {trailer:.3} m");
        assert!(tractor < 0.15 && trailer < 0.20, "{case}");
    }
}

/// Straight, grades of `amplitude` with a wave length of 1.2 km.
fn hills(amplitude: f64) -> Arc<Road> {
    let length = 12_000.0;
    let slopes: Vec<(f64, f64)> = (0..=600)
        .map(|i| f64::from(i) * 20.0)
        .map(|s| (s, amplitude * (core::f64::consts::TAU * s / 1_200.0).sin()))
        .collect();
    let height = Cubics::integral_of_linear(0.0, &slopes);
    let line = Line::from_curvature(0.0, &[(0.0, 0.0), (length, 0.0)], height, Cubics::default());
    let lanes = builtin::flat(length).lanes().to_vec();
    Arc::new(Road::new("hills", line, lanes, vec![(0.0, 25.0)]).unwrap())
}

#[test]
fn on_grades_of_three_per_cent_the_speed_stays_within_15_cm_per_s() {
    let road = hills(0.03);
    // 55 t on +3 % need 412 kW at 68 km/h: the set speed is one that the engine can hold
    let set = 15.0;
    let truck = truck(&road, set);
    let mut vehicle = Misinformed { told: truck.limits().clone(), truck };
    let config = StackConfig { set_speed_m_s: set, ..StackConfig::default() };
    let (mut squares, mut count, mut switches, mut last) = (0.0_f64, 0.0_f64, 0, 0);
    let (mut from, mut to) = (0.0, 0.0);
    drive(&road, config, &mut vehicle, 640.0, None, |time_s, ego, plan| {
        if time_s < 30.0 {
            from = ego.s_m;
            return;
        }
        to = ego.s_m;
        let error = ego.speed_m_s - set;
        squares += error * error;
        count += 1.0;
        let c = &plan.command;
        let braking = c.xbr_decel_m_s2 > 0.0 || c.retarder_frac > 0.0;
        let now = match (c.accelerator_pedal_frac > 0.0, braking) {
            (true, _) => 1,
            (_, true) => 2,
            _ => last,
        };
        switches += i32::from(now != last && last != 0);
        last = now;
    });
    let rms = (squares / count).sqrt();
    let per_km = f64::from(switches) / (to - from) * 1000.0;
    assert!(rms < 0.15, "speed RMS {rms:.3} m/s, {per_km:.2} switches per km");
    assert!(per_km < 2.0, "{per_km:.2} switches per km, RMS {rms:.3}");
}
