//! Steering: a linear-quadratic regulator over the tractor-semitrailer model, scheduled on speed
//! and mass, with optimal preview of the path's curvature and a predictor for the actuator's delay.
//!
//! With the steady states `x_s(kappa)`, `u_s(kappa)` of `model` and the deviation
//! `z = x - x_s(kappa)`, a change of curvature disturbs `z` by `w = -x_s(1) (kappa_{k+1} - kappa_k)`.
//! The LQ optimum with known future `w` (Tomizuka 1975) is
//! `u = u_s(kappa_k) - K z - sum_j (r + B'PB)^-1 B' (A - BK)'^j P w_{k+j}`.
//! A delay of `n` steps is met exactly by predicting `x` over the `n` commands still on their way.
//!
//! What comes of the preview turns the wheel no faster than [`PREVIEWED_JERK_M_S3`] allows: a path
//! that has just been planned would have been steered for before, and the sum above jumps where it
//! appears. The feedback is free of that bound.
//!
//! Left out: tyre saturation (the path planner's limits keep the truck in the linear range) and
//! estimation of side slip; the truck reports its lateral speed.

use alloc::collections::VecDeque;
use alloc::vec::Vec;

use super::model::{DiscreteModel, Matrix, State, discrete_model, solve_dare};
use crate::PlannerError;
use crate::error::config_in;
use serde::{Deserialize, Serialize};
use tractrix_core::{EgoState, Geometry, LateralLimits, VehicleLimits};

/// Curvature samples in the preview, [`PREVIEW_STEP_S`] apart.
pub(crate) const PREVIEW_POINTS: usize = 26;
/// Spacing of the preview, s.
pub(crate) const PREVIEW_STEP_S: f64 = 0.1;

/// Lateral jerk of a steady curve that the previewed part of the command may ask for, m/s^3. UN
/// Regulation 79 allows automatically commanded steering as much, as the mean of half a second; here
/// it bounds every moment.
const PREVIEWED_JERK_M_S3: f64 = 5.0;

const SPEEDS_M_S: [f64; 10] = [3.0, 5.0, 7.5, 10.0, 12.5, 15.0, 18.0, 22.0, 26.0, 30.0];
const TRAILER_MASS_FACTORS: [f64; 3] = [0.25, 0.6, 1.2];

/// Steering parameters: deviations that cost the same.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LateralConfig {
    /// Offset of the tractor, m.
    pub offset_m: f64,
    /// Offset of the trailer's axle group, m.
    pub trailer_offset_m: f64,
    /// Heading error, rad.
    pub heading_rad: f64,
    /// Road-wheel angle from its steady value, rad.
    pub road_wheel_rad: f64,
    /// Pure delay of the steering actuator besides its lag, s.
    pub delay_s: f64,
    /// Largest rate of the road-wheel angle, rad/s.
    pub road_wheel_rate_rad_s: f64,
}

impl Default for LateralConfig {
    fn default() -> Self {
        Self {
            offset_m: 0.1,
            trailer_offset_m: 0.3,
            heading_rad: 0.05,
            road_wheel_rad: 0.02,
            delay_s: 0.0,
            road_wheel_rate_rad_s: 0.4,
        }
    }
}

impl LateralConfig {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`PlannerError::Config`] names the key.
    pub fn check(&self) -> Result<(), PlannerError> {
        config_in("lateral.offset_m", self.offset_m, 0.005, 10.0)?;
        config_in("lateral.trailer_offset_m", self.trailer_offset_m, 0.005, 1e6)?;
        config_in("lateral.heading_rad", self.heading_rad, 0.001, 1e6)?;
        config_in("lateral.road_wheel_rad", self.road_wheel_rad, 0.001, 1.0)?;
        config_in("lateral.delay_s", self.delay_s, 0.0, 0.5)?;
        config_in("lateral.road_wheel_rate_rad_s", self.road_wheel_rate_rad_s, 0.02, 5.0)
    }
}

/// Gains and model of one grid point.
#[derive(Debug, Clone)]
struct GridPoint {
    model: DiscreteModel,
    gain: State,
    preview: [f64; PREVIEW_POINTS],
}

/// Where the truck is relative to its path.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct PathError {
    /// Offset of the reference point, m, left positive.
    pub offset_m: f64,
    /// Tractor heading minus path heading, rad.
    pub heading_rad: f64,
}

/// The steering controller.
#[derive(Debug, Clone)]
pub(crate) struct LateralController {
    config: LateralConfig,
    dt_s: f64,
    /// `TRAILER_MASS_FACTORS` blocks of `SPEEDS_M_S` points.
    grid: Vec<GridPoint>,
    design_mass_kg: [f64; 3],
    /// Commands that have not yet reached the wheels, oldest first.
    pending_rad: VecDeque<f64>,
    last_rad: f64,
    /// The previewed part of the last command.
    last_previewed_rad: f64,
}

