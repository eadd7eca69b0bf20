//! Tyres that build their side force up over a rolled distance, against closed forms.

use crate::multibody::linear::{model, steady};
use crate::multibody::trucks::{empty_19t, loaded_55t};
use dynamics::lateral::{
    AXLES, LateralInputs, LateralParameters, LateralState, SteeringState, TyreLaw,
};

fn relaxing(mut p: LateralParameters, length_m: f64) -> LateralParameters {
    p.tyres.relaxation_length_m = length_m;
    p
}

/// The truck on tyres so soft that it runs straight on.
fn on_rails(length_m: f64) -> LateralParameters {
    let mut p = relaxing(loaded_55t(), length_m);
    p.tyres.axle_stiffness_n_rad = Some([10.0; AXLES]);
    p
}

/// The distance counts, not the time: the story of the term in one curve.
#[test]
fn after_a_step_of_the_wheels_the_force_has_made_63_percent_of_its_way_one_length_further_on() {
    for (length_m, speed_m_s) in [(0.4, 2.0), (0.4, 8.0), (0.4, 25.0), (0.8, 25.0)] {
        let m = model(&on_rails(length_m));
        let inputs =
            LateralInputs { speed_m_s, steering_wheel_rad: 0.24, ..LateralInputs::default() };
        let dt_s = 0.01 * length_m / speed_m_s;
        let steering = SteeringState { wheel_rad: 0.24, gear_rad: 0.24, road_wheel_rad: 0.01 };
        let mut s = LateralState { steering, ..LateralState::default() };
        for lengths in 1..=3 {
            for _ in 0..100 {
                s = m.step(&s, &inputs, dt_s);
            }
            let built = m.outputs(&s, &inputs).side_force_n[0] / (10.0 * 0.01);
            let expected = 1.0 - (-f64::from(lengths)).exp();
            let what = format!("{length_m} m at {speed_m_s} m/s, {lengths} lengths");
            assert!((built - expected).abs() < 5e-4, "{what}: {built}, {expected}");
        }
    }
}

#[test]
fn a_steady_turn_knows_nothing_of_it() {
    for p in [loaded_55t(), empty_19t()] {
        for v in [5.0, 15.0, 25.0] {
            let yaw_1_s = steady(&model(&p), v)[1];
            let m = model(&relaxing(p, 0.6));
            let inputs = LateralInputs {
                speed_m_s: v,
                steering_wheel_rad: 0.01 * p.steering.ratio,
                ..LateralInputs::default()
            };
            let mut s = LateralState::default();
            for _ in 0..10_000 {
                s = m.step(&s, &inputs, 0.005);
            }
            assert!((s.yaw_rate_rad_s / 0.01 - yaw_1_s).abs() < 1e-6, "{v} m/s: {s:?}");
            let out = m.outputs(&s, &inputs);
            for (wheel, tyre) in out.slip_rad.iter().zip(s.tyre_slip_rad) {
                assert!((wheel - tyre).abs() < 1e-9, "{v} m/s: {out:?}");
            }
        }
    }
}

/// A lane change at this speed and with this step length; yaw rates of both bodies every 0.1 s.
fn lane_change(p: &LateralParameters, v: f64, dt_s: f64) -> Vec<[f64; 2]> {
    let m = model(p);
    let steps = (0.1 / dt_s).round() as usize;
    let mut s = LateralState::default();
    let mut out = Vec::new();
    for k in 0..60 * steps {
        let t = k as f64 * dt_s;
        let steering_wheel_rad = 0.5 * (t * core::f64::consts::TAU / 4.0).sin();
        let inputs = LateralInputs { speed_m_s: v, steering_wheel_rad, ..Default::default() };
        s = m.step(&s, &inputs, dt_s);
        if (k + 1) % steps == 0 {
            out.push([s.yaw_rate_rad_s, s.trailer_yaw_rate_rad_s]);
        }
    }
    out
}

fn apart(a: &[[f64; 2]], b: &[[f64; 2]]) -> f64 {
    let largest = a.iter().flatten().fold(0.0_f64, |m, x| m.max(x.abs()));
    let differ = a.iter().flatten().zip(b.iter().flatten()).map(|(x, y)| (x - y).abs());
    differ.fold(0.0, f64::max) / largest
}

#[test]
fn a_short_length_is_none_and_no_step_at_any_speed_makes_it_unstable() {
    for law in [TyreLaw::Linear, TyreLaw::Saturating { friction_coeff: 0.8 }] {
        let mut p = loaded_55t();
        p.tyres.law = law;
        for v in [0.0, 0.3, 1.5, 4.0, 12.0, 25.0] {
            let rigid = lane_change(&p, v, 0.005);
            assert!(apart(&rigid, &lane_change(&relaxing(p, 1e-6), v, 0.005)) < 2e-3, "{v} m/s");
            for length_m in [0.01, 0.1, 0.4, 1.0] {
                let fine = lane_change(&relaxing(p, length_m), v, 0.001);
                let coarse = lane_change(&relaxing(p, length_m), v, 0.01);
                let error = apart(&fine, &coarse);
                assert!(error < 0.02, "{v} m/s, {length_m} m, {law:?}: {error}");
            }
        }
    }
}

/// From a turn the truck stops, stands and drives on.
#[test]
fn a_truck_on_relaxing_tyres_stops_and_starts() {
    let m = model(&relaxing(loaded_55t(), 0.6));
    let mut s = LateralState::default();
    for k in 0..6_000 {
        let t = f64::from(k) * 0.01;
        let speed_m_s = (10.0 - t).max(0.0) + (t - 40.0).max(0.0);
        let inputs = LateralInputs { speed_m_s, steering_wheel_rad: 1.0, ..Default::default() };
        let before = s;
        s = m.step(&s, &inputs, 0.01);
        let out = m.outputs(&s, &inputs);
        let turns = speed_m_s / m.kinematic().lengths.wheelbase_m / 24.0;
        let settled = t > 3.0;
        assert!(
            !settled || (out.yaw_rate_rad_s - turns).abs() < 0.005 + 0.2 * turns,
            "{t} s: {out:?}"
        );
        assert!(s.tyre_slip_rad.iter().all(|a| a.abs() < 0.1), "{t} s: {s:?}");
        if speed_m_s == 0.0 {
            assert_eq!([s.x_m, s.y_m, s.yaw_rad], [before.x_m, before.y_m, before.yaw_rad]);
        }
    }
}

/// Where wheels slide sideways the force stays at the friction limit, whatever the tyres had reached.
#[test]
fn a_relaxing_tyre_never_pushes_beyond_the_friction_limit() {
    let mut p = relaxing(loaded_55t(), 0.6);
    p.tyres.law = TyreLaw::Saturating { friction_coeff: 0.3 };
    let m = model(&p);
    let mut s = LateralState::default();
    for k in 0..1_000 {
        let steering_wheel_rad = if k < 300 { 6.0 } else { -6.0 };
        let inputs = LateralInputs { speed_m_s: 20.0, steering_wheel_rad, ..Default::default() };
        s = m.step(&s, &inputs, 0.005);
        let out = m.outputs(&s, &inputs);
        for (f, load) in out.side_force_n.iter().zip(m.yaw_sideslip().axle_load_n) {
            assert!(f.abs() <= 0.3 * load * (1.0 + 1e-12), "{f} N of {load} N");
        }
    }
}
