//! Small independent traffic for the safety campaigns: cars with the intelligent driver model on a
//! straight road, that change lanes on their own when it is safe for them, and sometimes brake hard
//! without reason. Vehicles that fall out of the window around the ego come back at its other end.
#![allow(dead_code, unreachable_pub)]

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use road::Road;
use tractrix_core::{EgoState, Neighbour, VehicleClass};

const WINDOW_M: f64 = 350.0;

#[derive(Debug, Clone)]
pub struct Car {
    pub body: Neighbour,
    wanted: f64,
    brake_left_s: f64,
    from_d: f64,
    changed_s: Option<f64>,
}

/// The ego as the cars see it.
#[derive(Debug, Clone, Copy)]
pub struct EgoBody {
    pub front_s_m: f64,
    pub rear_s_m: f64,
    pub d_m: f64,
    pub width_m: f64,
    pub speed_m_s: f64,
    pub target_d_m: f64,
}

pub struct Cars {
    pub cars: Vec<Car>,
    rng: ChaCha8Rng,
    lanes: Vec<f64>,
}

const CHANGE_S: f64 = 4.0;

impl Cars {
    pub fn new(seed: u64, road: &Road, ego: &EgoState, per_km_lane: f64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let lanes: Vec<f64> = road.lanes().iter().map(|l| l.center_d_m(0.0)).collect();
        let count = (per_km_lane * 2.0 * WINDOW_M / 1000.0).round() as usize;
        let mut cars = Vec::new();
        for (lane, &d) in lanes.iter().enumerate() {
            for i in 0..count {
                let spacing = 2.0 * WINDOW_M / count as f64;
                let s = ego.s_m - WINDOW_M + spacing * (i as f64 + 0.3 * rng.random::<f64>());
                if (s - ego.s_m).abs() < 60.0 {
                    continue;
                }
                let truck = rng.random::<f64>() < 0.15;
                let length = if truck { 16.0 } else { 4.5 };
                let wanted = if truck { 21.0 } else { rng.random_range(16.0..32.0) };
                cars.push(Car {
                    body: Neighbour {
                        id: (lane * 1000 + i) as u64,
                        class: if truck { VehicleClass::Truck } else { VehicleClass::Car },
                        front_s_m: s,
                        rear_s_m: s - length,
                        d_m: d,
                        width_m: if truck { 2.5 } else { 1.8 },
                        speed_m_s: 18.0,
                        lane: lane as u16,
                        ..Neighbour::default()
                    },
                    wanted,
                    brake_left_s: 0.0,
                    from_d: d,
                    changed_s: None,
                });
            }
        }
        Self { cars, rng, lanes }
    }

    pub fn neighbours(&self) -> Vec<Neighbour> {
        let mut list: Vec<_> = self.cars.iter().map(|c| c.body).collect();
        list.sort_by(|a, b| a.front_s_m.total_cmp(&b.front_s_m));
        list
    }

    /// Whether the ego's body, or where it is going, is in the lane at `d`.
    fn ego_in(ego: &EgoBody, d: f64) -> bool {
        (ego.d_m - d).abs() < 0.5 * (ego.width_m + 1.8) + 0.3 || (ego.target_d_m - d).abs() < 0.5
    }

    /// Nearest vehicle ahead of station `s` in the lane at `d`: (gap, speed).
    fn ahead(&self, me: usize, s: f64, d: f64, ego: &EgoBody) -> Option<(f64, f64)> {
        let mut best: Option<(f64, f64)> = None;
        let mut take = |rear: f64, front: f64, v: f64| {
            if front > s && best.is_none_or(|b| rear - s < b.0) {
                best = Some((rear - s, v));
            }
        };
        for (i, c) in self.cars.iter().enumerate() {
            let target = c.body.target_lane.map(|l| self.lanes[usize::from(l)]);
            if i != me && ((c.body.d_m - d).abs() < 2.2 || target.is_some_and(|t| t == d)) {
                take(c.body.rear_s_m, c.body.front_s_m, c.body.speed_m_s);
            }
        }
        if Self::ego_in(ego, d) {
            take(ego.rear_s_m, ego.front_s_m, ego.speed_m_s);
        }
        best
    }

    /// Nearest vehicle behind station `s` in the lane at `d`: (gap, speed).
    fn behind(&self, me: usize, s: f64, d: f64, ego: &EgoBody) -> Option<(f64, f64)> {
        let mut best: Option<(f64, f64)> = None;
        let mut take = |front: f64, v: f64, rear: f64| {
            if rear < s && best.is_none_or(|b| s - front < b.0) {
                best = Some((s - front, v));
            }
        };
        for (i, c) in self.cars.iter().enumerate() {
            let target = c.body.target_lane.map(|l| self.lanes[usize::from(l)]);
            if i != me && ((c.body.d_m - d).abs() < 2.2 || target.is_some_and(|t| t == d)) {
                take(c.body.front_s_m, c.body.speed_m_s, c.body.rear_s_m);
            }
        }
        if Self::ego_in(ego, d) {
            take(ego.front_s_m, ego.speed_m_s, ego.rear_s_m);
        }
        best
    }