impl LateralController {
    /// Solves the Riccati equations of the grid; `dt_s` is the control period.
    ///
    /// # Errors
    /// [`PlannerError::Riccati`] names the grid point for which the data give no stabilising gain.
    pub(crate) fn new(
        config: LateralConfig,
        limits: &VehicleLimits,
        dt_s: f64,
    ) -> Result<Self, PlannerError> {
        let mut grid = Vec::with_capacity(SPEEDS_M_S.len() * TRAILER_MASS_FACTORS.len());
        let mut design_mass_kg = [0.0; 3];
        for (factor, mass) in TRAILER_MASS_FACTORS.into_iter().zip(&mut design_mass_kg) {
            let lateral = with_trailer_mass(&limits.lateral, &limits.geometry, factor);
            *mass = lateral.tractor_mass_kg + lateral.trailer_mass_kg;
            for speed_m_s in SPEEDS_M_S {
                grid.push(grid_point(&config, &lateral, &limits.geometry, speed_m_s, dt_s).ok_or(
                    PlannerError::Riccati { speed_m_s, trailer_mass_kg: lateral.trailer_mass_kg },
                )?);
            }
        }
        let steps = libm::round(config.delay_s / dt_s) as usize;
        Ok(Self {
            config,
            dt_s,
            grid,
            design_mass_kg,
            pending_rad: core::iter::repeat_n(0.0, steps).collect(),
            last_rad: 0.0,
            last_previewed_rad: 0.0,
        })
    }

    /// Road-wheel angle, rad, for this control step. `curvature_1_m` is the path's curvature at the
    /// truck and then every [`PREVIEW_STEP_S`] of driving ahead.
    #[must_use]
    pub(crate) fn step(
        &mut self,
        ego: &EgoState,
        error: PathError,
        curvature_1_m: &[f64; PREVIEW_POINTS],
        limits: &VehicleLimits,
    ) -> f64 {
        let weights = self.weights(ego.speed_m_s, limits.road_load.mass_kg);
        let cg_ahead_m = limits.geometry.cg_ahead_m;
        let mut x = State::from([
            ego.lateral_speed_m_s + cg_ahead_m * ego.yaw_rate_rad_s,
            ego.yaw_rate_rad_s,
            ego.trailer.yaw_rate_rad_s,
            -ego.trailer.articulation_rad,
            error.offset_m,
            error.heading_rad,
            ego.road_wheel_rad,
        ]);
        for &u in &self.pending_rad {
            x = self
                .blend(&weights, |p| p.model.a * x + p.model.b * u + p.model.e * curvature_1_m[0]);
        }
        let kappa = curvature_1_m[0];
        let steady_and_feedback = self.blend_scalar(&weights, |p| {
            p.model.u_steady * kappa - p.gain.dot(&(x - p.model.x_steady * kappa))
        });
        let step = self.config.road_wheel_rate_rad_s * self.dt_s;
        let previewed = self.previewed_rad(&weights, curvature_1_m, ego.speed_m_s, step);
        self.last_previewed_rad = previewed;
        let command = steady_and_feedback + previewed;
        let limit = limits.lateral.max_road_wheel_rad;
        let command =
            command.clamp(self.last_rad - step, self.last_rad + step).clamp(-limit, limit);
        if !self.pending_rad.is_empty() {
            self.pending_rad.pop_front();
            self.pending_rad.push_back(command);
        }
        self.last_rad = command;
        command
    }

    /// Part of the command that comes of the curvature ahead, rad; it changes by at most `step_rad`.
    fn previewed_rad(
        &self,
        weights: &[(usize, f64); 4],
        curvature_1_m: &[f64; PREVIEW_POINTS],
        speed_m_s: f64,
        step_rad: f64,
    ) -> f64 {
        let wanted = self.blend_scalar(weights, |p| {
            let changes = curvature_1_m.windows(2).map(|k| k[1] - k[0]);
            p.preview.iter().zip(changes).map(|(gain, change)| gain * change).sum()
        });
        let curvature_rate_1_ms = PREVIEWED_JERK_M_S3 / (speed_m_s * speed_m_s).max(1e-6);
        let rate_rad_s = self.blend_scalar(weights, |p| p.model.u_steady) * curvature_rate_1_ms;
        let step_rad = step_rad.min(rate_rad_s.abs() * self.dt_s);
        wanted.clamp(self.last_previewed_rad - step_rad, self.last_previewed_rad + step_rad)
    }

    /// Road-wheel angle, rad, that holds a curve of this curvature in steady state: for steering
    /// when the truck's state is not known.
    #[must_use]
    pub(crate) fn steady_road_wheel_rad(
        &self,
        curvature_1_m: f64,
        speed_m_s: f64,
        mass_kg: f64,
    ) -> f64 {
        let weights = self.weights(speed_m_s, mass_kg);
        self.blend_scalar(&weights, |p| p.model.u_steady) * curvature_1_m
    }

