//! Two-axle vehicle in yaw and sideslip: which tyre law do the drives ask for?
//!
//! Single-track model with the tyre law of [`dynamics::lateral`] under the axle's load:
//!
//! ```text
//! m (vy' + v r) = F_f cos(delta) + F_r          I r' = a F_f cos(delta) - b F_r
//! alpha_f = delta - (vy + a r)/v                alpha_r = -(vy - b r)/v
//! F_z,f = m (g b - h a_x)/(a + b)               F_z,r = m (g a + h a_x)/(a + b)
//! ```
//!
//! Open-loop windows start at the measured yaw rate and sideslip; nothing is fed back inside one.
//! The four [`TyreModel`]s are fitted to the same windows, with the same free parameters but for
//! the friction coefficient and the height of the CG. Left out: roll, tyre relaxation, left-right
//! load transfer, aerodynamic lift.

use dynamics::lateral::{LateralParameters, TyreLaw};
use tractrix_core::GRAVITY_M_S2;

use crate::studies::fit::{Estimate, Parameter, least_squares};

/// A drive on a uniform grid: what the model needs and what it is compared with.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LateralDrive {
    /// Grid step, s.
    pub step_s: f64,
    /// Longitudinal speed, m/s.
    pub speed_m_s: Vec<f64>,
    /// Longitudinal acceleration, m/s².
    pub accel_x_m_s2: Vec<f64>,
    /// Road-wheel angle, rad, positive left.
    pub road_wheel_rad: Vec<f64>,
    /// Yaw rate, rad/s.
    pub yaw_rate_rad_s: Vec<f64>,
    /// Lateral speed of the CG, m/s.
    pub lateral_speed_m_s: Vec<f64>,
}

/// How the axles' side forces are modelled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TyreModel {
    /// `F = C alpha`.
    Linear,
    /// `F = C alpha`, C in proportion to the axle's load under acceleration.
    LinearWithLoad,
    /// Saturating at friction times static load.
    Saturating,
    /// Saturating at friction times the load under acceleration; the longitudinal force of the
    /// driven and braked axles takes its share.
    SaturatingWithLoad,
}

impl TyreModel {
    /// All of them, simplest first.
    pub const ALL: [Self; 4] =
        [Self::Linear, Self::LinearWithLoad, Self::Saturating, Self::SaturatingWithLoad];

    fn saturates(self) -> bool {
        matches!(self, Self::Saturating | Self::SaturatingWithLoad)
    }

    fn feels_load(self) -> bool {
        matches!(self, Self::LinearWithLoad | Self::SaturatingWithLoad)
    }
}

/// The vehicle and what is known of it beforehand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vehicle {
    /// Mass, kg.
    pub mass_kg: f64,
    /// CG to front and rear axle, m.
    pub axle_m: (f64, f64),
    /// Yaw inertia, kg m², where the search starts.
    pub yaw_inertia_kg_m2: f64,
    /// Height of the CG and its uncertainty, m.
    pub cg_height_m: (f64, f64),
    /// Share of the braking force at the front axle.
    pub front_brake_frac: f64,
}

impl Vehicle {
    /// The tractor of a truck file as a vehicle of its own, whose CG height is known to a fifth.
    #[must_use]
    pub fn of(p: &LateralParameters) -> Self {
        let t = &p.tractor;
        Self {
            mass_kg: t.mass_kg,
            axle_m: (t.steer_axle_ahead_of_cg_m, t.drive_group_behind_cg_m),
            yaw_inertia_kg_m2: t.yaw_inertia_kg_m2,
            cg_height_m: (
                p.load_transfer.tractor_cg_height_m,
                0.2 * p.load_transfer.tractor_cg_height_m,
            ),
            front_brake_frac: 0.6,
        }
    }

    fn static_load_n(&self) -> (f64, f64) {
        let (a, b) = self.axle_m;
        let weight = self.mass_kg * GRAVITY_M_S2;
        (weight * b / (a + b), weight * a / (a + b))
    }
}

/// Places of the parameters in [`Fitted::estimate`].
pub mod place {
    /// Cornering stiffness per load of the front axle, 1/rad.
    pub const FRONT: usize = 0;
    /// Cornering stiffness per load of the rear axle, 1/rad.
    pub const REAR: usize = 1;
    /// Yaw inertia, kg m².
    pub const INERTIA: usize = 2;
    /// Offset of the road-wheel angle, rad.
    pub const OFFSET: usize = 3;
    /// Height of the CG, m.
    pub const HEIGHT: usize = 4;
    /// Friction coefficient of the front tyres.
    pub const FRICTION: usize = 5;
    /// Friction coefficient of the rear tyres.
    pub const REAR_FRICTION: usize = 6;
}

/// A model fitted to windows.
#[derive(Debug, Clone, PartialEq)]
pub struct Fitted {
    /// The tyre model.
    pub model: TyreModel,
    /// Parameters by [`place`], intervals clustered by window.
    pub estimate: Estimate,
}

