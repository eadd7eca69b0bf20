//! Brakes and the force balance along the truck, standstill included.

use tractrix_core::{Command, GRAVITY_M_S2, RPM_PER_RAD_S, ZERO_DEGC_K};

use super::powertrain::Wheel;
use super::{STANDSTILL_M_S, TruckModel};
use crate::effects::brake::{BrakeParameters, GROUPS};
use crate::effects::resistance::{AirFlow, air_density_kg_m3, grade_n};
use crate::effects::table::{self, TableSignal};
use crate::lateral::{AXLES, BodyForce, GROUP_AXLES, LateralInputs};
use crate::state::{Forces, RoadPatch, SUBSTEP_S, TruckState};

impl TruckModel {
    /// Pressures towards the demand; forces follow in `longitudinal`.
    pub(super) fn service_brakes(&self, s: &mut TruckState, decel: f64, patch: &RoadPatch) {
        let b = &self.parameters.brake;
        let asked = b.asked_decel_m_s2(&mut s.brake, decel, s.accel_m_s2, SUBSTEP_S);
        let most = b.max_pressure_pa * s.brake.reservoir_frac;
        for g in 0..GROUPS {
            let table = self.brake_tables.as_ref().map(|t| &t[g]);
            let demand = b.demand_pa(asked, self.mass_kg, table).min(most);
            let before = s.brake.pressure_pa[g];
            let after = b.pressure_step_pa(before, demand, SUBSTEP_S);
            s.brake.pressure_pa[g] = after;
            let filled = (after - before).max(0.0) / b.max_pressure_pa * self.brake_share[g];
            s.brake.reservoir_frac -= b.air_per_fill_frac * filled;
        }
        let refill = b.refill_1_s * SUBSTEP_S;
        s.brake.reservoir_frac = (s.brake.reservoir_frac + refill).clamp(0.0, 1.0);
        for g in 0..GROUPS {
            let share = self.brake_share[g];
            let pressure = b.acting_pressure_pa(&s.brake, g);
            let force = b.force_n(share, pressure, s.brake.lining_k[g]);
            let power = force * s.speed_m_s.abs();
            s.brake.temperature_k[g] = b.temperature_step_k(
                s.brake.temperature_k[g],
                power,
                share,
                patch.air_temperature_k,
                SUBSTEP_S,
            );
            s.brake.lining_k[g] = BrakeParameters::lining_step_k(
                s.brake.lining_k[g],
                s.brake.temperature_k[g],
                b.lining_lag_s,
                SUBSTEP_S,
            );
        }
    }

    /// The force balance, standstill, speed; returns what the lateral model needs.
    pub(super) fn longitudinal(
        &self,
        s: &mut TruckState,
        command: &Command,
        patch: &RoadPatch,
        wheel: &Wheel,
    ) -> LateralInputs {
        let (d, b, r) =
            (&self.parameters.driveline, &self.parameters.brake, &self.parameters.resistance);
        let v = s.speed_m_s;
        let (sin, cos) = libm::sincos(patch.grade_rad);
        let air = AirFlow::over(
            v,
            s.lateral.yaw_rad,
            (patch.wind_m_s.0 + r.wind_to_x_m_s, patch.wind_m_s.1 + r.wind_to_y_m_s),
            air_density_kg_m3(patch.air_pressure_pa, patch.air_temperature_k),
            (r.headwind_m_s, r.crosswind_to_left_m_s),
        );
        let grip = self.grip_left_coeff(s, patch);
        let drive_limit = grip * self.brake_share[1] * self.mass_kg * GRAVITY_M_S2;
        let drive_n = wheel.drive_n.clamp(-drive_limit, drive_limit);
        // What engine and engine brake leave of the drive axles' grip is the retarder's, then the
        // service brakes': the anti-lock system takes the retarder away before wheels slip.
        let own_n = d.shaft_force_n(s.retarder_nm);
        let hidden_nm = d.hidden_retarder_nm(v, command.accelerator_pedal_frac, -sin / cos);
        let wanted_n = own_n + d.shaft_force_n(hidden_nm);
        let retarder_n = wanted_n.min(drive_limit + drive_n.min(0.0));
        let retarder_heat_n = own_n * if wanted_n > 0.0 { retarder_n / wanted_n } else { 0.0 };
        let driveline_n = retarder_n - drive_n.min(0.0);
        let mut axle_n = [0.0; AXLES];
        let mut brake_n = 0.0;
        for (g, axles) in GROUP_AXLES.into_iter().enumerate() {
            let share = self.brake_share[g];
            let pressure = b.acting_pressure_pa(&s.brake, g);
            let wanted = b.force_n(share, pressure, s.brake.lining_k[g]);
            let used_n = if g == 1 { driveline_n } else { 0.0 };
            let held = wanted.min(grip * share * self.mass_kg * GRAVITY_M_S2 - used_n);
            brake_n += held;
            let count = axles.len() as f64;
            for a in axles {
                axle_n[a] -= held / count;
            }
        }
        axle_n[1] += 0.5 * (drive_n - retarder_n);
        axle_n[2] += 0.5 * (drive_n - retarder_n);
        let effective_mass_kg =
            self.mass_kg + d.rotating_mass_kg(self.parameters.engine.inertia_kg_m2, wheel.gear);
        let forces = Forces {
            table_n: effective_mass_kg * self.table_accel_m_s2(s, command, patch),
            drive_n,
            retarder_n,
            retarder_heat_n,
            brake_n,
            rolling_n: r.rolling_n(self.mass_kg, v, cos, s.tyre_warmth),
            drag_n: r.drag_n(&air),
            grade_n: grade_n(self.mass_kg, sin),
            curve_n: self.curve_drag_n(s),
            effective_mass_kg,
        };
        let pushing = forces.drive_n - forces.drag_n - forces.grade_n + forces.table_n;
        let holding = forces.brake_n + forces.rolling_n + forces.retarder_n + forces.curve_n;
        let next = if v.abs() < STANDSTILL_M_S && pushing.abs() <= holding {
            0.0
        } else {
            let direction = if v.abs() < STANDSTILL_M_S { pushing } else { v };
            let force = pushing - if direction >= 0.0 { holding } else { -holding };
            let next = v + SUBSTEP_S * force / forces.effective_mass_kg;
            // friction stops the truck, it does not turn it round
            if v * next < 0.0 && pushing.abs() <= holding { 0.0 } else { next }
        };
        s.accel_m_s2 = (next - v) / SUBSTEP_S;
        s.distance_m += 0.5 * (v + next) * SUBSTEP_S;
        s.speed_m_s = next;
        s.forces = forces;
        if s.clutch_locked && wheel.gear > 0 {
            s.engine_speed_rad_s = d.engine_speed_rad_s(next, wheel.gear);
        }
        let still = (BodyForce::default(), BodyForce::default());
        let (tractor, trailer) = if air.cross_m_s == 0.0 { still } else { r.side(&air) };
        LateralInputs {
            speed_m_s: 0.5 * (v + next),
            accel_x_m_s2: s.accel_m_s2,
            steering_wheel_rad: command.steering_wheel_rad,
            grade_rad: patch.grade_rad,
            bank_rad: patch.bank_rad,
            tractor,
            trailer,
            axle_longitudinal_force_n: axle_n,
        }
    }

