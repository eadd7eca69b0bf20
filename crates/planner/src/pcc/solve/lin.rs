//! The convex subproblem of one iteration, in the reduced form (E, b).
//!
//! Around a profile `E⁰` with fixed gears, for interval `k` with mean energy `Ē = (E_k+E_{k+1})/2`:
//!
//! - (a) dynamics, solved for the traction:
//!   `p_k = μ(E_{k+1}-E_k)/h + D⁰ + D'(Ē-Ē⁰) + R⁰ + R'(Ē-Ē⁰) + b_k`, R the resistance per mass
//! - (b) duration `2h/(v_k+v_{k+1})`, convex in E (the reciprocal of a concave positive function), to
//!   first order in the constraint and with its curvature, weighted by the time price, in the cost
//! - (d) traction `0 <= p_k <= φ⁰ + φ'(Ē-Ē⁰)`, φ the full-load envelope of the gear
//! - (e) `E_min <= E <= E_max`, `0 <= b <= b_max`
//! - (g) cost `q1 p + q2 p²/2 - δ u + g_E Ē + w_a ΔE² + w_j Σ(Δa)² + ε b + β t`, in g: q1, q2 from
//!   the fuel map of the gear at `v⁰` above zero wheel force, `g_E` its change with speed at fixed
//!   `p`; `u <= min(p, D)` is the part of the traction that only overcomes the engine's own drag,
//!   cheaper by `δ` (the driveline's losses change sides at zero wheel force)
//!
//! **Safe side.** A tangent of a convex function lies below it: the linearised elapsed time never
//! exceeds the true one. A fence `t_k >= t_f,k` (the lead's rear, minus the gap, passes `s_k` at
//! `t_f,k`) that holds for the linearised time therefore holds for the true time, in every iterate,
//! converged or not. For `t_N <= T` the error has the other sign; the iteration removes it.
//!
//! Units: E in J/kg, p and b in m/s², cost in g, time in s.

use alloc::vec::Vec;

use super::parabola::Parabola;
use super::sqp::CutModel;
use crate::pcc::model::{Course, Drive, Operating, Truck, Tuning, duration_s};

/// What holds at the last node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Terminal {
    /// The energy is given, J/kg.
    Fixed(f64),
    /// Energy below or above `reference` is paid and credited, g per J/kg; `pay >= credit`.
    Soft {
        /// Energy without cost, J/kg.
        reference: f64,
        /// Cost of missing energy, g per J/kg.
        pay: f64,
        /// Credit for spare energy, g per J/kg.
        credit: f64,
    },
}

/// How the trip's duration enters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TimeRule {
    /// A second costs this much, g/s.
    Price(f64),
    /// The trip takes no longer than this, s.
    AtMost(f64),
}

/// What a subproblem is linearised around.
#[derive(Debug, Clone, Copy)]
pub struct Linearisation<'a> {
    /// Energies per node of a driven profile, J/kg.
    pub e_j_kg: &'a [f64],
    /// Gears it is driven in.
    pub gears: &'a [Drive],
    /// Price of time, g/s.
    pub beta_g_s: f64,
    /// How part load below zero wheel force is charged.
    pub cut: CutModel,
}

/// One convex subproblem. Vectors are per interval unless the name says node; reused between
/// iterations without allocation.
#[derive(Debug, Clone, Default)]
pub struct Subproblem {
    /// Number of intervals.
    pub n: usize,
    /// Step, m.
    pub h_m: f64,
    /// Energy at node 0, J/kg.
    pub start_e: f64,
    /// `p = a0 E_k + a1 E_{k+1} + b + r`.
    pub a0: Vec<f64>,
    /// See `a0`.
    pub a1: Vec<f64>,
    /// See `a0`.
    pub r: Vec<f64>,
    /// `p <= phi0 + phi1 (E_k + E_{k+1})/2`.
    pub phi0: Vec<f64>,
    /// See `phi0`.
    pub phi1: Vec<f64>,
    /// Linear cost of `p`, g per m/s².
    pub q1: Vec<f64>,
    /// Quadratic cost of `p`, g per (m/s²)².
    pub q2: Vec<f64>,
    /// Traction at zero wheel force, m/s².
    pub kink: Vec<f64>,
    /// Discount of traction below the kink, g per m/s²; positive.
    pub discount: Vec<f64>,
    /// Linear cost of the mean energy, g per J/kg.
    pub ge: Vec<f64>,
    /// Cost of `(E_{k+1}-E_k)²`.
    pub wa: Vec<f64>,
    /// Cost of `(E_{k+2}-2E_{k+1}+E_k)²`.
    pub wj: f64,
    /// Mean energy of the linearisation, J/kg.
    pub mean0: Vec<f64>,
    /// Curvature of the duration in the mean energy, s/(J/kg)².
    pub t2: Vec<f64>,
    /// Duration `t0 + ta E_k + tb E_{k+1}`.
    pub t0: Vec<f64>,
    /// See `t0`.
    pub ta: Vec<f64>,
    /// See `t0`.
    pub tb: Vec<f64>,
    /// Lowest energy per node, J/kg.
    pub e_min: Vec<f64>,
    /// Highest energy per node, J/kg.
    pub e_max: Vec<f64>,
    /// Largest brake force per mass, m/s².
    pub b_max: f64,
    /// Cost of braking, g per m/s²: keeps traction and brake apart.
    pub b_cost: f64,
    /// Weight of the duration's curvature, g/s.
    pub hessian_price: f64,
}

