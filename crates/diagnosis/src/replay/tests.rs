use dynamics::effects::shift::ShiftPhase;
use dynamics::{RoadPatch, TruckModel, TruckParameters};
use tractrix_core::{Command, RPM_PER_RAD_S, ZERO_DEGC_K};

use super::*;
use crate::Channel as C;
use crate::Drive;

/// Twelve minutes of a truck: climbs that heat the coolant until the fan runs, descents on the
/// retarder, curves; recorded without noise.
pub(crate) fn recorded(truck: &TruckParameters, payload_kg: f64) -> Drive {
    let model = TruckModel::new(truck.clone(), payload_kg).unwrap();
    let n = 12 * 60 * 20;
    let mut s = model.initial_state(0.0, 0.0, 0.0, 18.0);
    s.tyre_warmth = 1.0;
    s.coolant_k = 364.0;
    let channels = [
        C::SpeedMS,
        C::EngineSpeedRpm,
        C::EngineTorquePercent,
        C::Gear,
        C::ShiftInProcess,
        C::EngineBrakeFrac,
        C::AcceleratorPedalFrac,
        C::GradeFrac,
        C::YawRateRadS,
        C::HeadingRad,
        C::CoolantTempDegc,
        C::AmbientTempDegc,
        C::BrakePressureKpa,
    ];
    let mut rows: Vec<Vec<f64>> = vec![Vec::new(); channels.len()];
    for i in 0..n {
        let t = i as f64 * Drive::STEP_S;
        let climbs = t % 180.0 < 120.0;
        let grade_frac: f64 = if climbs { 0.018 } else { -0.035 };
        let command = Command {
            accelerator_pedal_frac: if climbs { 0.95 } else { 0.0 },
            retarder_frac: if climbs { 0.0 } else { 0.45 },
            steering_wheel_rad: 0.3 * (t / 4.0).sin(),
            ..Command::default()
        };
        let patch = RoadPatch {
            grade_rad: grade_frac.atan(),
            air_temperature_k: 303.15,
            ..RoadPatch::default()
        };
        let values = [
            s.speed_m_s,
            s.engine_speed_rad_s * RPM_PER_RAD_S,
            100.0 * s.engine_torque_nm / truck.engine.reference_torque_nm,
            f64::from(s.shift.gear),
            if s.shift.phase == ShiftPhase::Engaged { 0.0 } else { 1.0 },
            command.retarder_frac,
            command.accelerator_pedal_frac,
            grade_frac,
            s.lateral.yaw_rate_rad_s,
            s.lateral.yaw_rad,
            s.coolant_k - ZERO_DEGC_K,
            patch.air_temperature_k - ZERO_DEGC_K,
            // nobody brakes; without the channel nobody knows, and coasting is not judged
            0.0,
        ];
        rows.iter_mut().zip(values).for_each(|(r, v)| r.push(v));
        s = model.step(&s, &command, &patch, Drive::STEP_S).unwrap();
    }
    let mut drive = Drive::new("recorded", 0.0, n);
    drive.reported_mass_kg = Some(model.mass_kg());
    drive.tyres_warm_at_start = Some(true);
    for (c, r) in channels.into_iter().zip(rows) {
        drive.set(c, r);
    }
    drive
}

