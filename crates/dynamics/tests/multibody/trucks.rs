//! Trucks that the lateral tests drive: the project's reference combination with its published
//! loading states.

use dynamics::lateral::{
    LateralParameters, LoadTransferParameters, PayloadParameters, SteeringParameters,
    TractorParameters, TrailerParameters, TyreLaw, TyreParameters,
};

/// 3-axle tractor with an empty 3-axle semitrailer, 19 t.
pub(crate) fn empty_19t() -> LateralParameters {
    LateralParameters {
        tractor: TractorParameters {
            mass_kg: 9200.0,
            yaw_inertia_kg_m2: 45_000.0,
            steer_axle_ahead_of_cg_m: 2.35,
            drive_group_behind_cg_m: 1.55,
            drive_half_spread_m: 0.70,
            hitch_behind_cg_m: 1.25,
        },
        trailer: TrailerParameters {
            mass_kg: 9800.0,
            yaw_inertia_kg_m2: 170_000.0,
            cg_behind_hitch_m: 5.0,
            axle_group_behind_hitch_m: 7.9,
            axle_half_spread_m: 1.20,
        },
        payload: PayloadParameters {
            mass_kg: 0.0,
            cg_behind_hitch_m: 5.764,
            yaw_gyration_squared_m2: 9.9,
        },
        tyres: TyreParameters {
            cornering_coeff_per_rad: 7.4,
            load_degression_frac: 0.18,
            rated_load_n: 30_000.0,
            tyres_per_axle: [2.0, 4.0, 4.0],
            relaxation_length_m: 0.0,
            stiffness_scale: [1.0; 3],
            axle_stiffness_n_rad: None,
            law: TyreLaw::Linear,
        },
        steering: SteeringParameters {
            ratio: 24.0,
            lag_s: 0.08,
            free_play_centring_1_s: 0.0,
            free_play_rad: 0.0,
            offset_rad: 0.0,
            max_wheel_rad: 16.0,
            max_wheel_rate_rad_s: 20.0,
        },
        load_transfer: LoadTransferParameters {
            tractor_cg_height_m: 1.05,
            trailer_cg_height_m: 1.25,
            payload_cg_height_m: 2.1,
            track_m: [2.04, 1.86, 1.86],
            roll_factor_coeff: 1.25,
        },
        max_articulation_rad: 1.4,
    }
}

/// The same combination at 55 t with the inertia of the reference table (trailer as one body).
pub(crate) fn loaded_55t() -> LateralParameters {
    let mut p = empty_19t();
    p.trailer.mass_kg = 45_800.0;
    p.trailer.yaw_inertia_kg_m2 = 600_000.0;
    p.trailer.cg_behind_hitch_m = 5.6;
    p
}

/// The rigid two-axle vehicle of the paper's released model: 18 t, one steer and one rear axle,
/// direct steering with ratio 22; the trailer is a feather without side force.
pub(crate) fn released_two_axle() -> LateralParameters {
    let mut p = empty_19t();
    p.tractor = TractorParameters {
        mass_kg: 18_000.0,
        yaw_inertia_kg_m2: 901_125.0,
        steer_axle_ahead_of_cg_m: 1.5,
        drive_group_behind_cg_m: 2.4,
        drive_half_spread_m: 0.0,
        hitch_behind_cg_m: 2.1,
    };
    (p.trailer.mass_kg, p.trailer.yaw_inertia_kg_m2) = (1.0, 10.0);
    p.tyres.axle_stiffness_n_rad = Some([4e5, 8e5, 8e5, 1.0, 1.0, 1.0]);
    (p.steering.ratio, p.steering.lag_s) = (22.0, 0.0);
    p.steering.max_wheel_rate_rad_s = 1000.0;
    p
}