/// Traction that a neutral interval leaves to the solver's interior, m/s².
const NEUTRAL_TRACTION: f64 = 3e-4;
/// Smallest discount below the kink relative to the marginal fuel: keeps `u` at its bound.
const LEAST_DISCOUNT: f64 = 1e-3;
/// Half width of the speed difference that slopes are taken over, m/s.
const SLOPE_STEP: f64 = 0.25;

impl Subproblem {
    fn resize(&mut self, n: usize) {
        self.n = n;
        for v in [
            &mut self.a0,
            &mut self.a1,
            &mut self.r,
            &mut self.phi0,
            &mut self.phi1,
            &mut self.q1,
            &mut self.q2,
            &mut self.kink,
            &mut self.discount,
            &mut self.ge,
            &mut self.wa,
            &mut self.mean0,
            &mut self.t2,
            &mut self.t0,
            &mut self.ta,
            &mut self.tb,
        ] {
            v.resize(n, 0.0);
        }
        self.e_min.resize(n + 1, 0.0);
        self.e_max.resize(n + 1, 0.0);
    }

    /// Linearises around a driven profile.
    pub fn linearise(
        &mut self,
        truck: &Truck,
        course: &Course,
        tuning: &Tuning,
        point: &Linearisation<'_>,
    ) {
        let Linearisation { e_j_kg: e, gears, beta_g_s, cut } = *point;
        let (n, h) = (course.n(), course.h_m);
        self.resize(n);
        self.h_m = h;
        self.start_e = e[0];
        self.b_max = course.brake_m_s2;
        self.hessian_price = beta_g_s.max(0.05);
        self.wj = tuning.accel_change_penalty_g_s4_m2 / (h * h);
        let mut q_typical = 0.0;
        for k in 0..n {
            let mean = 0.5 * (e[k] + e[k + 1]);
            let v = libm::sqrt(2.0 * mean);
            let (v0, v1) = (libm::sqrt(2.0 * e[k]), libm::sqrt(2.0 * e[k + 1]));
            let drive = gears[k];
            self.mean0[k] = mean;
            let mu = truck.inertia(drive);
            let around = match drive {
                Drive::Gear(g) => Some(Around::new(truck, g as usize, v)),
                Drive::Neutral => None,
            };
            let (overrun, overrun_slope) = around.as_ref().map_or((0.0, 0.0), Around::overrun_line);
            let road = &course.road[k];
            let resistance_slope = truck.resistance_slope_1_m(mean, road);
            let slope = overrun_slope + resistance_slope;
            self.a0[k] = -mu / h + 0.5 * slope;
            self.a1[k] = mu / h + 0.5 * slope;
            self.r[k] = overrun - overrun_slope * mean + truck.resistance_m_s2(mean, road)
                - resistance_slope * mean;
            let p = (self.a0[k] * e[k] + self.a1[k] * e[k + 1] + self.r[k]).max(0.0);
            match &around {
                Some(around) => self.traction_and_fuel(around, k, p, cut),
                None => self.rolling(truck.idle_fuel_g_s(), k, v),
            }
            q_typical += self.q1[k];
            self.wa[k] = tuning.accel_penalty_g_s3_m2 / (h * v);
            let sum = v0 + v1;
            self.ta[k] = -2.0 * h / (sum * sum * v0);
            self.tb[k] = -2.0 * h / (sum * sum * v1);
            self.t0[k] = duration_s(h, e[k], e[k + 1]) - self.ta[k] * e[k] - self.tb[k] * e[k + 1];
            self.t2[k] = 3.0 * h / (v * v * v * v * v);
        }
        self.b_cost = 1e-3 * q_typical / n as f64;
    }