/// Root mean square of the force balance's residuals, m/s per second, without the two percent that
/// demands and shifts just changed in.
fn balance(drive: &Drive, truck: &TruckParameters) -> f64 {
    let plant = Plant::of_truck(truck).unwrap();
    let d = Prepared::new(drive, &plant);
    let mut out = Residuals::default();
    replay_group(&d, &plant, &[0.0; PARAMS], Group::Force, &mut out);
    let valid = &d.valid[M::Force as usize];
    let rows = out[M::Force as usize].iter().zip(valid).filter(|(_, ok)| **ok);
    let mut squares: Vec<f64> = rows.map(|(x, _)| x * x).collect();
    assert!(squares.len() > 300, "{} rows", squares.len());
    squares.sort_by(f64::total_cmp);
    squares.truncate(squares.len() * 98 / 100);
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

#[test]
fn every_effect_of_the_truck_file_is_in_the_balance() {
    let truck = TruckParameters::load("sinotruk")
        .unwrap()
        .with_parameter("resistance.rolling_per_speed_s_m", 2e-4)
        .unwrap();
    let drive = recorded(&truck, 20_000.0);
    let whole = balance(&drive, &truck);
    assert!(whole < 2e-3, "{whole} m/s");
    for path in [
        "engine.fan_power_w",
        "driveline.retarder_torque_nm",
        "resistance.rolling_per_speed_s_m",
        "resistance.curve_drag_coeff",
    ] {
        let without = balance(&drive, &truck.with_parameter(path, 0.0).unwrap());
        assert!(without > 2.0 * whole, "{path}: {without} m/s, with it {whole} m/s");
    }
}

/// A stuck truck once stood for an hour on its brakes: the rounding of one pressure message, 63,000
/// times the same, was an effect outside the catalogue. And its controller weighs the truck itself,
/// so that a load lighter than its sheet is no fault of the brakes.
#[test]
fn brakes_that_are_held_say_it_once_and_a_load_of_their_own_is_a_tolerance() {
    const LOAD: f64 = 0.88;
    let truck = TruckParameters::load("reference").unwrap();
    let (n, reported_kg) = (3_600 * 20_usize, 40_000.0);
    let demand = |i: usize| match i {
        0..40 => 0.0,
        40..100 => 1.5,
        100..71_000 => 0.8,
        _ => 0.0,
    };
    let brake = &truck.brake;
    let dead = (brake.dead_time_s / Drive::STEP_S).round() as usize;
    let mut pressure_pa = 0.0;
    let pressures_kpa = (0..n).map(|i| {
        let asked_pa = brake.demand_pa(demand(i.saturating_sub(dead)), LOAD * reported_kg, None);
        for _ in 0..10 {
            pressure_pa = brake.pressure_step_pa(pressure_pa, asked_pa, Drive::STEP_S / 10.0);
        }
        (pressure_pa / 4e3).round() * 4.0
    });
    let mut drive = Drive::new("held", 0.0, n);
    drive.reported_mass_kg = Some(reported_kg);
    drive.set(C::BrakePressureKpa, pressures_kpa.collect());
    drive.set(C::XbrDecelMS2, (0..n).map(demand).collect());

    let plant = Plant::of_truck(&truck).unwrap();
    let d = Prepared::new(&drive, &plant);
    let rows = d.valid[M::Brake as usize].iter().filter(|ok| **ok).count();
    assert!((30..150).contains(&rows), "{rows} rows");
    let worst_kpa = |load_estimate| {
        let mut theta = [0.0; PARAMS];
        theta[P::BrakeLoad as usize] = load_estimate;
        let mut out = Residuals::default();
        replay_group(&d, &plant, &theta, Group::Brake, &mut out);
        out[M::Brake as usize].iter().fold(0.0_f64, |worst, x| worst.max(x.abs()))
    };
    assert!(worst_kpa(LOAD - 1.0) < 2.5, "{} kPa", worst_kpa(LOAD - 1.0));
    assert!(worst_kpa(0.0) > 9.0, "{} kPa", worst_kpa(0.0));
}

/// Half a sample of lag averages two samples' noise: the calibration once took that for a lag, and
/// what the false lag made of every released pedal was an effect outside the catalogue.
#[test]
fn noise_of_the_torque_message_is_no_lag_of_the_fuel() {
    let truck = TruckParameters::load("reference").unwrap();
    let plant = Plant::of_truck(&truck).unwrap();
    let n = 40_000;
    let mut random = 1_u64;
    let mut noise_percent = || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963);
        (random >> 40) as f64 / (1_u64 << 24) as f64 - 0.5
    };
    let (rpm, percent) = (1_200.0, 50.0);
    let torque_nm = 0.01 * percent * truck.engine.reference_torque_nm;
    let fuel_g_s = plant.engine.fuel_rate_g_s(rpm / RPM_PER_RAD_S, torque_nm);
    let mut drive = Drive::new("steady", 0.0, n);
    drive.set(C::EngineTorquePercent, (0..n).map(|_| percent + noise_percent()).collect());
    for (channel, value) in
        [(C::SpeedMS, 22.0), (C::EngineSpeedRpm, rpm), (C::Gear, 12.0), (C::FuelRateGS, fuel_g_s)]
    {
        drive.set(channel, vec![value; n]);
    }
    let d = Prepared::new(&drive, &plant);
    let mean_square = |lag_s| {
        let mut theta = [0.0; PARAMS];
        theta[P::FuelLag as usize] = lag_s;
        let mut out = Residuals::default();
        replay_group(&d, &plant, &theta, Group::Fuel, &mut out);
        let rows = out[M::Fuel as usize].iter().zip(&d.valid[M::Fuel as usize]);
        let squares: Vec<f64> = rows.filter(|(_, ok)| **ok).map(|(x, _)| x * x).collect();
        assert!(squares.len() > 9_000, "{} rows", squares.len());
        squares.iter().sum::<f64>() / squares.len() as f64
    };
    let ratio = mean_square(0.5 * Drive::STEP_S) / mean_square(0.0);
    assert!((ratio - 1.0).abs() < 0.03, "{ratio}");
}

