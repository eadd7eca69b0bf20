//! Longitudinal dynamics against closed forms.

use dynamics::effects::engine::Engine;
use dynamics::{RoadPatch, TruckModel, TruckParameters, TruckState};
use tractrix_core::{BrakeMode, Command, GRAVITY_M_S2, GearRequest};

fn truck(payload_kg: f64) -> TruckModel {
    TruckModel::new(TruckParameters::load("reference").unwrap(), payload_kg).unwrap()
}

fn parameters(changes: &[(&str, f64)]) -> TruckParameters {
    let mut p = TruckParameters::load("reference").unwrap();
    for (path, value) in changes {
        p = p.with_parameter(path, *value).unwrap();
    }
    p
}

fn changed(payload_kg: f64, changes: &[(&str, f64)]) -> TruckModel {
    TruckModel::new(parameters(changes), payload_kg).unwrap()
}

fn engine(changes: &[(&str, f64)]) -> Engine {
    Engine::new(parameters(changes).engine).unwrap()
}

fn on_grade(grade_rad: f64) -> RoadPatch {
    RoadPatch { grade_rad, ..RoadPatch::default() }
}

fn pedal(accelerator_pedal_frac: f64) -> Command {
    Command { accelerator_pedal_frac, ..Command::default() }
}

fn braking(decel: f64) -> Command {
    Command { xbr_decel_m_s2: decel, brake_mode: BrakeMode::Maximum, ..Command::default() }
}

fn neutral() -> Command {
    Command { gear: GearRequest::Neutral, ..Command::default() }
}

fn run(m: &TruckModel, s: &TruckState, c: &Command, p: &RoadPatch, seconds: f64) -> TruckState {
    m.step(s, c, p, seconds).unwrap()
}

/// Mass with wheels turning and the driveline open, kg.
fn rolling_mass_kg(m: &TruckModel) -> f64 {
    m.mass_kg() + m.vehicle_limits().unwrap().powertrain.rotating_mass_neutral_kg
}

#[test]
fn coasting_down_follows_the_arc_tangent_law() {
    let m = truck(36_000.0);
    let patch = RoadPatch::default();
    let mut s = m.initial_state(0.0, 0.0, 0.0, 25.0);
    s = run(&m, &s, &neutral(), &patch, 2.0);
    let (v0, mass) = (s.speed_m_s, rolling_mass_kg(&m));
    let rho = 101_325.0 / (287.05 * 288.15);
    let a = m.mass_kg() * GRAVITY_M_S2 * 0.0062 / mass;
    let b = 0.5 * rho * 6.2 / mass;
    for t in [10.0_f64, 60.0, 120.0] {
        let end = run(&m, &s, &neutral(), &patch, t);
        let v = (a / b).sqrt() * ((v0 * (b / a).sqrt()).atan() - (a * b).sqrt() * t).tan();
        assert!((end.speed_m_s - v).abs() < 2e-3 * v0, "t {t}: {} vs {v}", end.speed_m_s);
    }
}

#[test]
fn rolling_down_a_grade_ends_at_the_terminal_speed() {
    let m = truck(36_000.0);
    let grade: f64 = -0.012;
    let mut s = m.initial_state(0.0, 0.0, 0.0, 25.0);
    s = run(&m, &s, &neutral(), &on_grade(grade), 2_500.0);
    let rho = 101_325.0 / (287.05 * 288.15);
    let push = m.mass_kg() * GRAVITY_M_S2 * (-grade.sin() - 0.0062 * grade.cos());
    let v = (push / (0.5 * rho * 6.2)).sqrt();
    assert!((s.speed_m_s - v).abs() < 0.05, "{} vs {v}", s.speed_m_s);
}

#[test]
fn full_power_on_a_hill_settles_where_power_meets_resistance() {
    let m = truck(36_000.0);
    let grade: f64 = 0.03;
    let s = run(&m, &m.initial_state(0.0, 0.0, 0.0, 15.0), &pedal(1.0), &on_grade(grade), 400.0);
    let v = s.speed_m_s;
    let rho = 101_325.0 / (287.05 * 288.15);
    let resist =
        m.mass_kg() * GRAVITY_M_S2 * (grade.sin() + 0.0062 * grade.cos()) + 0.5 * rho * 6.2 * v * v;
    // net crank power through the driveline's efficiency, all of the truck file
    let n = s.engine_speed_rad_s;
    let full = m.vehicle_limits().unwrap().powertrain.full_load_nm.at(n);
    let power = (full * n - 4_000.0) * 0.98 * 0.97;
    assert!((resist * v - power).abs() < 0.01 * power, "{v} m/s: {} vs {power}", resist * v);
    assert!(v > 15.0 && v < 20.0, "{v}");
}