    /// An interval with the driveline open.
    fn rolling(&mut self, idle_g_s: f64, k: usize, v: f64) {
        let h = self.h_m;
        let (low, high, d_e) = slope_range(v);
        self.ge[k] = (h / high * idle_g_s - h / low * idle_g_s) / d_e;
        self.phi0[k] = NEUTRAL_TRACTION;
        self.phi1[k] = 0.0;
        self.q1[k] = h;
        self.q2[k] = 0.0;
        self.kink[k] = NEUTRAL_TRACTION;
        self.discount[k] = LEAST_DISCOUNT * h;
    }

    fn traction_and_fuel(&mut self, around: &Around<'_>, k: usize, p: f64, cut: CutModel) {
        let h = self.h_m;
        let Around { v, v_low, v_high, d_e, here, low, high } = around;
        let per_interval = |v: f64, at: &Operating<'_>, p: f64| h / v * at.fuel_charged_g_s(p);
        self.ge[k] = (per_interval(*v_high, high, p) - per_interval(*v_low, low, p)) / d_e;
        let phi = here.traction_m_s2();
        let slope = (high.traction_m_s2() - low.traction_m_s2()) / d_e;
        self.phi1[k] = slope;
        self.phi0[k] = phi - slope * self.mean0[k];
        // Quadratic through the map at zero wheel force, half way and full traction; only
        // its convex part. Below zero wheel force a straight line to fuel cut-off, where
        // the true flow is zero: with a map that jumps there, its lower convex hull.
        let kink = here.overrun_m_s2().min(0.9 * phi);
        let fuel = |p: f64| per_interval(*v, here, p);
        let Parabola { q1, q2, first_g } = Parabola::through(fuel, kink, 0.5 * (phi - kink));
        let zero = match cut {
            CutModel::Hull => 0.0,
            CutModel::Charged => fuel(0.0),
        };
        let below = (first_g - zero) / kink;
        let above = q1 + q2 * kink;
        (self.q1[k], self.q2[k], self.kink[k]) = (q1, q2, kink);
        self.discount[k] = (above - below).max(LEAST_DISCOUNT * above);
    }

    /// Leaves marked intervals (empty: none) no traction beyond the solver's interior.
    pub fn force_cut(&mut self, marked: &[bool]) {
        for (k, _) in marked.iter().enumerate().filter(|(_, m)| **m) {
            self.phi0[k] = NEUTRAL_TRACTION;
            self.phi1[k] = 0.0;
        }
    }

    /// Linearised duration of the trip for energies `e` (per node), s.
    #[must_use]
    pub fn time_s(&self, e: &[f64]) -> f64 {
        (0..self.n).map(|k| self.t0[k] + self.ta[k] * e[k] + self.tb[k] * e[k + 1]).sum()
    }

    /// Traction of interval `k`, m/s².
    #[must_use]
    pub fn p(&self, k: usize, e: &[f64], b: f64) -> f64 {
        self.a0[k] * e[k] + self.a1[k] * e[k + 1] + b + self.r[k]
    }

    /// Marginal fuel of traction at `p`, g per m/s².
    #[must_use]
    pub fn marginal(&self, k: usize, p: f64) -> f64 {
        self.q1[k] + self.q2[k] * p
    }
}

/// Speeds a little below and above `v`, m/s, and the energy between them, J/kg.
fn slope_range(v: f64) -> (f64, f64, f64) {
    let low = (v - SLOPE_STEP).max(0.5 * v);
    let high = v + SLOPE_STEP;
    (low, high, 0.5 * (high * high - low * low))
}

/// The engine at the speed of an interval and a little below and above it.
struct Around<'a> {
    v: f64,
    v_low: f64,
    v_high: f64,
    d_e: f64,
    here: Operating<'a>,
    low: Operating<'a>,
    high: Operating<'a>,
}

impl<'a> Around<'a> {
    fn new(truck: &'a Truck, g: usize, v: f64) -> Self {
        let (v_low, v_high, d_e) = slope_range(v);
        let [here, low, high] = [v, v_low, v_high].map(|v| truck.at(g, v));
        Self { v, v_low, v_high, d_e, here, low, high }
    }

    /// Overrun drag per mass and its slope in the mean energy.
    fn overrun_line(&self) -> (f64, f64) {
        let rise = self.high.overrun_m_s2() - self.low.overrun_m_s2();
        (self.here.overrun_m_s2(), rise / self.d_e)
    }
}
