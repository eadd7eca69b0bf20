//! The closed loop over a bus: the same drive as directly, and what it makes of faults.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::disallowed_macros,
    reason = "a test may fail, and prints figures"
)]

use j1939::BitRate;
use j1939::bus::Bus;
use j1939::bus::faults::{FaultPlan, Faults};
use j1939::bus::loopback::{Loopback, LoopbackNode};
use j1939::dm::{DM1, DiagnosticMessage};
use j1939::message::{Cvw, Message};
use j1939::truck::Engagement;
use j1939::{Frame, Id, Request, TpEvent, Transport};
use sim::ecu::{EcuConfig, EcuFault, EcuSim, Unit};
use sim::{Scenario, SimTruck, Status, World};
use tractrix_core::{Time, VehicleFault};

const MS: i64 = 1_000_000;

fn scenario(name: &str, duration_s: f64) -> Scenario {
    let mut scenario = Scenario::builtin(name).unwrap();
    scenario.run.duration_s = duration_s;
    scenario
}

fn on_loopback(scenario: &Scenario) -> World {
    let mut world = World::new(scenario, 1).unwrap();
    world.put_on_loopback(BitRate::Kbit250).unwrap();
    world
}

/// Drives a scenario for a minute directly and over a bus, and compares both.
fn is_the_drive_that_it_is_directly(name: &str, connect: impl FnOnce(&mut World)) {
    let scenario = scenario(name, 60.0);
    let mut direct = World::new(&scenario, 1).unwrap();
    let mut bus = direct.clone();
    connect(&mut bus);
    let (mut sum, mut ticks) = (0.0, 0.0);
    while direct.status() == Status::Running {
        let off = direct.truck().state().speed_m_s - bus.truck().state().speed_m_s;
        (sum, ticks) = (sum + off * off, ticks + 1.0);
        direct.tick(&mut ()).unwrap();
        bus.tick(&mut ()).unwrap();
    }
    let (a, b) = (direct.summary(), bus.summary());
    let (figures, rmse_m_s) = (bus.bus().unwrap(), f64::sqrt(sum / ticks));
    println!(
        "{name}: {} collisions, speed RMSE {rmse_m_s:.4} m/s, lane changes {} and {}, lateral \
         error {:.4} and {:.4} m, fuel {:+.3} %, {figures:?}",
        b.collisions,
        a.lane_changes,
        b.lane_changes,
        a.max_lateral_error_m,
        b.max_lateral_error_m,
        100.0 * (b.fuel_g / a.fuel_g - 1.0)
    );
    assert!(rmse_m_s < 0.05, "{name}: {rmse_m_s}");
    assert_eq!((b.collisions, b.lane_changes), (0, a.lane_changes), "{name}");
    assert!(b.max_lateral_error_m < a.max_lateral_error_m + 0.02, "{name}: {b:#?}");
    assert!(figures.peak_load_frac > 0.3 && figures.peak_load_frac < 0.6, "{figures:?}");
    assert_eq!((figures.ticks_not_driven, figures.refused, figures.unsent), (0, 0, 0));
}

#[test]
fn a_drive_over_a_bus_is_the_drive_that_it_is_directly() {
    for name in ["test-site", "medium-12.5"] {
        is_the_drive_that_it_is_directly(name, |world| {
            world.put_on_loopback(BitRate::Kbit250).unwrap();
        });
    }
}

#[test]
#[ignore = "needs CAN sockets: tests/can/uml.sh"]
fn a_drive_over_two_can_sockets_is_the_drive_that_it_is_directly() {
    for name in ["test-site", "medium-12.5"] {
        is_the_drive_that_it_is_directly(name, |world| {
            let open = || j1939::bus::open("can:vcan0").unwrap();
            let [ecu, driver] = sim::in_step(open(), open());
            world.put_on_bus(BitRate::Kbit250, ecu, driver).unwrap();
        });
    }
}

/// In wall time: a program that was held up does not say afterwards what it could not say.
#[test]
fn a_virtual_truck_that_was_held_up_does_not_flood_its_bus() {
    let wire = Loopback::new(BitRate::Kbit250, 2);
    let scenario = scenario("flat", 9.0);
    let mut plant = sim::Plant::on_bus(&scenario, 1, wire.node(0)).unwrap();
    let mut bus = wire.node(1);
    let mut engine_frames = 0;
    for ms in (0..2000).step_by(10) {
        let wall_ms = if (1000..1300).contains(&ms) { 1300 } else { ms };
        plant.tick(Time(ms * MS), Time(wall_ms * MS)).unwrap();
        let before = engine_frames;
        while let Some(heard) = bus.receive(Time((ms + 9) * MS)).unwrap() {
            engine_frames += usize::from(heard.value.id().raw() == 0x0CF0_0400);
        }
        let most = if (1000..1280).contains(&ms) { 0 } else { 2 };
        assert!(engine_frames - before <= most, "{} at {ms} ms", engine_frames - before);
    }
    assert!(engine_frames > 120, "{engine_frames}");
}