#[test]
fn stopping_takes_dead_time_build_up_and_braking_distance() {
    let m = changed(
        36_000.0,
        &[
            ("brake.lag_s", 0.005),
            ("resistance.rolling_coeff", 0.0),
            ("resistance.drag_area_m2", 0.0),
        ],
    );
    let mut s = m.initial_state(0.0, 0.0, 0.0, 20.0);
    s = run(&m, &s, &neutral(), &RoadPatch::default(), 2.0);
    let (v0, start, decel) = (s.speed_m_s, s.distance_m, 3.0);
    let stop = Command { gear: GearRequest::Neutral, ..braking(decel) };
    let end = run(&m, &s, &stop, &RoadPatch::default(), 30.0);
    assert_eq!(end.speed_m_s, 0.0);
    let real = decel * m.mass_kg() / rolling_mass_kg(&m);
    let build_s = decel * m.mass_kg() / 0.4 / 500_000.0;
    let d =
        v0 * 0.25 + 0.5 * v0 * build_s - real * build_s * build_s / 24.0 + v0 * v0 / (2.0 * real);
    assert!((end.distance_m - start - d).abs() < 0.01 * d, "{} vs {d}", end.distance_m - start);
}

#[test]
fn a_shift_takes_the_traction_away_for_its_open_phase() {
    let m = truck(36_000.0);
    let mut s = m.initial_state(0.0, 0.0, 0.0, 12.0);
    let (mut open, mut shifts, mut was) = (0.0, 0, false);
    for _ in 0..12_000 {
        s = run(&m, &s, &pedal(1.0), &RoadPatch::default(), 0.005);
        let now = m.ego_state(&s, &RoadPatch::default()).powertrain.gear == 0;
        if now {
            open += 0.005;
            assert_eq!(s.forces.drive_n, 0.0);
        }
        shifts += u32::from(now && !was);
        was = now;
    }
    assert!(shifts >= 2, "{shifts}");
    assert!((open / f64::from(shifts) - 0.45).abs() < 0.011, "{open} s in {shifts} shifts");
}

#[test]
fn the_work_of_all_forces_is_the_change_of_energy() {
    let m = truck(20_000.0);
    let mut s = m.initial_state(0.0, 0.0, 0.0, 20.0);
    let mass = m.mass_kg();
    let wheels = m.vehicle_limits().unwrap().powertrain.rotating_mass_neutral_kg;
    let (mut input, mut height, mut turnover) = (0.0, 0.0, 0.0);
    let start = 0.5 * (mass + wheels) * s.speed_m_s * s.speed_m_s;
    while s.distance_m < 15_000.0 {
        let grade = 0.03 * (s.distance_m / 700.0).sin();
        let command = if s.speed_m_s > 22.0 { braking(0.5) } else { pedal(0.6) };
        let next = run(&m, &s, &command, &on_grade(grade), 0.005);
        let ds = next.distance_m - s.distance_m;
        let f = next.forces;
        // what the engine's inertia takes while it is coupled is not the chassis' energy
        let engine_n = (f.effective_mass_kg - mass - wheels) * next.accel_m_s2;
        let work =
            (f.drive_n - engine_n - f.retarder_n - f.brake_n - f.rolling_n - f.drag_n - f.curve_n)
                * ds;
        input += work;
        turnover += work.abs();
        height += grade.sin() * ds;
        s = next;
    }
    let change =
        0.5 * (mass + wheels) * s.speed_m_s * s.speed_m_s - start + mass * GRAVITY_M_S2 * height;
    assert!((input - change).abs() < 1e-3 * turnover, "{input} vs {change} of {turnover}");
}

#[test]
fn the_result_does_not_depend_on_how_often_the_step_is_called() {
    let m = truck(36_000.0);
    let s = m.initial_state(0.0, 0.0, 0.0, 15.0);
    let c = Command { steering_wheel_rad: 0.2, ..pedal(0.7) };
    let once = run(&m, &s, &c, &RoadPatch::default(), 2.0);
    let mut many = s;
    for _ in 0..400 {
        many = run(&m, &many, &c, &RoadPatch::default(), 0.005);
    }
    assert_eq!(once, many);
}

