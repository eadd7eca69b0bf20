//! Side force of an axle over its slip angle.
//!
//! | symbol | meaning |
//! |---|---|
//! | C | cornering stiffness of an axle, N/rad, all its tyres |
//! | F_z | vertical load of the axle, N; F_z,tyre per tyre |
//! | alpha | slip angle, rad, positive when it gives a force to the left |
//! | mu | friction coefficient |
//!
//! `C = c F_z (1 - k (F_z,tyre / F_rated - 1))`: stiffness grows less than load. Saturation:
//!
//! ```text
//! F = F_max z (15 - 10 z² + 3 z⁴) / 8,   z = 8 C alpha / (15 F_max) limited to -1..1,   F_max = mu F_z
//! ```
//! the odd polynomial that starts with slope C, reaches F_max with slope and curvature zero and meets the tyre table of the
//! paper's released truck (34.3 kN: 6269, 12192, 21948 N at 1, 2, 4 degrees) within 0.5 %; the
//! brush model is 15 % low there. Under a longitudinal force the side force that is left follows
//! the friction ellipse.
//!
//! A rolling tyre builds its side force up over a distance, the relaxation length: a slip angle of its
//! own follows the axle's (`relaxation`), and the law takes that one.
//!
//! Left out: camber, aligning moment, speed-dependent friction, a relaxation length that changes with
//! load or slip.

use serde::{Deserialize, Serialize};

use super::AXLES;

/// Tyres of all axles.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TyreParameters {
    /// Cornering stiffness per load at the rated load, 1/rad.
    pub cornering_coeff_per_rad: f64,
    /// Relative loss of that coefficient per relative load above the rated one.
    pub load_degression_frac: f64,
    /// Rated load of one tyre, N.
    pub rated_load_n: f64,
    /// Tyres on the steer axle, on each drive axle, on each trailer axle.
    pub tyres_per_axle: [f64; 3],
    /// Factor on the cornering stiffness of the steer axle, each drive axle, each trailer axle.
    pub stiffness_scale: [f64; 3],
    /// Measured cornering stiffness per axle, N/rad, instead of the load formula.
    #[serde(default)]
    pub axle_stiffness_n_rad: Option<[f64; AXLES]>,
    /// Distance rolled until side force has made 63 % of its way to what the slip angle asks for, m;
    /// 0: it follows at once. Heavy-truck tyres have 0.3 to 1 m.
    #[serde(default)]
    pub relaxation_length_m: f64,
    /// Linear or saturating.
    pub law: TyreLaw,
}

/// How side force grows with slip angle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum TyreLaw {
    /// `F = C alpha`, without bound (the paper's model).
    Linear,
    /// Side force up to `friction_coeff` times load, less under longitudinal force.
    Saturating {
        /// Friction coefficient mu of the road.
        friction_coeff: f64,
    },
}

/// Axles of the groups: steer, drive, trailer.
pub const GROUP_AXLES: [core::ops::Range<usize>; 3] = [0..1, 1..3, 3..6];

/// Group of an axle: 0 steer, 1 drive, 2 trailer.
pub(super) const GROUP: [usize; AXLES] = [0, 1, 1, 2, 2, 2];

impl TyreParameters {
    pub(super) fn check(&self, check: &mut impl FnMut(&str, f64, f64, f64)) {
        check("tyres.cornering_coeff_per_rad", self.cornering_coeff_per_rad, 0.0, 50.0);
        check("tyres.load_degression_frac", self.load_degression_frac, 0.0, 0.9);
        check("tyres.relaxation_length_m", self.relaxation_length_m, 0.0, 5.0);
        check("tyres.rated_load_n", self.rated_load_n, 1e3, 1e5);
        for n in self.tyres_per_axle {
            check("tyres.tyres_per_axle", n, 1.0, 8.0);
        }
        for k in self.stiffness_scale {
            check("tyres.stiffness_scale", k, 0.0, 10.0);
        }
        for c in self.axle_stiffness_n_rad.into_iter().flatten() {
            check("tyres.axle_stiffness_n_rad", c, 0.0, 1e8);
        }
        if let TyreLaw::Saturating { friction_coeff } = self.law {
            check("tyres.law.saturating.friction_coeff", friction_coeff, 0.01, 2.0);
        }
    }

    /// Cornering stiffness per axle, N/rad, for these axle loads.
    #[must_use]
    pub fn stiffness_n_rad(&self, axle_load_n: &[f64; AXLES]) -> [f64; AXLES] {
        core::array::from_fn(|axle| {
            let group = GROUP[axle];
            let stiffness = match self.axle_stiffness_n_rad {
                Some(measured) => measured[axle],
                None => {
                    let load = axle_load_n[axle];
                    let tyre = load / self.tyres_per_axle[group];
                    let factor = 1.0 - self.load_degression_frac * (tyre / self.rated_load_n - 1.0);
                    self.cornering_coeff_per_rad * load * factor.max(0.1)
                }
            };
            stiffness * self.stiffness_scale[group]
        })
    }
}

/// The tyres of one axle under one vertical and longitudinal load.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoadedAxle {
    stiffness_n_rad: f64,
    /// Largest side force, N; infinite for the linear law.
    limit_n: f64,
    /// `z / alpha`, 1/rad.
    steepness_per_rad: f64,
}

