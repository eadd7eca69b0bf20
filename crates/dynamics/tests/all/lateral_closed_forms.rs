//! The lateral model against closed forms and the published figures of its truck.

use crate::multibody::linear::{model, steady};
use crate::multibody::trucks::{empty_19t, loaded_55t};
use dynamics::lateral::{LateralInputs, LateralState};
use tractrix_core::GRAVITY_M_S2;

#[test]
fn axle_loads_and_stiffnesses_of_the_55_t_truck_match_the_reference_table() {
    let m = model(&loaded_55t());
    let y = m.yaw_sideslip();
    for (axle, tonnes) in [(0, 4.68), (1, 8.93), (2, 8.93), (3, 10.82), (5, 10.82)] {
        assert!((y.axle_load_n[axle] / 9806.65 - tonnes).abs() < 0.006);
    }
    for (axle, kn) in [(0, 354.0), (1, 680.0), (3, 802.0)] {
        assert!((y.stiffness_n_rad[axle] / 1e3 - kn).abs() < 1.0);
    }
    let y = *model(&empty_19t()).yaw_sideslip();
    for (axle, kn) in [(0, 304.0), (1, 359.0), (3, 173.0)] {
        assert!((y.stiffness_n_rad[axle] / 1e3 - kn).abs() < 1.0);
    }
}

#[test]
fn payload_adds_mass_and_inertia_by_the_parallel_axis_theorem_and_keeps_the_weight() {
    let mut p = empty_19t();
    p.payload.mass_kg = 36_000.0;
    let y = *model(&p).yaw_sideslip();
    let cg = (9800.0 * 5.0 + 36_000.0 * 5.764) / 45_800.0;
    let about_hitch =
        170_000.0 + 9800.0 * 25.0 + 36_000.0 * (9.9 + 5.764 * 5.764) - 45_800.0 * cg * cg;
    assert!((y.trailer_cg_behind_hitch_m - cg).abs() < 1e-12);
    assert!((y.trailer_inertia_kg_m2 / about_hitch - 1.0).abs() < 1e-12);
    let weight: f64 = y.axle_load_n.iter().sum();
    assert!((weight / (55_000.0 * GRAVITY_M_S2) - 1.0).abs() < 1e-12);
    p.payload.cg_behind_hitch_m = 7.9;
    let behind = *model(&p).yaw_sideslip();
    assert!(behind.axle_load_n[1] < y.axle_load_n[1]);
}

#[test]
fn effective_lengths_are_those_of_the_scrub_balance() {
    // The published 4.37256558 m was computed with g = 9.81 m/s²: loads and so stiffnesses differ.
    let mut p = loaded_55t();
    let load = p.static_axle_load_n().map(|n| n * 9.81 / GRAVITY_M_S2);
    p.tyres.axle_stiffness_n_rad = Some(p.tyres.stiffness_n_rad(&load));
    let l = model(&p).kinematic().lengths;
    assert!((l.trailer_m - (7.9 + 2.0 / 3.0 * 1.2 * 1.2 / 7.9)).abs() < 1e-12);
    assert!((l.trailer_m - 8.0215).abs() < 5e-5);
    assert!((l.wheelbase_m - 4.372_565_58).abs() < 5e-9, "{}", l.wheelbase_m);
    // The same length as the numeric limit of the 4-state model.
    let v = 1e-3;
    assert!((v / steady(&model(&p), v)[1] - l.wheelbase_m).abs() < 5e-8);
}

#[test]
fn a_tandem_tractor_without_trailer_has_the_textbook_effective_wheelbase() {
    let mut p = loaded_55t();
    let full = *model(&p).yaw_sideslip();
    let c = full.stiffness_n_rad;
    p.tyres.axle_stiffness_n_rad = Some([c[0], c[1], c[2], 0.0, 0.0, 0.0]);
    let l = model(&p).kinematic().lengths;
    let wheelbase = 3.9 + 0.7 * 0.7 / 3.9 * (1.0 + 2.0 * c[1] / c[0]);
    assert!((l.wheelbase_m - wheelbase).abs() < 1e-12);
    assert!((wheelbase - 4.508).abs() < 2e-3);
}

#[test]
fn steady_yaw_gain_matches_the_table() {
    let speeds = [5.0, 10.0, 15.0, 20.0, 22.22, 25.0, 27.8, 35.0];
    let full = [1.143, 2.283, 3.416, 4.540, 5.035, 5.652, 6.268, 7.826];
    let empty = [1.170, 2.317, 3.417, 4.452, 4.887, 5.407, 5.901, 7.034];
    for (p, table) in [(loaded_55t(), full), (empty_19t(), empty)] {
        let m = model(&p);
        for (v, gain) in speeds.iter().zip(table) {
            let s = steady(&m, *v);
            assert!((s[1] - s[2]).abs() < 1e-12 * s[1], "tractor and trailer turn together");
            assert!((s[1] - gain).abs() < 6e-4, "{v} m/s: {}", s[1]);
        }
    }
}

#[test]
fn articulation_gain_of_the_55_t_truck_matches_the_table() {
    let m = model(&loaded_55t());
    assert!((steady(&m, 5.0)[3] - 1.78).abs() < 0.005);
    assert!((steady(&m, 35.0)[3] - 1.65).abs() < 0.006);
}

#[test]
fn steering_angle_is_linear_in_curvature_and_side_acceleration() {
    for (p, gradient_deg_g) in [(loaded_55t(), 0.05), (empty_19t(), 0.33)] {
        let m = model(&p);
        let length = m.kinematic().lengths.wheelbase_m;
        // delta / kappa = L_eq + K v²
        let slope = |v: f64| (v / steady(&m, v)[1] - length) / (v * v);
        let k = slope(25.0);
        for v in [5.0, 10.0, 15.0, 20.0] {
            assert!(((slope(v) - k) * v * v / length).abs() < 1e-4);
        }
        assert!(((k * GRAVITY_M_S2).to_degrees() - gradient_deg_g).abs() < 0.005);
    }
}

