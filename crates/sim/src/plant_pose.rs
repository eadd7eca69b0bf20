//! The simulated truck's pose for a truck that is driven over its bus: truth, or satellites.

use std::collections::VecDeque;
use std::convert::Infallible;

use tractrix_core::{EgoState, Pose, PoseSource, Stamped, Time};

/// How well the pose is measured. The default is the truth at once.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PoseNoise {
    /// Standard deviation of x and of y, m.
    pub position_m: f64,
    /// Standard deviation of the heading, rad.
    pub yaw_rad: f64,
    /// Time over which an error persists, s (it decays to 1/e); 0: every measurement has its own.
    pub persists_s: f64,
    /// Time between measurements, s; 0: one for every state of the plant.
    pub period_s: f64,
    /// Age of a measurement when it arrives, s, up to a second.
    pub latency_s: f64,
}

/// Measurements that may be under way at once.
const UNDER_WAY: usize = 1024;

/// Measures the plant's pose with stated noise, rate and latency; same seed, same bits.
#[derive(Debug, Clone)]
pub struct PlantPose {
    noise: PoseNoise,
    seed: u64,
    taken: u64,
    /// Present errors of x, y (m) and heading (rad).
    error: [f64; 3],
    last_taken: Option<Time>,
    under_way: VecDeque<Stamped<Pose>>,
    arrived: Stamped<Pose>,
}

impl PlantPose {
    /// A source that starts at a known state.
    #[must_use]
    pub fn new(noise: PoseNoise, seed: u64, start: &Stamped<EgoState>) -> Self {
        let arrived = Stamped { time: start.time, value: pose_of(&start.value) };
        let under_way = VecDeque::new();
        Self { noise, seed, taken: 0, error: [0.0; 3], last_taken: None, under_way, arrived }
    }

    /// Takes the plant's true state.
    pub fn feed(&mut self, truth: &Stamped<EgoState>) {
        let since_s = self.last_taken.map(|last| truth.time.seconds_since(last));
        // Half a nanosecond of slack: periods are rarely whole nanoseconds
        if since_s.is_some_and(|since_s| since_s + 0.5e-9 < self.noise.period_s) {
            return;
        }
        self.last_taken = Some(truth.time);
        let mut pose = pose_of(&truth.value);
        self.draw(since_s.unwrap_or(f64::INFINITY));
        let [x_m, y_m, yaw_rad] = self.error;
        pose.x_m += x_m;
        pose.y_m += y_m;
        pose.yaw_rad += yaw_rad;
        // The road's axes at the truck: s and d err with x and y
        let (sin, cos) = libm::sincos(truth.value.yaw_rad);
        pose.s_m += cos * x_m + sin * y_m;
        pose.d_m += cos * y_m - sin * x_m;
        if self.under_way.len() == UNDER_WAY {
            self.under_way.pop_front();
        }
        self.under_way.push_back(Stamped { time: truth.time, value: pose });
    }

    /// The next error of a first-order Gauss-Markov process.
    fn draw(&mut self, since_s: f64) {
        let n = &self.noise;
        let keep = if n.persists_s > 0.0 { libm::exp(-since_s / n.persists_s) } else { 0.0 };
        let fresh = (1.0 - keep * keep).sqrt();
        for (i, sd) in [n.position_m, n.position_m, n.yaw_rad].into_iter().enumerate() {
            let normal = normal(self.seed, 3 * self.taken + i as u64);
            self.error[i] = keep * self.error[i] + fresh * sd * normal;
        }
        self.taken += 1;
    }
}

impl PoseSource for PlantPose {
    type Error = Infallible;

    fn pose(&mut self, now: Time) -> Result<Stamped<Pose>, Infallible> {
        while let Some(next) = self.under_way.front() {
            if now.seconds_since(next.time) + 0.5e-9 < self.noise.latency_s {
                break;
            }
            self.arrived = *next;
            self.under_way.pop_front();
        }
        Ok(self.arrived)
    }
}

/// The pose that an ego state holds.
#[must_use]
pub fn pose_of(ego: &EgoState) -> Pose {
    Pose {
        x_m: ego.x_m,
        y_m: ego.y_m,
        z_m: ego.z_m,
        yaw_rad: ego.yaw_rad,
        s_m: ego.s_m,
        d_m: ego.d_m,
        lateral_speed_m_s: ego.lateral_speed_m_s,
        articulation_rad: ego.trailer.articulation_rad,
        trailer_yaw_rate_rad_s: ego.trailer.yaw_rate_rad_s,
    }
}

/// A draw of the standard normal distribution that depends on seed and index alone (Box and Muller,
/// Ann. Math. Statist. 29, 1958).
fn normal(seed: u64, index: u64) -> f64 {
    let uniform = |n: u64| ((split_mix(seed ^ split_mix(n)) >> 11) as f64 + 0.5) * 2f64.powi(-53);
    let (u, v) = (uniform(2 * index), uniform(2 * index + 1));
    (-2.0 * libm::log(u)).sqrt() * libm::cos(2.0 * std::f64::consts::PI * v)
}

/// SplitMix64: Steele, Lea, Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014.
fn split_mix(x: u64) -> u64 {
    let z = x.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}