#[test]
fn a_clone_goes_on_bit_for_bit_and_one_on_a_bus_outside_is_refused() {
    let mut world = on_loopback(&scenario("medium-15", 6.0));
    for _ in 0..250 {
        world.tick(&mut ()).unwrap();
    }
    let mut copy = world.clone();
    assert_eq!(world.run(&mut ()).unwrap(), copy.run(&mut ()).unwrap());

    let wire = Loopback::new(BitRate::Kbit250, 2);
    let mut world = World::new(&scenario("flat", 1.0), 1).unwrap();
    let (ecu, driver) = (Box::new(wire.node(0)), Box::new(wire.node(1)));
    world.put_on_bus(BitRate::Kbit250, ecu, driver).unwrap();
    let why = world.clone().tick(&mut ()).unwrap_err().to_string();
    assert!(why.contains("there is one bus"), "{why}");
    assert!(world.run(&mut ()).is_ok());
}

/// A world whose driver's end has faults, and a third node on its bus.
fn with_faults(plan: FaultPlan) -> (World, LoopbackNode) {
    let wire = Loopback::new(BitRate::Kbit250, 3);
    let mut world = World::new(&scenario("flat", 12.0), 1).unwrap();
    let driver = Box::new(Faults::new(wire.node(1), plan, 1));
    world.put_on_bus(BitRate::Kbit250, Box::new(wire.node(0)), driver).unwrap();
    (world, wire.node(2))
}

const FROM: Time = Time(2_000 * MS);

/// Drives until a fault is seen, s after [`FROM`], and one tick more.
fn detected_after_s(
    world: &mut World,
    mut each_tick: impl FnMut(&mut World),
) -> (VehicleFault, f64) {
    while world.now().seconds() < FROM.seconds() + 2.0 {
        if world.now() >= FROM {
            each_tick(world);
        }
        let now = world.now();
        world.tick(&mut ()).unwrap();
        let status = tractrix_core::Vehicle::status(world.bus_mut().unwrap());
        if let Some(fault) = status.faults().next() {
            assert!(now >= FROM, "{fault:?} without a cause at {now:?}");
            world.tick(&mut ()).unwrap();
            return (fault.fault, now.seconds_since(FROM));
        }
    }
    panic!("nothing was noticed");
}

fn assert_minimal_risk(world: &mut World) {
    assert_eq!(world.bus_mut().unwrap().driver().engagement(), Engagement::MinimalRisk);
    assert!(!world.stack().plan().guard.is_empty());
}

#[test]
fn a_silent_engine_is_noticed_in_time_and_the_truck_brought_to_a_stop() {
    let (mut world, _) = with_faults(FaultPlan::default());
    let mut done = false;
    let (fault, after_s) = detected_after_s(&mut world, |world| {
        if !std::mem::replace(&mut done, true) {
            let ecu = world.bus_mut().unwrap().ecu();
            ecu.set_fault(EcuFault::Silent(Unit::Engine), true);
        }
    });
    assert_eq!(fault, VehicleFault::SignalLost);
    assert!(after_s < 0.1, "{after_s}");
    assert_minimal_risk(&mut world);
    let from_m_s = world.truck().state().speed_m_s;
    let summary = world.run(&mut ()).unwrap();
    assert!(world.truck().state().speed_m_s < from_m_s - 5.0, "{summary:#?}");
    assert_eq!(summary.collisions, 0);
}

/// TSC1 of the brakes' address at 31 Hz, as in the log of an attack (a torque of 125 %).
#[test]
fn a_spoofed_torque_command_is_noticed_within_ten_frames() {
    let (mut world, mut intruder) = with_faults(FaultPlan::default());
    let mut frames = 0;
    let (fault, after_s) = detected_after_s(&mut world, |world| {
        let tick = (world.now().0 - FROM.0) / (10 * MS);
        if tick % 3 == 0 {
            let id = Id::from_raw(0x0C00_000B);
            intruder.send(world.now(), &Frame::of(id, [0xC1, 0, 0, 0xFA, 0, 0, 0, 0])).unwrap();
            frames += 1;
        }
    });
    assert_eq!(fault, VehicleFault::Spoofed);
    assert!(frames <= 10 && after_s < 0.1, "{frames} frames, {after_s} s");
    assert_minimal_risk(&mut world);
}

