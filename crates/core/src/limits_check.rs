//! Whether a vehicle's limits can be planned with: every range, checked once, here.
//!
//! The ranges are those of road vehicles on public highways, wide enough for every truck that is
//! built and narrow enough that a value in another unit (km/h, rpm, t, kPa) falls outside.

use alloc::{format, string::String, vec::Vec};

use crate::{CoreError, FuelModel, VehicleLimits};

/// Most forward gears: gear sets travel as 32 bits.
const MOST_GEARS: usize = 32;
/// Lowest engine speed under load over idle speed that any plan needs room above.
const LEAST_SPEED_RANGE: f64 = 1.25;

/// A value with the range it has to lie in: key with unit, value, lowest, highest.
type Row = (&'static str, f64, f64, f64);

impl VehicleLimits {
    /// Checks finiteness and range of everything that a planner divides by or plans with.
    ///
    /// | quantity | range | why |
    /// |---|---|---|
    /// | `mass_kg` | 1 t to 200 t | a van; a road train with a permit |
    /// | `rolling_coeff` | 0 to 0.1 | 0.1 is loose ground, beyond any road |
    /// | `wheel_radius_m` | 0.1 to 2 | the largest tyre made has 2.0 m |
    /// | `idle_speed_rad_s` | 1 to 300 | 300 rad/s are 2 865 rpm; an idle speed in rpm is refused |
    /// | `max_speed_rad_s` | above 1.25 times idle, up to 1000 | below it no gear has a range to drive in |
    /// | `lugging_speed_rad_s` | idle to highest speed | the gearbox keeps no gear under power below it |
    /// | `fuel_density_kg_m3` | 300 to 2000 | liquefied gas; a density in kg/l is refused |
    /// | gear ratios | 0.1 to 100 | overdrive; crawler with splitter and range |
    /// | gear efficiencies | 0.3 to 1 | below it the overrun drag of a gear exceeds its traction |
    /// | `max_decel_m_s2` | 0.5 to 12.5 | the legal minimum of a worn truck is 4.5 (ECE R13); 12.5 is a tyre's limit |
    ///
    /// # Errors
    /// [`CoreError::OutOfRange`] names the first value outside its range, [`CoreError::BadTable`]
    /// the table or list that has the wrong shape.
    pub fn check(&self) -> Result<(), CoreError> {
        self.violations().into_iter().next().map_or(Ok(()), Err)
    }

    /// Everything that [`Self::check`] would refuse.
    #[must_use]
    pub fn violations(&self) -> Vec<CoreError> {
        let mut wrong = Vec::new();
        self.check_gears(&mut wrong);
        let groups: [Vec<Row>; 4] =
            [self.geometry_rows(), self.powertrain_rows(), self.load_rows(), self.lateral_rows()];
        check_rows(groups.into_iter().flatten(), &mut wrong);
        let p = &self.powertrain;
        for (name, curve) in [
            ("powertrain.full_load_nm", Some(&p.full_load_nm)),
            ("powertrain.friction_nm", Some(&p.friction_nm)),
            ("powertrain.engine_brake_nm", Some(&p.engine_brake_nm)),
            ("powertrain.retarder_force_n", p.retarder_force_n.as_ref()),
        ] {
            if let Some(curve) = curve {
                check_each(name, curve.y(), 0.0, 1e6, &mut wrong);
            }
        }
        check_fuel(&p.fuel, &mut wrong);
        wrong
    }

    fn check_gears(&self, wrong: &mut Vec<CoreError>) {
        let p = &self.powertrain;
        let gears = p.gear_ratios.len();
        let lists = [p.gear_efficiency_frac.len(), p.rotating_mass_kg.len()];
        if gears == 0 || gears > MOST_GEARS || lists != [gears; 2] {
            let [efficiencies, masses] = lists;
            wrong.push(CoreError::BadTable {
                name: "powertrain.gear_ratios".into(),
                why: format!(
                    "{gears} values, {efficiencies} in gear_efficiency_frac, {masses} in \
                     rotating_mass_kg; as many of each, 1 to {MOST_GEARS}"
                ),
            });
        }
        for (name, values, low, high) in [
            ("powertrain.gear_ratios", &p.gear_ratios, 0.1, 100.0),
            ("powertrain.gear_efficiency_frac", &p.gear_efficiency_frac, 0.3, 1.0),
            ("powertrain.rotating_mass_kg", &p.rotating_mass_kg, 0.0, 1e6),
        ] {
            check_each(name, values, low, high, wrong);
        }
    }

    fn geometry_rows(&self) -> Vec<Row> {
        let g = &self.geometry;
        alloc::vec![
            ("geometry.front_m", g.front_m, 0.0, 20.0),
            ("geometry.wheelbase_m", g.wheelbase_m, 1.0, 15.0),
            ("geometry.cg_ahead_m", g.cg_ahead_m, 0.0, 10.0),
            ("geometry.hitch_ahead_m", g.hitch_ahead_m, -5.0, 5.0),
            ("geometry.hitch_to_trailer_axle_m", g.hitch_to_trailer_axle_m, 1.0, 25.0),
            ("geometry.trailer_rear_m", g.trailer_rear_m, 1.0, 30.0),
            ("geometry.width_m", g.width_m, 0.5, 5.0),
        ]
    }

    fn powertrain_rows(&self) -> Vec<Row> {
        let p = &self.powertrain;
        let slowest = p.idle_speed_rad_s * LEAST_SPEED_RANGE;
        alloc::vec![
            ("powertrain.final_drive_ratio", p.final_drive_ratio, 0.1, 50.0),
            ("powertrain.wheel_radius_m", p.wheel_radius_m, 0.1, 2.0),
            ("powertrain.idle_speed_rad_s", p.idle_speed_rad_s, 1.0, 300.0),
            ("powertrain.max_speed_rad_s", p.max_speed_rad_s, slowest, 1000.0),
            (
                "powertrain.lugging_speed_rad_s",
                p.lugging_speed_rad_s,
                p.idle_speed_rad_s,
                p.max_speed_rad_s,
            ),
            ("powertrain.auxiliary_power_w", p.auxiliary_power_w, 0.0, 1e6),
            ("powertrain.idle_fuel_g_s", p.idle_fuel_g_s, 0.0, 100.0),
            ("powertrain.rotating_mass_neutral_kg", p.rotating_mass_neutral_kg, 0.0, 1e6),
            ("powertrain.shift_duration_s", p.shift_duration_s, 0.0, 10.0),
            ("powertrain.fuel_density_kg_m3", p.fuel_density_kg_m3, 300.0, 2000.0),
        ]
    }

    fn load_rows(&self) -> Vec<Row> {
        let (r, b) = (&self.road_load, &self.brakes);
        alloc::vec![
            ("road_load.mass_kg", r.mass_kg, 1000.0, 200_000.0),
            ("road_load.cd_a_m2", r.cd_a_m2, 0.0, 50.0),
            ("road_load.air_density_kg_m3", r.air_density_kg_m3, 0.0, 3.0),
            ("road_load.rolling_coeff", r.rolling_coeff, 0.0, 0.1),
            ("road_load.rolling_per_speed_s_m", r.rolling_per_speed_s_m, 0.0, 1e-2),
            ("road_load.constant_drag_n", r.constant_drag_n, 0.0, 1e5),
            ("road_load.curve_drag_1_n", r.curve_drag_1_n, 0.0, 1e-2),
            ("road_load.drag_yaw_1_rad", r.drag_yaw_1_rad, 0.0, 20.0),
            ("road_load.wind.to_x_m_s", r.wind.to_x_m_s, -60.0, 60.0),
            ("road_load.wind.to_y_m_s", r.wind.to_y_m_s, -60.0, 60.0),
            ("road_load.wind.against_m_s", r.wind.against_m_s, -60.0, 60.0),
            ("road_load.wind.to_left_m_s", r.wind.to_left_m_s, -60.0, 60.0),
            ("brakes.max_decel_m_s2", b.max_decel_m_s2, 0.5, 12.5),
            ("brakes.dead_time_s", b.dead_time_s, 0.0, 3.0),
            ("brakes.build_up_s", b.build_up_s, 0.0, 5.0),
        ]
    }

    fn lateral_rows(&self) -> Vec<Row> {
        let l = &self.lateral;
        alloc::vec![
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
        ]
    }
}

/// Checks `low <= value <= high`; NaN fails.
fn in_range(
    field: impl FnOnce() -> String,
    value: f64,
    low: f64,
    high: f64,
    wrong: &mut Vec<CoreError>,
) {
    if !(value >= low && value <= high) {
        wrong.push(CoreError::OutOfRange { field: field(), value, low, high });
    }
}

fn check_rows(rows: impl IntoIterator<Item = Row>, wrong: &mut Vec<CoreError>) {
    for (field, value, low, high) in rows {
        in_range(|| field.into(), value, low, high, wrong);
    }
}

fn check_each(name: &str, values: &[f64], low: f64, high: f64, wrong: &mut Vec<CoreError>) {
    for (i, &value) in values.iter().enumerate() {
        in_range(|| format!("{name}[{i}]"), value, low, high, wrong);
    }
}

fn check_fuel(fuel: &FuelModel, wrong: &mut Vec<CoreError>) {
    let low_load = match fuel {
        FuelModel::Willans { constant_g_s, per_rpm_g_s, per_kw_g_s, low_load } => {
            let rows = [
                ("powertrain.fuel.constant_g_s", *constant_g_s, 0.0, 100.0),
                ("powertrain.fuel.per_rpm_g_s", *per_rpm_g_s, 0.0, 1.0),
                ("powertrain.fuel.per_kw_g_s", *per_kw_g_s, 1e-6, 1.0),
            ];
            check_rows(rows, wrong);
            low_load
        }
        FuelModel::Map { flow_g_s: map, friction_nm, low_load } => {
            let name = "powertrain.fuel.flow_g_s";
            let lowest = |axis: &[f64]| axis.first().copied().unwrap_or(f64::NAN);
            let (speed_rad_s, torque_nm) = (lowest(map.x()), lowest(map.y()));
            if !(speed_rad_s > 0.0) || torque_nm != 0.0 {
                let why = format!(
                    "speeds from {speed_rad_s} rad/s, torques from {torque_nm} Nm; speeds must be \
                     above zero, torques begin at zero"
                );
                wrong.push(CoreError::BadTable { name: name.into(), why });
            }
            check_each(name, map.z(), 0.0, 1e3, wrong);
            check_each("powertrain.fuel.friction_nm", friction_nm.y(), 0.0, 1e5, wrong);
            low_load
        }
    };
    let rows = [
        ("powertrain.fuel.low_load.extra_frac", low_load.extra_frac, -0.9, 10.0),
        ("powertrain.fuel.low_load.fades_out_kw", low_load.fades_out_kw, 0.1, 1e4),
    ];
    check_rows(rows, wrong);
}
