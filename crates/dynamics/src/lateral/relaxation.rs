//! Side force that builds up over a rolled distance.
//!
//! ```text
//! sigma d(alpha')/dt = v (alpha - alpha')          F_j = F(alpha'_j)
//! ```
//! alpha is the slip angle of the wheel, alpha' the one that the tyre's deflection has reached, sigma the
//! relaxation length: cornering stiffness over the side stiffness of the standing tyre (Pacejka, Tire and
//! Vehicle Dynamics, 3rd ed., 7.2.1, the single-point contact model). The law takes alpha', so that a
//! side force never exceeds the friction limit.
//!
//! In the ROS2 step alpha' is one more state per axle and eliminated like the articulation: with
//! `q = c v / sigma`, `k' = (v / sigma (alpha - alpha') + q S k) / (1 + q)`, S the derivative of the slip
//! angles by the state. What is left of the tyres in the matrix is `q / (1 + q)`: all of them without a
//! relaxation length, so that no length, speed or step makes the step unstable.
//!
//! Left out: a length that grows with load and shrinks with slip, the contact patch's own lag.

use super::AXLES;
use super::rosenbrock::ROS2;
use super::yaw_sideslip::{Force3, YawSideslip};

/// The tyres' lag in one step.
#[derive(Clone, Copy)]
pub(super) struct Relaxation {
    /// Speed over relaxation length, 1/s.
    rate_1_s: f64,
    /// `q / (1 + q)`.
    pub(super) tyre_frac: f64,
    /// `1 / (1 + q)`.
    left_frac: f64,
    /// The method's `c`, s.
    c_s: f64,
}

impl Relaxation {
    /// At speed `v` > 0, m/s, over a step of `dt_s`; `None` where the tyres follow at once.
    #[inline]
    pub(super) fn new(m: &YawSideslip, v: f64, dt_s: f64) -> Option<Self> {
        (m.relaxation_length_m > 0.0).then(|| {
            let (rate_1_s, c_s) = (v / m.relaxation_length_m, ROS2 * dt_s);
            let left_frac = 1.0 / (1.0 + c_s * rate_1_s);
            Self { rate_1_s, tyre_frac: c_s * rate_1_s * left_frac, left_frac, c_s }
        })
    }

    /// What the tyres do by themselves in a stage, rad/s: from wheels' and tyres' slip angles, less
    /// what the second stage takes off.
    #[inline]
    pub(super) fn own(
        &self,
        wheels: &[f64; AXLES],
        tyres: &[f64; AXLES],
        less: &[f64; AXLES],
    ) -> [f64; AXLES] {
        core::array::from_fn(|j| {
            (self.rate_1_s * (wheels[j] - tyres[j]) - less[j]) * self.left_frac
        })
    }

    /// Generalised forces that come of it within the stage.
    #[inline]
    pub(super) fn force(&self, m: &YawSideslip, own: &[f64; AXLES]) -> Force3 {
        m.of_axles(&core::array::from_fn(|j| self.c_s * m.stiffness_n_rad[j] * own[j]))
    }

    /// Rate of the tyres' slip angles with the state's rate `k`, rad/s.
    #[inline]
    pub(super) fn rate(
        &self,
        m: &YawSideslip,
        v: f64,
        k: &[f64; 4],
        own: &[f64; AXLES],
    ) -> [f64; AXLES] {
        let moved = m.slip_rad(v, k, 0.0);
        core::array::from_fn(|j| own[j] + self.tyre_frac * moved[j])
    }
}