/// Errors of one open-loop window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WindowError {
    /// Mean squared error of the yaw rate, rad²/s².
    pub yaw_rad2_s2: f64,
    /// Mean squared error of the sideslip angle, rad².
    pub sideslip_rad2: f64,
}

/// Length of an open-loop window, s.
pub const WINDOW_S: f64 = 5.0;
/// Standard deviations that weigh yaw rate, rad/s, against sideslip, rad, in the fit.
const WEIGHT: (f64, f64) = (0.02, 0.01);
/// Standard deviations beyond which an error is an outlier.
const OUTLIER: f64 = 3.0;

impl LateralDrive {
    /// Samples of a window.
    #[must_use]
    pub fn window(&self) -> usize {
        (WINDOW_S / self.step_s) as usize
    }

    /// Starts of the consecutive windows in which the vehicle moves.
    #[must_use]
    pub fn windows(&self) -> Vec<usize> {
        let n = self.window();
        (0..self.speed_m_s.len() / n.max(1))
            .map(|k| k * n)
            .filter(|&k| self.speed_m_s[k..k + n].iter().all(|v| *v > 5.0))
            .collect()
    }

    /// Yaw rate and sideslip minus measured ones, every fifth sample of a window.
    fn errors(
        &self,
        vehicle: &Vehicle,
        model: TyreModel,
        p: &[f64],
        from: usize,
    ) -> Vec<(f64, f64)> {
        let (front_static, rear_static) = vehicle.static_load_n();
        let (a, b) = vehicle.axle_m;
        let height = if model.feels_load() { p[place::HEIGHT] } else { 0.0 };
        let law = |place: usize| match p.get(place) {
            Some(mu) if model.saturates() => TyreLaw::Saturating { friction_coeff: mu.max(0.05) },
            _ => TyreLaw::Linear,
        };
        let (front_law, rear_law) = (law(place::FRICTION), law(place::REAR_FRICTION));
        let (m, inertia) = (vehicle.mass_kg, p[place::INERTIA].max(1.0));
        let rate = |i: usize, vy: f64, r: f64| {
            let (v, ax) = (self.speed_m_s[i], self.accel_x_m_s2[i]);
            let delta = self.road_wheel_rad[i] - p[place::OFFSET];
            let moved = m * height * ax / (a + b);
            let loads = ((front_static - moved).max(1.0), (rear_static + moved).max(1.0));
            let force = if model == TyreModel::SaturatingWithLoad { m * ax } else { 0.0 };
            let front_force = if force < 0.0 { vehicle.front_brake_frac * force } else { 0.0 };
            let front = front_law
                .under_load(p[place::FRONT] * loads.0, loads.0, front_force)
                .side_force_n(delta - (vy + a * r) / v);
            let rear = rear_law
                .under_load(p[place::REAR] * loads.1, loads.1, force - front_force)
                .side_force_n(-(vy - b * r) / v);
            let across = front * delta.cos();
            ((across + rear) / m - v * r, (a * across - b * rear) / inertia)
        };
        let (mut vy, mut r) = (self.lateral_speed_m_s[from], self.yaw_rate_rad_s[from]);
        let dt = self.step_s;
        let end = (from + self.window()).min(self.speed_m_s.len() - 1);
        let mut out = Vec::with_capacity(self.window() / 5 + 1);
        for i in from..end {
            // Heun's method.
            let k1 = rate(i, vy, r);
            let k2 = rate(i + 1, vy + dt * k1.0, r + dt * k1.1);
            vy += 0.5 * dt * (k1.0 + k2.0);
            r += 0.5 * dt * (k1.1 + k2.1);
            if (i - from) % 5 == 4 {
                let slip = (vy - self.lateral_speed_m_s[i + 1]) / self.speed_m_s[i + 1];
                out.push((
                    (r - self.yaw_rate_rad_s[i + 1]).clamp(-10.0, 10.0),
                    slip.clamp(-3.0, 3.0),
                ));
            }
        }
        out
    }

    /// Mean squared errors of a window under a fitted model.
    #[must_use]
    pub fn window_error(&self, vehicle: &Vehicle, fitted: &Fitted, from: usize) -> WindowError {
        let e = self.errors(vehicle, fitted.model, &fitted.estimate.value, from);
        let n = e.len().max(1) as f64;
        WindowError {
            yaw_rad2_s2: e.iter().map(|e| e.0 * e.0).sum::<f64>() / n,
            sideslip_rad2: e.iter().map(|e| e.1 * e.1).sum::<f64>() / n,
        }
    }
}

/// Pseudo-Huber residual: a window that spins in the model counts by its size, not its square.
fn bounded(e: f64) -> f64 {
    let x = e / OUTLIER;
    OUTLIER * (2.0 * ((1.0 + x * x).sqrt() - 1.0)).sqrt().copysign(e)
}

