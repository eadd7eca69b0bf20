//! From the truck's state to the messages of its control units: pure functions.

use j1939::Slot;
use j1939::message::{
    Acc1, Adss, Air1, Amb, Ccvs1, Cvw, Ebc1, Ebc2, Ebc3, Ebc5, Ec1, Eec1, Eec2, Eec3, Erc1, Et1,
    Etc1, Etc2, Hrw, Lfe1, Rc, Sas, Vdc1, Vdc2, Vdhr, Vds, Vp1,
};
use j1939::truck::{Torque, XBR_DECEL_MAX_M_S2};
use planner::localise::MapProjection;
use tractrix_core::{
    BrakeMode, EgoState, Geometry, PowertrainLimits, Scene, Vehicle, VehicleLimits,
};

use crate::SimTruck;
use crate::metrics::nearest_ahead;

/// What the radar sees ahead in the truck's way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ahead {
    /// From bumper to bumper, m.
    pub gap_m: f64,
    /// Speed of the vehicle, m/s.
    pub speed_m_s: f64,
}

impl Ahead {
    /// The nearest vehicle ahead in the truck's way.
    #[must_use]
    pub fn of(ego: &EgoState, geometry: &Geometry, scene: &Scene) -> Option<Self> {
        let front_m = ego.s_m + geometry.front_m;
        let ahead = nearest_ahead(ego, geometry, scene)?;
        Some(Self { gap_m: ahead.rear_s_m - front_m, speed_m_s: ahead.speed_m_s })
    }
}

/// What the messages of one instant are made of.
pub(super) struct Snapshot<'a> {
    pub(super) truck: &'a SimTruck,
    /// As the truck's instruments have it.
    pub(super) ego: &'a EgoState,
    /// Speed that the wheel speed sensors report, m/s.
    pub(super) wheel_speed_m_s: f64,
    pub(super) ahead: Option<Ahead>,
    /// Distance driven since the start, m.
    pub(super) driven_m: f64,
    /// Who controls the engine, and the retarder.
    pub(super) engine_master: Option<u8>,
    pub(super) retarder_master: Option<u8>,
    pub(super) brake_mode: BrakeMode,
    /// Where the map lies on the earth.
    pub(super) projection: Option<&'a MapProjection>,
}

/// Below this speed a receiver's course is noise, m/s.
const COURSE_FROM_M_S: f64 = 1.0;

/// A code that says "other" in the torque modes of engines and retarders (SPN 899, 900).
const OTHER: u8 = 14;
/// The radar sees this far, m: the range of SPN 1587.
const RADAR_RANGE_M: f64 = 250.0;
/// Air pressure of the reservoirs, Pa: the compressor is not simulated.
const RESERVOIR_PA: f64 = 9.6e5;
/// What is no measure for a signal of a wheel: standing.
const STANDING_M_S: f64 = 0.0;

const YES: Slot<u8> = Slot::Value(1);
const NO: Slot<u8> = Slot::Value(0);