#[test]
fn single_axles_at_walking_speed_follow_equation_1() {
    let mut p = loaded_55t();
    p.tractor.drive_half_spread_m = 0.0;
    p.trailer.axle_half_spread_m = 0.0;
    let m = model(&p);
    let l = m.kinematic().lengths;
    assert!((l.wheelbase_m - 3.9).abs() < 1e-12 && (l.trailer_m - 7.9).abs() < 1e-12);
    let (v, delta) = (0.01, 0.02);
    let s = steady(&m, v) * delta;
    assert!((s[1] / (v * delta / 3.9) - 1.0).abs() < 1e-5);
    // Steady articulation of Eq. 1 with L_1 = -0.3 m (hitch ahead of the axle), small angles.
    let psi = m.kinematic().steady_articulation_rad(delta).unwrap();
    let radius = 3.9 / delta.tan();
    let closed = (-7.9 / radius.hypot(0.3)).asin() - (-0.3 / radius).atan();
    assert!((psi - closed).abs() < 1e-14);
    assert!((-s[3] / psi - 1.0).abs() < 1e-3);
    let (tractor, trailer) = m.kinematic().yaw_rates_rad_s(v, delta, psi);
    assert!((tractor - trailer).abs() < 1e-15);
    assert_eq!(m.kinematic().steady_articulation_rad(0.6), None, "the turn is too tight");
}

#[test]
fn a_slow_tight_turn_settles_at_the_articulation_of_equation_1() {
    let m = model(&loaded_55t());
    let wheel = 0.35 * 24.0;
    let inputs = LateralInputs { speed_m_s: 0.8, steering_wheel_rad: wheel, ..Default::default() };
    let mut s = LateralState::default();
    for _ in 0..60_000 {
        s = m.step(&s, &inputs, 0.005);
    }
    let psi = m.kinematic().steady_articulation_rad(0.35).unwrap();
    assert!(psi < -0.7, "a tight turn: {psi}");
    assert!((s.articulation_rad - psi).abs() < 1e-6, "{} {psi}", s.articulation_rad);
    let yaw_rate = m.outputs(&s, &inputs).yaw_rate_rad_s;
    assert!((yaw_rate - 0.8 * 0.35_f64.tan() / m.kinematic().lengths.wheelbase_m).abs() < 1e-9);
}

#[test]
fn without_trailer_forces_the_tractor_is_a_bicycle() {
    let mut p = loaded_55t();
    let c = model(&p).yaw_sideslip().stiffness_n_rad;
    p.tractor.drive_half_spread_m = 0.0;
    p.tyres.axle_stiffness_n_rad = Some([c[0], c[1], c[2], 0.0, 0.0, 0.0]);
    (p.trailer.mass_kg, p.trailer.yaw_inertia_kg_m2) = (1.0, 1.0);
    let v = 20.0;
    let ss = model(&p).state_matrix(v);
    let (m, i, lf, lr, cf, cr) = (9200.0, 45_000.0, 2.35, 1.55, c[0], c[1] + c[2]);
    let bicycle = [
        [-(cf + cr) / (m * v), (lr * cr - lf * cf) / (m * v) - v],
        [(lr * cr - lf * cf) / (i * v), -(lf * lf * cf + lr * lr * cr) / (i * v)],
    ];
    for (row, expected) in ss.a.iter().zip(bicycle) {
        for (a, b) in row.iter().zip(expected) {
            assert!((a - b).abs() < 2e-3 * b.abs().max(1.0), "{a} {b}");
        }
    }
}

#[test]
fn stepping_reaches_the_steady_state_of_the_matrix() {
    let m = model(&loaded_55t());
    let mut s = LateralState::default();
    let inputs = LateralInputs { speed_m_s: 22.22, steering_wheel_rad: 0.24, ..Default::default() };
    for _ in 0..6000 {
        s = m.step(&s, &inputs, 0.005);
    }
    let e = steady(&m, 22.22) * 0.01;
    assert!((s.yaw_rate_rad_s - e[1]).abs() < 1e-9);
    assert!((s.articulation_rad + e[3]).abs() < 1e-9);
    assert!((s.cg_lateral_speed_m_s - e[0]).abs() < 1e-9);
    // The reference point runs on a circle of radius v / omega, wherever its sideslip points.
    let o = m.outputs(&s, &inputs);
    assert!((o.accel_y_m_s2 - 22.22 * s.yaw_rate_rad_s).abs() < 1e-9);
}

#[test]
fn load_transfer_of_a_left_turn_goes_to_the_right_and_reaches_one_at_the_rollover_threshold() {
    let mut p = empty_19t();
    p.load_transfer.roll_factor_coeff = 1.0;
    p.load_transfer.track_m = [1.9; 3];
    p.load_transfer.tractor_cg_height_m = 1.3;
    p.load_transfer.trailer_cg_height_m = 1.3;
    let m = model(&p);
    // A rigid block: a_y / g = T / (2 h).
    let threshold = GRAVITY_M_S2 * 1.9 / (2.0 * 1.3);
    assert!((m.load_transfer().rollover_accel_m_s2() - threshold).abs() < 1e-12);
    assert!((m.load_transfer().ratio(threshold, threshold, 0.0) - 1.0).abs() < 1e-12);
    assert!(m.load_transfer().ratio(0.0, 0.0, 0.05) > 0.0, "left side up loads the right wheels");
}
