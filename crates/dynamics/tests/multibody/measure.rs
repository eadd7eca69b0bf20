//! Accuracy as the results state it, and runs of model and reference side by side.

use super::{Action, MultiBody};
use dynamics::lateral::{LateralInputs, LateralModel, LateralState};

/// `1 - mean|sim - ref| / mean|ref|`.
pub(crate) fn accuracy(sim: &[f64], reference: &[f64]) -> f64 {
    let error: f64 = sim.iter().zip(reference).map(|(a, b)| (a - b).abs()).sum();
    let size: f64 = reference.iter().map(|b| b.abs()).sum();
    1.0 - error / size
}

/// Signals of one run, one value per sample.
#[derive(Default)]
pub(crate) struct Trace {
    pub(crate) yaw_rate: Vec<f64>,
    pub(crate) trailer_yaw_rate: Vec<f64>,
    pub(crate) lateral_position: Vec<f64>,
    pub(crate) hitch_angle: Vec<f64>,
}

impl Trace {
    /// Accuracy of the four signals of the paper's Fig. 10.
    pub(crate) fn accuracies(&self, reference: &Self) -> [f64; 4] {
        [
            accuracy(&self.yaw_rate, &reference.yaw_rate),
            accuracy(&self.trailer_yaw_rate, &reference.trailer_yaw_rate),
            accuracy(&self.lateral_position, &reference.lateral_position),
            accuracy(&self.hitch_angle, &reference.hitch_angle),
        ]
    }
}

/// Drives model and reference with the same hand wheel at constant speed; the model steps by
/// `dt`, the reference by a fifth of it; samples every step of the model.
pub(crate) fn side_by_side(
    model: &LateralModel,
    reference: &MultiBody,
    v: f64,
    duration: f64,
    dt: f64,
    wheel: impl Fn(f64) -> f64,
) -> (Trace, Trace) {
    const FINE: usize = 5;
    let (mut sim, mut truth) = (Trace::default(), Trace::default());
    let mut s = LateralState::default();
    let mut q = reference.start(v, [0.0; 4]);
    let mut steering = s.steering;
    let h = dt / FINE as f64;
    for k in 0..(duration / dt).round() as usize {
        let demand = wheel(k as f64 * dt);
        let inputs =
            LateralInputs { speed_m_s: v, steering_wheel_rad: demand, ..Default::default() };
        s = model.step(&s, &inputs, dt);
        for _ in 0..FINE {
            let at = |t: f64| Action {
                delta: model.steering().step(&steering, demand, t).road_wheel_rad,
                accel: Some(0.0),
                ..Default::default()
            };
            q = reference.step(&q, [&at(0.0), &at(0.5 * h), &at(h)], h);
            steering = model.steering().step(&steering, demand, h);
        }
        sim.yaw_rate.push(s.yaw_rate_rad_s);
        sim.trailer_yaw_rate.push(s.trailer_yaw_rate_rad_s);
        sim.lateral_position.push(s.y_m);
        sim.hitch_angle.push(s.articulation_rad);
        truth.yaw_rate.push(q[8]);
        truth.trailer_yaw_rate.push(q[11]);
        truth.lateral_position.push(reference.reference_point(&q)[1]);
        truth.hitch_angle.push(q[5] - q[2]);
    }
    (sim, truth)
}