#[test]
fn brakes_hold_the_truck_on_a_hill_and_never_push_it() {
    let m = truck(36_000.0);
    let s = run(&m, &m.initial_state(0.0, 0.0, 0.0, 5.0), &braking(3.0), &on_grade(0.06), 60.0);
    assert_eq!(s.speed_m_s, 0.0);
    let later = run(&m, &s, &braking(3.0), &on_grade(0.06), 60.0);
    assert_eq!(later.distance_m, s.distance_m);
}

#[test]
fn without_brakes_it_rolls_back_down_the_hill_and_gains_no_energy() {
    let m = truck(36_000.0);
    let s = run(&m, &m.initial_state(0.0, 0.0, 0.0, 0.0), &neutral(), &on_grade(0.05), 20.0);
    assert!(s.speed_m_s < -3.0, "{}", s.speed_m_s);
    let free = m.mass_kg() * GRAVITY_M_S2 * 0.05_f64.sin() * -s.distance_m;
    assert!(0.5 * m.mass_kg() * s.speed_m_s * s.speed_m_s < free);
}

#[test]
fn it_pulls_away_with_a_slipping_clutch_and_does_not_stall() {
    let m = truck(36_000.0);
    let s = run(&m, &m.initial_state(0.0, 0.0, 0.0, 0.0), &pedal(0.5), &RoadPatch::default(), 40.0);
    assert!(s.speed_m_s > 6.0, "{}", s.speed_m_s);
    assert!(
        s.clutch_locked && s.clutch_heat_j > 1e3 && s.clutch_heat_j < 2e6,
        "{}",
        s.clutch_heat_j
    );
}

#[test]
fn hot_brakes_fade_and_cool_again() {
    let m = changed(36_000.0, &[("brake.fade_1_k", 0.002), ("brake.fade_from_k", 400.0)]);
    let mut s = m.initial_state(0.0, 0.0, 0.0, 20.0);
    s = run(
        &m,
        &s,
        &Command { gear: GearRequest::Neutral, ..braking(0.45) },
        &on_grade(-0.06),
        240.0,
    );
    let hot = s.brake.temperature_k[1];
    assert!(hot > 450.0, "{hot}");
    s.speed_m_s = 20.0;
    let weak = run(&m, &s, &braking(2.0), &RoadPatch::default(), 1.5).forces.brake_n;
    s.brake.temperature_k = [300.0; 3];
    let fresh = run(&m, &s, &braking(2.0), &RoadPatch::default(), 1.5).forces.brake_n;
    assert!(weak < 0.95 * fresh, "{weak} {fresh}");
    let cooled =
        run(&m, &m.initial_state(0.0, 0.0, 0.0, 0.0), &braking(1.0), &RoadPatch::default(), 1.0);
    assert!(cooled.brake.temperature_k[1] < 294.0);
}

/// A turbocharger that comes softly: the lag passes evenly from the one to the other about its threshold,
/// and at once where the band has no width.
#[test]
fn the_lag_of_boost_comes_over_the_band_that_the_truck_file_gives() {
    let of = |width_frac: f64| {
        engine(&[
            ("engine.fast_lag_s", 0.1),
            ("engine.slow_lag_s", 0.9),
            ("engine.lag_threshold_frac", 0.4),
            ("engine.lag_width_frac", width_frac),
        ])
    };
    let (soft, sudden) = (of(0.2), of(0.0));
    for (part, soft_s, sudden_s) in [
        (0.2, 0.1, 0.1),
        (0.3, 0.1, 0.1),
        (0.35, 0.3, 0.1),
        (0.4, 0.5, 0.1),
        (0.45, 0.7, 0.9),
        (0.5, 0.9, 0.9),
    ] {
        let lag_s = |e: &Engine| e.lag_s(part * 2_000.0, 2_000.0, 2_000.0);
        assert!((lag_s(&soft) - soft_s).abs() < 1e-9, "{part}: {}", lag_s(&soft));
        assert_eq!(lag_s(&sudden), sudden_s, "{part}");
    }
    assert_eq!(soft.lag_s(1_000.0, 500.0, 2_000.0), 0.1);
}

