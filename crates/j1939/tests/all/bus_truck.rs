//! A truck over its bus: when it speaks, what it notices, how exactly it reads.

use crate::support;
use crate::support::{ENGINE_NM, RETARDER_NM, TICK, Yard, limits};
use j1939::bus::Bus;
use j1939::message::{Tc1, Tsc1, Xbr};
use j1939::truck::{BusTruckConfig, Engagement, brakes_asked, gear_asked, torque_asked};
use j1939::{ADDRESS_CLAIMED_PGN, Frame, Id, Message, Name, Slot};
use tractrix_core::{BrakeMode, Command, GearRequest, SafetySignal, Time, Vehicle, VehicleFault};

fn of(frames: &[Frame], pgn: u32, da: u8) -> impl Iterator<Item = &Frame> {
    frames.iter().filter(move |f| f.id().pgn() == pgn && f.id().da() == da)
}

/// Ticks until a condition holds; its time, at most `most` of them.
fn until(yard: &mut Yard, most: usize, condition: impl Fn(&Yard) -> bool) -> Option<Time> {
    (0..most).find_map(|_| {
        let at = yard.now;
        yard.tick();
        condition(yard).then_some(at)
    })
}

fn count(frames: &[Frame], pgn: u32, da: u8) -> usize {
    of(frames, pgn, da).count()
}

#[test]
fn nothing_but_the_claim_is_sent_before_the_truck_is_engaged() {
    let mut yard = Yard::new();
    yard.command = Command { accelerator_pedal_frac: 0.5, ..Command::default() };
    let frames = yard.run(8.0);
    let claims = frames.iter().filter(|f| f.id().pgn() == ADDRESS_CLAIMED_PGN).count();
    assert_eq!((claims, frames.len()), (1, 1), "{frames:?}");
    assert_eq!(yard.truck.engagement(), Engagement::Ready);
    let faults: Vec<_> = yard.truck.status().faults().map(|f| f.fault).collect();
    assert_eq!(faults, [VehicleFault::DriverOverride]);
}

#[test]
fn rates_are_those_of_the_standard_and_end_with_the_engagement() {
    let mut yard = Yard::engaged();
    yard.command = Command {
        accelerator_pedal_frac: 0.3,
        gear: GearRequest::Gear(9),
        retarder_frac: 0.0,
        ..Command::default()
    };
    yard.tick();
    let second = yard.run(1.0);
    assert_eq!(count(&second, Tsc1::TABLE.pgn, 0x00), 100);
    for retarder in [0x0F, 0x10, 0x29] {
        assert_eq!(count(&second, Tsc1::TABLE.pgn, retarder), 20);
    }
    assert_eq!(count(&second, Xbr::TABLE.pgn, 0x0B), 5);
    assert_eq!(count(&second, Tc1::TABLE.pgn, 0x03), 20);
    assert_eq!(count(&second, 0xEF00, 0x13), 100);
    yard.command.xbr_decel_m_s2 = 1.0;
    yard.command.brake_mode = BrakeMode::Maximum;
    yard.tick();
    assert_eq!(count(&yard.run(1.0), Xbr::TABLE.pgn, 0x0B), 50);
    yard.truck.disengage(yard.now);
    // One period: what was under way, and the last word of each
    let last = yard.run(0.03);
    let release = of(&last, Tsc1::TABLE.pgn, 0x00).last().unwrap();
    assert_eq!(torque_asked(&Tsc1::decode(release.id(), release.bytes()).unwrap()), None);
    let release = of(&last, Xbr::TABLE.pgn, 0x0B).last().unwrap();
    let release = Xbr::decode(release.id(), release.bytes()).unwrap();
    assert_eq!(brakes_asked(&release).1, BrakeMode::Off);
    let release = of(&last, Tc1::TABLE.pgn, 0x03).last().unwrap();
    let release = Tc1::decode(release.id(), release.bytes()).unwrap();
    assert_eq!(gear_asked(&release), GearRequest::Automatic);
    assert_eq!(yard.run(2.0), []);
}

