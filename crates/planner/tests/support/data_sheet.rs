//! The reference truck's data sheet for this crate's unit tests.

#![allow(dead_code, unreachable_pub, clippy::unwrap_used)]
use std::vec;
use std::vec::Vec;
use tractrix_core::{
    BrakeLimits, Curve, FuelModel, Geometry, LateralLimits, LowLoadFuel, PowertrainLimits,
    RPM_PER_RAD_S, RoadLoad, VehicleLimits,
};

/// Geometry of the reference truck.
pub fn reference_geometry() -> Geometry {
    Geometry {
        front_m: 5.3,
        wheelbase_m: 3.9,
        cg_ahead_m: 1.55,
        hitch_ahead_m: 0.3,
        hitch_to_trailer_axle_m: 7.9,
        trailer_front_m: 1.6,
        trailer_rear_m: 12.0,
        tractor_rear_m: 1.4,
        width_m: 2.55,
    }
}

/// The data sheet's cornering stiffness of one axle, N/rad, from its static load.
fn axle_stiffness(load_kg: f64, tyres: f64) -> f64 {
    let load_n = load_kg * 9.80665;
    7.4 * load_n * (1.0 - 0.18 * (load_n / tyres / 30e3 - 1.0))
}

/// Handling of the reference truck at 55 t.
pub fn reference_lateral() -> LateralLimits {
    LateralLimits {
        steering_ratio: 24.0,
        steering_lag_s: 0.08,
        tractor_mass_kg: 9200.0,
        tractor_inertia_kg_m2: 45_000.0,
        trailer_mass_kg: 45_800.0,
        trailer_inertia_kg_m2: 600_000.0,
        trailer_cg_behind_hitch_m: 5.6,
        drive_half_spread_m: 0.7,
        trailer_half_spread_m: 1.2,
        steer_stiffness_n_rad: axle_stiffness(4682.1, 2.0),
        drive_stiffness_n_rad: 2.0 * axle_stiffness(8926.0, 4.0),
        trailer_stiffness_n_rad: 3.0 * axle_stiffness(10_821.9, 4.0),
        rollover_accel_m_s2: 3.8,
        max_road_wheel_rad: 0.7,
    }
}

/// The whole data sheet at 55 t.
pub fn reference_limits() -> VehicleLimits {
    let rpm: Vec<f64> = vec![
        600.0, 700.0, 800.0, 900.0, 1000.0, 1100.0, 1400.0, 1500.0, 1600.0, 1700.0, 1800.0, 1950.0,
        2100.0,
    ];
    let full = vec![
        1400.0, 1700.0, 2002.0, 2295.0, 2586.0, 2600.0, 2600.0, 2568.0, 2457.0, 2313.0, 2185.0,
        1700.0, 0.0,
    ];
    let speed: Vec<f64> = rpm.iter().map(|n| n / RPM_PER_RAD_S).collect();
    let of_rpm = |f: fn(f64) -> f64| rpm.iter().map(|n| f(*n)).collect::<Vec<_>>();
    let ratios =
        vec![15.012, 11.667, 9.03, 7.146, 5.568, 4.375, 3.431, 2.667, 2.064, 1.633, 1.273, 1.0];
    let rotating = |r: &f64| (288.0 + 3.5 * (r * 2.85) * (r * 2.85)) / (0.53 * 0.53);
    VehicleLimits {
        geometry: reference_geometry(),
        powertrain: PowertrainLimits {
            gear_efficiency_frac: vec![0.98 * 0.97; 12],
            rotating_mass_kg: ratios.iter().map(rotating).collect(),
            rotating_mass_neutral_kg: 288.0 / (0.53 * 0.53),
            gear_ratios: ratios,
            final_drive_ratio: 2.85,
            wheel_radius_m: 0.53,
            full_load_nm: Curve::new("full_load", speed.clone(), full).unwrap(),
            friction_nm: Curve::new("friction", speed.clone(), of_rpm(|n| 95.0 + 0.085 * n))
                .unwrap(),
            engine_brake_nm: Curve::new("brake", speed, of_rpm(|n| 100.0 + 0.45 * n)).unwrap(),
            retarder_force_n: None,
            auxiliary_power_w: 4000.0,
            idle_speed_rad_s: 600.0 / RPM_PER_RAD_S,
            max_speed_rad_s: 2100.0 / RPM_PER_RAD_S,
            lugging_speed_rad_s: 750.0 / RPM_PER_RAD_S,
            fuel: FuelModel::Willans {
                constant_g_s: 0.05,
                per_rpm_g_s: 0.000_12,
                per_kw_g_s: 0.0505,
                low_load: LowLoadFuel::default(),
            },
            idle_fuel_g_s: 0.6,
            shift_duration_s: 1.0,
            pedal_map_nm: None,
            fuel_density_kg_m3: 835.0,
        },
        road_load: RoadLoad {
            mass_kg: 55_000.0,
            cd_a_m2: 6.2,
            air_density_kg_m3: 1.2,
            rolling_coeff: 0.0062,
            ..RoadLoad::default()
        },
        brakes: BrakeLimits { max_decel_m_s2: 4.4, dead_time_s: 0.25, build_up_s: 0.8 },
        lateral: reference_lateral(),
    }
}
