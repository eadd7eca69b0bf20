//! The controllers of a truck that stands or rolls as told, on a bus in memory.
#![allow(clippy::unwrap_used, unreachable_pub)]

use core::convert::Infallible;

use j1939::bus::Bus;
use j1939::bus::loopback::{Loopback, LoopbackNode};
use j1939::message::{
    Ebc1, Ebc3, Ebc5, Ec1, Eec1, Eec2, Eec3, Erc1, Etc1, Etc2, Hrw, Lfe1, Rc, Vdc2,
};
use j1939::steering::ExampleSteering;
use j1939::truck::{BusTruck, BusTruckConfig, Engagement, Torque};
use j1939::{BitRate, Frame, GLOBAL_ADDRESS, Message, Slot, Transport};
use tractrix_core::{Command, EgoState, Pose, PoseSource, Stamped, Time, Vehicle, VehicleLimits};

pub const TICK: i64 = 10_000_000;
pub const ENGINE_NM: f64 = 2600.0;
pub const RETARDER_NM: f64 = 1800.0;

pub fn limits() -> VehicleLimits {
    VehicleLimits::from_sheet("longhaul", include_str!("../data/longhaul_sheet.toml")).unwrap()
}

/// Rolls along a straight road at a speed.
#[derive(Debug, Clone)]
pub struct Rolling(pub f64);

impl PoseSource for Rolling {
    type Error = Infallible;
    fn pose(&mut self, now: Time) -> Result<Stamped<Pose>, Infallible> {
        let s_m = self.0 * now.seconds();
        Ok(Stamped { time: now, value: Pose { x_m: s_m, s_m, ..Pose::default() } })
    }
}

/// What the controllers measure.
#[derive(Debug, Clone, Copy)]
pub struct Measured {
    pub speed_m_s: f64,
    pub yaw_rate_rad_s: f64,
    pub steering_wheel_rad: f64,
    pub accel_y_m_s2: f64,
    pub engine_speed_rad_s: f64,
    pub engine_torque_nm: f64,
    pub friction_nm: f64,
    pub fuel_m3_s: f64,
    pub accelerator_frac: f64,
    /// What the cab says of a pedal; nothing where it has none.
    pub cab_accelerator_frac: Option<f64>,
    pub brake_pedal_frac: f64,
    pub gear: i16,
    pub retarder_frac: f64,
    pub xbr_state: u8,
    pub brakes_act: bool,
    pub brake_pressure_pa: [f64; 4],
    pub driveline_engaged: u8,
}

impl Default for Measured {
    fn default() -> Self {
        Self {
            speed_m_s: 20.0,
            yaw_rate_rad_s: 0.0,
            steering_wheel_rad: 0.0,
            accel_y_m_s2: 0.0,
            // 20 m/s in the direct gear
            engine_speed_rad_s: 20.0 / 0.53 * 2.85,
            engine_torque_nm: 800.0,
            friction_nm: 150.0,
            fuel_m3_s: 8e-6,
            accelerator_frac: 0.0,
            cab_accelerator_frac: None,
            brake_pedal_frac: 0.0,
            gear: 12,
            retarder_frac: 0.0,
            xbr_state: 0,
            brakes_act: false,
            brake_pressure_pa: [0.0; 4],
            driveline_engaged: 1,
        }
    }
}

/// Engine 00, transmission 03, brakes 0B, retarder 29 on one node.
pub struct Controllers {
    pub node: LoopbackNode,
    pub measured: Measured,
    /// Controllers that do not send.
    pub silent: Vec<u8>,
    engine: Transport<1, 64>,
    retarder: Transport<1, 64>,
    tick: i64,
}

impl Controllers {
    pub fn new(node: LoopbackNode) -> Self {
        let transport = |address| {
            let mut transport = Transport::new(16);
            transport.set_address(Some(address));
            transport
        };
        Self {
            node,
            measured: Measured::default(),
            silent: Vec::new(),
            engine: transport(0x00),
            retarder: transport(0x29),
            tick: 0,
        }
    }

    fn put<M: Message>(&mut self, now: Time, message: &M, sa: u8) {
        if !self.silent.contains(&sa) {
            self.node.send(now, &message.frame(GLOBAL_ADDRESS, sa).unwrap()).unwrap();
        }
    }