/// Fits a tyre model to windows of drives; `None` if these say nothing.
#[must_use]
pub fn fit(
    drives: &[LateralDrive],
    windows: &[(usize, usize)],
    vehicle: &Vehicle,
    model: TyreModel,
) -> Option<Fitted> {
    let mut parameters = vec![
        Parameter::free(15.0, 10.0),
        Parameter::free(18.0, 10.0),
        Parameter::known(vehicle.yaw_inertia_kg_m2, 0.3 * vehicle.yaw_inertia_kg_m2),
        Parameter::known(0.0, 0.01),
        Parameter::known(vehicle.cg_height_m.0, vehicle.cg_height_m.1),
    ];
    if model.saturates() {
        parameters.extend([Parameter::free(1.5, 0.5), Parameter::free(1.6, 0.5)]);
    }
    let rows = 2 * (drives.first()?.window() / 5);
    let estimate = least_squares(&parameters, |p| {
        windows
            .iter()
            .flat_map(|&(d, from)| {
                let mut e = drives[d].errors(vehicle, model, p, from);
                e.resize(rows / 2, (0.0, 0.0));
                e.into_iter().flat_map(|(r, s)| [bounded(r / WEIGHT.0), bounded(s / WEIGHT.1)])
            })
            .collect()
    })?;
    Some(Fitted { model, estimate: estimate.clustered(rows) })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drive of the model itself, with steering that grows to the limit of grip.
    fn drive(vehicle: &Vehicle, model: TyreModel, truth: &[f64], phase: f64) -> LateralDrive {
        let n = 12_000;
        let t = |i: usize| i as f64 * 0.01;
        let mut d = LateralDrive {
            step_s: 0.01,
            speed_m_s: (0..n).map(|i| 28.0 + 6.0 * (0.13 * t(i) + phase).sin()).collect(),
            accel_x_m_s2: (0..n).map(|i| 0.78 * (0.13 * t(i) + phase).cos()).collect(),
            road_wheel_rad: (0..n)
                .map(|i| 0.055 * (0.9 * t(i) + phase).sin() + 0.03 * (2.3 * t(i)).sin())
                .collect(),
            yaw_rate_rad_s: vec![0.0; n],
            lateral_speed_m_s: vec![0.0; n],
        };
        // One window after the other, each from the end of the one before.
        let (mut vy, mut r) = (0.0, 0.0);
        for i in 0..n - 1 {
            d.yaw_rate_rad_s[i] = r;
            d.lateral_speed_m_s[i] = vy;
            let mut one = d.clone_range(i, 7);
            one.yaw_rate_rad_s[1..].fill(0.0);
            one.lateral_speed_m_s[1..].fill(0.0);
            one.step_s = 0.002;
            for z in 1..7 {
                one.speed_m_s[z] = d.speed_m_s[i];
                one.accel_x_m_s2[z] = d.accel_x_m_s2[i];
                one.road_wheel_rad[z] = d.road_wheel_rad[i];
            }
            let e = one.errors(vehicle, model, truth, 0);
            r = e[0].0;
            vy = e[0].1 * d.speed_m_s[i];
        }
        d
    }

    impl LateralDrive {
        fn clone_range(&self, from: usize, n: usize) -> Self {
            let cut = |v: &Vec<f64>| (0..n).map(|k| v[(from + k).min(v.len() - 1)]).collect();
            Self {
                step_s: self.step_s,
                speed_m_s: cut(&self.speed_m_s),
                accel_x_m_s2: cut(&self.accel_x_m_s2),
                road_wheel_rad: cut(&self.road_wheel_rad),
                yaw_rate_rad_s: cut(&self.yaw_rate_rad_s),
                lateral_speed_m_s: cut(&self.lateral_speed_m_s),
            }
        }
    }

    #[test]
    fn a_tyre_that_saturates_is_recovered_and_beats_the_linear_one_on_unseen_drives() {
        let vehicle = Vehicle {
            mass_kg: 1000.0,
            axle_m: (1.3, 1.1),
            yaw_inertia_kg_m2: 1400.0,
            cg_height_m: (0.45, 0.09),
            front_brake_frac: 0.6,
        };
        let truth = [17.0, 21.0, 1500.0, 0.002, 0.45, 1.1, 1.2];
        let drives: Vec<LateralDrive> = [0.0, 1.0]
            .map(|phase| drive(&vehicle, TyreModel::SaturatingWithLoad, &truth, phase))
            .into();
        let train: Vec<(usize, usize)> = drives[0].windows().into_iter().map(|w| (0, w)).collect();
        let error = |model| {
            let f = fit(&drives, &train, &vehicle, model).unwrap();
            let sum: f64 = drives[1]
                .windows()
                .into_iter()
                .map(|w| drives[1].window_error(&vehicle, &f, w).yaw_rad2_s2)
                .sum();
            (f, sum)
        };
        let (saturating, small) = error(TyreModel::SaturatingWithLoad);
        let (_, large) = error(TyreModel::Linear);
        for (i, t) in truth.iter().enumerate().filter(|(i, _)| *i != place::HEIGHT) {
            let found = saturating.estimate.value[i];
            // The drive holds its inputs for a step, the model is linear between them.
            assert!((found - t).abs() < 0.05 * t.abs() + 2e-4, "parameter {i}: {found}, not {t}");
        }
        assert!(small < 0.05 * large, "{small} against {large}");
    }
}
