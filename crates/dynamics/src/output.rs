//! What the truck reports, and what a planner may know about it.

use tractrix_core::{
    BrakeLimits, Curve, EgoState, GRAVITY_M_S2, Geometry, PowertrainLimits, PowertrainSignals,
    RPM_PER_RAD_S, RoadLoad, RoadPiece, TrailerState, VehicleLimits, Wind,
};

use crate::effects::resistance::air_density_kg_m3;
use crate::effects::shift::ShiftPhase;
use crate::{DynamicsError, RoadPatch, TruckModel, TruckState};

/// Speed at which the mean power of the fan is told, m/s: 80 km/h.
const CRUISE_M_S: f64 = 80.0 / 3.6;

/// The paper's 16 outputs of the truck model (Table I and the released interface), in SI.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct PaperOutputs {
    /// Engaged gear, 0 = neutral (GearPos).
    pub gear: u8,
    /// Service brakes at work (foundation_brake_in_use).
    pub foundation_brake_in_use: bool,
    /// Engine torque before friction, Nm (EngTrq).
    pub engine_torque_nm: f64,
    /// Engine speed, rad/s (EngSpd).
    pub engine_speed_rad_s: f64,
    /// Friction torque over the reference torque (engine_torque_loss_percent / 100).
    pub engine_torque_loss_frac: f64,
    /// A shift is in progress (shift_in_process).
    pub shift_in_progress: bool,
    /// Engine torque over the reference torque (engine_torque_percent / 100).
    pub engine_torque_frac: f64,
    /// Longitudinal speed, m/s (Velong).
    pub speed_m_s: f64,
    /// Lateral speed, m/s (Velate).
    pub lateral_speed_m_s: f64,
    /// Heading, rad (Yaw).
    pub yaw_rad: f64,
    /// Yaw rate, rad/s (YawRate).
    pub yaw_rate_rad_s: f64,
    /// Wheel speed, rad/s (Omega_w).
    pub wheel_speed_rad_s: f64,
    /// Longitudinal acceleration, m/s² (ax).
    pub accel_x_m_s2: f64,
    /// Map x, m (X).
    pub x_m: f64,
    /// Map y, m (Y).
    pub y_m: f64,
    /// Articulation angle, rad: the trailer that the released model lacks.
    pub articulation_rad: f64,
}

impl TruckModel {
    /// The ego state of a truck state, in road coordinates left at zero (the road knows them).
    #[must_use]
    pub fn ego_state(&self, s: &TruckState, patch: &RoadPatch) -> EgoState {
        let lateral = self.lateral_outputs(s, patch);
        let friction_nm = self.engine.friction_nm(s.engine_speed_rad_s);
        EgoState {
            x_m: s.lateral.x_m,
            y_m: s.lateral.y_m,
            yaw_rad: s.lateral.yaw_rad,
            speed_m_s: s.speed_m_s,
            lateral_speed_m_s: lateral.lateral_speed_m_s,
            accel_x_m_s2: s.accel_m_s2,
            accel_y_m_s2: lateral.accel_y_m_s2,
            yaw_rate_rad_s: lateral.yaw_rate_rad_s,
            trailer: TrailerState {
                articulation_rad: lateral.articulation_rad,
                yaw_rate_rad_s: lateral.trailer_yaw_rate_rad_s,
            },
            road_wheel_rad: lateral.road_wheel_rad,
            steering_wheel_rad: s.lateral.steering.wheel_rad,
            load_transfer_ratio: lateral.load_transfer_ratio,
            powertrain: PowertrainSignals {
                engine_speed_rad_s: s.engine_speed_rad_s,
                engine_torque_nm: s.engine_torque_nm,
                engine_friction_torque_nm: friction_nm,
                drive_force_n: s.forces.drive_n,
                brake_force_n: s.forces.brake_n,
                brake_pressure_pa: self.mean_pressure_pa(s),
                retarder_force_n: s.forces.retarder_n,
                gear: if s.shift.phase == ShiftPhase::Open { 0 } else { s.shift.gear },
                shift_in_progress: s.shift.phase != ShiftPhase::Engaged,
                fuel_rate_g_s: s.fuel_rate_g_s,
                fuel_used_g: s.fuel_g,
                engine_power_w: (s.engine_torque_nm - friction_nm - s.engine_brake_nm)
                    * s.engine_speed_rad_s,
            },
            ..EgoState::default()
        }
    }

    /// What the truck's instruments make of its true state.
    #[must_use]
    pub fn measured(&self, truth: &EgoState) -> EgoState {
        let i = &self.parameters.instruments;
        EgoState {
            speed_m_s: truth.speed_m_s * i.speed_scale_coeff,
            yaw_rate_rad_s: truth.yaw_rate_rad_s + i.yaw_rate_bias_rad_s,
            powertrain: PowertrainSignals {
                fuel_rate_g_s: i
                    .reported_fuel_g_s(truth.powertrain.fuel_rate_g_s, self.engine.most_fuel_g_s),
                ..truth.powertrain
            },
            ..*truth
        }
    }

