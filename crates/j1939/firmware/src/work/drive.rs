//! Ticks of the loop around the planning stack.

#[path = "../../../../planner/tests/support/data_sheet.rs"]
mod data_sheet;

pub use data_sheet::reference_limits;

use core::convert::Infallible;

use super::Bits;
use planner::{SpeedPlannerKind, Stack, StackConfig, drive_tick};
use road::{Road, builtin};
use tractrix_core::{
    Command, EgoState, GRAVITY_M_S2, GearRequest, Neighbour, PowertrainSignals, RoadPiece, Scene,
    Stamped, Time, TrafficSource, Vehicle, VehicleClass, VehicleLimits,
};

/// Ticks of a drive.
pub const TICKS: usize = 1_000;
const TICK_NS: i64 = 10_000_000;
const TICK_S: f64 = 1e-9 * TICK_NS as f64;
/// Where the drives begin, m.
const START_M: f64 = 600.0;
const SPEED_M_S: f64 = 20.0;

/// A truck on the middle of its lane that does at once what it is asked: what a tick costs does not
/// depend on how well the truck drives.
struct OnRails {
    limits: VehicleLimits,
    ego: EgoState,
    now: Time,
    command: Command,
}

impl OnRails {
    fn new(road: &Road) -> Self {
        let ego = EgoState {
            s_m: START_M,
            speed_m_s: SPEED_M_S,
            powertrain: PowertrainSignals { gear: 12, ..PowertrainSignals::default() },
            ..EgoState::default()
        };
        let limits = reference_limits();
        let mut truck = Self { limits, ego, now: Time::ZERO, command: Command::default() };
        truck.place(road);
        truck
    }

    /// The pose that belongs to the station.
    fn place(&mut self, road: &Road) {
        let e = &mut self.ego;
        e.d_m = road.lanes()[0].center_d_m(e.s_m);
        let at = road.at(e.s_m, e.d_m);
        (e.x_m, e.y_m, e.z_m, e.yaw_rad) = (at.x_m, at.y_m, at.z_m, at.heading_rad);
        let curvature_1_m = road.line().at(e.s_m).curvature_1_m;
        e.yaw_rate_rad_s = e.speed_m_s * curvature_1_m;
        e.accel_y_m_s2 = e.speed_m_s * e.yaw_rate_rad_s;
        e.steering_wheel_rad = self.command.steering_wheel_rad;
        e.road_wheel_rad = e.steering_wheel_rad / self.limits.lateral.steering_ratio;
    }

    /// One tick further.
    fn step(&mut self, road: &Road) {
        let p = &self.limits.powertrain;
        let e = &mut self.ego;
        let s = &mut e.powertrain;
        if let GearRequest::Gear(gear) = self.command.gear {
            s.gear = gear.clamp(1, p.gear_ratios.len() as u8);
        }
        let gear = usize::from(s.gear) - 1;
        let lever = p.gear_ratios[gear] * p.final_drive_ratio / p.wheel_radius_m;
        let engine_rad_s = (e.speed_m_s * lever).max(p.idle_speed_rad_s);
        let friction_nm = p.friction_nm.at(engine_rad_s);
        let indicated_nm =
            self.command.accelerator_pedal_frac * (p.full_load_nm.at(engine_rad_s) + friction_nm);
        let open = self.command.gear == GearRequest::Neutral;
        let net_nm = indicated_nm - friction_nm - p.auxiliary_power_w / engine_rad_s;
        s.engine_speed_rad_s = engine_rad_s;
        s.engine_torque_nm = indicated_nm;
        s.engine_friction_torque_nm = friction_nm;
        s.drive_force_n = if open { 0.0 } else { net_nm * lever * p.gear_efficiency_frac[gear] };
        s.retarder_force_n =
            self.command.retarder_frac * p.engine_brake_nm.at(engine_rad_s) * lever;
        let mass_kg = self.limits.road_load.mass_kg;
        s.brake_force_n = self.command.xbr_decel_m_s2 * mass_kg;
        let (sin_grade, cos_grade) = libm::sincos(road.at(e.s_m, 0.0).grade_rad);
        let piece = RoadPiece { sin_grade, cos_grade, ..RoadPiece::default() };
        let resistance_n = self.limits.road_load.resistance_n(e.speed_m_s, &piece);
        let force_n = s.drive_force_n - s.retarder_force_n - s.brake_force_n - resistance_n;
        e.accel_x_m_s2 = (force_n / (mass_kg + p.rotating_mass_kg[gear])).max(-GRAVITY_M_S2);
        e.speed_m_s = (e.speed_m_s + e.accel_x_m_s2 * TICK_S).max(0.0);
        e.s_m += e.speed_m_s * TICK_S;
        self.now = self.now.plus_nanos(TICK_NS);
        self.place(road);
    }
}