impl Snapshot<'_> {
    fn limits(&self) -> &VehicleLimits {
        self.truck.limits()
    }

    fn reference_nm(&self) -> f64 {
        self.truck.model().parameters().engine.reference_torque_nm
    }

    pub(super) fn eec1(&self) -> Eec1 {
        let p = &self.ego.powertrain;
        let torque = Torque::of_frac(p.engine_torque_nm / self.reference_nm());
        Eec1 {
            torque_mode: Slot::Value(if self.engine_master.is_some() { OTHER } else { 0 }),
            torque_fine_frac: torque.fine_frac,
            driver_torque_demand_frac: Slot::Value(0.0),
            torque_frac: torque.coarse_frac,
            engine_speed_rad_s: Slot::Value(p.engine_speed_rad_s),
            controlling_address: controlling(self.engine_master),
            torque_demand_frac: torque.coarse_frac,
            ..Eec1::default()
        }
    }

    /// The driver's pedal, which nobody touches.
    pub(super) fn eec2(&self) -> Eec2 {
        let p = &self.ego.powertrain;
        let most_nm = self.limits().powertrain.full_load_nm.at(p.engine_speed_rad_s)
            + p.engine_friction_torque_nm;
        let load_frac = (p.engine_torque_nm / most_nm.max(1.0)).clamp(0.0, 1.25);
        Eec2 {
            pedal_1_idle_switch: YES,
            pedal_kickdown_switch: NO,
            accelerator_pedal_frac: Slot::Value(0.0),
            load_frac: Slot::Value(load_frac),
            ..Eec2::default()
        }
    }

    pub(super) fn eec3(&self) -> Eec3 {
        let friction_frac = self.ego.powertrain.engine_friction_torque_nm / self.reference_nm();
        Eec3 { friction_torque_frac: Slot::Value(friction_frac), ..Eec3::default() }
    }

    /// The torque curve at idle, at four points between, and at the highest governed speed.
    pub(super) fn ec1(&self) -> Ec1 {
        let p = &self.limits().powertrain;
        let (idle, high) = (p.idle_speed_rad_s, p.max_speed_rad_s);
        let speed = |share: f64| idle + share * (high - idle);
        let point = |share: f64| {
            let n = speed(share);
            let indicated_nm = p.full_load_nm.at(n) + p.friction_nm.at(n);
            let frac = (indicated_nm / self.reference_nm()).clamp(-1.25, 1.25);
            (Slot::Value(n), Slot::Value(frac))
        };
        let [a, b, c, d, e] = [0.0, 0.2, 0.4, 0.6, 0.8].map(point);
        Ec1 {
            idle_speed_rad_s: a.0,
            idle_torque_frac: a.1,
            point_2_speed_rad_s: b.0,
            point_2_torque_frac: b.1,
            point_3_speed_rad_s: c.0,
            point_3_torque_frac: c.1,
            point_4_speed_rad_s: d.0,
            point_4_torque_frac: d.1,
            point_5_speed_rad_s: e.0,
            point_5_torque_frac: e.1,
            high_idle_speed_rad_s: Slot::Value(high),
            reference_torque_nm: Slot::Value(self.reference_nm()),
            ..Ec1::default()
        }
    }

    pub(super) fn lfe1(&self) -> Lfe1 {
        let grams_per_m3 = 1e3 * self.limits().powertrain.fuel_density_kg_m3;
        let rate_m3_s = self.ego.powertrain.fuel_rate_g_s / grams_per_m3;
        Lfe1 { fuel_rate_m3_s: Slot::Value(rate_m3_s.max(0.0)), ..Lfe1::default() }
    }

    pub(super) fn et1(&self) -> Et1 {
        let coolant_k = self.truck.plant().coolant_k;
        Et1 { coolant_temperature_k: Slot::Value(coolant_k), ..Et1::default() }
    }

    pub(super) fn adss(&self) -> Adss {
        Adss { tsc1_p7_readiness: YES, speed_control_readiness: NO, ..Adss::default() }
    }

    pub(super) fn etc1(&self) -> Etc1 {
        let p = &self.ego.powertrain;
        let sheet = &self.limits().powertrain;
        let output_rad_s =
            self.wheel_speed_m_s.max(0.0) / sheet.wheel_radius_m * sheet.final_drive_ratio;
        let in_gear = p.gear > 0;
        let input_rad_s = ratio(sheet, p.gear).map_or(p.engine_speed_rad_s, |r| r * output_rad_s);
        Etc1 {
            driveline_engaged: Slot::Value(u8::from(in_gear)),
            shift_in_process: Slot::Value(u8::from(p.shift_in_progress)),
            output_shaft_speed_rad_s: Slot::Value(output_rad_s),
            input_shaft_speed_rad_s: Slot::Value(input_rad_s),
            ..Etc1::default()
        }
    }

    pub(super) fn etc2(&self) -> Etc2 {
        let gear = self.ego.powertrain.gear;
        let ratio = ratio(&self.limits().powertrain, gear);
        Etc2 {
            selected_gear: Slot::Value(i16::from(gear)),
            gear_ratio_ratio: ratio.map_or(Slot::NotAvailable, Slot::Value),
            current_gear: Slot::Value(i16::from(gear)),
            ..Etc2::default()
        }
    }

    /// The service brake pedal, which nobody touches, and the anti-lock system, which is ready.
    pub(super) fn ebc1(&self) -> Ebc1 {
        Ebc1 {
            asr_engine_control: NO,
            asr_brake_control: NO,
            abs_active: NO,
            brake_switch: NO,
            brake_pedal_frac: Slot::Value(0.0),
            abs_operational: YES,
            red_warning: NO,
            amber_warning: NO,
            ..Ebc1::default()
        }
    }

    /// Speeds of the wheels: outer ones are faster in a bend, by yaw rate and track.
    pub(super) fn hrw(&self) -> Hrw {
        let [front, rear] = self.wheel_speeds_m_s();
        Hrw {
            front_left_speed_m_s: Slot::Value(front[0]),
            front_right_speed_m_s: Slot::Value(front[1]),
            rear_left_speed_m_s: Slot::Value(rear[0]),
            rear_right_speed_m_s: Slot::Value(rear[1]),
        }
    }

    pub(super) fn ebc2(&self) -> Ebc2 {
        let [front, rear] = self.wheel_speeds_m_s();
        let axle_m_s = 0.5 * (front[0] + front[1]);
        let relative = |wheel_m_s: f64| Slot::Value(wheel_m_s - axle_m_s);
        Ebc2 {
            front_axle_speed_m_s: Slot::Value(axle_m_s),
            front_left_relative_speed_m_s: relative(front[0]),
            front_right_relative_speed_m_s: relative(front[1]),
            rear_1_left_relative_speed_m_s: relative(rear[0]),
            rear_1_right_relative_speed_m_s: relative(rear[1]),
            ..Ebc2::default()
        }
    }

    /// Left and right of the steered axle, left and right of the drive axles.
    fn wheel_speeds_m_s(&self) -> [[f64; 2]; 2] {
        let [steer_track_m, drive_track_m, _] =
            self.truck.model().parameters().lateral.load_transfer.track_m;
        let yaw_rate_rad_s = self.ego.yaw_rate_rad_s;
        // Along its own direction the steered axle is faster than the drive axles in a bend
        let (sin, cos) = libm::sincos(self.ego.road_wheel_rad);
        let sideways_m_s =
            self.ego.lateral_speed_m_s + yaw_rate_rad_s * self.limits().geometry.wheelbase_m;
        let front_m_s = self.wheel_speed_m_s * cos + sideways_m_s * sin;
        let pair = |speed_m_s: f64, track_m: f64| {
            let more_m_s = 0.5 * track_m * yaw_rate_rad_s;
            [speed_m_s - more_m_s, speed_m_s + more_m_s].map(|v| v.max(STANDING_M_S))
        };
        [pair(front_m_s, steer_track_m), pair(self.wheel_speed_m_s, drive_track_m)]
    }

    pub(super) fn ebc3(&self) -> Ebc3 {
        let pressure = Slot::Value(self.ego.powertrain.brake_pressure_pa.max(0.0));
        Ebc3 {
            front_left_pressure_pa: pressure,
            front_right_pressure_pa: pressure,
            rear_1_left_pressure_pa: pressure,
            rear_1_right_pressure_pa: pressure,
            ..Ebc3::default()
        }
    }

    pub(super) fn ebc5(&self) -> Ebc5 {
        let acts = self.ego.powertrain.brake_force_n > 0.0;
        Ebc5 {
            foundation_brake_use: Slot::Value(u8::from(acts)),
            xbr_state: NO,
            xbr_active_mode: Slot::Value(match self.brake_mode {
                BrakeMode::Off => 0,
                BrakeMode::Addition => 2,
                BrakeMode::Maximum => 3,
            }),
            xbr_acceleration_limit_m_s2: Slot::Value(-XBR_DECEL_MAX_M_S2),
            parking_brake_applied: NO,
            emergency_braking: NO,
            ..Ebc5::default()
        }
    }

    pub(super) fn vdc1(&self) -> Vdc1 {
        Vdc1 {
            vdc_operational: YES,
            rollover_engine_control: NO,
            rollover_brake_control: NO,
            yaw_engine_control: NO,
            yaw_brake_control: NO,
            ..Vdc1::default()
        }
    }

    pub(super) fn vdc2(&self) -> Vdc2 {
        let [along, across] = self.truck.model().specific_force_m_s2(self.ego, &self.truck.patch());
        let turns = libm::trunc(self.ego.steering_wheel_rad / (2.0 * std::f64::consts::PI));
        Vdc2 {
            steering_wheel_rad: Slot::Value(self.ego.steering_wheel_rad),
            steering_wheel_turns: Slot::Value(turns as i16),
            steering_sensor_type: YES,
            yaw_rate_rad_s: Slot::Value(self.ego.yaw_rate_rad_s),
            lateral_acceleration_m_s2: Slot::Value(across),
            longitudinal_acceleration_m_s2: Slot::Value(along),
        }
    }

    pub(super) fn air1(&self) -> Air1 {
        Air1 {
            service_1_pressure_pa: Slot::Value(RESERVOIR_PA),
            service_2_pressure_pa: Slot::Value(RESERVOIR_PA),
            ..Air1::default()
        }
    }

    pub(super) fn cvw(&self) -> Cvw {
        let limits = self.limits();
        Cvw {
            powered_vehicle_mass_kg: Slot::Value(limits.lateral.tractor_mass_kg),
            combination_mass_kg: Slot::Value(limits.road_load.mass_kg),
        }
    }

    /// The satellite receiver, whose antenna is at the reference point; none where the map does not
    /// say where it lies on the earth.
    pub(super) fn vp1(&self) -> Option<Vp1> {
        let [latitude_deg, longitude_deg] =
            self.projection?.on_earth_deg(self.ego.x_m, self.ego.y_m)?;
        Some(Vp1 {
            latitude_rad: Slot::Value(latitude_deg.to_radians()),
            longitude_rad: Slot::Value(longitude_deg.to_radians()),
        })
    }

    /// The receiver's course over ground; a truck that stands has none.
    pub(super) fn vds(&self) -> Option<Vds> {
        let (ego, projection) = (self.ego, self.projection?);
        let [latitude_deg, longitude_deg] = projection.on_earth_deg(ego.x_m, ego.y_m)?;
        let moves = ego.speed_m_s.abs() > COURSE_FROM_M_S;
        let heading_rad = ego.yaw_rad + libm::atan2(ego.lateral_speed_m_s, ego.speed_m_s);
        let course_rad = projection.north_rad(latitude_deg, longitude_deg) - heading_rad;
        let turn = 2.0 * core::f64::consts::PI;
        let bearing_rad = course_rad - turn * libm::floor(course_rad / turn);
        Some(Vds {
            bearing_rad: if moves { Slot::Value(bearing_rad) } else { Slot::NotAvailable },
            altitude_m: Slot::Value(ego.z_m),
            ..Vds::default()
        })
    }

    pub(super) fn sas(&self) -> Sas {
        Sas {
            steering_wheel_rad: Slot::Value(self.ego.steering_wheel_rad),
            active_mode: NO,
            calibrated: YES,
            ..Sas::default()
        }
    }

    /// Torque of engine brake and retarder together, at the crank: the plant counts the engine brake
    /// to the driveline's force, EEC1 does not have it.
    pub(super) fn erc1(&self) -> Erc1 {
        let retarder_nm = self.ego.powertrain.retarder_force_n / self.retarder_leverage_1_m();
        let torque_nm = retarder_nm + self.truck.plant().engine_brake_nm;
        let frac = (torque_nm / self.retarder_reference_nm()).clamp(0.0, 1.25);
        Erc1 {
            torque_mode: Slot::Value(if self.retarder_master.is_some() { OTHER } else { 0 }),
            torque_frac: Slot::Value(-frac),
            controlling_address: controlling(self.retarder_master),
            ..Erc1::default()
        }
    }

    pub(super) fn rc(&self) -> Rc {
        Rc { reference_torque_nm: Slot::Value(self.retarder_reference_nm()), ..Rc::default() }
    }

    /// Wheel force of a torque at the crank in the present gear, N/Nm; in neutral that of the top
    /// gear, where no force is.
    fn retarder_leverage_1_m(&self) -> f64 {
        let p = &self.limits().powertrain;
        let gear = self.ego.powertrain.gear;
        let top = p.gear_ratios.last().copied().unwrap_or(1.0);
        ratio(p, gear).unwrap_or(top) * p.final_drive_ratio / p.wheel_radius_m
    }

    /// All that engine brake and retarder can do at the crank in the top gear, Nm.
    fn retarder_reference_nm(&self) -> f64 {
        let p = &self.limits().powertrain;
        let engine_nm = p.engine_brake_nm.at(p.max_speed_rad_s);
        let most_n = p
            .retarder_force_n
            .as_ref()
            .map_or(0.0, |force_n| force_n.y().iter().copied().fold(0.0, f64::max));
        let top = p.gear_ratios.last().copied().unwrap_or(1.0);
        libm::ceil(engine_nm + most_n * p.wheel_radius_m / p.final_drive_ratio / top).max(1.0)
    }

    /// The nearest vehicle in the truck's way within the radar's range.
    pub(super) fn acc1(&self) -> Acc1 {
        let seen = self.ahead.filter(|a| a.gap_m <= RADAR_RANGE_M);
        let number = |value: Option<f64>| value.map_or(Slot::NotAvailable, Slot::Value);
        Acc1 {
            lead_speed_m_s: number(seen.map(|a| a.speed_m_s.max(0.0))),
            lead_distance_m: number(seen.map(|a| a.gap_m.max(0.0))),
            mode: NO,
            target_detected: Slot::Value(u8::from(seen.is_some())),
            ..Acc1::default()
        }
    }

    pub(super) fn ccvs1(&self) -> Ccvs1 {
        Ccvs1 {
            parking_brake_switch: NO,
            speed_m_s: Slot::Value(self.wheel_speed_m_s.max(0.0)),
            cruise_active: NO,
            brake_switch: NO,
            clutch_switch: NO,
            ..Ccvs1::default()
        }
    }

    pub(super) fn vdhr(&self) -> Vdhr {
        let driven = Slot::Value(self.driven_m.max(0.0));
        Vdhr { total_distance_m: driven, trip_distance_m: driven }
    }

    pub(super) fn amb(&self) -> Amb {
        let patch = self.truck.patch();
        Amb {
            barometric_pressure_pa: Slot::Value(patch.air_pressure_pa),
            ambient_temperature_k: Slot::Value(patch.air_temperature_k),
            ..Amb::default()
        }
    }
}

fn ratio(p: &PowertrainLimits, gear: u8) -> Option<f64> {
    p.gear_ratios.get(usize::from(gear).checked_sub(1)?).copied()
}

/// The controlling device in EEC1 and ERC1 (SPN 1483, 1480); not available: the driver.
fn controlling(master: Option<u8>) -> Slot<u8> {
    master.map_or(Slot::NotAvailable, Slot::Value)
}
