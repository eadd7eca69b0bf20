//! A truck on a bus where anybody says anything: it never panics, its state is a finite number, and
//! it is silent until it is engaged.

use core::convert::Infallible;
use std::collections::VecDeque;

use crate::support;
use j1939::bus::{Bus, BusError};
use j1939::message::MESSAGES;
use j1939::steering::ExampleSteering;
use j1939::truck::{BusTruck, BusTruckConfig, Engagement};
use j1939::{ADDRESS_CLAIMED_PGN, BitRate, Frame, Id};
use proptest::prelude::*;
use tractrix_core::{
    BrakeMode, Command, Fix, GearRequest, Motion, Pose, PoseSource, Stamped, Time, Vehicle,
    VehicleFault,
};

/// A bus that gives what it is told to and keeps what it gets; or fails.
#[derive(Debug, Default)]
struct Script {
    incoming: VecDeque<Stamped<Frame>>,
    sent: Vec<Frame>,
    off: bool,
}

impl Bus for Script {
    fn send(&mut self, _: Time, frame: &Frame) -> Result<(), BusError> {
        if self.off {
            return Err(BusError::Off);
        }
        self.sent.push(*frame);
        Ok(())
    }

    fn receive(&mut self, _: Time) -> Result<Option<Stamped<Frame>>, BusError> {
        if self.off { Err(BusError::Off) } else { Ok(self.incoming.pop_front()) }
    }
}

/// Remembers what the truck told it.
#[derive(Debug, Default)]
struct Listener {
    motion: Option<Motion>,
    fix: Option<Fix>,
}

impl PoseSource for Listener {
    type Error = Infallible;
    fn pose(&mut self, now: Time) -> Result<Stamped<Pose>, Infallible> {
        Ok(Stamped { time: now, value: Pose::default() })
    }
    fn moved(&mut self, motion: &Stamped<Motion>) {
        self.motion = Some(motion.value);
    }
    fn fixed(&mut self, fix: &Stamped<Fix>) {
        self.fix = Some(fix.value);
    }
}

fn truck() -> BusTruck<Script, Listener> {
    let steering = Some(ExampleSteering::new(9));
    let (bus, pose) = (Script::default(), Listener::default());
    let config = BusTruckConfig::default();
    BusTruck::new(bus, BitRate::Kbit250, pose, steering, support::limits(), config).unwrap()
}

/// Any identifier, more often one that the truck listens to.
fn identifier() -> impl Strategy<Value = u32> {
    let pgns: Vec<u32> = MESSAGES.iter().map(|m| m.pgn).chain([60_416, 60_160, 59_904]).collect();
    let addresses = vec![0x00_u8, 0x03, 0x0B, 0x0F, 0x10, 0x29, 0x2A, 0x31, 0x13, 0x27, 0xFE];
    let known =
        (0..8_u32, prop::sample::select(pgns), prop::sample::select(addresses), any::<u8>())
            .prop_map(|(priority, pgn, sa, da)| {
                let da = if pgn >> 8 & 0xFF < 240 { u32::from(da % 64) << 8 } else { 0 };
                priority << 26 | pgn << 8 | da | u32::from(sa)
            });
    prop_oneof![8 => known, 2 => any::<u32>()]
}

fn bytes() -> impl Strategy<Value = Vec<u8>> {
    let byte = prop_oneof![
        6 => any::<u8>(),
        1 => Just(0xFF),
        1 => Just(0xFE),
        1 => Just(0xFA),
        1 => Just(0x00),
    ];
    prop_oneof![
        9 => prop::collection::vec(byte.clone(), 8),
        1 => prop::collection::vec(byte, 0..8),
    ]
}

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![8 => -3.0..3.0, 1 => Just(1e300), 1 => Just(-1e300)]
}

