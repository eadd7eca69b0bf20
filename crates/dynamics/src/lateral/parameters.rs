//! The lateral part of a truck file, its checks, and the static axle loads.
//!
//! | symbol | field | paper |
//! |---|---|---|
//! | m_c, I_c | tractor mass, yaw inertia | Eq. 4 |
//! | L_c1, L_c2 | CG to steer axle, CG to drive-group centre | Fig. 7 |
//! | i_2, i_3 | half spread of drive and trailer group | Fig. 7 |
//! | L_h | hitch behind the tractor's CG | Eq. 5 |
//! | m_t, I_t | trailer mass and yaw inertia with payload | Eq. 4 |
//! | L_t1, L_t2 | hitch to trailer CG, trailer CG to axle group | Fig. 7 |
//!
//! Axle loads are static: a beam on the axle-group centres, equal loads within a group (air or
//! equalised suspension).

use serde::{Deserialize, Serialize};
use tractrix_core::GRAVITY_M_S2;

use super::{AXLES, LoadTransferParameters, SteeringParameters, TyreParameters};

/// Everything that a truck file says about lateral behaviour.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LateralParameters {
    /// The tractor.
    pub tractor: TractorParameters,
    /// The empty trailer.
    pub trailer: TrailerParameters,
    /// What the trailer carries.
    pub payload: PayloadParameters,
    /// Tyres of all axles.
    pub tyres: TyreParameters,
    /// Hand wheel to road wheel.
    pub steering: SteeringParameters,
    /// Heights and tracks for load transfer and rollover.
    pub load_transfer: LoadTransferParameters,
    /// Largest articulation angle, rad, at which the bodies touch.
    pub max_articulation_rad: f64,
}

/// The tractor as a rigid body.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TractorParameters {
    /// Mass, kg (m_c).
    pub mass_kg: f64,
    /// Yaw inertia about the CG, kg m² (I_c).
    pub yaw_inertia_kg_m2: f64,
    /// Steer axle ahead of the CG, m (L_c1).
    pub steer_axle_ahead_of_cg_m: f64,
    /// Drive-axle-group centre behind the CG, m (L_c2).
    pub drive_group_behind_cg_m: f64,
    /// Half the distance of the two drive axles, m (i_2); 0 for a single axle.
    pub drive_half_spread_m: f64,
    /// Hitch behind the CG, m (L_h).
    pub hitch_behind_cg_m: f64,
}

/// The empty semitrailer as a rigid body.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrailerParameters {
    /// Empty mass, kg.
    pub mass_kg: f64,
    /// Yaw inertia of the empty trailer about its CG, kg m².
    pub yaw_inertia_kg_m2: f64,
    /// CG of the empty trailer behind the hitch, m.
    pub cg_behind_hitch_m: f64,
    /// Axle-group centre behind the hitch, m (L_t1 + L_t2).
    pub axle_group_behind_hitch_m: f64,
    /// Distance from the middle axle to the outer ones, m (i_3); 0 for a single axle.
    pub axle_half_spread_m: f64,
}

/// The payload on the trailer.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PayloadParameters {
    /// Mass, kg.
    pub mass_kg: f64,
    /// CG behind the hitch, m.
    pub cg_behind_hitch_m: f64,
    /// Squared radius of gyration in yaw, m².
    pub yaw_gyration_squared_m2: f64,
}

/// Why a set of lateral parameters cannot be used: every violation at once.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("lateral parameters: {}", violations.join("; "))]
pub struct LateralError {
    /// One sentence per violated bound, with key and value.
    pub violations: Vec<String>,
}

/// The loaded trailer: empty trailer and payload as one rigid body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LoadedTrailer {
    pub(super) mass_kg: f64,
    pub(super) yaw_inertia_kg_m2: f64,
    /// L_t1.
    pub(super) cg_behind_hitch_m: f64,
}