/// Full load falls with hot coolant as the controller follows it: `loss (1 - exp(-t / tau))` of what it is
/// too hot by, at once without a lag.
#[test]
fn full_load_follows_hot_coolant_with_the_controllers_lag() {
    let of = |lag_s: f64| {
        engine(&[
            ("engine.derate_coolant_k", 368.0),
            ("engine.derate_coolant_1_k", 0.01),
            ("engine.derate_coolant_lag_s", lag_s),
        ])
    };
    let left = |lag_s: f64, coolant_k: f64, after_s: f64| {
        let (e, dt_s) = (of(lag_s), 0.005);
        let mut overheat_k = 0.0;
        for _ in 0..(after_s / dt_s) as usize {
            overheat_k = e.overheat_step_k(overheat_k, coolant_k, dt_s);
        }
        e.full_load_at_nm(120.0, 0.0, 293.0, overheat_k) / e.full_load_at_nm(120.0, 0.0, 293.0, 0.0)
    };
    assert!((left(20.0, 378.0, 20.0) - (1.0 - 0.1 * (1.0 - (-1.0_f64).exp()))).abs() < 1e-4);
    assert!((left(0.0, 378.0, 0.005) - 0.9).abs() < 1e-12);
    assert_eq!(left(20.0, 367.0, 20.0), 1.0);
}

/// A retarder that holds a truck on descents does so with a released pedal, where it is steep enough,
/// and never pushes a truck that stands.
#[test]
fn a_retarder_of_descents_holds_on_descents_alone() {
    let m = changed(
        20_000.0,
        &[
            ("driveline.hidden_retarder_downhill_nm", 1_000.0),
            ("driveline.hidden_retarder_from_descent_frac", 0.02),
        ],
    );
    let held_n = |grade: f64, pedal_frac: f64, speed_m_s: f64| {
        let s = m.initial_state(0.0, 0.0, 0.0, speed_m_s);
        run(&m, &s, &pedal(pedal_frac), &on_grade(grade), 0.1).forces.retarder_n
    };
    let full_n = m.parameters().driveline.shaft_force_n(1_000.0);
    assert!((held_n(-0.03, 0.0, 20.0) / full_n - 1.0).abs() < 1e-9);
    for (grade, pedal_frac, speed_m_s) in
        [(-0.03, 0.3, 20.0), (-0.01, 0.0, 20.0), (0.03, 0.0, 20.0), (-0.03, 0.0, 0.0)]
    {
        let held = held_n(grade, pedal_frac, speed_m_s);
        assert!(held < 0.1 * full_n, "{grade} {pedal_frac} {speed_m_s}: {held}");
    }
}

/// After a long descent discs that are held hot warm the linings by `1 - exp(-t/tau)`; without a lag
/// linings are as hot as the discs.
#[test]
fn linings_follow_the_discs_with_their_lag() {
    let after = |lag_s: f64| {
        let m = changed(36_000.0, &[("brake.lining_lag_s", lag_s), ("brake.cooling_s", 1e5)]);
        let mut s = m.initial_state(0.0, 0.0, 0.0, 20.0);
        s.brake.temperature_k = [500.0; 3];
        run(&m, &s, &pedal(0.3), &RoadPatch::default(), 30.0).brake
    };
    let behind = after(30.0);
    let expected = 500.0 - (500.0 - 293.15) * (-1.0_f64).exp();
    assert!((behind.lining_k[1] - expected).abs() < 0.5, "{} {expected}", behind.lining_k[1]);
    assert_eq!(after(0.0).lining_k, after(0.0).temperature_k);
}

#[test]
fn thin_air_takes_power_where_the_truck_file_says_so() {
    let m = changed(0.0, &[("engine.derate_altitude_1_m", 1e-4)]);
    let high = RoadPatch { altitude_m: 3_500.0, ..RoadPatch::default() };
    let s = m.initial_state(0.0, 0.0, 0.0, 15.0);
    let low = run(&m, &s, &pedal(1.0), &RoadPatch::default(), 2.0).engine_torque_nm;
    let up = run(&m, &s, &pedal(1.0), &high, 2.0).engine_torque_nm;
    assert!(up < 0.9 * low, "{up} {low}");
}

#[test]
fn ice_limits_the_braking_force() {
    let m = truck(36_000.0);
    let ice = RoadPatch { adhesion_coeff: 0.1, ..RoadPatch::default() };
    let s = run(&m, &m.initial_state(0.0, 0.0, 0.0, 20.0), &braking(6.0), &ice, 3.0);
    // what the overrunning engine takes of the drive axles' grip is not there for the brakes
    let held_n = s.forces.brake_n - s.forces.drive_n;
    assert!(s.forces.drive_n < 0.0);
    assert!((held_n - 0.1 * m.mass_kg() * GRAVITY_M_S2).abs() < 1.0);
}

