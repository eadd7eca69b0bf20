//! What a solver returns for a subproblem.

use alloc::vec::Vec;

/// How a solve ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SolveStatus {
    /// Optimal within tolerance.
    Solved,
    /// Usable, but stopped early.
    AlmostSolved,
    /// No point satisfies the constraints.
    Infeasible,
    /// The iteration limit or a numerical failure.
    #[default]
    Failed,
}

/// Solution of one subproblem.
#[derive(Debug, Clone, Default)]
pub struct Solution {
    /// How it ended.
    pub status: SolveStatus,
    /// Specific energy per node, J/kg.
    pub e_j_kg: Vec<f64>,
    /// Brake force per mass per interval, m/s².
    pub b_m_s2: Vec<f64>,
    /// Multiplier of the traction envelope minus those of fuel cut-off and of the kink, per
    /// interval, g per m/s²: worth of traction beyond its marginal fuel.
    pub traction_price: Vec<f64>,
    /// Multiplier of fuel cut-off, per interval, g per m/s².
    pub cut_price: Vec<f64>,
    /// Price of time, g/s: given, or the multiplier of the trip time.
    pub beta_g_s: f64,
    /// Interior-point iterations.
    pub iterations: u32,
}
