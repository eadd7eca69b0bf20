//! Checks that a vehicle's limits can be planned with.

use crate::PlannerError;
use tractrix_core::VehicleLimits;

/// Checks finiteness and ranges of everything that the stack divides by or plans with.
///
/// # Errors
/// [`PlannerError::Limits`] or [`PlannerError::Gears`] names what is wrong.
pub(crate) fn check_limits(limits: &VehicleLimits) -> Result<(), PlannerError> {
    let p = &limits.powertrain;
    let gears = p.gear_ratios.len();
    if gears == 0 || p.gear_efficiency_frac.len() != gears || p.rotating_mass_kg.len() != gears {
        return Err(PlannerError::Gears {
            ratios: gears,
            efficiencies: p.gear_efficiency_frac.len(),
            rotating_masses: p.rotating_mass_kg.len(),
        });
    }
    let (g, r, b, l) = (&limits.geometry, &limits.road_load, &limits.brakes, &limits.lateral);
    let gear_ratio = |i: usize| ("powertrain.gear_ratios", p.gear_ratios[i], 0.1, 100.0);
    let gear_eff =
        |i: usize| ("powertrain.gear_efficiency_frac", p.gear_efficiency_frac[i], 0.1, 1.0);
    let gear_mass = |i: usize| ("powertrain.rotating_mass_kg", p.rotating_mass_kg[i], 0.0, 1e6);
    let gear_rows = (0..gears).flat_map(|i| [gear_ratio(i), gear_eff(i), gear_mass(i)]);
    let rows = [
        ("geometry.front_m", g.front_m, 0.0, 20.0),
        ("geometry.wheelbase_m", g.wheelbase_m, 1.0, 15.0),
        ("geometry.cg_ahead_m", g.cg_ahead_m, 0.0, 10.0),
        ("geometry.hitch_ahead_m", g.hitch_ahead_m, -5.0, 5.0),
        ("geometry.hitch_to_trailer_axle_m", g.hitch_to_trailer_axle_m, 1.0, 25.0),
        ("geometry.trailer_rear_m", g.trailer_rear_m, 1.0, 30.0),
        ("geometry.width_m", g.width_m, 0.5, 5.0),
        ("powertrain.final_drive_ratio", p.final_drive_ratio, 0.1, 50.0),
        ("powertrain.wheel_radius_m", p.wheel_radius_m, 0.1, 2.0),
        ("powertrain.idle_speed_rad_s", p.idle_speed_rad_s, 1.0, 300.0),
        ("powertrain.max_speed_rad_s", p.max_speed_rad_s, p.idle_speed_rad_s, 1000.0),
        ("powertrain.auxiliary_power_w", p.auxiliary_power_w, 0.0, 1e6),
        ("road_load.mass_kg", r.mass_kg, 1000.0, 200_000.0),
        ("road_load.cd_a_m2", r.cd_a_m2, 0.0, 50.0),
        ("road_load.air_density_kg_m3", r.air_density_kg_m3, 0.0, 3.0),
        ("road_load.rolling_coeff", r.rolling_coeff, 0.0, 0.1),
        ("brakes.max_decel_m_s2", b.max_decel_m_s2, 0.5, 12.5),
        ("brakes.dead_time_s", b.dead_time_s, 0.0, 3.0),
        ("brakes.build_up_s", b.build_up_s, 0.0, 5.0),
        ("lateral.steering_ratio", l.steering_ratio, 1.0, 100.0),
        ("lateral.steering_lag_s", l.steering_lag_s, 0.0, 2.0),
        ("lateral.tractor_mass_kg", l.tractor_mass_kg, 100.0, 100_000.0),
        ("lateral.tractor_inertia_kg_m2", l.tractor_inertia_kg_m2, 100.0, 1e7),
        ("lateral.trailer_mass_kg", l.trailer_mass_kg, 100.0, 200_000.0),
        ("lateral.trailer_inertia_kg_m2", l.trailer_inertia_kg_m2, 100.0, 1e8),
        ("lateral.trailer_cg_behind_hitch_m", l.trailer_cg_behind_hitch_m, 0.0, 25.0),
        ("lateral.steer_stiffness_n_rad", l.steer_stiffness_n_rad, 1e3, 1e8),
        ("lateral.drive_stiffness_n_rad", l.drive_stiffness_n_rad, 1e3, 1e8),
        ("lateral.trailer_stiffness_n_rad", l.trailer_stiffness_n_rad, 1e3, 1e8),
        ("lateral.rollover_accel_m_s2", l.rollover_accel_m_s2, 0.5, 20.0),
        ("lateral.max_road_wheel_rad", l.max_road_wheel_rad, 0.05, 1.5),
    ];
    for (field, value, low, high) in rows.into_iter().chain(gear_rows) {
        if !(value >= low && value <= high) {
            return Err(PlannerError::Limits { field, value, low, high });
        }
    }
    Ok(())
}