fn command() -> impl Strategy<Value = Command> {
    (number(), number(), number(), number(), 0..3_u8, any::<u8>()).prop_map(|(a, b, c, d, m, g)| {
        Command {
            accelerator_pedal_frac: a,
            xbr_decel_m_s2: b,
            brake_mode: [BrakeMode::Off, BrakeMode::Addition, BrakeMode::Maximum][usize::from(m)],
            steering_wheel_rad: c,
            retarder_frac: d,
            gear: match g {
                0..=40 => GearRequest::Automatic,
                41..=80 => GearRequest::Neutral,
                gear => GearRequest::Gear(gear),
            },
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2_000, ..ProptestConfig::default() })]

    #[test]
    fn arbitrary_frames_neither_break_the_truck_nor_make_it_speak(
        ticks in prop::collection::vec(
            (
                prop::collection::vec((identifier(), bytes()), 0..24),
                prop_oneof![9 => Just(10_000_000_i64), 1 => any::<i64>()],
                command(),
            ),
            1..24,
        ),
    ) {
        let mut truck = truck();
        let mut now = Time::ZERO;
        for (frames, step, command) in ticks {
            let heard = frames.iter().map(|(id, bytes)| Stamped {
                time: now,
                value: Frame::new(Id::from_raw(*id), bytes).unwrap(),
            });
            truck.bus().incoming.extend(heard);
            prop_assert!(truck.ego(now).unwrap().value.is_finite());
            let _ = truck.status();
            truck.command(now, &command).unwrap();
            now = now.plus_nanos(step);
        }
        // Answers to requests, claims and transfers are no demands
        let quiet = [ADDRESS_CLAIMED_PGN, 60_416];
        let demands =
            truck.bus().sent.iter().find(|f| !quiet.contains(&f.id().pgn()));
        prop_assert_eq!(demands, None);
        prop_assert!(!truck.engagement().actuates());
    }

    #[test]
    fn arbitrary_frames_and_commands_do_not_break_a_truck_that_drives(
        noise in prop::collection::vec((identifier(), bytes(), command()), 1..60),
    ) {
        let mut yard = support::Yard::engaged();
        for (id, bytes, command) in noise {
            yard.stranger.send(yard.now, &Frame::new(Id::from_raw(id), &bytes).unwrap()).unwrap();
            yard.command = command;
            yard.tick();
            prop_assert!(yard.ego.is_finite());
        }
    }
}

#[test]
fn a_bus_that_is_gone_is_a_fault_and_no_error() {
    let mut truck = truck();
    truck.bus().off = true;
    for i in 0..100 {
        let now = Time(i * support::TICK);
        assert!(truck.ego(now).is_ok());
        truck.command(now, &Command::default()).unwrap();
        assert_eq!(truck.status().since(VehicleFault::BusOff), Some(Time::ZERO));
    }
    assert_eq!(truck.engagement(), Engagement::Off);
}

#[test]
fn a_command_that_is_no_number_is_refused() {
    let bad = Command { accelerator_pedal_frac: f64::NAN, ..Command::default() };
    let refused = truck().command(Time::ZERO, &bad).unwrap_err();
    assert!(refused.to_string().contains("accelerator_pedal_frac"), "{refused}");
}

#[test]
fn what_the_sensors_and_receivers_say_reaches_the_pose_source() {
    use j1939::message::{Hrw, Vdc2, Vds, Vp1};
    use j1939::{Message, Slot};
    let mut truck = truck();
    let speed = Slot::Value(20.0);
    let wheels = Hrw { rear_left_speed_m_s: speed, rear_right_speed_m_s: speed, ..Hrw::default() };
    let turning = Vdc2 { yaw_rate_rad_s: Slot::Value(0.1), ..Vdc2::default() };
    let course = Vds { bearing_rad: Slot::Value(1.0), ..Vds::default() };
    let (north, east) = (48.137_f64.to_radians(), 11.575_f64.to_radians());
    let at = Vp1 { latitude_rad: Slot::Value(north), longitude_rad: Slot::Value(east) };
    let frames = [
        wheels.frame(0xFF, 0x0B),
        turning.frame(0xFF, 0x0B),
        course.frame(0xFF, 0x1C),
        at.frame(0xFF, 0x1C),
    ];
    for frame in frames {
        let frame = Stamped { time: Time::ZERO, value: frame.unwrap() };
        truck.bus().incoming.push_back(frame);
    }
    truck.ego(Time::ZERO).unwrap();
    let told = truck.pose_source();
    let motion = told.motion.unwrap();
    assert!((motion.speed_m_s - 20.0).abs() < 1e-3 && (motion.yaw_rate_rad_s - 0.1).abs() < 1e-4);
    let fix = told.fix.unwrap();
    assert!((fix.latitude_deg - 48.137).abs() < 1e-7 && (fix.longitude_deg - 11.575).abs() < 1e-7);
    assert!((fix.course_rad.unwrap() - 1.0).abs() < 1e-3);
}