impl Vehicle for OnRails {
    type Error = Infallible;

    fn ego(&mut self, _now: Time) -> Result<Stamped<EgoState>, Infallible> {
        Ok(Stamped { time: self.now, value: self.ego })
    }

    fn command(&mut self, _now: Time, command: &Command) -> Result<(), Infallible> {
        self.command = *command;
        Ok(())
    }

    fn limits(&self) -> &VehicleLimits {
        &self.limits
    }
}

/// Cars that hold their speed.
struct Cars(Scene);

impl Cars {
    /// So many, 60 m apart, in turn in both lanes, the first 160 m behind the truck.
    fn new(road: &Road, count: u8) -> Self {
        let neighbours = (0..count).map(|i| {
            let lane = u16::from(i % 2);
            let rear_s_m = START_M - 160.0 + 60.0 * f64::from(i);
            Neighbour {
                id: u64::from(i),
                class: VehicleClass::Car,
                front_s_m: rear_s_m + 4.5,
                rear_s_m,
                d_m: road.lanes()[usize::from(lane)].center_d_m(rear_s_m),
                width_m: 1.8,
                speed_m_s: SPEED_M_S,
                lane,
                ..Neighbour::default()
            }
        });
        Self(Scene { time: Time::ZERO, neighbours: neighbours.collect() })
    }

    fn step(&mut self) {
        self.0.time = self.0.time.plus_nanos(TICK_NS);
        for car in &mut self.0.neighbours {
            car.front_s_m += car.speed_m_s * TICK_S;
            car.rear_s_m += car.speed_m_s * TICK_S;
        }
    }
}

impl TrafficSource for Cars {
    type Error = Infallible;

    fn advance(&mut self, _now: Time, _ego: &EgoState) -> Result<&Scene, Infallible> {
        Ok(&self.0)
    }
}

/// A road, a truck, cars and the stack.
pub struct Drive {
    road: Road,
    truck: OnRails,
    cars: Cars,
    stack: Stack,
    bits: Bits,
}

impl Drive {
    fn new(road: Road, cars: u8, speed_planner: SpeedPlannerKind) -> Result<Self, &'static str> {
        let truck = OnRails::new(&road);
        let config = StackConfig { speed_planner, ..StackConfig::default() };
        let stack = Stack::new(config, &truck.limits).map_err(|_| "the stack refuses the truck")?;
        Ok(Self { cars: Cars::new(&road, cars), truck, stack, road, bits: Bits::NONE })
    }

    /// Cruise control alone on a level road.
    pub fn cruise() -> Result<Self, &'static str> {
        Self::new(builtin::flat(5_000.0), 0, SpeedPlannerKind::Cruise)
    }

    /// Predictive cruise control among eight cars on a level road.
    pub fn predictive() -> Result<Self, &'static str> {
        Self::new(builtin::flat(5_000.0), 8, SpeedPlannerKind::Predictive)
    }

    /// Predictive cruise control alone over hills.
    pub fn hills() -> Result<Self, &'static str> {
        Self::new(builtin::test_site(), 0, SpeedPlannerKind::Predictive)
    }

    /// Speed plans made so far.
    pub fn plans(&self) -> u64 {
        self.stack.speed_plans_made()
    }

    /// The bits of all commands so far.
    pub fn bits(&self) -> Bits {
        self.bits
    }

    /// The tick, and nothing else.
    pub fn tick(&mut self) -> Result<(), &'static str> {
        let Self { road, truck, cars, stack, .. } = self;
        match drive_tick(truck.now, truck, cars, stack, road, &mut ()) {
            Ok(outcome) if !outcome.guarded => Ok(()),
            Ok(_) => Err("the guard had to act"),
            Err(_) => Err("a seam failed"),
        }
    }

    /// What happens between two ticks.
    pub fn step(&mut self) {
        let c = &self.truck.command;
        for number in
            [c.accelerator_pedal_frac, c.xbr_decel_m_s2, c.steering_wheel_rad, c.retarder_frac]
        {
            self.bits.number(number);
        }
        self.truck.step(&self.road);
        self.cars.step();
    }
}
