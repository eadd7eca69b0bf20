//! A planned speed profile over station, as the predictive speed planner delivers it: for the whole
//! trip ahead of time (the paper's way) or for the next kilometres, renewed while driving.

use alloc::vec::Vec;

use crate::PlannerError;
use crate::error::config_in;
use tractrix_core::{PlanStatus, SpeedPoint};

/// A checked profile.
#[derive(Debug, Clone, PartialEq)]
pub struct SpeedProfile {
    points: Vec<SpeedPoint>,
    status: PlanStatus,
}

impl SpeedProfile {
    /// A profile from points in order of station; `status` says how it was found.
    ///
    /// # Errors
    /// [`PlannerError::Config`] names the first value out of range: fewer than two points, stations
    /// that do not increase, or a speed outside 0 to 60 m/s.
    pub fn new(points: Vec<SpeedPoint>, status: PlanStatus) -> Result<Self, PlannerError> {
        config_in("speed profile: points", points.len() as f64, 2.0, 1e7)?;
        for p in &points {
            config_in("speed profile: speed_m_s", p.speed_m_s, 0.0, 60.0)?;
        }
        for w in points.windows(2) {
            config_in("speed profile: step of s_m", w[1].s_m - w[0].s_m, 1e-6, 1e6)?;
        }
        Ok(Self { points, status })
    }

    /// How it was found.
    #[must_use]
    pub fn status(&self) -> PlanStatus {
        self.status
    }

    /// Planned speed at a station, m/s; `None` outside the profile. Kinetic energy is linear
    /// between the points, as in the planner's space domain.
    #[must_use]
    pub fn at(&self, s_m: f64) -> Option<f64> {
        let i = self.points.partition_point(|p| p.s_m <= s_m);
        let (a, b) = (self.points.get(i.checked_sub(1)?)?, self.points.get(i)?);
        let f = (s_m - a.s_m) / (b.s_m - a.s_m);
        let energy = a.speed_m_s * a.speed_m_s * (1.0 - f) + b.speed_m_s * b.speed_m_s * f;
        Some(libm::sqrt(energy))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;
    use alloc::vec;

    fn point(s_m: f64, speed_m_s: f64) -> SpeedPoint {
        SpeedPoint { s_m, speed_m_s, accel_m_s2: 0.0 }
    }

    #[test]
    fn a_profile_accelerates_evenly_between_its_points_and_ends_at_its_ends() {
        let points = vec![point(0.0, 10.0), point(100.0, 20.0)];
        let p = SpeedProfile::new(points, PlanStatus::Solved).unwrap();
        assert!((p.at(50.0).unwrap() - 250.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(p.at(-1.0), None);
        assert_eq!(p.at(100.0), None);
    }

    #[test]
    fn a_profile_that_goes_back_or_is_not_a_number_is_refused() {
        for points in [vec![point(0.0, 10.0); 2], vec![point(0.0, f64::NAN), point(1.0, 1.0)]] {
            let e = SpeedProfile::new(points, PlanStatus::Solved).unwrap_err();
            assert!(e.to_string().contains("speed profile"), "{e}");
        }
    }
}