    /// Sends what is due in this tick, and returns what was heard since the last.
    pub fn step(&mut self, now: Time) -> Vec<Stamped<Frame>> {
        let mut heard = Vec::new();
        while let Some(frame) = self.node.receive(now).unwrap() {
            heard.push(frame);
        }
        let m = self.measured;
        let torque = Torque::of_frac(m.engine_torque_nm / ENGINE_NM);
        let eec1 = Eec1 {
            torque_mode: Slot::Value(0),
            torque_frac: torque.coarse_frac,
            torque_fine_frac: torque.fine_frac,
            engine_speed_rad_s: Slot::Value(m.engine_speed_rad_s),
            ..Eec1::default()
        };
        self.put(now, &eec1, 0x00);
        let etc1 = Etc1 {
            driveline_engaged: Slot::Value(self.measured.driveline_engaged),
            shift_in_process: Slot::Value(0),
            ..Etc1::default()
        };
        self.put(now, &etc1, 0x03);
        let vdc2 = Vdc2 {
            steering_wheel_rad: Slot::Value(m.steering_wheel_rad),
            yaw_rate_rad_s: Slot::Value(m.yaw_rate_rad_s),
            lateral_acceleration_m_s2: Slot::Value(m.accel_y_m_s2),
            ..Vdc2::default()
        };
        self.put(now, &vdc2, 0x0B);
        if self.tick % 2 == 0 {
            let hrw = Hrw {
                rear_left_speed_m_s: Slot::Value(m.speed_m_s),
                rear_right_speed_m_s: Slot::Value(m.speed_m_s),
                ..Hrw::default()
            };
            self.put(now, &hrw, 0x0B);
        }
        if self.tick % 5 == 0 {
            let eec2 =
                Eec2 { accelerator_pedal_frac: Slot::Value(m.accelerator_frac), ..Eec2::default() };
            self.put(now, &eec2, 0x00);
            // A cab that has no pedal says so
            let cab = m.cab_accelerator_frac.map_or(Slot::NotAvailable, Slot::Value);
            self.put(now, &Eec2 { accelerator_pedal_frac: cab, ..Eec2::default() }, 0x31);
        }
        if self.tick % 10 == 0 {
            self.slow(now);
        }
        if self.tick % 500 == 0 && !self.silent.contains(&0x00) {
            let ec1 = Ec1 { reference_torque_nm: Slot::Value(ENGINE_NM), ..Ec1::default() };
            let rc = Rc {
                kind: Slot::Value(3),
                location: Slot::Value(1),
                reference_torque_nm: Slot::Value(RETARDER_NM),
                ..Rc::default()
            };
            let all = GLOBAL_ADDRESS;
            self.engine.send(now, 6, Ec1::TABLE.pgn, all, &ec1.encode().unwrap()).unwrap();
            self.retarder.send(now, 6, Rc::TABLE.pgn, all, &rc.encode().unwrap()).unwrap();
        }
        for transport in [&mut self.engine, &mut self.retarder] {
            transport.poll(now, &mut self.node).unwrap();
            while transport.event().is_some() {}
        }
        self.tick += 1;
        heard
    }

    fn slow(&mut self, now: Time) {
        let m = self.measured;
        let friction = Eec3 {
            friction_torque_frac: Torque::of_frac(m.friction_nm / ENGINE_NM).coarse_frac,
            ..Eec3::default()
        };
        self.put(now, &friction, 0x00);
        self.put(now, &Lfe1 { fuel_rate_m3_s: Slot::Value(m.fuel_m3_s), ..Lfe1::default() }, 0x00);
        self.put(now, &Etc2 { current_gear: Slot::Value(m.gear), ..Etc2::default() }, 0x03);
        let pedal = Ebc1 {
            brake_switch: Slot::Value(0),
            brake_pedal_frac: Slot::Value(m.brake_pedal_frac),
            ..Ebc1::default()
        };
        self.put(now, &pedal, 0x0B);
        let brakes = Ebc5 {
            xbr_state: Slot::Value(m.xbr_state),
            foundation_brake_use: Slot::Value(u8::from(m.brakes_act)),
            ..Ebc5::default()
        };
        self.put(now, &brakes, 0x0B);
        let [front_left, front_right, rear_left, rear_right] = m.brake_pressure_pa;
        let pressures = Ebc3 {
            front_left_pressure_pa: Slot::Value(front_left),
            front_right_pressure_pa: Slot::Value(front_right),
            rear_1_left_pressure_pa: Slot::Value(rear_left),
            rear_1_right_pressure_pa: Slot::Value(rear_right),
            ..Ebc3::default()
        };
        self.put(now, &pressures, 0x0B);
        let retarder = Erc1 {
            torque_mode: Slot::Value(0),
            torque_frac: Torque::of_frac(-m.retarder_frac).coarse_frac,
            ..Erc1::default()
        };
        self.put(now, &retarder, 0x29);
    }
}

/// A truck, its controllers and a third node for whoever else is on the bus.
pub struct Yard {
    pub truck: BusTruck<LoopbackNode, Rolling>,
    pub controllers: Controllers,
    pub stranger: LoopbackNode,
    pub now: Time,
    pub command: Command,
    /// The last state, and the frames of the truck that were heard in the last tick.
    pub ego: EgoState,
    pub sent: Vec<Frame>,
}

impl Yard {
    pub fn new() -> Self {
        let wire = Loopback::new(BitRate::Kbit250, 3);
        let steering = Some(ExampleSteering::new(9));
        let config = BusTruckConfig::default();
        let truck = BusTruck::new(
            wire.node(0),
            BitRate::Kbit250,
            Rolling(20.0),
            steering,
            limits(),
            config,
        );
        Self {
            truck: truck.unwrap(),
            controllers: Controllers::new(wire.node(1)),
            stranger: wire.node(2),
            now: Time::ZERO,
            command: Command::default(),
            ego: EgoState::default(),
            sent: Vec::new(),
        }
    }

    /// One that drives.
    pub fn engaged() -> Self {
        let mut yard = Self::new();
        yard.run(2.0);
        assert_eq!(yard.truck.engagement(), Engagement::Ready, "{:?}", yard.truck.status());
        yard.truck.engage();
        yard.run(0.2);
        assert_eq!(yard.truck.engagement(), Engagement::Engaged);
        yard
    }

    pub fn tick(&mut self) {
        self.ego = self.truck.ego(self.now).unwrap().value;
        self.truck.command(self.now, &self.command).unwrap();
        let heard = self.controllers.step(self.now);
        self.sent = heard.into_iter().map(|f| f.value).filter(|f| f.id().sa() == 0x27).collect();
        while self.stranger.receive(self.now).unwrap().is_some() {}
        self.now = self.now.plus_nanos(TICK);
    }

    /// Runs on and returns the truck's frames.
    pub fn run(&mut self, seconds: f64) -> Vec<Frame> {
        let ticks = (seconds * 100.0).round() as usize;
        (0..ticks)
            .flat_map(|_| {
                self.tick();
                std::mem::take(&mut self.sent)
            })
            .collect()
    }
}