#[test]
fn a_command_that_is_not_finite_is_refused_by_name() {
    let m = truck(0.0);
    let bad = Command { accelerator_pedal_frac: f64::NAN, ..Command::default() };
    let e = m.step(&m.initial_state(0.0, 0.0, 0.0, 1.0), &bad, &RoadPatch::default(), 0.01);
    assert!(e.unwrap_err().to_string().contains("accelerator_pedal_frac"));
    let patch = RoadPatch { grade_rad: f64::NAN, ..RoadPatch::default() };
    let e = m.step(&m.initial_state(0.0, 0.0, 0.0, 1.0), &pedal(0.1), &patch, 0.01);
    assert!(e.unwrap_err().to_string().contains("longitudinal"));
}

#[test]
fn a_fitted_table_in_an_overlay_pushes_by_its_acceleration() {
    let base = TruckParameters::load("reference").unwrap();
    let text = r#"schema = 1
        base = "reference"
        name = "with a table"
        [set]
        [[table_effect]]
        source = "test: fitted over speed_m_s, cause unknown"
        signal = "speed_m_s"
        signal_values = [10.0, 20.0, 30.0]
        accel_m_s2 = [0.0, -0.04, 0.0]"#;
    let overlay: dynamics::Overlay = toml::from_str(text).unwrap();
    let with = base.with_overlay(&overlay).unwrap();
    let again: TruckParameters = toml::from_str(&toml::to_string(&with).unwrap()).unwrap();
    assert_eq!(again, with);
    let (m, plain) = (TruckModel::new(with, 36_000.0).unwrap(), truck(36_000.0));
    for (speed, accel) in [(10.0, 0.0), (15.0, -0.02), (20.0, -0.04)] {
        let s = m.initial_state(0.0, 0.0, 0.0, speed);
        let patch = RoadPatch::default();
        let (a, b) =
            (run(&m, &s, &neutral(), &patch, 0.5), run(&plain, &s, &neutral(), &patch, 0.5));
        assert!(((a.speed_m_s - b.speed_m_s) / 0.5 - accel).abs() < 5e-4, "{speed}");
    }
    let rest = m.initial_state(0.0, 0.0, 0.0, 0.0);
    assert_eq!(run(&m, &rest, &neutral(), &RoadPatch::default(), 5.0).speed_m_s, 0.0);
    let wrong = text.replace("[0.0, -0.04, 0.0]", "[0.0, -0.04]");
    let error = base.with_overlay(&toml::from_str(&wrong).unwrap()).unwrap_err().to_string();
    assert!(error.contains("table_effect.accel_m_s2"), "{error}");
}

/// It acted under power too, in every truck that was extended by a retarder of the released
/// accelerator.
#[test]
fn a_hidden_retarder_acts_only_while_the_accelerator_is_released_and_from_its_speed_on() {
    let file = TruckParameters::load("reference").unwrap();
    let file = file.with_parameter("driveline.hidden_retarder_torque_nm", 1_000.0).unwrap();
    let m = TruckModel::new(file, 20_000.0).unwrap();
    let force_n = |speed_m_s: f64, command: &Command| {
        let s = m.initial_state(0.0, 0.0, 0.0, speed_m_s);
        run(&m, &s, command, &on_grade(0.0), 0.005).forces.retarder_n
    };
    assert!(force_n(20.0, &pedal(0.0)) > 1_000.0);
    assert_eq!(force_n(20.0, &pedal(0.5)), 0.0);
    assert_eq!(force_n(6.0, &pedal(0.0)), 0.0);
}

/// An engine without inertia, whose torque may only fall slowly, was pulled to a stall at full pedal in
/// top gear; as the clutch opened it turned at 24,600 rpm and burnt 288 g/s.
#[test]
fn an_engine_that_comes_free_at_full_load_is_not_injected_beyond_its_highest_speed() {
    let m = TruckModel::new(TruckParameters::load("iits").unwrap(), 30_000.0).unwrap();
    let most = 1.3 * m.parameters().engine.max_speed_rpm / tractrix_core::RPM_PER_RAD_S;
    let (uphill, command) = (on_grade(0.03), pedal(1.0));
    let (mut s, mut comes_free) = (m.initial_state(0.0, 0.0, 0.0, 12.0), false);
    for _ in 0..6_000 {
        let was_locked = s.clutch_locked;
        s = run(&m, &s, &Command { gear: GearRequest::Gear(12), ..command }, &uphill, 0.01);
        comes_free |= was_locked && !s.clutch_locked;
        assert!(s.engine_speed_rad_s < most, "{} rad/s", s.engine_speed_rad_s);
    }
    assert!(comes_free, "{} m/s", s.speed_m_s);
}
