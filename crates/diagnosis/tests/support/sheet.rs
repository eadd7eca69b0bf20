//! The reference truck's data sheet in plain numbers, and what a drive changes in it. Nothing here
//! comes from the project's own models.

/// Gearbox ratios.
pub(crate) const GEARS: [f64; 12] =
    [15.012, 11.667, 9.03, 7.146, 5.568, 4.375, 3.431, 2.667, 2.064, 1.633, 1.273, 1.0];
/// Final drive.
pub(crate) const AXLE: f64 = 2.85;
/// Rolling radius, m.
pub(crate) const RADIUS_M: f64 = 0.53;
/// Gravity, m/s².
pub(crate) const G: f64 = 9.806_65;
/// rpm per rad/s.
pub(crate) const RPM: f64 = 30.0 / core::f64::consts::PI;

const FULL_LOAD: [(f64, f64); 13] = [
    (600.0, 1400.0),
    (700.0, 1700.0),
    (800.0, 2002.0),
    (900.0, 2295.0),
    (1000.0, 2586.0),
    (1100.0, 2600.0),
    (1400.0, 2600.0),
    (1500.0, 2568.0),
    (1600.0, 2457.0),
    (1700.0, 2313.0),
    (1800.0, 2185.0),
    (1950.0, 1700.0),
    (2100.0, 0.0),
];

/// Full-load torque, Nm.
pub(crate) fn full_load(rpm: f64) -> f64 {
    let mut last = FULL_LOAD[0];
    for p in FULL_LOAD {
        if rpm <= p.0 {
            let span = p.0 - last.0;
            return if span > 0.0 {
                last.1 + (p.1 - last.1) * (rpm.max(last.0) - last.0) / span
            } else {
                p.1
            };
        }
        last = p;
    }
    0.0
}

/// Friction torque, Nm.
pub(crate) fn friction(rpm: f64) -> f64 {
    95.0 + 0.085 * rpm
}

/// Engine brake at full stage, Nm.
pub(crate) fn engine_brake(rpm: f64) -> f64 {
    100.0 + 0.45 * rpm
}

/// Everything of a truck, its load, its instruments and the weather that may be off.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Figures {
    pub(crate) rolling: f64,
    pub(crate) drag_area: f64,
    pub(crate) efficiency: f64,
    /// Share that all gears but the direct one lose on top.
    pub(crate) mesh_loss: f64,
    pub(crate) friction_scale: f64,
    pub(crate) auxiliary_w: f64,
    pub(crate) boost_lag_s: f64,
    /// Part of the full load above which it acts.
    pub(crate) boost_from: f64,
    pub(crate) pedal_delay_s: f64,
    /// The engine's control unit follows the pedal with this lag.
    pub(crate) pedal_lag_s: f64,
    pub(crate) shift_extra_s: f64,
    pub(crate) brake_scale: f64,
    pub(crate) brake_delay_s: f64,
    pub(crate) engine_brake_scale: f64,
    pub(crate) fuel_scale: f64,
    pub(crate) drag_force_n: f64,
    pub(crate) mass_scale: f64,
    /// The tyres' stiffness follows the true load instead of the load sheet's.
    pub(crate) tyres_follow: bool,
    pub(crate) payload_rearward_m: f64,
    pub(crate) stiffness: [f64; 3],
    pub(crate) steer_ratio: f64,
    pub(crate) steer_offset_rad: f64,
    pub(crate) free_play_rad: f64,
    pub(crate) steer_lag_s: f64,
    /// Dead time of the steering, s.
    pub(crate) steer_delay_s: f64,
    pub(crate) bank_rad: f64,
    pub(crate) headwind: f64,
    pub(crate) crosswind: f64,
    pub(crate) wind: [f64; 2],
    /// Part of the side force that acts on the tractor.
    pub(crate) side_share: f64,
    /// How far behind the trailer's CG the rest of it acts, m.
    pub(crate) side_behind_m: f64,
    /// How far the wind turns to and fro, rad, and part by which a crosswind swells and falls.
    pub(crate) wind_turns_rad: f64,
    pub(crate) crosswind_swells: f64,
    pub(crate) grade_bias: f64,
    pub(crate) map_shift_m: f64,
    pub(crate) speed_scale: f64,
    pub(crate) yaw_bias: f64,
    pub(crate) trailer_yaw_bias: f64,
    pub(crate) accel_bias: [f64; 2],
}

impl Figures {
    /// As the data sheet says.
    pub(crate) const SHEET: Self = Self {
        rolling: 0.0062,
        drag_area: 6.2,
        efficiency: 0.98 * 0.97,
        mesh_loss: 0.0,
        friction_scale: 1.0,
        auxiliary_w: 4000.0,
        boost_lag_s: 0.45,
        boost_from: 0.35,
        pedal_delay_s: 0.05,
        pedal_lag_s: 0.0,
        shift_extra_s: 0.0,
        brake_scale: 1.0,
        brake_delay_s: 0.25,
        engine_brake_scale: 1.0,
        fuel_scale: 1.0,
        drag_force_n: 0.0,
        mass_scale: 1.0,
        tyres_follow: false,
        payload_rearward_m: 0.0,
        stiffness: [1.0; 3],
        steer_ratio: 24.0,
        steer_offset_rad: 0.0,
        free_play_rad: 0.0,
        steer_lag_s: 0.08,
        steer_delay_s: 0.0,
        bank_rad: 0.0,
        headwind: 0.0,
        crosswind: 0.0,
        wind: [0.0; 2],
        side_share: 0.25,
        side_behind_m: 0.0,
        wind_turns_rad: 0.0,
        crosswind_swells: 0.0,
        grade_bias: 0.0,
        map_shift_m: 0.0,
        speed_scale: 1.0,
        yaw_bias: 0.0,
        trailer_yaw_bias: 0.0,
        accel_bias: [0.0; 2],
    };
}