#[test]
fn a_command_arrives_as_it_was_meant() {
    let mut yard = Yard::engaged();
    yard.command = Command {
        accelerator_pedal_frac: 0.4,
        xbr_decel_m_s2: 1.25,
        brake_mode: BrakeMode::Addition,
        retarder_frac: 0.5,
        ..Command::default()
    };
    let frames = yard.run(0.2);
    let engine = of(&frames, Tsc1::TABLE.pgn, 0).last().unwrap();
    let engine = Tsc1::decode(engine.id(), engine.bytes()).unwrap();
    let p = limits().powertrain;
    let asked_nm = torque_asked(&engine).unwrap() * ENGINE_NM;
    assert!((p.pedal_frac(asked_nm, 20.0 / 0.53 * 2.85) - 0.4).abs() < 1e-3, "{asked_nm}");
    let xbr = of(&frames, Xbr::TABLE.pgn, 0x0B).last().unwrap();
    let (decel, mode) = brakes_asked(&Xbr::decode(xbr.id(), xbr.bytes()).unwrap());
    assert!((decel - 1.25).abs() < 0.5 / 2048.0 + 1e-9);
    assert_eq!(mode, BrakeMode::Addition);
    let retarder = of(&frames, Tsc1::TABLE.pgn, 0x29).last().unwrap();
    let retarder = Tsc1::decode(retarder.id(), retarder.bytes()).unwrap();
    assert!((torque_asked(&retarder).unwrap() + 0.5).abs() < 1e-9);
}

/// Fuel of the sheet, g/m³.
const DENSITY: f64 = 835.0e3;

/// Half a step of a signal on the bus, and for what is made of several the sum of their shares.
#[test]
fn what_is_read_is_what_was_measured_within_half_a_step() {
    for i in 0..60 {
        let mut yard = Yard::new();
        let x = f64::from(i);
        let m = &mut yard.controllers.measured;
        m.speed_m_s = 0.41 * x;
        m.yaw_rate_rad_s = 0.011 * (x - 30.0);
        m.steering_wheel_rad = 0.137 * (x - 30.0);
        m.accel_y_m_s2 = 0.093 * (x - 30.0);
        m.engine_speed_rad_s = 60.0 + 2.3 * x;
        m.engine_torque_nm = 41.7 * x;
        m.friction_nm = 95.0 + 1.3 * x;
        m.fuel_m3_s = 3.1e-7 * x;
        m.retarder_frac = 0.0137 * x;
        yard.run(1.6);
        let (m, e, p) = (yard.controllers.measured, yard.ego, yard.ego.powertrain);
        let rpm = std::f64::consts::TAU / 60.0;
        for (name, read, measured, step) in [
            ("speed", e.speed_m_s, m.speed_m_s, 1.0 / 256.0 / 3.6),
            ("yaw rate", e.yaw_rate_rad_s, m.yaw_rate_rad_s, 1.0 / 8192.0),
            ("hand wheel", e.steering_wheel_rad, m.steering_wheel_rad, 1.0 / 1024.0),
            ("lateral", e.accel_y_m_s2, m.accel_y_m_s2, 1.0 / 2048.0),
            ("engine speed", p.engine_speed_rad_s, m.engine_speed_rad_s, 0.125 * rpm),
            ("torque", p.engine_torque_nm, m.engine_torque_nm, 0.00125 * ENGINE_NM),
            ("friction", p.engine_friction_torque_nm, m.friction_nm, 0.02 * ENGINE_NM),
            ("fuel", p.fuel_rate_g_s, m.fuel_m3_s * DENSITY, 0.05e-3 / 3600.0 * DENSITY),
        ] {
            assert!((read - measured).abs() <= 0.5 * step + 1e-9, "{name}: {read}, {measured}");
        }
        assert_eq!((p.gear, p.shift_in_progress), (12, false));
        let l = limits();
        let lever = l.powertrain.gear_ratios[11] * l.powertrain.final_drive_ratio
            / l.powertrain.wheel_radius_m;
        let retarder_n = m.retarder_frac * RETARDER_NM * lever;
        assert!((p.retarder_force_n - retarder_n).abs() <= 0.01 * RETARDER_NM * lever + 1e-6);
        let net_nm = p.engine_torque_nm
            - p.engine_friction_torque_nm
            - l.powertrain.auxiliary_power_w / p.engine_speed_rad_s;
        let eta = l.powertrain.gear_efficiency_frac[11];
        let force_n = net_nm * lever * if net_nm > 0.0 { eta } else { 1.0 / eta };
        assert!((p.drive_force_n - force_n).abs() < 1e-6);
        assert!((e.road_wheel_rad * l.lateral.steering_ratio - e.steering_wheel_rad).abs() < 1e-12);
    }
}