#[test]
fn a_controller_that_is_off_the_bus_is_noticed_at_once() {
    let plan = FaultPlan { from: FROM, bus_off: true, ..FaultPlan::default() };
    let (mut world, _) = with_faults(plan);
    let (fault, after_s) = detected_after_s(&mut world, |_| {});
    assert_eq!(fault, VehicleFault::BusOff);
    assert!(after_s < 0.02, "{after_s}");
    assert_minimal_risk(&mut world);
}

#[test]
fn a_clock_that_jumps_is_noticed_at_once_and_driven_on_with() {
    for by_ns in [1_000 * MS, -1_000 * MS] {
        let (mut world, _) = with_faults(FaultPlan::default());
        let mut jumped = false;
        let (fault, after_s) = detected_after_s(&mut world, |world| {
            if !std::mem::replace(&mut jumped, true) {
                world.bus_mut().unwrap().jump_clock(by_ns);
            }
        });
        assert_eq!((fault, after_s), (VehicleFault::SignalLost, 0.0), "{by_ns}");
        let summary = world.run(&mut ()).unwrap();
        assert_eq!(summary.collisions, 0);
        let looped = world.bus_mut().unwrap();
        assert_eq!(looped.driver().engagement(), Engagement::Engaged, "{by_ns}");
        assert!(looped.figures().ticks_not_driven < 100, "{:?}", looped.figures());
    }
}

#[test]
fn a_lost_frame_in_a_hundred_changes_nothing() {
    let plan = FaultPlan { from: FROM, loss: 0.01, ..FaultPlan::default() };
    let (mut world, _) = with_faults(plan);
    let summary = world.run(&mut ()).unwrap();
    assert_eq!((summary.collisions, summary.off_road_events), (0, 0));
    assert!(summary.max_lateral_error_m < 0.05, "{summary:#?}");
    assert!(world.bus().unwrap().refused > 0, "a lost counter is refused by the truck");
}

/// The virtual truck answers on its bus as a truck does.
#[test]
fn the_virtual_truck_claims_answers_requests_and_tells_its_faults() {
    let wire = Loopback::new(BitRate::Kbit250, 2);
    let world = World::new(&scenario("flat", 1.0), 1).unwrap();
    let truck: SimTruck = world.truck().clone();
    let mass_kg = tractrix_core::Vehicle::limits(&truck).road_load.mass_kg;
    let mut ecu = EcuSim::new(truck, wire.node(0), EcuConfig::default(), Time::ZERO, None).unwrap();
    let (mut bus, mut transport) = (wire.node(1), Transport::<8, 256>::new(16));
    transport.set_address(Some(0xF9));
    let (mut claims, mut vin, mut masses, mut codes) = (0, None, None, Vec::new());
    for tick in 0..400 {
        let now = Time(tick * 10 * MS);
        ecu.advance(now).unwrap();
        while let Some(heard) = bus.receive(now).unwrap() {
            let id = heard.value.id();
            transport.on_frame(heard.time, &heard.value);
            claims += usize::from(j1939::Name::claimed_in(&heard.value).is_some());
            if id.pgn() == Cvw::TABLE.pgn {
                masses = Cvw::decode(id, heard.value.bytes()).unwrap().combination_mass_kg.value();
            }
            if id.pgn() == DM1 && id.sa() == Unit::Brakes.address() {
                let message = DiagnosticMessage::decode(id, heard.value.bytes()).unwrap();
                codes.extend(message.dtcs().map(|code| (code.spn, code.fmi)));
            }
            while let Some(event) = transport.event() {
                if let TpEvent::Received(message) = event
                    && message.pgn == j1939::ident::VI
                {
                    vin = Some(String::from_utf8(message.bytes.to_vec()).unwrap());
                }
            }
        }
        transport.poll(now, &mut bus).unwrap();
        if tick == 50 {
            for pgn in [Cvw::TABLE.pgn, j1939::ident::VI] {
                let request = Request { pgn, da: 0xFF, sa: 0xF9 };
                bus.send(now, &request.frame().unwrap()).unwrap();
            }
        }
        if tick == 200 {
            // XBR with a wrong checksum
            let wrong = Frame::of(Id::from_raw(0x0C04_0BF9), [0x7F, 0x6D, 0x20, 0, 0, 0, 0, 0]);
            bus.send(now, &wrong).unwrap();
        }
    }
    assert_eq!(claims, Unit::ALL.len());
    assert_eq!(vin.as_deref(), Some("TRACTRIX000000001*"));
    assert!((masses.unwrap() - mass_kg).abs() <= 5.0);
    assert_eq!(ecu.refused(), 1);
    assert_eq!(ecu.let_go(), None, "what is refused does not let the truck go");
    assert_eq!(codes.first(), Some(&(3_188, 19)));
}
