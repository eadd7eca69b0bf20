//! The reference truck: the data sheet that the measured drives of the contract are made with.

use dynamics::lateral::{
    LateralParameters, LoadTransferParameters, PayloadParameters, SteeringParameters,
    TractorParameters, TrailerParameters, TyreLaw, TyreParameters,
};
use tractrix_core::{CoreError, Curve};

use crate::Plant;

impl Plant {
    /// The reference truck.
    ///
    /// # Errors
    /// None in practice: the table is checked by a test.
    pub fn reference() -> Result<Self, CoreError> {
        let rpm = [
            600.0, 700.0, 800.0, 900.0, 1000.0, 1100.0, 1400.0, 1500.0, 1600.0, 1700.0, 1800.0,
            1950.0, 2100.0,
        ];
        let nm = [
            1400.0, 1700.0, 2002.0, 2295.0, 2586.0, 2600.0, 2600.0, 2568.0, 2457.0, 2313.0, 2185.0,
            1700.0, 0.0,
        ];
        Ok(Self {
            name: "reference".to_owned(),
            mass_kg: 38_000.0,
            wheel_radius_m: 0.53,
            rolling_coeff: 0.0062,
            cd_a_m2: 6.2,
            drag_yaw_frac_per_deg: 0.018,
            side_area_m2_per_deg: 0.7,
            side_force_tractor_frac: 0.25,
            gear_ratios: vec![
                15.012, 11.667, 9.03, 7.146, 5.568, 4.375, 3.431, 2.667, 2.064, 1.633, 1.273, 1.0,
            ],
            final_drive_ratio: 2.85,
            efficiency_frac: 0.98 * 0.97,
            wheel_inertia_kg_m2: 12.0 * 24.0,
            engine_inertia_kg_m2: 3.5,
            full_load_nm: Curve::new("full_load_nm", rpm.to_vec(), nm.to_vec())?,
            friction_nm: [95.0, 0.085],
            reference_torque_nm: 2700.0,
            idle_speed_rpm: 600.0,
            torque_lag_s: [0.45, 0.15],
            boost_from_frac: 0.35,
            pedal_delay_s: 0.05,
            auxiliary_power_w: 4000.0,
            engine_brake_nm: [100.0, 0.45],
            shift_duration_s: 1.0,
            brake_gain_n_kpa: 400.0,
            brake_delay_s: 0.25,
            brake_lag_s: 0.15,
            brake_rate_kpa_s: [500.0, 1000.0],
            brake_heat_capacity_j_k: 200_000.0,
            brake_cooling_s: 600.0,
            fuel: [0.05, 0.000_12, 0.0505],
            lateral: reference_lateral(),
        })
    }
}

fn reference_lateral() -> LateralParameters {
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
            stiffness_scale: [1.0; 3],
            axle_stiffness_n_rad: None,
            law: TyreLaw::Linear,
        },
        steering: SteeringParameters {
            ratio: 24.0,
            lag_s: 0.08,
            free_play_rad: 0.0,
            offset_rad: 0.0,
            max_wheel_rad: 16.0,
            max_wheel_rate_rad_s: 20.0,
        },
        load_transfer: LoadTransferParameters {
            tractor_cg_height_m: 1.05,
            trailer_cg_height_m: 1.25,
            payload_cg_height_m: 1.95,
            track_m: [2.04, 1.86, 1.86],
            roll_factor_coeff: 1.15,
        },
        max_articulation_rad: 1.4,
    }
}
