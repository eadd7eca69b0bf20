//! Mass and rolling resistance from driving: recursive least squares on the force balance
//! (Vahidi, Stefanopoulou, Peng 2005).
//!
//! `F_drive - F_retarder - m_rot a - F_air = m (a + g sin(grade)) + m C_rr g cos(grade)`,
//! unknown `theta = [m, m C_rr]`. Mass shows when the acceleration changes, rolling resistance in
//! between; both are valid only once their variance is small. Shifts, service braking, low speed and
//! steering are left out.

use super::road_load::{InGear, road_under};
use crate::PlannerError;
use crate::error::config_in;
use serde::{Deserialize, Serialize};
use tractrix_core::{EgoState, GRAVITY_M_S2, RoadLoad, VehicleLimits};

/// Estimator parameters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EstimatorConfig {
    /// The stack plans with the estimate once it is valid.
    pub enabled: bool,
    /// Noise of the force balance, mean of one second, N.
    pub force_noise_n: f64,
    /// Time over which old data are forgotten, s.
    pub memory_s: f64,
    /// Valid from this relative standard deviation of the mass on.
    pub mass_sigma_frac: f64,
    /// The estimate stays within this share of the declared mass.
    pub mass_range_frac: f64,
}

impl Default for EstimatorConfig {
    fn default() -> Self {
        Self {
            enabled: true,
            force_noise_n: 2_000.0,
            memory_s: 1200.0,
            mass_sigma_frac: 0.03,
            mass_range_frac: 0.5,
        }
    }
}

impl EstimatorConfig {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`PlannerError::Config`] names the key.
    pub fn check(&self) -> Result<(), PlannerError> {
        config_in("estimator.force_noise_n", self.force_noise_n, 1.0, 1e6)?;
        config_in("estimator.memory_s", self.memory_s, 1.0, 1e6)?;
        config_in("estimator.mass_sigma_frac", self.mass_sigma_frac, 1e-4, 1.0)?;
        config_in("estimator.mass_range_frac", self.mass_range_frac, 0.0, 0.9)
    }
}

/// An estimate and whether it may be used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoadEstimate {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Standard deviation of the mass, kg.
    pub mass_sigma_kg: f64,
    /// Rolling resistance coefficient.
    pub rolling_coeff: f64,
    /// Both may be used.
    pub valid: bool,
}

/// The estimator.
#[derive(Debug, Clone)]
pub(crate) struct LoadEstimator {
    config: EstimatorConfig,
    declared: RoadLoad,
    theta: [f64; 2],
    /// Covariance: [mass, mass x rolling, rolling].
    p: [f64; 3],
    settled_s: f64,
}

impl LoadEstimator {
    /// Starts from the declared load with 30 % and 50 % uncertainty.
    #[must_use]
    pub(crate) fn new(config: EstimatorConfig, declared: &RoadLoad) -> Self {
        let m = declared.mass_kg;
        let roll = m * declared.rolling_coeff;
        let square = |x: f64| x * x;
        Self {
            config,
            declared: *declared,
            theta: [m, roll],
            p: [square(0.3 * m), 0.0, square(0.5 * roll)],
            settled_s: 0.0,
        }
    }

    /// Takes one state, `dt_s` after the last; `grade_rad` is the mean grade under the truck.
    pub(crate) fn update(
        &mut self,
        dt_s: f64,
        ego: &EgoState,
        grade_rad: f64,
        limits: &VehicleLimits,
    ) {
        let signals = &ego.powertrain;
        let quiet = signals.gear > 0
            && !signals.shift_in_progress
            && signals.brake_force_n.abs() < 50.0
            && ego.speed_m_s > 5.0
            && ego.accel_y_m_s2.abs() < 0.5;
        if !quiet {
            self.settled_s = 0.0;
            return;
        }
        self.settled_s += dt_s;
        if self.settled_s < 0.5 {
            return;
        }
        let in_gear = InGear::new(&limits.powertrain, signals.gear, ego.speed_m_s);
        let v = ego.speed_m_s;
        let known = &self.declared;
        let road = road_under(known, ego, grade_rad);
        // what does not grow with the mass, and the declared growth of the rolling resistance
        let growth = known.rolling_per_speed_s_m * v * road.cos_grade;
        let bound = known.bound_n(v, &road) + known.mass_kg * GRAVITY_M_S2 * growth;
        let force = signals.drive_force_n
            - signals.retarder_force_n
            - in_gear.rotating_mass_kg * ego.accel_x_m_s2
            - bound;
        let phi = [
            ego.accel_x_m_s2 + GRAVITY_M_S2 * libm::sin(grade_rad),
            GRAVITY_M_S2 * libm::cos(grade_rad),
        ];
        let forget = libm::exp(dt_s / self.config.memory_s);
        let [a, b, c] = self.p.map(|x| x * forget);
        let noise = self.config.force_noise_n * self.config.force_noise_n / dt_s.max(1e-3);
        let pf = [a * phi[0] + b * phi[1], b * phi[0] + c * phi[1]];
        let inner = noise + phi[0] * pf[0] + phi[1] * pf[1];
        let gain = [pf[0] / inner, pf[1] / inner];
        let miss = force - phi[0] * self.theta[0] - phi[1] * self.theta[1];
        self.theta = [self.theta[0] + gain[0] * miss, self.theta[1] + gain[1] * miss];
        self.p = [a - gain[0] * pf[0], b - gain[0] * pf[1], c - gain[1] * pf[1]];
        self.bound();
    }

