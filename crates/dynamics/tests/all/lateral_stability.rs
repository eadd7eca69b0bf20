//! Poles, jackknife, trailer sway, rearward amplification, off-tracking.

use crate::multibody::linear::{damping, eigenvalues, matrix, model, response, size, steady};
use crate::multibody::trucks::{empty_19t, loaded_55t};
use dynamics::lateral::LateralParameters;
use nalgebra::Complex;

#[test]
fn least_damped_poles_match_the_table() {
    let m = model(&loaded_55t());
    let table = [
        (5.0, -0.62, 0.0),
        (10.0, -1.46, 0.0),
        (15.0, -2.56, 1.58),
        (20.0, -1.93, 2.32),
        (22.22, -1.74, 2.46),
        (25.0, -1.55, 2.59),
        (27.8, -1.39, 2.68),
        (35.0, -1.11, 2.81),
    ];
    for (v, re, im) in table {
        let e = eigenvalues(&matrix(&m.state_matrix(v)))[0];
        assert!((e.re - re).abs() < 0.006 && (e.im - im).abs() < 0.006, "{v} m/s: {e}");
    }
}

#[test]
fn damping_ratios_match_the_table() {
    let speeds = [15.0, 20.0, 22.22, 25.0, 27.8, 35.0];
    for (p, table) in [
        (loaded_55t(), [0.85, 0.64, 0.58, 0.51, 0.46, 0.37]),
        (empty_19t(), [0.82, 0.61, 0.55, 0.49, 0.44, 0.35]),
    ] {
        let m = model(&p);
        for (v, zeta) in speeds.iter().zip(table) {
            let d = damping(&matrix(&m.state_matrix(*v))).unwrap();
            assert!((d - zeta).abs() < 0.006, "{v} m/s: {d}");
        }
    }
}

/// Lowest speed, m/s, at which a pole lies in the right half plane, and that pole.
fn critical_speed(p: &LateralParameters) -> Option<(f64, Complex<f64>)> {
    let m = model(p);
    (30..800).map(|k| 0.1 * f64::from(k)).find_map(|v| {
        let e = eigenvalues(&matrix(&m.state_matrix(v)))[0];
        (e.re > 0.0).then_some((v, e))
    })
}

#[test]
fn weak_drive_axles_jackknife_above_the_published_speeds() {
    for (scale, speed) in [(0.7, 27.5), (0.5, 17.5), (0.4, 14.0), (0.3, 11.0), (0.2, 8.0)] {
        let mut p = loaded_55t();
        p.tyres.stiffness_scale[1] = scale;
        let (v, pole) = critical_speed(&p).unwrap();
        assert!((v - speed).abs() < 0.55, "scale {scale}: {v} m/s");
        assert!(pole.im.abs() < 1e-9, "divergence, not oscillation");
        // The divergence boundary is where A becomes singular.
        let m = model(&p);
        let det = |v: f64| matrix(&m.state_matrix(v)).determinant();
        assert!(det(v - 0.1) > 0.0 && det(v) < 0.0);
    }
    assert_eq!(critical_speed(&loaded_55t()), None, "the sound truck is stable to 80 m/s");
}

#[test]
fn weak_trailer_axles_sway_but_do_not_diverge() {
    for (scale, zeta) in [(0.5, 0.39), (0.2, 0.24), (0.1, 0.17)] {
        let mut p = loaded_55t();
        p.tyres.stiffness_scale[2] = scale;
        let a = matrix(&model(&p).state_matrix(22.22));
        assert!((damping(&a).unwrap() - zeta).abs() < 0.006, "scale {scale}: {:?}", damping(&a));
        assert!(eigenvalues(&a)[0].re < 0.0);
    }
}

/// Side acceleration of the trailer's CG over that of the steer axle at `f`, Hz.
fn rearward_amplification(v: f64, f: f64) -> f64 {
    let m = model(&loaded_55t());
    let y = m.yaw_sideslip();
    let omega = core::f64::consts::TAU * f;
    let s = response(&m.state_matrix(v), omega);
    let jw = Complex::new(0.0, omega);
    let cg = jw * s[0] + s[1] * v;
    let steer = cg + jw * s[1] * y.axle_position_m[0];
    let trailer = cg - jw * (s[1] * y.hitch_behind_cg_m + s[2] * y.trailer_cg_behind_hitch_m);
    size(trailer) / size(steer)
}

#[test]
fn rearward_amplification_peaks_where_published() {
    for (v, peak, at) in [(80.0 / 3.6, 1.11, 0.32), (88.0 / 3.6, 1.20, 0.36)] {
        let (f, ra) = (1..200)
            .map(|k| 0.01 * f64::from(k))
            .map(|f| (f, rearward_amplification(v, f)))
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap();
        assert!((ra - peak).abs() < 0.006, "{v} m/s: {ra}");
        assert!((f - at).abs() < 0.015, "{v} m/s: {f} Hz");
    }
    assert!((rearward_amplification(88.0 / 3.6, 0.4) - 1.18).abs() < 0.02);
}

/// Radius of the steer axle's path minus that of the trailer group's centre, m, in a steady turn
/// whose drive-axle radius is 300 m; exact plane geometry on the linear steady state.
fn off_tracking(p: &LateralParameters, v: f64) -> f64 {
    let m = model(p);
    let y = m.yaw_sideslip();
    let gain = steady(&m, v);
    let s = gain * (v / 300.0 / gain[1]);
    let (sin, cos) = s[3].sin_cos();
    let steer = v.hypot(s[0] + y.axle_position_m[0] * s[1]);
    let hitch = s[0] - y.hitch_behind_cg_m * s[1];
    let trailer =
        (v * cos - hitch * sin).hypot(v * sin + hitch * cos - y.axle_position_m[4] * s[1]);
    (steer - trailer) / s[1]
}

#[test]
fn off_tracking_turns_from_inward_to_outward_with_speed() {
    assert!((off_tracking(&loaded_55t(), 0.5) - 0.131).abs() < 1.5e-3);
    for (p, outward) in [(loaded_55t(), -0.122), (empty_19t(), -0.096)] {
        let d = off_tracking(&p, 80.0 / 3.6);
        assert!((d - outward).abs() < 2e-3, "{d}");
    }
}
