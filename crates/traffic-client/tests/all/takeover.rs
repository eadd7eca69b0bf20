//! One source goes on where another one ended, around a truck that drives on. Once, 1 of 5 starts
//! and 2 of 6 takeovers under way ended in a collision: traffic of the new source stood on the
//! truck or just ahead of it, the first decisions were made without it, and vehicles between two
//! lanes jumped back into the first.

use std::sync::Arc;

use driver_models::{Idm, ballistic};
use road::{Road, builtin};
use tractrix_core::{EgoState, Geometry, Neighbour, Scene, Time, TrafficSource};
use traffic_client::native::{Density, NativeTraffic, TrafficConfig};

const FRONT_M: f64 = 4.8;
const REAR_M: f64 = 11.2;
const WIDTH_M: f64 = 2.55;

fn truck() -> Geometry {
    Geometry {
        front_m: FRONT_M,
        hitch_ahead_m: 0.3,
        trailer_front_m: 1.5,
        trailer_rear_m: 11.5,
        tractor_rear_m: 1.0,
        width_m: WIDTH_M,
        ..Geometry::default()
    }
}

/// A truck that keeps its lane and follows as IDM does, with a truck's brakes.
struct Ego {
    road: Arc<Road>,
    state: EgoState,
}

impl Ego {
    fn new(road: &Arc<Road>, speed_m_s: f64) -> Self {
        let d_m = road.lanes()[0].center_d_m(0.0);
        let state = EgoState { s_m: 500.0, d_m, speed_m_s, ..EgoState::default() };
        let mut ego = Self { road: Arc::clone(road), state };
        ego.place();
        ego
    }

    fn place(&mut self) {
        let at = self.road.at(self.state.s_m, self.state.d_m);
        (self.state.x_m, self.state.y_m, self.state.yaw_rad) = (at.x_m, at.y_m, at.heading_rad);
    }

    fn beside(&self, n: &Neighbour) -> bool {
        (n.d_m - self.state.d_m).abs() > 0.5 * (n.width_m + WIDTH_M)
    }

    fn touches(&self, n: &Neighbour) -> bool {
        !self.beside(n)
            && n.rear_s_m < self.state.s_m + FRONT_M
            && n.front_s_m > self.state.s_m - REAR_M
    }

    fn drive(&mut self, scene: &Scene, dt_s: f64) {
        let front_m = self.state.s_m + FRONT_M;
        let ahead = |n: &&Neighbour| !self.beside(n) && n.rear_s_m > front_m - 1.0;
        let idm = Idm::new(22.0, 1.5, 3.0, 0.6, 2.0, 5.0);
        let v = self.state.speed_m_s;
        let a = match scene.neighbours.iter().find(ahead) {
            Some(n) => idm.accel_m_s2(v, 22.0, n.rear_s_m - front_m, v - n.speed_m_s),
            None => idm.free_m_s2(v, 22.0),
        };
        let (speed_m_s, way_m) = ballistic(v, a, dt_s);
        (self.state.speed_m_s, self.state.accel_x_m_s2) = (speed_m_s, a);
        self.state.s_m += way_m;
        self.place();
    }
}

/// Drives on to `until_s` in steps of 20 ms; how often somebody touches the truck.
fn drive(traffic: &mut NativeTraffic, ego: &mut Ego, now: &mut Time, until_s: f64) -> usize {
    let mut touched = std::collections::BTreeSet::new();
    while now.seconds() < until_s {
        let scene = traffic.advance(*now, &ego.state).unwrap().clone();
        touched.extend(scene.neighbours.iter().filter(|n| ego.touches(n)).map(|n| n.id));
        ego.drive(&scene, 0.02);
        *now = now.plus_nanos(20_000_000);
    }
    touched.len()
}