    /// Keeps estimate and covariance within what is possible.
    fn bound(&mut self) {
        let (m, f) = (self.declared.mass_kg, self.config.mass_range_frac);
        self.theta[0] = self.theta[0].clamp(m * (1.0 - f), m * (1.0 + f));
        self.theta[1] = self.theta[1].clamp(0.001 * self.theta[0], 0.03 * self.theta[0]);
        self.p[0] = self.p[0].clamp(1.0, 0.09 * m * m);
        self.p[2] = self.p[2].clamp(1e-3, 0.25 * m * m * 1e-4);
        let cross = 0.999 * libm::sqrt(self.p[0] * self.p[2]);
        self.p[1] = self.p[1].clamp(-cross, cross);
    }

    /// The present estimate.
    #[must_use]
    pub(crate) fn estimate(&self) -> LoadEstimate {
        let sigma = libm::sqrt(self.p[0]);
        LoadEstimate {
            mass_kg: self.theta[0],
            mass_sigma_kg: sigma,
            rolling_coeff: self.theta[1] / self.theta[0],
            valid: sigma < self.config.mass_sigma_frac * self.theta[0],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::reference_limits;
    use tractrix_core::PowertrainSignals;

    /// Twenty minutes over gentle hills with a truck 20 % lighter than declared.
    fn drive(estimator: &mut LoadEstimator, actual_kg: f64, hills: f64) {
        let limits = reference_limits();
        let actual = RoadLoad { mass_kg: actual_kg, rolling_coeff: 0.0075, ..limits.road_load };
        for i in 0..12_000 {
            let t = 0.1 * f64::from(i);
            let grade_rad = hills * libm::sin(t / 40.0);
            let accel = 5.0 * hills * libm::sin(t / 15.0);
            let gear = InGear::new(&limits.powertrain, 12, 20.0);
            let road = road_under(&actual, &EgoState::default(), grade_rad);
            let force =
                actual.resistance_n(20.0, &road) + (actual_kg + gear.rotating_mass_kg) * accel;
            let ego = EgoState {
                speed_m_s: 20.0,
                accel_x_m_s2: accel,
                powertrain: PowertrainSignals {
                    gear: 12,
                    drive_force_n: force,
                    ..PowertrainSignals::default()
                },
                ..EgoState::default()
            };
            estimator.update(0.1, &ego, grade_rad, &limits);
        }
    }

    #[test]
    fn a_wrongly_declared_mass_is_found_on_hills_within_three_per_cent() {
        let declared = reference_limits().road_load;
        let mut e = LoadEstimator::new(EstimatorConfig::default(), &declared);
        drive(&mut e, 44_000.0, 0.02);
        let found = e.estimate();
        assert!(found.valid, "{found:?}");
        assert!((found.mass_kg / 44_000.0 - 1.0).abs() < 0.03, "{found:?}");
        assert!((found.rolling_coeff - 0.0075).abs() < 0.0005, "{found:?}");
    }

    #[test]
    fn on_a_flat_road_at_constant_speed_the_estimate_never_claims_to_be_valid() {
        let declared = reference_limits().road_load;
        let mut e = LoadEstimator::new(EstimatorConfig::default(), &declared);
        drive(&mut e, 44_000.0, 0.0);
        assert!(!e.estimate().valid, "{:?}", e.estimate());
    }
}
