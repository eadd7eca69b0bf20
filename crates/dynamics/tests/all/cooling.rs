//! Heat of retarder and engine brake, the fan, and the grip of the drive axles.
//!
//! The story: the retarder gave 400 kW for as long as anybody asked, because its heat went nowhere,
//! and on a wet road retarder, engine brake and service brakes each got the drive axles' whole grip.

use dynamics::effects::cooling::{CoolingParameters, HeatSources};
use dynamics::effects::engine::Engine;
use dynamics::{RoadPatch, TruckModel, TruckParameters, TruckState};
use tractrix_core::{BrakeMode, Command, GRAVITY_M_S2};

fn cooling() -> CoolingParameters {
    TruckParameters::load("longhaul").unwrap().cooling.unwrap()
}

fn model(payload_kg: f64) -> TruckModel {
    TruckModel::new(TruckParameters::load("longhaul").unwrap(), payload_kg).unwrap()
}

/// A truck on rollers that hold its speed.
fn on_rollers(
    m: &TruckModel,
    mut s: TruckState,
    command: &Command,
    patch: &RoadPatch,
    time_s: f64,
) -> TruckState {
    let speed_m_s = s.speed_m_s;
    for _ in 0..(time_s / 0.1) as u32 {
        s = m.step(&s, command, patch, 0.1).unwrap();
        s.speed_m_s = speed_m_s;
    }
    s
}

fn braking(retarder_frac: f64) -> Command {
    Command { retarder_frac, ..Command::default() }
}

#[test]
fn with_the_thermostat_open_the_coolant_warms_as_one_heat_capacity() {
    let c = cooling();
    let (air_k, from) = (300.0, HeatSources { retarder_w: 250e3, ..HeatSources::default() });
    let g = c.body_w_k + c.radiator_w_k + c.fan_w_k;
    let level_k = air_k + 250e3 / g;
    let (mut t, start) = (c.thermostat_to_k, c.thermostat_to_k);
    for _ in 0..20_000 {
        t = c.step_k(t, 1.0, &from, air_k, 0.005);
    }
    let want = level_k + (start - level_k) * (-100.0 * g / c.heat_capacity_j_k).exp();
    assert!((t - want).abs() < 1e-3, "{t} for {want}");
}

#[test]
fn heat_that_goes_in_and_does_not_come_out_warms_the_coolant() {
    let c = CoolingParameters {
        body_w_k: 0.0,
        thermostat_from_k: 400.0,
        thermostat_to_k: 410.0,
        ..cooling()
    };
    let from = HeatSources { indicated_w: 100e3, engine_brake_w: 50e3, retarder_w: 200e3 };
    let mut t = 350.0;
    for _ in 0..1000 {
        t = c.step_k(t, 0.0, &from, 288.15, 0.005);
    }
    let joules = 5.0 * (0.45 * 100e3 + 0.3 * 50e3 + 200e3);
    assert!((t - 350.0 - joules / c.heat_capacity_j_k).abs() < 1e-9);
}

/// A clutch of plates switches; a viscous one comes over a span of the coolant's temperature and goes,
/// by the hysteresis later, over the same.
#[test]
fn a_viscous_fan_comes_and_goes_over_its_band() {
    let engine = |band_k: f64| {
        let truck = TruckParameters::load("longhaul").unwrap();
        let truck = truck.with_parameter("engine.fan_band_k", band_k).unwrap();
        Engine::new(truck.engine).unwrap()
    };
    let (from_k, hysteresis_k) = {
        let e = engine(0.0);
        (e.parameters.fan_on_k, e.parameters.fan_hysteresis_k)
    };
    let course = |band_k: f64, coolant_k: &[f64]| -> Vec<f64> {
        let (e, mut on) = (engine(band_k), 0.0);
        let step = |t: &f64| {
            on = e.fan_on_frac(on, *t);
            on
        };
        coolant_k.iter().map(step).collect()
    };
    let away_k = from_k - hysteresis_k;
    let turns = [from_k, from_k + 0.1, away_k + 0.1, away_k - 0.1, away_k + 0.1];
    assert_eq!(course(0.0, &turns), [0.0, 1.0, 1.0, 0.0, 0.0]);
    let turns = [from_k, from_k + 1.0, from_k + 3.0, from_k - 0.5, away_k + 1.0, from_k + 1.0];
    let on = course(4.0, &turns);
    for (is, want) in on.iter().zip([0.0, 0.25, 0.75, 0.75, 0.25, 0.25]) {
        assert!((is - want).abs() < 1e-9, "{on:?}");
    }
}