    fn idm(v: f64, wanted: f64, ahead: Option<(f64, f64)>) -> f64 {
        let (a, b) = (1.4, 2.0);
        let free = 1.0 - (v / wanted).powi(4);
        let pull = ahead.map_or(0.0, |(gap, v_a)| {
            let s = 2.0 + (v * 1.2 + v * (v - v_a) / (2.0 * f64::sqrt(a * b))).max(0.0);
            (s / gap.max(0.2)).powi(2)
        });
        (a * (free - pull)).max(-8.0)
    }

    pub fn step(&mut self, dt: f64, ego: &EgoBody) {
        for i in 0..self.cars.len() {
            let body = self.cars[i].body;
            let lane_d = self.lanes[usize::from(body.target_lane.unwrap_or(body.lane))];
            let mut a = Self::idm(
                body.speed_m_s,
                self.cars[i].wanted,
                self.ahead(i, body.front_s_m, lane_d, ego),
            );
            if body.target_lane.is_some() {
                let own = self.lanes[usize::from(body.lane)];
                a = a.min(Self::idm(
                    body.speed_m_s,
                    self.cars[i].wanted,
                    self.ahead(i, body.front_s_m, own, ego),
                ));
            }
            if self.rng.random::<f64>() < 0.002 * dt {
                self.cars[i].brake_left_s = self.rng.random_range(0.5..3.0);
            }
            if self.cars[i].brake_left_s > 0.0 {
                self.cars[i].brake_left_s -= dt;
                a = a.min(-7.0);
            }
            if body.target_lane.is_none() && self.rng.random::<f64>() < 0.03 * dt {
                self.maybe_change(i, ego);
            }
            let car = &mut self.cars[i];
            car.body.accel_m_s2 = a;
            let v = (car.body.speed_m_s + a * dt).max(0.0);
            let moved = 0.5 * (v + car.body.speed_m_s) * dt;
            car.body.speed_m_s = v;
            car.body.front_s_m += moved;
            car.body.rear_s_m += moved;
            if let (Some(t), Some(target)) = (car.changed_s, car.body.target_lane) {
                let t = t + dt;
                let to = self.lanes[usize::from(target)];
                let u = (t / CHANGE_S).min(1.0);
                let old = car.body.d_m;
                let shape = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
                car.body.d_m = car.from_d + (to - car.from_d) * shape;
                car.body.lateral_speed_m_s = (car.body.d_m - old) / dt;
                car.changed_s = Some(t);
                if u >= 1.0 {
                    car.body.lane = target;
                    car.body.target_lane = None;
                    car.body.lateral_speed_m_s = 0.0;
                    car.changed_s = None;
                }
            }
        }
        self.recycle(ego);
    }

    /// A lane change of a careful driver: room ahead, and nobody behind has to brake harder than
    /// 2 m/s².
    fn maybe_change(&mut self, i: usize, ego: &EgoBody) {
        let body = self.cars[i].body;
        let side: i32 = if self.rng.random::<bool>() { 1 } else { -1 };
        let target = i32::from(body.lane) + side;
        if target < 0 || target as usize >= self.lanes.len() {
            return;
        }
        let d = self.lanes[target as usize];
        let front = self.ahead(i, body.front_s_m, d, ego);
        let rear = self.behind(i, body.rear_s_m, d, ego);
        let front_ok = front.is_none_or(|f| {
            f.0 > 2.0 && Self::idm(body.speed_m_s, self.cars[i].wanted, Some(f)) > -2.0
        });
        let rear_ok = rear.is_none_or(|(gap, v)| {
            gap > 4.0 && Self::idm(v, v.max(15.0), Some((gap, body.speed_m_s))) > -2.0
        });
        if front_ok && rear_ok {
            let car = &mut self.cars[i];
            car.body.target_lane = Some(target as u16);
            car.from_d = body.d_m;
            car.changed_s = Some(0.0);
        }
    }

    /// Moves vehicles that left the window to its other end, where there is room.
    fn recycle(&mut self, ego: &EgoBody) {
        let middle = ego.front_s_m;
        for i in 0..self.cars.len() {
            let b = self.cars[i].body;
            let off = b.front_s_m - middle;
            if off.abs() <= WINDOW_M || b.target_lane.is_some() {
                continue;
            }
            let s = middle - off.signum() * (WINDOW_M - 5.0);
            let length = b.length_m();
            let lane = b.lane;
            let room = self.cars.iter().enumerate().all(|(j, c)| {
                j == i
                    || (c.body.lane != lane && c.body.target_lane != Some(lane))
                    || c.body.rear_s_m - s > 40.0
                    || s - length - c.body.front_s_m > 40.0
            });
            if room {
                let car = &mut self.cars[i];
                car.body.front_s_m = s;
                car.body.rear_s_m = s - length;
                let wanted = if off > 0.0 { 28.0 } else { 17.0 };
                if car.body.class == VehicleClass::Car {
                    car.wanted = wanted + self.rng.random_range(-3.0..3.0);
                }
                let v: f64 = if off > 0.0 { ego.speed_m_s + 3.0 } else { ego.speed_m_s - 3.0 };
                car.body.speed_m_s = v.max(5.0).min(car.wanted);
            }
        }
    }
}