impl TyreLaw {
    /// Part of the side force that a longitudinal force, N, leaves of an axle's under this load, N: the
    /// friction ellipse; 1 for the linear law.
    #[inline]
    #[must_use]
    pub fn left_frac(self, load_n: f64, longitudinal_force_n: f64) -> f64 {
        match self {
            Self::Linear => 1.0,
            Self::Saturating { friction_coeff } => {
                let used =
                    (longitudinal_force_n / limit_n(friction_coeff, load_n)).clamp(-0.99, 0.99);
                libm::sqrt(1.0 - used * used)
            }
        }
    }

    /// The axle under load: cornering stiffness, N/rad; vertical load, N; longitudinal force, N.
    #[inline]
    #[must_use]
    pub fn under_load(
        self,
        stiffness_n_rad: f64,
        load_n: f64,
        longitudinal_force_n: f64,
    ) -> LoadedAxle {
        match self {
            Self::Linear => {
                LoadedAxle { stiffness_n_rad, limit_n: f64::INFINITY, steepness_per_rad: 0.0 }
            }
            Self::Saturating { friction_coeff } => {
                let limit = limit_n(friction_coeff, load_n);
                let left = self.left_frac(load_n, longitudinal_force_n);
                LoadedAxle {
                    stiffness_n_rad: stiffness_n_rad * left,
                    limit_n: limit * left,
                    steepness_per_rad: 8.0 / 15.0 * stiffness_n_rad / limit,
                }
            }
        }
    }
}

impl LoadedAxle {
    /// Side force, N, at this slip angle, rad.
    #[inline]
    #[must_use]
    pub fn side_force_n(&self, slip_rad: f64) -> f64 {
        if self.steepness_per_rad == 0.0 {
            return self.stiffness_n_rad * slip_rad;
        }
        let z = (self.steepness_per_rad * slip_rad).clamp(-1.0, 1.0);
        self.limit_n * z * polynomial(z)
    }

    /// Side force over that of the stiffness alone at this slip angle, rad, up to the friction limit.
    #[inline]
    #[must_use]
    pub fn kept_frac(&self, slip_rad: f64) -> f64 {
        polynomial((self.steepness_per_rad * slip_rad).clamp(-1.0, 1.0)) / SLOPE
    }
}

/// Largest force of an axle in any direction, N.
#[inline]
fn limit_n(friction_coeff: f64, load_n: f64) -> f64 {
    friction_coeff * load_n.max(1.0)
}

/// Slope of the side force at no slip, in `z` and parts of the largest force.
const SLOPE: f64 = 1.875;

/// `(15 - 10 z² + 3 z⁴) / 8`.
#[inline]
fn polynomial(z: f64) -> f64 {
    let z2 = z * z;
    SLOPE - 1.25 * z2 + 0.375 * z2 * z2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_saturating_law_meets_the_published_tyre_table() {
        let law = TyreLaw::Saturating { friction_coeff: 0.85 };
        for (slip_deg, force) in [(1.0_f64, 6269.0), (2.0, 12_192.0), (4.0, 21_948.0)] {
            let f = law.under_load(362e3, 34_300.0, 0.0).side_force_n(slip_deg.to_radians());
            assert!((f / force - 1.0).abs() < 5e-3, "{slip_deg} degrees: {f} N");
        }
    }

    #[test]
    fn side_force_starts_with_the_cornering_stiffness_and_ends_at_the_friction_limit() {
        let law = TyreLaw::Saturating { friction_coeff: 0.8 };
        let slope = law.under_load(4e5, 6e4, 0.0).side_force_n(1e-6) / 1e-6;
        assert!((slope / 4e5 - 1.0).abs() < 1e-5);
        assert!((law.under_load(4e5, 6e4, 0.0).side_force_n(1.0) - 0.8 * 6e4).abs() < 1e-9);
        assert_eq!(
            law.under_load(4e5, 6e4, 0.0).side_force_n(-0.05),
            -law.under_load(4e5, 6e4, 0.0).side_force_n(0.05)
        );
    }

    #[test]
    fn what_is_kept_of_the_stiffness_is_the_secant_of_the_side_force() {
        let law = TyreLaw::Saturating { friction_coeff: 0.8 };
        let axle = law.under_load(4e5, 6e4, 2e4);
        for slip in [-0.08, 0.02, 0.05] {
            let secant = axle.side_force_n(slip) / (4e5 * slip);
            let kept = law.left_frac(6e4, 2e4) * axle.kept_frac(slip);
            assert!((secant - kept).abs() < 1e-12, "{secant} {kept}");
        }
        assert_eq!(TyreLaw::Linear.under_load(4e5, 6e4, 2e4).kept_frac(0.1), 1.0);
        assert_eq!(TyreLaw::Linear.left_frac(6e4, 2e4), 1.0);
    }

    #[test]
    fn braking_takes_side_force_along_the_friction_ellipse() {
        let law = TyreLaw::Saturating { friction_coeff: 0.5 };
        let (fx, fz): (f64, f64) = (-3e4, 1e5);
        let fy = law.under_load(6e5, fz, fx).side_force_n(1.0);
        assert!(((fx * fx + fy * fy).sqrt() / (0.5 * fz) - 1.0).abs() < 1e-12);
    }
}