/// Under power a loss of the teeth takes speed in the gears that have teeth in mesh, and none in the
/// direct one.
#[test]
fn teeth_hold_back_in_all_gears_but_the_direct_one() {
    let truck = TruckParameters::load("reference").unwrap();
    let direct = f64::from(truck.driveline.top_gear());
    let pulls = [(C::Gear, direct - 1.0, direct), (C::EngineTorquePercent, 60.0, 60.0)];
    let held = held_back(&[(P::MeshLoss, 0.02)], 20 * 20, &pulls);
    assert!(held[..19].iter().all(|x| (0.003..0.02).contains(x)), "{:?}", &held[..19]);
    assert!(held[21..].iter().all(|x| *x == 0.0), "{:?}", &held[21..]);
}

/// What a retarder holds back in each second of a drive at 20 m/s, m/s: some channels change at `begins`.
fn held_back(theta: &[(P, f64)], begins: usize, changes: &[(C, f64, f64)]) -> Vec<f64> {
    let truck = TruckParameters::load("reference").unwrap();
    let plant = Plant::of_truck(&truck).unwrap();
    let gear = truck.driveline.top_gear() - 1;
    let rpm = truck.driveline.engine_speed_rad_s(20.0, gear) * RPM_PER_RAD_S;
    let n = 40 * 20;
    let mut drive = Drive::new("steady", 0.0, n);
    drive.reported_mass_kg = Some(40_000.0);
    for (channel, value) in [
        (C::SpeedMS, 20.0),
        (C::EngineTorquePercent, 0.0),
        (C::EngineSpeedRpm, rpm),
        (C::Gear, f64::from(gear)),
        (C::GradeFrac, 0.0),
        (C::BrakePressureKpa, 0.0),
        (C::ShiftInProcess, 0.0),
        (C::EngineBrakeFrac, 0.0),
        (C::AcceleratorPedalFrac, 0.0),
    ] {
        drive.set(channel, vec![value; n]);
    }
    for (channel, before, after) in changes {
        let at = |i| if i < begins { *before } else { *after };
        drive.set(*channel, (0..n).map(at).collect());
    }
    let d = Prepared::new(&drive, &plant);
    let of = |theta: &Theta| {
        let mut out = Residuals::default();
        replay_group(&d, &plant, theta, Group::Force, &mut out);
        out[M::Force as usize].clone()
    };
    let mut with = [0.0; PARAMS];
    theta.iter().for_each(|(p, x)| with[*p as usize] = *x);
    let (with, without) = (of(&with), of(&[0.0; PARAMS]));
    with.iter().zip(&without).map(|(x, y)| (x - y).abs()).collect()
}