impl LateralParameters {
    /// Lists every bound that the parameters violate, with key and value; empty when usable.
    #[must_use]
    pub fn violations(&self) -> Vec<String> {
        let mut out = Vec::new();
        let mut check = |key: &str, value: f64, low: f64, high: f64| {
            if !(value >= low && value <= high) {
                out.push(format!("{key} = {value} is outside {low} to {high}"));
            }
        };
        let (c, t, p) = (&self.tractor, &self.trailer, &self.payload);
        check("tractor.mass_kg", c.mass_kg, 100.0, 1e5);
        check("tractor.yaw_inertia_kg_m2", c.yaw_inertia_kg_m2, 10.0, 1e8);
        check("tractor.steer_axle_ahead_of_cg_m", c.steer_axle_ahead_of_cg_m, 0.1, 20.0);
        check("tractor.drive_group_behind_cg_m", c.drive_group_behind_cg_m, 0.1, 20.0);
        check("tractor.drive_half_spread_m", c.drive_half_spread_m, 0.0, 3.0);
        check("tractor.hitch_behind_cg_m", c.hitch_behind_cg_m, -5.0, 20.0);
        check("trailer.mass_kg", t.mass_kg, 1.0, 2e5);
        check("trailer.yaw_inertia_kg_m2", t.yaw_inertia_kg_m2, 1.0, 1e9);
        check("trailer.cg_behind_hitch_m", t.cg_behind_hitch_m, 0.0, 30.0);
        check("trailer.axle_group_behind_hitch_m", t.axle_group_behind_hitch_m, 0.5, 30.0);
        check(
            "trailer.axle_half_spread_m",
            t.axle_half_spread_m,
            0.0,
            0.5 * t.axle_group_behind_hitch_m,
        );
        check("payload.mass_kg", p.mass_kg, 0.0, 2e5);
        check("payload.cg_behind_hitch_m", p.cg_behind_hitch_m, -5.0, 30.0);
        check("payload.yaw_gyration_squared_m2", p.yaw_gyration_squared_m2, 0.0, 200.0);
        check("max_articulation_rad", self.max_articulation_rad, 0.1, 3.1);
        self.tyres.check(&mut check);
        self.steering.check(&mut check);
        self.load_transfer.check(&mut check);
        if out.is_empty() {
            for (axle, load) in self.static_axle_load_n().iter().enumerate() {
                if *load <= 0.0 {
                    out.push(format!("axle {} carries {load} N: it lifts off", axle + 1));
                }
            }
        }
        out
    }

    /// Empty trailer and payload as one rigid body (parallel-axis theorem).
    pub(super) fn loaded_trailer(&self) -> LoadedTrailer {
        let (t, p) = (&self.trailer, &self.payload);
        let mass = t.mass_kg + p.mass_kg;
        let cg = (t.mass_kg * t.cg_behind_hitch_m + p.mass_kg * p.cg_behind_hitch_m) / mass;
        let (dt, dp) = (t.cg_behind_hitch_m - cg, p.cg_behind_hitch_m - cg);
        LoadedTrailer {
            mass_kg: mass,
            yaw_inertia_kg_m2: t.yaw_inertia_kg_m2
                + t.mass_kg * dt * dt
                + p.mass_kg * (p.yaw_gyration_squared_m2 + dp * dp),
            cg_behind_hitch_m: cg,
        }
    }

    /// Total mass, kg.
    #[must_use]
    pub fn total_mass_kg(&self) -> f64 {
        self.tractor.mass_kg + self.trailer.mass_kg + self.payload.mass_kg
    }

    /// Static vertical load per axle on a level road, N: steer, two drive, three trailer axles.
    #[must_use]
    pub fn static_axle_load_n(&self) -> [f64; AXLES] {
        let (c, t) = (&self.tractor, self.loaded_trailer());
        let trailer_weight = t.mass_kg * GRAVITY_M_S2;
        let group = trailer_weight * t.cg_behind_hitch_m / self.trailer.axle_group_behind_hitch_m;
        let hitch = trailer_weight - group;
        let wheelbase = c.steer_axle_ahead_of_cg_m + c.drive_group_behind_cg_m;
        let weight = c.mass_kg * GRAVITY_M_S2;
        let steer = (weight * c.drive_group_behind_cg_m
            + hitch * (c.drive_group_behind_cg_m - c.hitch_behind_cg_m))
            / wheelbase;
        let drive = 0.5 * (weight + hitch - steer);
        [steer, drive, drive, group / 3.0, group / 3.0, group / 3.0]
    }

    /// Distance of every axle from its body's datum, m: ahead of the tractor's CG for the first
    /// three (negative behind), behind the hitch for the trailer's.
    pub(super) fn axle_positions_m(&self) -> [f64; AXLES] {
        let (c, t) = (&self.tractor, &self.trailer);
        [
            c.steer_axle_ahead_of_cg_m,
            -(c.drive_group_behind_cg_m - c.drive_half_spread_m),
            -(c.drive_group_behind_cg_m + c.drive_half_spread_m),
            t.axle_group_behind_hitch_m - t.axle_half_spread_m,
            t.axle_group_behind_hitch_m,
            t.axle_group_behind_hitch_m + t.axle_half_spread_m,
        ]
    }
}