/// Steps of 5 kPa; each wheel is off by half of one at most, and so is the mean.
#[test]
fn brake_pressure_is_read_within_half_a_step() {
    for i in 0..80 {
        let mut yard = Yard::new();
        let wheels = [0.0, 1.3, 2.1, 3.7].map(|off| 1e3 * (off + 9.7 * f64::from(i)));
        yard.controllers.measured.brake_pressure_pa = wheels;
        yard.run(0.3);
        let (read, mean) =
            (yard.ego.powertrain.brake_pressure_pa, wheels.iter().sum::<f64>() / 4.0);
        assert!((read - mean).abs() <= 2500.0 + 1e-6, "{read} Pa, {mean} Pa");
    }
}

/// The bus has no brake force: it is the demand, which XBR rounds to 1/2048 m/s², times the mass.
#[test]
fn brake_force_is_that_of_the_demand_within_half_a_step() {
    let mass_kg = limits().road_load.mass_kg;
    let mut yard = Yard::engaged();
    for i in 1..60 {
        let decel_m_s2 = 0.0417 * f64::from(i);
        yard.command.xbr_decel_m_s2 = decel_m_s2;
        yard.command.brake_mode = BrakeMode::Maximum;
        yard.controllers.measured.brakes_act = i % 4 != 0;
        let frames = yard.run(0.2);
        let xbr = of(&frames, Xbr::TABLE.pgn, 0x0B).last().unwrap();
        let (asked_m_s2, _) = brakes_asked(&Xbr::decode(xbr.id(), xbr.bytes()).unwrap());
        let told_n = yard.ego.powertrain.brake_force_n;
        let acting_n = if i % 4 == 0 { 0.0 } else { mass_kg * asked_m_s2 };
        assert!((told_n - acting_n).abs() <= mass_kg * 0.5 / 2048.0 + 1e-6, "{told_n} {acting_n}");
    }
}

/// A wheel speed that is off by half a step puts the filtered derivative off by a step over the
/// filter's time and a period at most; the times of frames waver by the bus (1 ms of 20).
#[test]
fn acceleration_errs_by_a_sixth_of_a_step_a_period() {
    const STEP_M_S: f64 = 1.0 / 256.0 / 3.6;
    let filter_s = BusTruckConfig::default().acceleration_filter_s;
    let mut worst_m_s2 = 0.0_f64;
    for accel_m_s2 in [-2.5, -1.1, -0.3, 0.0, 0.07, 0.4, 1.3] {
        let mut yard = Yard::new();
        for tick in 0..400 {
            yard.tick();
            yard.controllers.measured.speed_m_s += 0.01 * accel_m_s2;
            if tick > 200 {
                let off_m_s2 = (yard.ego.accel_x_m_s2 - accel_m_s2).abs();
                let wavers_m_s2 = 0.05 * accel_m_s2.abs();
                worst_m_s2 = worst_m_s2.max(off_m_s2 - wavers_m_s2);
            }
        }
    }
    assert!(worst_m_s2 <= STEP_M_S / (filter_s + 0.02), "{worst_m_s2}");
}

#[test]
fn acceleration_is_made_of_wheel_speeds_and_fuel_is_the_integral_of_its_rate() {
    let mut yard = Yard::new();
    yard.run(1.0);
    let before_g = yard.ego.powertrain.fuel_used_g;
    for _ in 0..200 {
        yard.controllers.measured.speed_m_s += 0.005;
        yard.tick();
    }
    assert!((yard.ego.accel_x_m_s2 - 0.5).abs() < 0.06, "{}", yard.ego.accel_x_m_s2);
    let p = yard.ego.powertrain;
    let used_g = p.fuel_used_g - before_g;
    assert!((used_g - 2.0 * p.fuel_rate_g_s).abs() < 1e-6 && used_g > 10.0, "{used_g}");
}