/// What the truck needs to stop behind `n`, and what `n` needs behind the truck, are there.
fn has_room(ego: &Ego, n: &Neighbour) -> bool {
    let stop = |v: f64, w: f64| v + v * v / 6.0 - w * w / 16.0;
    let (v, w) = (ego.state.speed_m_s, n.speed_m_s);
    let (ahead, behind) =
        (n.rear_s_m - ego.state.s_m - FRONT_M, ego.state.s_m - REAR_M - n.front_s_m);
    ego.beside(n) || ahead >= stop(v, w) - 0.5 || behind >= stop(w, v) - 0.5
}

#[test]
fn at_a_start_nobody_is_closer_to_the_truck_than_both_can_stop_and_nobody_touches_it() {
    let road = Arc::new(builtin::flat(4000.0));
    for density in Density::ALL {
        for seed in 0..15 {
            let config = TrafficConfig::family(density, 15.0, seed);
            let mut traffic = NativeTraffic::new(road.clone(), truck(), config).unwrap();
            let mut ego = Ego::new(&road, 22.0);
            let mut now = Time(0);
            let scene = traffic.advance(now, &ego.state).unwrap();
            for n in &scene.neighbours {
                assert!(has_room(&ego, n), "{density:?} {seed}: {n:?}");
            }
            let touched = drive(&mut traffic, &mut ego, &mut now, 40.0);
            assert_eq!(touched, 0, "{density:?}, seed {seed}");
        }
    }
}

#[test]
fn after_a_takeover_everybody_is_where_they_were_and_nobody_touches_the_truck() {
    let road = Arc::new(builtin::flat(4000.0));
    for density in Density::ALL {
        for seed in 0..30u64 {
            let config = |seed| TrafficConfig::family(density, 15.0, seed);
            let mut first = NativeTraffic::new(road.clone(), truck(), config(seed)).unwrap();
            let (mut ego, mut now) = (Ego::new(&road, 15.0), Time(0));
            let until_s = 8.0 + 1.37 * seed as f64;
            assert_eq!(drive(&mut first, &mut ego, &mut now, until_s), 0, "{density:?} {seed}");
            let last = first.advance(now, &ego.state).unwrap().clone();
            // The other source falls silent: its next scene would have come 60 ms later.
            now = now.plus_nanos(60_000_000);
            ego.drive(&last, 0.06);
            let mut second = NativeTraffic::take_over(
                road.clone(),
                truck(),
                config(seed + 100),
                &last,
                &ego.state,
                now,
            )
            .unwrap();
            let scene = second.advance(now, &ego.state).unwrap().clone();
            for n in &scene.neighbours {
                match last.neighbours.iter().find(|was| was.id == n.id) {
                    Some(was) => {
                        let moved = n.front_s_m - was.front_s_m - 0.06 * was.speed_m_s;
                        let aside = n.d_m - was.d_m - 0.06 * was.lateral_speed_m_s;
                        assert!(moved.abs() < 0.1 && aside.abs() < 0.1, "{was:?} {n:?}");
                    }
                    None => assert!(has_room(&ego, n), "{density:?} {seed}: {n:?}"),
                }
            }
            let touched = drive(&mut second, &mut ego, &mut now, until_s + 40.0);
            assert_eq!(touched, 0, "{density:?}, seed {seed}");
        }
    }
}

#[test]
fn a_takeover_from_an_empty_road_leaves_the_truck_its_room() {
    let road = Arc::new(builtin::flat(4000.0));
    for seed in 0..30 {
        let config = TrafficConfig::family(Density::Dense, 15.0, seed);
        let (mut ego, mut now) = (Ego::new(&road, 22.0), Time(3_040_000_000));
        let empty = Scene { time: Time(3_000_000_000), ..Scene::default() };
        let mut traffic =
            NativeTraffic::take_over(road.clone(), truck(), config, &empty, &ego.state, now)
                .unwrap();
        for n in &traffic.advance(now, &ego.state).unwrap().neighbours {
            assert!(has_room(&ego, n), "seed {seed}: {n:?}");
        }
        assert_eq!(drive(&mut traffic, &mut ego, &mut now, 40.0), 0, "seed {seed}");
    }
}