/// A retarder that blends in before the brakes was a brake gain of 10 %, stated as certain: in the
/// catalogue it grew with the demand without a limit, and at once.
#[test]
fn a_retarder_of_the_brakes_fills_within_a_second_and_has_a_limit() {
    let held_m_s = |demand_m_s2: f64, saturation_s2_m: f64| {
        let theta = [(P::RetarderBrake, 4_000.0), (P::RetarderSaturation, saturation_s2_m)];
        let rows = held_back(&theta, 10 * 20, &[(C::XbrDecelMS2, 0.0, demand_m_s2)]);
        assert!(rows[..9].iter().all(|x| *x == 0.0), "{rows:?}");
        (rows[10], rows[30])
    };
    let (first, full) = held_m_s(1.0, 1.0);
    // Half of 4 kN on 40 t and what turns, for a second.
    assert!((0.045..0.05).contains(&full), "{full} m/s");
    // The mean of 1 - exp(-t / 0.4 s) over the first second, begun at each of its first four samples.
    let edges = (0..4).map(|j| (-f64::from(j) * Drive::STEP_S / 0.4).exp()).sum::<f64>() / 4.0;
    let fills = 1.0 - 0.4 * edges * (1.0 - (-2.5_f64).exp());
    assert!((first / full - fills).abs() < 0.03, "{} of {fills}", first / full);
    // Twice the demand is not twice the force: 2 / (1 + 2) of 1 / (1 + 1).
    assert!((held_m_s(2.0, 1.0).1 / full - 4.0 / 3.0).abs() < 1e-3);
    assert!((held_m_s(2.0, 0.0).1 / held_m_s(1.0, 0.0).1 - 2.0).abs() < 1e-3);
}

/// A demanded stage was taken to act at once: an engine brake that comes 0.2 s later was one of -33 %
/// beside a hidden retarder, both certain, in trucks that brake with part of it.
#[test]
fn an_engine_brake_acts_later_than_its_stage_is_logged() {
    let begins = [(C::EngineBrakeFrac, 0.0, 1.0)];
    let half = held_back(&[(P::EngineBrakeScale, -0.5)], 10 * 20, &begins);
    for (lag_s, row) in [(0.4, 10), (-0.4, 9)] {
        let held = held_back(&[(P::StageLag, lag_s)], 10 * 20, &begins);
        assert!(held[..9].iter().chain(&held[11..]).all(|x| *x < 1e-12), "{held:?}");
        assert!(held[row] > 0.7 * (held[9] + held[10]), "{held:?}");
        let lacks_s = 0.5 * (held[9] + held[10]) / half[30];
        assert!((lacks_s - lag_s.abs()).abs() < 0.03, "{lacks_s} s of {lag_s} s");
    }
}

/// A retarder that holds a truck on descents, and not where it rolls out on the level, had no name.
#[test]
fn a_retarder_of_descents_holds_there_and_with_a_released_pedal_alone() {
    let truck = TruckParameters::load("reference").unwrap();
    let full_m_s = truck.driveline.shaft_force_n(800.0) / 40_000.0;
    let downhill = |grade: f64, pedal: f64, from: f64| {
        let changes = [(C::GradeFrac, 0.0, grade), (C::AcceleratorPedalFrac, 0.0, pedal)];
        let theta = [(P::RetarderSlope, 800.0), (P::RetarderSteep, from)];
        held_back(&theta, 10 * 20, &changes)
    };
    let held = downhill(-0.03, 0.0, 0.01);
    assert!(held[..9].iter().all(|x| *x == 0.0), "{held:?}");
    assert!((0.9..1.0).contains(&(held[30] / full_m_s)), "{} of {full_m_s}", held[30]);
    for (grade, pedal, from) in [(-0.03, 0.3, 0.01), (0.03, 0.0, 0.01), (-0.015, 0.0, 0.02)] {
        let held = downhill(grade, pedal, from);
        assert!(held.iter().all(|x| *x == 0.0), "{grade} {pedal} {from}: {held:?}");
    }
}
