//! The truck as the replay needs it: figures of the truck file in SI units.

use dynamics::lateral::LateralParameters;
use tractrix_core::Curve;

/// Longitudinal figures and the lateral parameters of a truck.
#[derive(Debug, Clone, PartialEq)]
pub struct Plant {
    /// Name of the truck file.
    pub name: String,
    /// Mass assumed where a drive reports none, kg.
    pub mass_kg: f64,
    /// Dynamic wheel radius, m.
    pub wheel_radius_m: f64,
    /// Rolling resistance coefficient.
    pub rolling_coeff: f64,
    /// Drag area, m².
    pub cd_a_m2: f64,
    /// Growth of drag per degree of air yaw.
    pub drag_yaw_frac_per_deg: f64,
    /// Side area times side-force slope, m²/deg.
    pub side_area_m2_per_deg: f64,
    /// Part of the side force that acts on the tractor.
    pub side_force_tractor_frac: f64,
    /// Gearbox ratios, first gear first.
    pub gear_ratios: Vec<f64>,
    /// Final drive ratio.
    pub final_drive_ratio: f64,
    /// Efficiency gearbox input to wheel.
    pub efficiency_frac: f64,
    /// Inertia of all wheels, kg m².
    pub wheel_inertia_kg_m2: f64,
    /// Inertia of the engine, kg m².
    pub engine_inertia_kg_m2: f64,
    /// Full-load brake torque over engine speed in rpm, Nm.
    pub full_load_nm: Curve,
    /// Friction torque `a + b n`, Nm with n in rpm.
    pub friction_nm: [f64; 2],
    /// Reference torque of the percent signals, Nm.
    pub reference_torque_nm: f64,
    /// Idle speed, rpm.
    pub idle_speed_rpm: f64,
    /// Torque build-up lag above [`Self::boost_from_frac`] of full load, s, and below it.
    pub torque_lag_s: [f64; 2],
    /// Part of full load above which boost is needed.
    pub boost_from_frac: f64,
    /// Dead time from pedal to torque demand, s.
    pub pedal_delay_s: f64,
    /// Auxiliary power at the crank, W.
    pub auxiliary_power_w: f64,
    /// Engine brake at full stage `a + b n`, Nm with n in rpm.
    pub engine_brake_nm: [f64; 2],
    /// Duration of a shift, s.
    pub shift_duration_s: f64,
    /// Brake force per pressure, N/kPa.
    pub brake_gain_n_kpa: f64,
    /// Dead time of the brake, s.
    pub brake_delay_s: f64,
    /// Lag of the brake, s.
    pub brake_lag_s: f64,
    /// Pressure rates up and down, kPa/s.
    pub brake_rate_kpa_s: [f64; 2],
    /// Heat capacity of the brakes, J/K.
    pub brake_heat_capacity_j_k: f64,
    /// Cooling time constant of the brakes, s.
    pub brake_cooling_s: f64,
    /// Fuel `a + b n + c P_ind`, g/s with n in rpm and P in kW.
    pub fuel: [f64; 3],
    /// Lateral parameters, empty trailer.
    pub lateral: LateralParameters,
}