/// Held at 80 km/h with full demand the retarder ends where what is left of it is what the radiator
/// takes away: a linear equation for the temperature.
#[test]
fn a_long_descent_ends_at_the_temperature_that_balances() {
    let (m, c) = (model(36_000.0), cooling());
    let mut s = m.initial_state(0.0, 0.0, 0.0, 80.0 / 3.6);
    s = on_rollers(&m, s, &braking(1.0), &RoadPatch::default(), 10.0);
    let d = &m.parameters().driveline;
    let (v, air_k) = (s.speed_m_s, RoadPatch::default().air_temperature_k);
    let full_w = d.shaft_force_n(d.retarder_limit_nm(v)) * v;
    assert!((s.forces.retarder_n * v / full_w - 1.0).abs() < 0.01, "cold: all of it");
    s = on_rollers(&m, s, &braking(1.0), &RoadPatch::default(), 1_500.0);
    let engine_w = c.engine_brake_heat_frac * s.engine_brake_nm * s.engine_speed_rad_s;
    let g = c.body_w_k + c.radiator_w_k + c.fan_w_k;
    // full_w (to - T)/(to - from) + engine_w = g (T - air)
    let per_k = full_w / (c.derate_to_k - c.derate_from_k);
    let want_k = (per_k * c.derate_to_k + engine_w + g * air_k) / (per_k + g);
    assert!(
        s.fan_on_frac == 1.0 && (s.coolant_k - want_k).abs() < 0.02,
        "{} for {want_k}",
        s.coolant_k
    );
    let held_w = s.forces.retarder_n * v;
    assert!((held_w / (g * (want_k - air_k) - engine_w) - 1.0).abs() < 0.005);
    assert!((200e3..320e3).contains(&held_w), "a water retarder's lasting power: {held_w} W");
}

/// 6 % over 10 km with 55 t at 80 km/h: the retarder begins with its full power, loses a part of it
/// to the heat, and the service brakes make up for it; a truck file without cooling block knows
/// nothing of it.
#[test]
fn on_ten_kilometres_of_six_percent_the_retarder_tires() {
    let patch = RoadPatch { grade_rad: -(0.06_f64).atan(), ..RoadPatch::default() };
    let descend = |m: &TruckModel| {
        let mut s = m.initial_state(0.0, 0.0, 0.0, 80.0 / 3.6);
        let (mut first_w, mut hottest_k) = (0.0, 0.0_f64);
        let power_w = |s: &TruckState| s.forces.retarder_n * s.speed_m_s;
        while s.distance_m < 10_000.0 {
            let over = s.speed_m_s - 80.0 / 3.6;
            let command = Command {
                retarder_frac: if over > -0.5 { 1.0 } else { 0.0 },
                xbr_decel_m_s2: (0.5 * over).clamp(0.0, 2.0),
                brake_mode: BrakeMode::Addition,
                ..Command::default()
            };
            s = m.step(&s, &command, &patch, 0.1).unwrap();
            hottest_k = hottest_k.max(s.coolant_k);
            if first_w <= 0.0 && s.distance_m > 300.0 {
                first_w = power_w(&s);
            }
        }
        assert!((s.speed_m_s * 3.6 - 80.0).abs() < 5.0, "{}", s.speed_m_s);
        (power_w(&s) / first_w, hottest_k)
    };
    let m = model(36_000.0);
    let (left, hottest_k) = descend(&m);
    assert!((0.4..0.9).contains(&left), "{left}");
    assert!((372.0..381.0).contains(&hottest_k), "{hottest_k}");
    let mut old = TruckParameters::load("longhaul").unwrap();
    old.cooling = None;
    let (left, _) = descend(&TruckModel::new(old, 36_000.0).unwrap());
    assert!((left - 1.0).abs() < 0.05, "{left}");
}