    /// Adhesion that the side forces leave to the longitudinal ones (friction circle), all axles
    /// taken alike.
    fn grip_left_coeff(&self, s: &TruckState, patch: &RoadPatch) -> f64 {
        let side = s.speed_m_s * s.lateral.yaw_rate_rad_s / GRAVITY_M_S2;
        if side == 0.0 {
            return patch.adhesion_coeff;
        }
        libm::sqrt((patch.adhesion_coeff * patch.adhesion_coeff - side * side).max(0.0))
    }

    /// Induced drag of the quasi-static side forces.
    fn curve_drag_n(&self, s: &TruckState) -> f64 {
        let stiffness: f64 = self.lateral.yaw_sideslip().stiffness_n_rad.iter().sum();
        let accel = s.speed_m_s * s.lateral.yaw_rate_rad_s;
        self.parameters.resistance.curve_n(self.mass_kg, accel, stiffness)
    }

    /// Fitted tables at the present signals.
    fn table_accel_m_s2(&self, s: &TruckState, command: &Command, patch: &RoadPatch) -> f64 {
        if self.tables.is_empty() {
            return 0.0;
        }
        let yaw_rate = s.lateral.yaw_rate_rad_s;
        let reference_nm = self.parameters.engine.reference_torque_nm;
        table::accel_m_s2(&self.tables, s.speed_m_s, |signal| match signal {
            TableSignal::EngineSpeedRpm => s.engine_speed_rad_s * RPM_PER_RAD_S,
            TableSignal::SpeedMS => s.speed_m_s,
            TableSignal::Curvature1M => (yaw_rate / s.speed_m_s.max(1.0)).abs(),
            TableSignal::GradeFrac => libm::tan(patch.grade_rad),
            TableSignal::AmbientTempDegc => patch.air_temperature_k - ZERO_DEGC_K,
            TableSignal::CoolantTempDegc => s.coolant_k - ZERO_DEGC_K,
            TableSignal::AcceleratorPedalFrac => command.accelerator_pedal_frac,
            TableSignal::BrakePressureKpa => 1e-3 * self.mean_pressure_pa(s),
            TableSignal::GpsAltitudeM => patch.altitude_m,
            TableSignal::Gear => f64::from(s.shift.gear),
            TableSignal::EngineTorquePercent => 100.0 * s.engine_torque_nm / reference_nm,
            TableSignal::EngineBrakeFrac => command.retarder_frac,
            TableSignal::XbrDecelMS2 => command.xbr_decel_m_s2,
            TableSignal::YawRateRadS => yaw_rate,
            TableSignal::AccelYMS2 => s.speed_m_s * yaw_rate,
            TableSignal::SteeringWheelRad => s.lateral.steering.wheel_rad,
        })
    }
}