    /// What an accelerometer fixed to the body at the reference point measures, m/s²: along and across
    /// (positive left), with gravity's part on a grade and on a bank, where the map says `patch`. The
    /// body's own pitch and roll on its springs are left out.
    #[must_use]
    pub fn specific_force_m_s2(&self, truth: &EgoState, patch: &RoadPatch) -> [f64; 2] {
        let road = self.true_patch(patch);
        let gravity = |angle_rad: f64| GRAVITY_M_S2 * libm::sin(angle_rad);
        [
            truth.accel_x_m_s2 - truth.lateral_speed_m_s * truth.yaw_rate_rad_s
                + gravity(road.grade_rad),
            truth.accel_y_m_s2 + gravity(road.bank_rad),
        ]
    }

    /// CO2 in the exhaust, g/s, as an instrument of this truck measures it.
    #[must_use]
    pub fn measured_co2_g_s(&self, truth: &EgoState) -> f64 {
        let i = &self.parameters.instruments;
        i.measured_co2_g_s(truth.powertrain.fuel_rate_g_s, self.engine.most_fuel_g_s)
    }

    /// The paper's outputs.
    #[must_use]
    pub fn paper_outputs(&self, s: &TruckState, patch: &RoadPatch) -> PaperOutputs {
        let e = self.ego_state(s, patch);
        let reference = self.parameters.engine.reference_torque_nm;
        PaperOutputs {
            gear: e.powertrain.gear,
            foundation_brake_in_use: s.brake.pressure_pa.iter().any(|&p| p > 1_000.0),
            engine_torque_nm: s.engine_torque_nm,
            engine_speed_rad_s: s.engine_speed_rad_s,
            engine_torque_loss_frac: e.powertrain.engine_friction_torque_nm / reference,
            shift_in_progress: e.powertrain.shift_in_progress,
            engine_torque_frac: s.engine_torque_nm / reference,
            speed_m_s: s.speed_m_s,
            lateral_speed_m_s: e.lateral_speed_m_s,
            yaw_rad: e.yaw_rad,
            yaw_rate_rad_s: e.yaw_rate_rad_s,
            wheel_speed_rad_s: s.speed_m_s / self.parameters.driveline.wheel_radius_m,
            accel_x_m_s2: s.accel_m_s2,
            x_m: e.x_m,
            y_m: e.y_m,
            articulation_rad: e.trailer.articulation_rad,
        }
    }

    /// Brake pressure, Pa: mean over the axle groups, weighted with their share of the brake force.
    #[must_use]
    pub fn mean_pressure_pa(&self, s: &TruckState) -> f64 {
        self.brake_share.iter().zip(s.brake.pressure_pa).map(|(w, p)| w * p).sum()
    }

    /// Lengths relative to the reference point.
    #[must_use]
    pub fn geometry(&self) -> Geometry {
        let (l, b) = (&self.parameters.lateral, &self.parameters.body);
        let wheelbase_m = l.tractor.steer_axle_ahead_of_cg_m + l.tractor.drive_group_behind_cg_m;
        Geometry {
            front_m: wheelbase_m + b.front_overhang_m,
            wheelbase_m,
            cg_ahead_m: l.tractor.drive_group_behind_cg_m,
            hitch_ahead_m: l.tractor.drive_group_behind_cg_m - l.tractor.hitch_behind_cg_m,
            hitch_to_trailer_axle_m: l.trailer.axle_group_behind_hitch_m,
            trailer_front_m: b.trailer_front_m,
            trailer_rear_m: b.trailer_rear_m,
            tractor_rear_m: b.tractor_rear_overhang_m,
            width_m: b.width_m,
        }
    }

    /// What a planner may know about this truck at its present load, in standard air without wind.
    ///
    /// # Errors
    /// [`DynamicsError::OutOfBounds`] if a table cannot be built.
    pub fn vehicle_limits(&self) -> Result<VehicleLimits, DynamicsError> {
        self.vehicle_limits_in(&RoadPatch::default())
    }