/// What the drive axles carry, N.
fn drive_load_n(m: &TruckModel) -> f64 {
    let load = m.parameters().lateral.static_axle_load_n();
    let share = (load[1] + load[2]) / load.iter().sum::<f64>();
    share * m.mass_kg() * GRAVITY_M_S2
}

#[test]
fn on_a_wet_road_all_braking_of_the_drive_axles_stays_within_their_grip() {
    let m = model(0.0);
    let load_n = drive_load_n(&m);
    let brakes = Command { xbr_decel_m_s2: 4.0, brake_mode: BrakeMode::Addition, ..braking(1.0) };
    let hold = |command: &Command, adhesion_coeff: f64| {
        let patch = RoadPatch { adhesion_coeff, ..RoadPatch::default() };
        let s = m.initial_state(0.0, 0.0, 0.0, 18.0);
        on_rollers(&m, s, command, &patch, 5.0).forces
    };
    let dry = hold(&braking(1.0), 0.8);
    let wanted_n = dry.retarder_n - dry.drive_n;
    assert!(wanted_n < 0.8 * load_n && wanted_n > 0.25 * load_n, "{wanted_n} of {load_n}");
    for adhesion in [0.3, 0.2, 0.1, 0.0] {
        let wet = hold(&braking(1.0), adhesion);
        let held = wet.retarder_n - wet.drive_n;
        let want = wanted_n.min(adhesion * load_n);
        assert!((held - want).abs() < 1e-6 * load_n, "{adhesion}: {held} for {want}");
        // with the service brakes as well: every axle group at its limit, none beyond
        let all = hold(&brakes, adhesion);
        let total = all.retarder_n - all.drive_n + all.brake_n;
        let most = adhesion * m.mass_kg() * GRAVITY_M_S2;
        assert!(total <= most * (1.0 + 1e-9), "{adhesion}: {total} of {most}");
    }
}

/// Side forces take their part of the grip (friction circle).
#[test]
fn in_a_curve_less_grip_is_left_for_the_retarder() {
    let m = model(0.0);
    let adhesion_coeff = 0.25;
    let patch = RoadPatch { adhesion_coeff, ..RoadPatch::default() };
    let mut s = m.initial_state(0.0, 0.0, 0.0, 18.0);
    s = on_rollers(&m, s, &braking(1.0), &patch, 3.0);
    let straight = s.forces.retarder_n - s.forces.drive_n;
    let turn = Command { steering_wheel_rad: 0.35, ..braking(1.0) };
    s = on_rollers(&m, s, &turn, &patch, 4.0);
    let before = s;
    s = m.step(&s, &turn, &patch, 0.005).unwrap();
    let side = before.speed_m_s * before.lateral.yaw_rate_rad_s / GRAVITY_M_S2;
    assert!(side > 0.05 && side < adhesion_coeff, "{side}");
    let want = (adhesion_coeff.powi(2) - side.powi(2)).sqrt() / adhesion_coeff;
    let held = (s.forces.retarder_n - s.forces.drive_n) / straight;
    assert!((held - want).abs() < 0.01, "{held} for {want}");
}

#[test]
fn a_cooling_block_out_of_bounds_is_refused_by_name() {
    let text = include_str!("../../trucks/longhaul.toml");
    for (from, to, key) in [
        ("derate_to_k = 381.0", "derate_to_k = 370.0", "cooling.derate_to_k"),
        ("radiator_w_k = 2200.0", "radiator_w_k = nan", "cooling.radiator_w_k"),
        ("body_w_k = 60.0", "body_w = 60.0", "body_w"),
    ] {
        let e = TruckParameters::from_toml_str("bad", &text.replacen(from, to, 1)).unwrap_err();
        assert!(e.to_string().contains(key), "{e}");
    }
}