    /// Takes note of a command that was sent in place of this controller's.
    pub(crate) fn overridden(&mut self, road_wheel_rad: f64) {
        self.last_rad = road_wheel_rad;
        if let Some(last) = self.pending_rad.back_mut() {
            *last = road_wheel_rad;
        }
    }

    /// The four grid points around (mass, speed) and their weights.
    fn weights(&self, speed_m_s: f64, mass_kg: f64) -> [(usize, f64); 4] {
        let (i, f) = bracket(&SPEEDS_M_S, speed_m_s);
        let (j, g) = bracket(&self.design_mass_kg, mass_kg);
        let n = SPEEDS_M_S.len();
        [
            (j * n + i, (1.0 - g) * (1.0 - f)),
            (j * n + i + 1, (1.0 - g) * f),
            ((j + 1) * n + i, g * (1.0 - f)),
            ((j + 1) * n + i + 1, g * f),
        ]
    }

    fn blend(&self, weights: &[(usize, f64); 4], f: impl Fn(&GridPoint) -> State) -> State {
        weights.iter().fold(State::zeros(), |sum, &(i, w)| sum + f(&self.grid[i]) * w)
    }

    fn blend_scalar(&self, weights: &[(usize, f64); 4], f: impl Fn(&GridPoint) -> f64) -> f64 {
        weights.iter().map(|&(i, w)| f(&self.grid[i]) * w).sum()
    }
}

/// Interval of a strictly increasing axis with at least two points, and the fraction in it, 0 to 1.
fn bracket(axis: &[f64], x: f64) -> (usize, f64) {
    let i = axis.partition_point(|&a| a <= x).clamp(1, axis.len() - 1) - 1;
    (i, ((x - axis[i]) / (axis[i + 1] - axis[i])).clamp(0.0, 1.0))
}

/// The handling data with another trailer mass. Inertia is taken proportional; so is each axle
/// group's cornering stiffness to its static load, which holds within a few per cent for radial
/// truck tyres.
fn with_trailer_mass(l: &LateralLimits, g: &Geometry, factor: f64) -> LateralLimits {
    let trailer = l.trailer_mass_kg * factor;
    let on_group = l.trailer_cg_behind_hitch_m / g.hitch_to_trailer_axle_m;
    let drive_load = |trailer_kg: f64| {
        let kingpin = trailer_kg * (1.0 - on_group);
        l.tractor_mass_kg * (1.0 - g.cg_ahead_m / g.wheelbase_m)
            + kingpin * (1.0 - g.hitch_ahead_m / g.wheelbase_m)
    };
    LateralLimits {
        trailer_mass_kg: trailer,
        trailer_inertia_kg_m2: l.trailer_inertia_kg_m2 * factor,
        trailer_stiffness_n_rad: l.trailer_stiffness_n_rad * factor,
        drive_stiffness_n_rad: l.drive_stiffness_n_rad * drive_load(trailer)
            / drive_load(l.trailer_mass_kg),
        ..*l
    }
}

fn grid_point(
    c: &LateralConfig,
    lateral: &LateralLimits,
    geometry: &Geometry,
    speed_m_s: f64,
    dt_s: f64,
) -> Option<GridPoint> {
    let model = discrete_model(lateral, geometry, speed_m_s, dt_s)?;
    let inverse_square = |x: f64| 1.0 / (x * x);
    // Trailer axle group: e_y + h e_psi - l (e_psi - g), with hitch at h and axles l behind it.
    let mut trailer = State::zeros();
    trailer[3] = geometry.hitch_to_trailer_axle_m;
    trailer[4] = 1.0;
    trailer[5] = geometry.hitch_ahead_m - geometry.hitch_to_trailer_axle_m;
    let mut q = trailer * trailer.transpose() * inverse_square(c.trailer_offset_m);
    q[(4, 4)] += inverse_square(c.offset_m);
    q[(5, 5)] += inverse_square(c.heading_rad);
    let r = inverse_square(c.road_wheel_rad);
    let p = solve_dare(&model.a, &model.b, &q, r)?;
    let pb = p * model.b;
    let inner = r + model.b.dot(&pb);
    let gain = model.a.transpose() * pb / inner;
    let closed: Matrix = model.a - model.b * gain.transpose();

    // p_j = (r + B'PB)^-1 B' (A_cl')^j P x_s, averaged over each preview interval
    let px = p * model.x_steady;
    let mut row = model.b / inner;
    let per_interval = libm::round(PREVIEW_STEP_S / dt_s).max(1.0) as usize;
    let mut preview = [0.0; PREVIEW_POINTS];
    for gain in &mut preview {
        for _ in 0..per_interval {
            *gain += row.dot(&px) / per_interval as f64;
            row = closed * row;
        }
    }
    Some(GridPoint { model, gain, preview })
}
