//! What a planner may know about the truck: geometry, powertrain, road load, brakes, handling.
//!
//! The planner never sees the plant's model. A simulated truck fills these from its truck file, a
//! real one from its data sheet and its estimators.

use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use crate::{Curve, FuelModel, Grid, RoadLoad};

/// Lengths of the combination. "Ahead" and "behind" refer to the reference point: the centre of
/// the tractor's drive-axle group, on the ground.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Geometry {
    /// Front bumper ahead of the reference point, m.
    pub front_m: f64,
    /// Steer axle ahead of the reference point, m (wheelbase L of Eq. 1).
    pub wheelbase_m: f64,
    /// Tractor centre of gravity ahead of the reference point, m (L_c2 of Fig. 7).
    pub cg_ahead_m: f64,
    /// Hitch ahead of the reference point, m (minus L_1 of Eq. 1).
    pub hitch_ahead_m: f64,
    /// Trailer axle-group centre behind the hitch, m (L_2 of Eq. 1).
    pub hitch_to_trailer_axle_m: f64,
    /// Trailer front edge ahead of the hitch, m.
    pub trailer_front_m: f64,
    /// Trailer rear bumper behind the hitch, m.
    pub trailer_rear_m: f64,
    /// Tractor rear end behind the reference point, m.
    pub tractor_rear_m: f64,
    /// Body width, m.
    pub width_m: f64,
}

impl Geometry {
    /// Rear bumper behind the reference point when the combination is straight, m.
    #[must_use]
    pub fn rear_m(&self) -> f64 {
        self.trailer_rear_m - self.hitch_ahead_m
    }

    /// Overall length when straight, m.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.front_m + self.rear_m()
    }
}

/// Engine and driveline as a planner needs them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PowertrainLimits {
    /// Gearbox ratios, first gear first.
    pub gear_ratios: Vec<f64>,
    /// Efficiency gearbox input to wheel, per gear, 0 to 1.
    pub gear_efficiency_frac: Vec<f64>,
    /// Rotating inertia felt as mass at the wheels with the clutch closed, kg, per gear.
    pub rotating_mass_kg: Vec<f64>,
    /// Rotating inertia felt as mass with the driveline open, kg.
    pub rotating_mass_neutral_kg: f64,
    /// Final drive ratio.
    pub final_drive_ratio: f64,
    /// Dynamic wheel radius, m.
    pub wheel_radius_m: f64,
    /// Full-load brake torque over engine speed (rad/s), Nm.
    pub full_load_nm: Curve,
    /// Friction torque over engine speed (rad/s), Nm, positive.
    pub friction_nm: Curve,
    /// Engine-brake torque at the crank at full demand over engine speed, Nm, positive.
    pub engine_brake_nm: Curve,
    /// Force of a retarder behind the gearbox at the wheels at full demand over road speed (m/s), N,
    /// positive; it adds to the engine brake. `None`: there is no such retarder.
    #[serde(default)]
    pub retarder_force_n: Option<Curve>,
    /// Auxiliary power at the crank, W, with the mean of a fan that runs by temperature.
    pub auxiliary_power_w: f64,
    /// Idle speed, rad/s.
    pub idle_speed_rad_s: f64,
    /// Highest governed speed, rad/s.
    pub max_speed_rad_s: f64,
    /// Lowest engine speed at which a gear is kept under power, rad/s: the gearbox's own limit.
    pub lugging_speed_rad_s: f64,
    /// Fuel flow.
    pub fuel: FuelModel,
    /// Fuel flow at idle with the driveline open, g/s.
    pub idle_fuel_g_s: f64,
    /// Time without traction during a shift, s.
    pub shift_duration_s: f64,
    /// Indicated torque over (pedal 0 to 1, engine speed rad/s), Nm. `None`: torque = pedal ×
    /// (full load + friction).
    pub pedal_map_nm: Option<Grid>,
    /// Density of the fuel, kg/m³.
    pub fuel_density_kg_m3: f64,
}

/// Brakes as a planner needs them.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct BrakeLimits {
    /// Largest service deceleration that may be relied on at this mass, m/s², level road.
    pub max_decel_m_s2: f64,
    /// Dead time of the pneumatics, s.
    pub dead_time_s: f64,
    /// Time from the first pressure to the full one, s.
    pub build_up_s: f64,
}

/// Handling as a lateral controller needs it (linear single-track with trailer).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct LateralLimits {
    /// Steering ratio, hand wheel to road wheel.
    pub steering_ratio: f64,
    /// Steering lag, s.
    pub steering_lag_s: f64,
    /// Tractor mass, kg.
    pub tractor_mass_kg: f64,
    /// Tractor yaw inertia, kg m².
    pub tractor_inertia_kg_m2: f64,
    /// Trailer mass with payload, kg.
    pub trailer_mass_kg: f64,
    /// Trailer yaw inertia with payload, kg m².
    pub trailer_inertia_kg_m2: f64,
    /// Trailer centre of gravity behind the hitch, m.
    pub trailer_cg_behind_hitch_m: f64,
    /// Half the drive-axle spread, m (i_2).
    pub drive_half_spread_m: f64,
    /// Half the trailer-group spread, m (i_3).
    pub trailer_half_spread_m: f64,
    /// Cornering stiffness of the steer axle, N/rad.
    pub steer_stiffness_n_rad: f64,
    /// Cornering stiffness of all drive axles together, N/rad.
    pub drive_stiffness_n_rad: f64,
    /// Cornering stiffness of all trailer axles together, N/rad.
    pub trailer_stiffness_n_rad: f64,
    /// Lateral acceleration at which the inner wheels lift, m/s².
    pub rollover_accel_m_s2: f64,
    /// Largest road-wheel angle, rad.
    pub max_road_wheel_rad: f64,
}

/// Everything that a planner may know about the truck.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VehicleLimits {
    /// Lengths.
    pub geometry: Geometry,
    /// Engine and driveline.
    pub powertrain: PowertrainLimits,
    /// Road load.
    pub road_load: RoadLoad,
    /// Brakes.
    pub brakes: BrakeLimits,
    /// Handling.
    pub lateral: LateralLimits,
}