#[test]
fn a_silent_engine_is_noticed_within_100_ms_and_the_truck_stops() {
    let mut yard = Yard::engaged();
    yard.controllers.silent.push(0x00);
    let last = yard.now.plus_nanos(-TICK);
    let noticed =
        until(&mut yard, 20, |y| y.truck.status().since(VehicleFault::SignalLost).is_some())
            .expect("it was not noticed");
    assert!(noticed.seconds_since(last) < 0.1, "{}", noticed.seconds_since(last));
    assert_eq!(yard.truck.engagement(), Engagement::MinimalRisk);
    let status = yard.truck.status();
    assert!(status.age_s(SafetySignal::Engine).unwrap() > 0.08);
    assert!(status.age_s(SafetySignal::SteeringAngle).unwrap() < 0.03, "still steerable");
    yard.command.xbr_decel_m_s2 = 1.0;
    yard.command.brake_mode = BrakeMode::Maximum;
    let frames = yard.run(0.03);
    let xbr = of(&frames, Xbr::TABLE.pgn, 0x0B).last().expect("no brake demand");
    let xbr = Xbr::decode(xbr.id(), xbr.bytes()).unwrap();
    assert_eq!(xbr.priority, Slot::Value(0), "the first priority");
    yard.controllers.silent.clear();
    yard.run(6.0);
    assert_eq!(yard.truck.engagement(), Engagement::Engaged, "{:?}", yard.truck.status());
}

#[test]
fn a_spoofed_command_is_noticed_in_the_next_tick_and_not_forgotten() {
    let mut yard = Yard::engaged();
    let at = yard.now;
    let spoof = Frame::of(Id::from_raw(0x0C00_000B), [0xC1, 0, 0, 0xFA, 0xFF, 0xFF, 0xFF, 0xFF]);
    yard.stranger.send(at, &spoof).unwrap();
    let noticed = until(&mut yard, 10, |y| y.truck.status().since(VehicleFault::Spoofed).is_some());
    assert!(noticed.unwrap().seconds_since(at) <= 0.02);
    assert_eq!(yard.truck.engagement(), Engagement::MinimalRisk);
    yard.run(10.0);
    assert_eq!(yard.truck.engagement(), Engagement::MinimalRisk, "until it is engaged anew");
    // The transmission may: it asks for torque in its shifts
    let mut yard = Yard::engaged();
    let shift = Frame::of(Id::from_raw(0x0C00_0003), [0xC1, 0, 0, 0x96, 0xFF, 0xFF, 0xFF, 0xFF]);
    yard.stranger.send(yard.now, &shift).unwrap();
    yard.run(0.5);
    assert_eq!(yard.truck.engagement(), Engagement::Engaged);
}

#[test]
fn a_claim_with_name_zero_is_an_intruder() {
    for address in [0x00, 0x0B, 0x27] {
        let mut yard = Yard::engaged();
        let at = yard.now;
        yard.stranger.send(at, &Name(0).claim(address)).unwrap();
        let seen = until(&mut yard, 10, |y| {
            y.truck.status().since(VehicleFault::AddressConflict).is_some()
        });
        assert!(seen.unwrap().seconds_since(at) <= 0.02, "{address:02X}");
        assert_eq!(yard.truck.engagement(), Engagement::MinimalRisk);
    }
}

#[test]
fn who_has_lost_its_address_sends_nothing() {
    let mut yard = Yard::engaged();
    // A NAME that is smaller than ours and cannot choose another address
    yard.stranger.send(yard.now, &Name(1).claim(0x27)).unwrap();
    yard.run(0.05);
    assert_ne!(yard.truck.engagement(), Engagement::Engaged);
    let ours = yard.run(1.0);
    assert!(ours.iter().all(|f| f.id().pgn() == ADDRESS_CLAIMED_PGN), "{ours:?}");
}

