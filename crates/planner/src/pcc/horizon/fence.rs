//! The fence behind a vehicle ahead: earliest times at which the truck may pass the stations ahead.
//!
//! | symbol | unit | meaning |
//! |---|---|---|
//! | `g`, `g*` | m | gap now (front bumper to rear bumper), wanted gap |
//! | `v_l` | m/s | predicted speed of the vehicle ahead, constant |
//! | `t_f,k` | s | earliest time at node `k`: `(k h + g* - g)/v_l` |
//!
//! The gap at time `t_k` is `g + v_l t_k - k h`; it is at least `g*` exactly if `t_k >= t_f,k`.
//!
//! **Safe side.** The subproblem knows elapsed time only to first order around a profile `E⁰`:
//! `t_lin(E) = t(E⁰) + ∇t(E⁰)(E - E⁰)`. The duration of an interval, `2h/(√(2E_k) + √(2E_{k+1}))`,
//! is the reciprocal of a positive concave function of `(E_k, E_{k+1})`, hence convex; elapsed time
//! is a sum of such durations, hence convex; and a convex function lies above its tangents:
//! `t(E) >= t_lin(E)` for every `E`. So `t_lin(E) >= t_f,k`, which the solver sees to, implies
//! `t(E) >= t_f,k`: every iterate keeps the gap in truth, converged or not, whatever the solver's
//! starting profile was. It also implies that an iterate is a feasible point of the next
//! subproblem, which is linearised around it and exact there: an iteration that starts from a
//! profile behind the fence never becomes infeasible.
//!
//! That starting profile is [`Fence::follow_e_j_kg`]: the truck slows down comfortably until it is
//! behind the fence. Where even that is too early (somebody has just cut in) the fence yields to it.

use alloc::vec::Vec;

use crate::pcc::model::{Course, E_FLOOR, Truck, duration_s};

/// The vehicle ahead, as predicted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeadAhead {
    /// Identifier.
    pub id: u64,
    /// Gap, front bumper to rear bumper, m.
    pub gap_m: f64,
    /// Its speed, m/s, taken as constant.
    pub speed_m_s: f64,
    /// Gap to be kept, m.
    pub wanted_gap_m: f64,
}

/// Earliest times, and a profile that keeps them.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Fence {
    /// Earliest time per node, s; `-∞` where it does not bind.
    pub earliest_s: Vec<f64>,
    /// Energies per node of a profile that keeps them, J/kg.
    pub follow_e_j_kg: Vec<f64>,
}

/// Deceleration of the following profile, m/s².
const COMFORT_M_S2: f64 = 0.5;
/// The following profile falls this much below the lead's speed to open the gap, m/s.
const OPENING_M_S: f64 = 1.5;
/// The fence is this much earlier than the following profile, s: room for the solver's interior.
const ROOM_S: f64 = 2e-3;

impl Fence {
    /// The fence of `lead`, which is predicted for `valid_s`; `free_e` is the profile that would be
    /// driven without it (energies per node).
    #[must_use]
    pub(super) fn new(
        truck: &Truck,
        course: &Course,
        free_e: &[f64],
        lead: &LeadAhead,
        valid_s: f64,
    ) -> Self {
        let h = course.h_m;
        let earliest = |k: usize| {
            let t = (k as f64 * h + lead.wanted_gap_m - lead.gap_m) / lead.speed_m_s.max(0.1);
            if t <= valid_s { t } else { f64::NEG_INFINITY }
        };
        let opening = (lead.speed_m_s - OPENING_M_S).max(1.0);
        let (slow_e, lead_e) = (0.5 * opening * opening, 0.5 * lead.speed_m_s * lead.speed_m_s);
        let mut fence = Self::default();
        let (mut e, mut t) = (free_e[0], 0.0);
        fence.follow_e_j_kg.push(e);
        fence.earliest_s.push(f64::NEG_INFINITY);
        for k in 0..course.n() {
            let bound = earliest(k + 1);
            let held = 0.9 * course.brake_m_s2 + truck.resistance_m_s2(e, &course.road[k]);
            let slowest =
                (e - COMFORT_M_S2.min(held.max(0.02)) * h).max(slow_e.min(e)).max(E_FLOOR);
            // As fast as without a lead, at its speed, or slower, whichever keeps the fence.
            let free = free_e[k + 1].min(e + 0.3 * h).max(slowest);
            let matched = lead_e.clamp(slowest, free);
            let next = [free, matched]
                .into_iter()
                .find(|&next| {
                    let after = t + duration_s(h, e, next);
                    let brake_m = ((next - lead_e) / COMFORT_M_S2).max(0.0);
                    let then_s = 2.0 * brake_m / (libm::sqrt(2.0 * next) + lead.speed_m_s).max(1.0);
                    let ahead = (k + 1) as f64 * h + brake_m + lead.wanted_gap_m - lead.gap_m;
                    let keeps_on =
                        bound == f64::NEG_INFINITY || (after + then_s) * lead.speed_m_s >= ahead;
                    after >= bound && keeps_on
                })
                .unwrap_or(slowest);
            t += duration_s(h, e, next);
            e = next;
            fence.follow_e_j_kg.push(e);
            fence.earliest_s.push(bound.min(t - ROOM_S));
        }
        fence
    }

    /// Whether a profile (energies per node) passes a node too early.
    #[must_use]
    pub(super) fn cuts(&self, h_m: f64, e_j_kg: &[f64]) -> bool {
        let mut t = 0.0;
        e_j_kg.windows(2).zip(self.earliest_s.iter().skip(1)).any(|(w, &earliest)| {
            t += duration_s(h_m, w[0], w[1]);
            t < earliest - 1e-6
        })
    }
}
