//! Eq. 1 of the paper, corrected: tractor and trailer that roll without side slip.
//!
//! | symbol | meaning |
//! |---|---|
//! | v | speed of the reference point along the tractor's x axis, m/s |
//! | delta | road-wheel angle, rad (phi in the paper) |
//! | psi | articulation, trailer heading minus tractor heading, rad |
//! | L | effective wheelbase, m; L_1 hitch behind the slip-free point, m (negative ahead); L_2 hitch to the trailer's slip-free point, m |
//!
//! ```text
//! omega_c = v tan(delta) / L
//! omega_t = -(v sin(psi) + L_1 omega_c cos(psi)) / L_2
//! ```
//! which is the paper's psi' = omega_t - omega_c. The paper's text swaps the names of L_1 and L_2
//! and does not say that v belongs to the rear-axle centre.
//!
//! An axle group cannot roll without scrub in a turn. Its slip-free point follows from force and
//! moment balance of the tyres at walking speed: `L_2 = S_2 / S_1` (sums of `l_j C_j` and
//! `l_j² C_j`), and for the tractor a 2x2 balance that includes the trailer group's scrub through
//! the hitch. These lengths make the kinematic model the exact low-speed, small-angle limit of the
//! 4-state model's steady turn.

use super::yaw_sideslip::YawSideslip;

/// Lengths of the slip-free kinematic train.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EffectiveLengths {
    /// Effective wheelbase L, m: road-wheel angle over path curvature.
    pub wheelbase_m: f64,
    /// Effective hitch to trailer axle L_2, m.
    pub trailer_m: f64,
    /// Lateral speed of the reference point per yaw rate, m: the slip-free point of the tractor lies
    /// this far behind the reference point.
    pub sideslip_m: f64,
}

/// The kinematic model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kinematic {
    /// Effective lengths.
    pub lengths: EffectiveLengths,
    /// Hitch ahead of the reference point, m.
    pub hitch_ahead_m: f64,
}

/// Velocities that the kinematic model gives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct KinematicVelocity {
    /// Lateral speed of the reference point, m/s.
    pub(super) lateral_speed_m_s: f64,
    pub(super) yaw_rate_rad_s: f64,
    pub(super) trailer_yaw_rate_rad_s: f64,
}

impl Kinematic {
    /// The low-speed limit of a yaw-sideslip model.
    #[must_use]
    pub fn from_yaw_sideslip(m: &YawSideslip) -> Self {
        let [c1, ..] = m.stiffness_n_rad;
        let (x, c) = (&m.axle_position_m, &m.stiffness_n_rad);
        let geometric = x[4];
        let (s0, s1, s2) = m.trailer_moments();
        let trailer_m = if s1 > 0.0 { s2 / s1 } else { geometric };
        // Side force of the trailer group's scrub on the hitch, per curvature.
        let scrub = s0 * trailer_m - s1;
        let c2 = c[1] + c[2];
        let z1 = x[0] * c1 + x[1] * c[1] + x[2] * c[2];
        let z2 = x[0] * x[0] * c1 + x[1] * x[1] * c[1] + x[2] * x[2] * c[2];
        // [c1 + c2, z1 + scrub; z1, z2 - L_h scrub] [beta; kappa] = [c1; x0 c1] delta
        let (a, b) = (c1 + c2, z1 + scrub);
        let (p, q) = (z1, z2 - m.hitch_behind_cg_m * scrub);
        let beta = c1 * (q - x[0] * b);
        let kappa = c1 * (x[0] * a - p);
        let rear = m.drive_group_behind_cg_m;
        let (wheelbase_m, sideslip_m) = if kappa > 0.0 {
            ((a * q - b * p) / kappa, beta / kappa - rear)
        } else {
            (x[0] + rear, 0.0)
        };
        Self {
            lengths: EffectiveLengths { wheelbase_m, trailer_m, sideslip_m },
            hitch_ahead_m: rear - m.hitch_behind_cg_m,
        }
    }

    /// Velocities at speed `v`, m/s, road-wheel angle and articulation, rad.
    #[inline]
    pub(super) fn velocity(&self, v: f64, delta: f64, psi: f64) -> KinematicVelocity {
        let l = &self.lengths;
        let (sin, cos) = libm::sincos(psi);
        let yaw_rate = v * libm::tan(delta) / l.wheelbase_m;
        let hitch_lateral = (l.sideslip_m + self.hitch_ahead_m) * yaw_rate;
        KinematicVelocity {
            lateral_speed_m_s: l.sideslip_m * yaw_rate,
            yaw_rate_rad_s: yaw_rate,
            trailer_yaw_rate_rad_s: (hitch_lateral * cos - v * sin) / l.trailer_m,
        }
    }

    /// Yaw rate of tractor and trailer, rad/s (Eq. 1): speed, m/s; road-wheel angle and
    /// articulation, rad.
    #[must_use]
    pub fn yaw_rates_rad_s(
        &self,
        speed_m_s: f64,
        road_wheel_rad: f64,
        articulation_rad: f64,
    ) -> (f64, f64) {
        let u = self.velocity(speed_m_s, road_wheel_rad, articulation_rad);
        (u.yaw_rate_rad_s, u.trailer_yaw_rate_rad_s)
    }

    /// Articulation of a steady turn with this road-wheel angle, rad; `None` when the trailer is too
    /// long for the turn and folds: `sin(psi + chi) = -L_2 / sqrt(R² + L_1²)`, `tan(chi) = L_1 / R`.
    #[must_use]
    pub fn steady_articulation_rad(&self, road_wheel_rad: f64) -> Option<f64> {
        let l = &self.lengths;
        let l1 = -(l.sideslip_m + self.hitch_ahead_m);
        let curvature = libm::tan(road_wheel_rad) / l.wheelbase_m;
        let sin = -l.trailer_m * curvature / libm::sqrt(1.0 + l1 * l1 * curvature * curvature);
        (sin.abs() <= 1.0).then(|| libm::asin(sin) - libm::atan(l1 * curvature))
    }
}