#[test]
fn pedals_and_wheel_give_the_truck_to_the_driver_until_it_is_engaged_again() {
    let acts: [fn(&mut Yard); 3] = [
        |y| y.controllers.measured.accelerator_frac = 0.2,
        |y| y.controllers.measured.brake_pedal_frac = 0.1,
        |y| y.controllers.measured.steering_wheel_rad = 0.9,
    ];
    for (i, act) in acts.into_iter().enumerate() {
        let mut yard = Yard::engaged();
        act(&mut yard);
        yard.run(0.6);
        assert_ne!(yard.truck.engagement(), Engagement::Engaged, "{i}");
        assert!(yard.truck.status().since(VehicleFault::DriverOverride).is_some());
        assert_eq!(yard.run(1.0), [], "{i}");
        yard.controllers.measured = support::Measured::default();
        yard.run(1.0);
        assert_eq!(yard.truck.engagement(), Engagement::Ready, "{i}");
        assert_eq!(yard.run(0.5), [], "{i}");
    }
}

#[test]
fn a_cab_that_says_no_pedal_is_down_does_not_hide_the_engine_s() {
    // The story: engine and cab tell the pedal in turn, and the last word counted: a foot that the
    // engine feels was never down for as long as an override takes.
    for (engine_frac, cab_frac) in [(0.2, 0.0), (0.0, 0.2)] {
        let mut yard = Yard::engaged();
        yard.controllers.measured.accelerator_frac = engine_frac;
        yard.controllers.measured.cab_accelerator_frac = Some(cab_frac);
        yard.run(0.6);
        assert_ne!(yard.truck.engagement(), Engagement::Engaged, "{engine_frac} {cab_frac}");
        assert!(yard.truck.status().since(VehicleFault::DriverOverride).is_some());
    }
}

#[test]
fn a_single_wrong_message_is_no_foot() {
    // The story: one corrupted EEC2 looked like the driver's foot, and the truck was given to a driver
    // who was not there.
    let mut yard = Yard::engaged();
    yard.controllers.measured.accelerator_frac = 0.2;
    yard.controllers.measured.brake_pedal_frac = 0.2;
    yard.run(0.1);
    yard.controllers.measured = support::Measured::default();
    yard.run(0.5);
    assert_eq!(yard.truck.engagement(), Engagement::Engaged);
    assert!(yard.truck.status().since(VehicleFault::DriverOverride).is_none());
}

#[test]
fn brakes_that_take_no_demand_are_not_relied_on() {
    for state in [1, 2] {
        let mut yard = Yard::engaged();
        yard.controllers.measured.xbr_state = state;
        yard.run(0.2);
        assert_eq!(yard.truck.engagement(), Engagement::MinimalRisk);
        assert!(yard.truck.status().since(VehicleFault::NotReady).is_some());
    }
}

/// The truck slows down, its wheel speed does not.
#[test]
fn a_frozen_wheel_speed_is_noticed_by_the_engine_s() {
    let mut yard = Yard::engaged();
    let first = yard.now;
    let noticed = (0..600).find_map(|_| {
        yard.controllers.measured.engine_speed_rad_s *= 1.0 - 0.5 * 0.01 / 20.0;
        yard.tick();
        let lost = yard.truck.status().since(VehicleFault::SignalLost).is_some();
        lost.then(|| yard.now.seconds_since(first))
    });
    let noticed_s = noticed.expect("it was not noticed");
    assert!(noticed_s < 3.0, "{noticed_s} s at 0.5 m/s²");
    assert_eq!(yard.truck.status().age_s(SafetySignal::RoadSpeed), Some(f64::INFINITY));
    assert_eq!(yard.truck.engagement(), Engagement::MinimalRisk);
    // Not in a shift, and not with an open driveline
    let mut yard = Yard::engaged();
    yard.controllers.measured.driveline_engaged = 0;
    yard.run(0.1);
    yard.controllers.measured.engine_speed_rad_s = 63.0;
    yard.run(2.0);
    assert_eq!(yard.truck.engagement(), Engagement::Engaged);
}

#[test]
fn a_clock_that_jumps_is_noticed_and_survived() {
    for jump_s in [-30.0, -0.02, 3.0, 1e9, -1e9] {
        let mut yard = Yard::engaged();
        yard.now = yard.now.plus_nanos(Time::from_seconds(jump_s).0);
        yard.tick();
        assert_eq!(yard.truck.engagement(), Engagement::MinimalRisk, "{jump_s}");
    }
}

#[test]
fn the_defaults_are_an_address_and_a_name_that_can_be_claimed() {
    let config = BusTruckConfig::default();
    assert!(config.name.can_choose() && config.name.0 != 0 && config.address < 0xFE);
}
