//! The replay's figures from a truck file.

use dynamics::TruckParameters;
use tractrix_core::Curve;

use crate::{DiagnosisError, Plant};

/// Pa per kPa.
const PA_PER_KPA: f64 = 1e3;

impl Plant {
    /// The truck of a truck file. Where a drive reports no mass, the truck file's own (with its
    /// payload) counts. Left out, because the replay has no such effect: demand maps of the pedal,
    /// pressure tables of the brakes, rolling resistance that grows with speed, and the faults of
    /// instruments that an extended truck file carries.
    ///
    /// # Errors
    /// [`DiagnosisError::Truck`] if the full-load curve cannot be used.
    pub fn of_truck(truck: &TruckParameters) -> Result<Self, DiagnosisError> {
        let (e, d, b, r) = (&truck.engine, &truck.driveline, &truck.brake, &truck.resistance);
        let full_load_nm = Curve::new(
            "full_load_torque_nm",
            e.full_load_speed_rpm.clone(),
            e.full_load_torque_nm.clone(),
        )
        .map_err(|e| DiagnosisError::Truck(e.to_string()))?;
        let mut lateral = truck.lateral;
        let mass_kg = lateral.total_mass_kg();
        lateral.payload.mass_kg = 0.0;
        let s = &truck.shift;
        Ok(Self {
            name: truck.name.clone(),
            mass_kg,
            wheel_radius_m: d.wheel_radius_m,
            rolling_coeff: r.rolling_coeff,
            cd_a_m2: r.drag_area_m2,
            drag_yaw_frac_per_deg: r.drag_yaw_1_rad.to_radians(),
            side_area_m2_per_deg: r.side_force_area_m2_rad.to_radians(),
            side_force_tractor_frac: r.side_force_tractor_frac,
            gear_ratios: d.gear_ratios.clone(),
            final_drive_ratio: d.final_drive_ratio,
            efficiency_frac: d.efficiency_frac(),
            wheel_inertia_kg_m2: d.wheel_inertia_kg_m2,
            engine_inertia_kg_m2: e.inertia_kg_m2,
            full_load_nm,
            friction_nm: [e.friction_constant_nm, e.friction_per_rpm_nm]
                .map(|f| f * e.friction_scale_coeff),
            reference_torque_nm: e.reference_torque_nm,
            idle_speed_rpm: e.idle_speed_rpm,
            torque_lag_s: [e.slow_lag_s, e.fast_lag_s],
            boost_from_frac: e.lag_threshold_frac,
            pedal_delay_s: e.pedal_delay_s,
            auxiliary_power_w: e.auxiliary_power_w,
            engine_brake_nm: [e.engine_brake_constant_nm, e.engine_brake_per_rpm_nm],
            shift_duration_s: s.duration_scale_coeff * (s.ramp_down_s + s.open_s + s.ramp_up_s),
            brake_gain_n_kpa: b.gain_n_pa * b.gain_scale_coeff * PA_PER_KPA,
            brake_delay_s: b.dead_time_s,
            brake_lag_s: b.lag_s,
            brake_rate_kpa_s: [b.fill_rate_pa_s, b.vent_rate_pa_s].map(|r| r / PA_PER_KPA),
            brake_heat_capacity_j_k: b.heat_capacity_j_k,
            brake_cooling_s: b.cooling_s,
            fuel: [e.fuel.constant_g_s, e.fuel.per_rpm_g_s, e.fuel.per_kw_g_s],
            lateral,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reference_truck_file_gives_the_reference_plant() {
        let truck = TruckParameters::load("reference").unwrap();
        let of_file = Plant::of_truck(&truck).unwrap();
        let mut expected = Plant::reference().unwrap();
        for (a, b) in [
            (of_file.drag_yaw_frac_per_deg, expected.drag_yaw_frac_per_deg),
            (of_file.side_area_m2_per_deg, expected.side_area_m2_per_deg),
            (of_file.efficiency_frac, expected.efficiency_frac),
            (of_file.brake_gain_n_kpa, expected.brake_gain_n_kpa),
        ] {
            assert!((a - b).abs() < 1e-12 * b.abs(), "{a} {b}");
        }
        expected.drag_yaw_frac_per_deg = of_file.drag_yaw_frac_per_deg;
        expected.side_area_m2_per_deg = of_file.side_area_m2_per_deg;
        expected.efficiency_frac = of_file.efficiency_frac;
        expected.brake_gain_n_kpa = of_file.brake_gain_n_kpa;
        // not on the data sheet that the drives are made with
        expected.mass_kg = of_file.mass_kg;
        expected.lateral.load_transfer = of_file.lateral.load_transfer;
        expected.lateral.steering.max_wheel_rate_rad_s =
            of_file.lateral.steering.max_wheel_rate_rad_s;
        assert_eq!(of_file, expected);
    }
}
