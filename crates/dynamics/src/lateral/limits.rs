//! Lateral load transfer and static rollover threshold.
//!
//! Moment balance about the ground line in a turn: the bodies' side accelerations act at their CG
//! heights, the axles resist with half a track times their load,
//!
//! ```text
//! LTR = k_roll (m_c h_c a_c + m_t h_t a_t) / (1/2 sum F_z,i T_i),   a = a_y + g bank
//! ```
//! LTR = 1 when all load is on the right wheels (left turn). `k_roll` is the roll factor: the bodies
//! lean on their suspension and tyres, so that their CGs move outward and the moment grows;
//! 1 for a rigid vehicle, 1.15 to 1.3 for loaded highway trailers (Winkler, "Rollover of heavy
//! commercial vehicles", UMTRI 1999). The threshold is the side acceleration at which |LTR| = 1 with
//! both bodies at the same acceleration.
//!
//! The fifth wheel couples the two bodies in roll, so the combination is one roll unit. Left out:
//! roll dynamics (overshoot), liquid and hanging loads, lash of the fifth wheel.

use serde::{Deserialize, Serialize};
use tractrix_core::GRAVITY_M_S2;

use super::{AXLES, LateralParameters, tyre::GROUP};

/// Heights and tracks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoadTransferParameters {
    /// Tractor CG above the ground, m.
    pub tractor_cg_height_m: f64,
    /// CG of the empty trailer above the ground, m.
    pub trailer_cg_height_m: f64,
    /// Payload CG above the ground, m.
    pub payload_cg_height_m: f64,
    /// Track of steer, drive and trailer axles, m: distance of the wheels' (of twins: the pairs')
    /// centre lines.
    pub track_m: [f64; 3],
    /// Roll factor: growth of the overturning moment by suspension roll, at least 1.
    pub roll_factor_coeff: f64,
}

/// Load transfer of one loading state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoadTransfer {
    /// LTR per side acceleration of the tractor, s²/m.
    tractor_s2_m: f64,
    /// LTR per side acceleration of the trailer, s²/m.
    trailer_s2_m: f64,
}

impl LoadTransferParameters {
    pub(super) fn check(&self, check: &mut impl FnMut(&str, f64, f64, f64)) {
        check("load_transfer.tractor_cg_height_m", self.tractor_cg_height_m, 0.1, 5.0);
        check("load_transfer.trailer_cg_height_m", self.trailer_cg_height_m, 0.1, 5.0);
        check("load_transfer.payload_cg_height_m", self.payload_cg_height_m, 0.1, 5.0);
        for t in self.track_m {
            check("load_transfer.track_m", t, 0.5, 4.0);
        }
        check("load_transfer.roll_factor_coeff", self.roll_factor_coeff, 1.0, 3.0);
    }
}

impl LoadTransfer {
    /// Load transfer of these parameters.
    #[must_use]
    pub fn new(p: &LateralParameters) -> Self {
        let h = &p.load_transfer;
        let load = p.static_axle_load_n();
        let capacity: f64 = (0..AXLES).map(|i| 0.5 * load[i] * h.track_m[GROUP[i]]).sum();
        let per_capacity = h.roll_factor_coeff / capacity;
        Self {
            tractor_s2_m: per_capacity * p.tractor.mass_kg * h.tractor_cg_height_m,
            trailer_s2_m: per_capacity
                * (p.trailer.mass_kg * h.trailer_cg_height_m
                    + p.payload.mass_kg * h.payload_cg_height_m),
        }
    }

    /// Load-transfer ratio, -1 to 1 (beyond: wheels have lifted), from the side accelerations of
    /// both CGs, m/s², and the bank, rad (left side up positive). 1 = all load on the right wheels.
    #[inline]
    #[must_use]
    pub fn ratio(&self, tractor_m_s2: f64, trailer_m_s2: f64, bank_rad: f64) -> f64 {
        let g = GRAVITY_M_S2 * bank_rad;
        self.tractor_s2_m * (tractor_m_s2 + g) + self.trailer_s2_m * (trailer_m_s2 + g)
    }

    /// Static rollover threshold on a level road, m/s².
    #[must_use]
    pub fn rollover_accel_m_s2(&self) -> f64 {
        1.0 / (self.tractor_s2_m + self.trailer_s2_m)
    }
}
