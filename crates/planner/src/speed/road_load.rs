//! Inverse model of the powertrain: from a wanted acceleration to a force, from a force to a pedal,
//! with what [`VehicleLimits`] tells (the paper's Eq. 20, sorted into forces).
//!
//! Left out: torque build-up, shifting and temperature; the speed controller's feedback covers them.

use tractrix_core::{EgoState, PowertrainLimits, RoadLoad, RoadPiece, VehicleLimits};

/// The road under the truck as its load sees it, from where the truck drives and what it feels.
#[must_use]
pub(super) fn road_under(load: &RoadLoad, ego: &EgoState, grade_rad: f64) -> RoadPiece {
    let (headwind_m_s, crosswind_m_s) =
        if load.wind.is_calm() { (0.0, 0.0) } else { load.wind.on_course(ego.yaw_rad) };
    let curvature_1_m = ego.yaw_rate_rad_s / ego.speed_m_s.max(1.0);
    RoadPiece {
        sin_grade: libm::sin(grade_rad),
        cos_grade: libm::cos(grade_rad),
        curvature_squared_1_m2: curvature_1_m * curvature_1_m,
        headwind_m_s,
        crosswind_m_s,
    }
}

/// The driveline in one gear.
#[derive(Debug, Clone, Copy)]
pub(super) struct InGear<'a> {
    powertrain: &'a PowertrainLimits,
    /// Crank torque to wheel force, 1/m.
    leverage_1_m: f64,
    efficiency_frac: f64,
    /// Engine speed, rad/s, not below idle and not above the governed speed.
    pub engine_speed_rad_s: f64,
    /// Rotating inertia felt as mass, kg.
    pub rotating_mass_kg: f64,
    /// The clutch can be closed: the gear turns the engine at idle speed or above.
    closed: bool,
    /// Largest force of a retarder behind the gearbox at the wheels, N, positive.
    retarder_n: f64,
}

impl<'a> InGear<'a> {
    /// The driveline in `gear` (1-based) at `speed_m_s`. Neutral and unknown gears are read as the
    /// gear that a gearbox would choose: the highest with at least 1.5 times idle speed.
    #[must_use]
    pub(super) fn new(powertrain: &'a PowertrainLimits, gear: u8, speed_m_s: f64) -> Self {
        let count = powertrain.gear_ratios.len().max(1);
        let per_speed = powertrain.final_drive_ratio / powertrain.wheel_radius_m;
        let ratio = |i: usize| powertrain.gear_ratios.get(i).copied().unwrap_or(1.0);
        let index = if gear >= 1 && usize::from(gear) <= count {
            usize::from(gear) - 1
        } else {
            (0..count)
                .rev()
                .find(|&i| speed_m_s * per_speed * ratio(i) >= 1.5 * powertrain.idle_speed_rad_s)
                .unwrap_or(0)
        };
        let leverage_1_m = per_speed * ratio(index);
        let closed = speed_m_s * leverage_1_m >= powertrain.idle_speed_rad_s;
        let rotating = powertrain.rotating_mass_kg.get(index).copied().unwrap_or(0.0);
        Self {
            powertrain,
            leverage_1_m,
            efficiency_frac: powertrain.gear_efficiency_frac.get(index).copied().unwrap_or(1.0),
            engine_speed_rad_s: (speed_m_s * leverage_1_m)
                .clamp(powertrain.idle_speed_rad_s, powertrain.max_speed_rad_s),
            rotating_mass_kg: if closed { rotating } else { powertrain.rotating_mass_neutral_kg },
            closed,
            retarder_n: powertrain.retarder_force_n.as_ref().map_or(0.0, |f| f.at(speed_m_s)),
        }
    }

    /// Friction and auxiliaries at the crank, Nm, positive.
    #[must_use]
    pub(super) fn loss_nm(&self) -> f64 {
        self.powertrain.friction_nm.at(self.engine_speed_rad_s)
            + self.powertrain.auxiliary_power_w / self.engine_speed_rad_s.max(1.0)
    }

    /// Wheel force of a net crank torque, N; losses act against the flow of power.
    #[must_use]
    pub(super) fn force_n(&self, net_nm: f64) -> f64 {
        let force = net_nm * self.leverage_1_m;
        if net_nm >= 0.0 { force * self.efficiency_frac } else { force / self.efficiency_frac }
    }

    /// Net crank torque for a wheel force, Nm.
    #[must_use]
    pub(super) fn net_torque_nm(&self, force_n: f64) -> f64 {
        let torque = force_n / self.leverage_1_m;
        if force_n >= 0.0 { torque / self.efficiency_frac } else { torque * self.efficiency_frac }
    }

    /// Wheel force without fuel, N (negative); none where the clutch is open.
    #[must_use]
    pub(super) fn coast_force_n(&self) -> f64 {
        if self.closed { self.force_n(-self.loss_nm()) } else { 0.0 }
    }

    /// Largest wheel force, N.
    #[must_use]
    pub(super) fn max_force_n(&self) -> f64 {
        let aux_nm = self.powertrain.auxiliary_power_w / self.engine_speed_rad_s.max(1.0);
        self.force_n(self.powertrain.full_load_nm.at(self.engine_speed_rad_s) - aux_nm)
    }

    /// Largest additional braking force of engine brake and retarder, N, positive.
    #[must_use]
    pub(super) fn max_retarder_force_n(&self) -> f64 {
        self.powertrain.engine_brake_nm.at(self.engine_speed_rad_s) * self.leverage_1_m
            / self.efficiency_frac
            + self.retarder_n
    }

    /// Accelerator pedal, 0 to 1, that gives the wheel force, by inverting the pedal map.
    #[must_use]
    pub(super) fn pedal_frac(&self, force_n: f64) -> f64 {
        let indicated_nm = self.net_torque_nm(force_n) + self.loss_nm();
        self.powertrain.pedal_frac(indicated_nm, self.engine_speed_rad_s)
    }
}

/// Mass that the wheels have to accelerate in this gear, kg.
#[must_use]
pub(super) fn effective_mass_kg(limits: &VehicleLimits, in_gear: &InGear<'_>) -> f64 {
    limits.road_load.mass_kg + in_gear.rotating_mass_kg
}

/// Largest engine power less what driving on at this speed on this grade takes at the wheels, W.
#[must_use]
pub(crate) fn power_reserve_w(limits: &VehicleLimits, ego: &EgoState, grade_rad: f64) -> f64 {
    let full_load = &limits.powertrain.full_load_nm;
    let powers_w = full_load.x().iter().zip(full_load.y()).map(|(speed, torque)| speed * torque);
    let most_w = powers_w.fold(0.0, f64::max) - limits.powertrain.auxiliary_power_w;
    let load = &limits.road_load;
    let resistance_n = load.resistance_n(ego.speed_m_s, &road_under(load, ego, grade_rad));
    most_w - resistance_n * ego.speed_m_s
}