    /// The same in the air and the wind of a patch of road.
    ///
    /// # Errors
    /// [`DynamicsError::OutOfBounds`] if a table cannot be built.
    pub fn vehicle_limits_in(&self, patch: &RoadPatch) -> Result<VehicleLimits, DynamicsError> {
        let (p, e, d) = (&self.parameters, &self.parameters.engine, &self.parameters.driveline);
        let gears = d.top_gear();
        let speeds: Vec<f64> = (0..=30)
            .map(|i| {
                (e.idle_speed_rpm + f64::from(i) * (e.max_speed_rpm - e.idle_speed_rpm) / 30.0)
                    / RPM_PER_RAD_S
            })
            .collect();
        let tabulate = |name: &str, f: &dyn Fn(f64) -> f64| {
            Curve::new(name, speeds.clone(), speeds.iter().map(|&n| f(n)).collect()).map_err(|e| {
                DynamicsError::OutOfBounds { name: p.name.clone(), violations: vec![e.to_string()] }
            })
        };
        let road_speeds: Vec<f64> = (0..=40).map(f64::from).collect();
        let retarder = |v: &f64| d.shaft_force_n(d.retarder_limit_nm(*v));
        let retarder_n = road_speeds.iter().map(retarder).collect();
        let retarder_n = Curve::new("retarder", road_speeds, retarder_n).map_err(|e| {
            DynamicsError::OutOfBounds { name: p.name.clone(), violations: vec![e.to_string()] }
        })?;
        let idle = self.engine.idle_rad_s;
        let holding = self.engine.friction_nm(idle) + self.engine.auxiliary_nm(idle, 0.0);
        Ok(VehicleLimits {
            geometry: self.geometry(),
            powertrain: PowertrainLimits {
                gear_ratios: d.gear_ratios.clone(),
                gear_efficiency_frac: (1..=gears).map(|g| d.efficiency_frac(g)).collect(),
                rotating_mass_kg: (1..=gears)
                    .map(|g| d.rotating_mass_kg(e.inertia_kg_m2, g))
                    .collect(),
                rotating_mass_neutral_kg: d.rotating_mass_kg(e.inertia_kg_m2, 0),
                final_drive_ratio: d.final_drive_ratio,
                wheel_radius_m: d.wheel_radius_m,
                full_load_nm: self.engine.full_load_nm.clone(),
                friction_nm: tabulate("friction", &|n| self.engine.friction_nm(n))?,
                engine_brake_nm: tabulate("engine brake", &|n| self.engine.engine_brake_nm(n))?,
                retarder_force_n: (d.retarder_torque_nm > 0.0).then_some(retarder_n),
                auxiliary_power_w: e.auxiliary_power_w + self.cruising_fan_w(patch),
                idle_speed_rad_s: idle,
                max_speed_rad_s: self.engine.max_rad_s,
                lugging_speed_rad_s: p.shift.lugging_rpm() / RPM_PER_RAD_S,
                fuel: self.engine.fuel.clone(),
                idle_fuel_g_s: self.engine.fuel_rate_g_s(idle, holding),
                shift_duration_s: p.shift.duration_scale_coeff
                    * (p.shift.ramp_down_s + p.shift.open_s + p.shift.ramp_up_s),
                pedal_map_nm: self.engine.pedal_map_nm.clone(),
                fuel_density_kg_m3: e.fuel.density_kg_m3,
            },
            road_load: self.road_load_in(patch),
            brakes: BrakeLimits {
                max_decel_m_s2: (p.brake.gain_n_pa * p.brake.max_pressure_pa / self.mass_kg)
                    .min(0.65 * GRAVITY_M_S2),
                dead_time_s: p.brake.dead_time_s,
                build_up_s: p.brake.lag_s + p.brake.max_pressure_pa / p.brake.fill_rate_pa_s * 0.5,
            },
            lateral: self.lateral.limits(),
        })
    }

    /// Forces that resist the motion of this truck with warm tyres, in the air and the wind of a
    /// patch of road.
    #[must_use]
    pub fn road_load_in(&self, patch: &RoadPatch) -> RoadLoad {
        let r = &self.parameters.resistance;
        let stiffness: f64 = self.lateral.yaw_sideslip().stiffness_n_rad.iter().sum();
        RoadLoad {
            mass_kg: self.mass_kg,
            cd_a_m2: r.drag_area_m2,
            air_density_kg_m3: air_density_kg_m3(patch.air_pressure_pa, patch.air_temperature_k),
            rolling_coeff: r.rolling_coeff,
            rolling_per_speed_s_m: r.rolling_per_speed_s_m,
            constant_drag_n: r.parasitic_force_n,
            curve_drag_1_n: r.curve_drag_1_n(stiffness),
            drag_yaw_1_rad: r.drag_yaw_1_rad,
            wind: Wind {
                to_x_m_s: patch.wind_m_s.0 + r.wind_to_x_m_s,
                to_y_m_s: patch.wind_m_s.1 + r.wind_to_y_m_s,
                against_m_s: r.headwind_m_s,
                to_left_m_s: r.crosswind_to_left_m_s,
            },
        }
    }

    /// Mean power of the fan while the truck cruises on a level road, W.
    fn cruising_fan_w(&self, patch: &RoadPatch) -> f64 {
        let (e, d) = (&self.parameters.engine, &self.parameters.driveline);
        let level = RoadPiece { cos_grade: 1.0, ..RoadPiece::default() };
        let force_n = self.road_load_in(patch).resistance_n(CRUISE_M_S, &level);
        let speed_rad_s = d.engine_speed_rad_s(CRUISE_M_S, d.top_gear());
        let indicated_w = force_n * CRUISE_M_S / d.efficiency_frac(d.top_gear())
            + self.engine.friction_nm(speed_rad_s) * speed_rad_s
            + e.auxiliary_power_w;
        self.mean_fan_w(indicated_w, patch.air_temperature_k)
    }
}
