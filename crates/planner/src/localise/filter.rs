//! Where the truck is, by dead reckoning and fixes: an extended Kalman filter over x, y, heading and
//! the bias of the yaw rate sensor.

use nalgebra::{Matrix2, Matrix2x4, Matrix4, RowVector4, Vector2, Vector4};

use super::LocaliserConfig;

/// State and covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Filter {
    /// x, m; y, m; heading, rad; bias of the yaw rate, rad/s.
    pub state: Vector4<f64>,
    pub covariance: Matrix4<f64>,
}

impl Filter {
    /// A start with standard deviations of position, m, and heading, rad.
    pub(super) fn new(pose: [f64; 3], position_m: f64, yaw_rad: f64, bias_rad_s: f64) -> Self {
        let [x_m, y_m, heading] = pose;
        let sd = Vector4::new(position_m, position_m, yaw_rad, bias_rad_s);
        Self {
            state: Vector4::new(x_m, y_m, heading, 0.0),
            covariance: Matrix4::from_diagonal(&sd.component_mul(&sd)),
        }
    }

    /// Moves on for a time, s, with a body velocity, m/s, and a measured yaw rate, rad/s.
    pub(super) fn predict(
        &mut self,
        dt_s: f64,
        velocity_m_s: [f64; 2],
        yaw_rate_rad_s: f64,
        config: &LocaliserConfig,
    ) {
        let [forward, left] = velocity_m_s;
        let turn = (yaw_rate_rad_s - self.state[3]) * dt_s;
        let (sin, cos) = libm::sincos(self.state[2] + 0.5 * turn);
        let step = [(forward * cos - left * sin) * dt_s, (forward * sin + left * cos) * dt_s];
        self.state += Vector4::new(step[0], step[1], turn, 0.0);
        let mut f = Matrix4::identity();
        f[(0, 2)] = -step[1];
        f[(1, 2)] = step[0];
        f[(2, 3)] = -dt_s;
        self.covariance = f * self.covariance * f.transpose();
        let drift = |sd: f64| sd * sd * dt_s;
        let position = drift(config.position_drift_m) * (forward / 20.0).abs().min(2.0);
        for (i, noise) in
            [position, position, drift(config.yaw_drift_rad), drift(config.bias_drift_rad_s)]
                .into_iter()
                .enumerate()
        {
            self.covariance[(i, i)] += noise;
        }
    }

    /// Takes a position, m, of a point `lever_m` ahead of and to the left of the reference point;
    /// false if it lies too far off to be believed.
    pub(super) fn take_position(
        &mut self,
        position_m: [f64; 2],
        lever_m: [f64; 2],
        sd_m: f64,
        gate_sd: f64,
    ) -> bool {
        let (sin, cos) = libm::sincos(self.state[2]);
        let [ahead, left] = lever_m;
        let lever = Vector2::new(ahead * cos - left * sin, ahead * sin + left * cos);
        let expected = Vector2::new(self.state[0], self.state[1]) + lever;
        let innovation = Vector2::new(position_m[0], position_m[1]) - expected;
        let h = Matrix2x4::new(1.0, 0.0, -lever.y, 0.0, 0.0, 1.0, lever.x, 0.0);
        let s = h * self.covariance * h.transpose() + Matrix2::identity() * (sd_m * sd_m);
        let Some(inverse) = s.try_inverse() else { return false };
        if !((innovation.transpose() * inverse * innovation)[0] <= gate_sd * gate_sd) {
            return false;
        }
        let gain = self.covariance * h.transpose() * inverse;
        self.state += gain * innovation;
        self.shrink(gain * h);
        true
    }

    /// Takes a heading, rad; false if it lies too far off to be believed.
    pub(super) fn take_heading(&mut self, heading_rad: f64, sd_rad: f64, gate_sd: f64) -> bool {
        let innovation = crate::wrapped(heading_rad - self.state[2]);
        let h = RowVector4::new(0.0, 0.0, 1.0, 0.0);
        let s = self.covariance[(2, 2)] + sd_rad * sd_rad;
        if !(innovation * innovation <= gate_sd * gate_sd * s) {
            return false;
        }
        let gain = self.covariance * h.transpose() / s;
        self.state += gain * innovation;
        self.shrink(gain * h);
        true
    }

    fn shrink(&mut self, gain_h: Matrix4<f64>) {
        let p = (Matrix4::identity() - gain_h) * self.covariance;
        self.covariance = (p + p.transpose()) * 0.5;
    }

    /// Standard deviations of the position (of its worse axis), m, and of the heading, rad.
    pub(super) fn deviation(&self) -> [f64; 2] {
        let sd = |i: usize| libm::sqrt(self.covariance[(i, i)].max(0.0));
        [sd(0).max(sd(1)), sd(2)]
    }
}
