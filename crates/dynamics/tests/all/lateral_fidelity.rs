//! Fidelity in the protocol of the paper's Fig. 10: a hand-wheel step at 80 km/h, four signals,
//! accuracy = 1 - mean|sim - ref| / mean|ref| against the independent multi-body reference.
//!
//! The paper does not say at which wheel its 15 degrees are measured nor for how long. Taken here:
//! hand wheel (as its Table I), ratio 24 (its released model), from straight running, 10 s.

use crate::multibody::linear::model;
use crate::multibody::measure::{accuracy, side_by_side};
use crate::multibody::trucks::{empty_19t, loaded_55t, released_two_axle};
use crate::multibody::{MultiBody, ReferenceTyre};
use dynamics::lateral::{LateralInputs, LateralModel, LateralParameters, LateralState, TyreLaw};
use std::path::PathBuf;

const V: f64 = 80.0 / 3.6;
const MAGIC: ReferenceTyre = ReferenceTyre::Magic { friction: 0.85 };

fn saturating(mut p: LateralParameters) -> LateralParameters {
    p.tyres.law = TyreLaw::Saturating { friction_coeff: 0.85 };
    p
}

/// Accuracies of yaw rate, trailer yaw rate, lateral position and hitch angle for a step.
fn step(name: &str, p: &LateralParameters, reference: &MultiBody, wheel_deg: f64) -> [f64; 4] {
    let wheel = wheel_deg.to_radians();
    let (sim, truth) = side_by_side(&model(p), reference, V, 10.0, 0.005, |_| wheel);
    let a = sim.accuracies(&truth);
    let side_g = V * truth.yaw_rate.last().unwrap() / 9.80665;
    println!(
        "| {name} | {wheel_deg:.0} | {side_g:.3} | {:.2} | {:.2} | {:.2} | {:.2} |",
        100.0 * a[0],
        100.0 * a[1],
        100.0 * a[2],
        100.0 * a[3]
    );
    a
}

#[test]
fn a_15_degree_step_at_80_km_h_is_met_to_98_percent_in_every_signal_of_figure_10() {
    for (name, p) in [("55 t", loaded_55t()), ("19 t", empty_19t())] {
        let reference = MultiBody::new(&p, MAGIC);
        for a in step(name, &p, &reference, 15.0) {
            assert!(a >= 0.98, "{name}: {a}");
        }
    }
}

#[test]
fn larger_steps_keep_98_percent_with_the_saturating_tyre() {
    for (name, p) in [("55 t", loaded_55t()), ("19 t", empty_19t())] {
        let reference = MultiBody::new(&p, MAGIC);
        for wheel in [15.0, 30.0, 45.0] {
            step(&format!("{name}, linear"), &p, &reference, wheel);
            for a in step(&format!("{name}, saturating"), &saturating(p), &reference, wheel) {
                assert!(a >= 0.98, "{name} at {wheel} degrees: {a}");
            }
        }
    }
}

#[test]
fn a_sine_lane_change_is_met_to_99_percent_on_rigid_and_on_relaxing_tyres() {
    // Twice the rolling radius: the longest that truck tyres have. Without it in the truck file the
    // trailer's yaw rate loses 6 %.
    const LENGTH_M: f64 = 1.06;
    let sine = |t: f64| {
        if t < 4.0 { 0.5 * (t * core::f64::consts::TAU / 4.0).sin() } else { 0.0 }
    };
    for (name, truth_m, file_m, floor) in [
        ("rigid", 0.0, 0.0, 0.99),
        ("relaxing, rigid in the truck file", LENGTH_M, 0.0, 0.93),
        ("relaxing", LENGTH_M, LENGTH_M, 0.99),
    ] {
        let mut p = loaded_55t();
        let reference = MultiBody { relaxation: truth_m, ..MultiBody::new(&p, MAGIC) };
        p.tyres.relaxation_length_m = file_m;
        let (sim, truth) = side_by_side(&model(&p), &reference, V, 10.0, 0.005, sine);
        let a = sim.accuracies(&truth);
        println!("lane change, {name} tyres: {a:.4?}");
        let b = step(&format!("55 t, {name} tyres"), &p, &reference, 15.0);
        assert!(a.iter().all(|x| *x >= floor), "{name}: {a:?}");
        assert!(b.iter().all(|x| *x >= 0.98), "{name}: {b:?}");
    }
}

/// One column of the released model's trace.
fn column(rows: &[csv::StringRecord], header: &csv::StringRecord, name: &str) -> Vec<f64> {
    let k = header.iter().position(|h| h == name).unwrap();
    rows.iter().map(|r| r[k].parse().unwrap()).collect()
}

/// Drives the model with speed and hand wheel of a trace; returns lateral speed of the CG, yaw rate
/// and the CG's lateral displacement from the start of the steer on, with those of the trace.
fn replay(m: &LateralModel, path: &PathBuf) -> [(Vec<f64>, Vec<f64>); 3] {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let header = reader.headers().unwrap().clone();
    let rows: Vec<_> = reader.records().map(Result::unwrap).collect();
    let get = |name| column(&rows, &header, name);
    let (t, v, wheel) = (get("t_s"), get("v_kph"), get("steer_rad"));
    let (lateral, rate) = (get("vlat_kph"), get("yawrate_dps"));
    let (x, y) = (get("x_m"), get("y_m"));
    let start = wheel.iter().position(|w| *w != 0.0).unwrap();
    let mut out: [(Vec<f64>, Vec<f64>); 3] = Default::default();
    let mut s = LateralState::at(x[start] - 2.4, y[start], 0.0);
    for k in start..rows.len() - 1 {
        let inputs = LateralInputs {
            speed_m_s: 0.5 * (v[k] + v[k + 1]) / 3.6,
            steering_wheel_rad: wheel[k],
            ..Default::default()
        };
        let dt = (t[k + 1] - t[k]) / 4.0;
        for _ in 0..4 {
            s = m.step(&s, &inputs, dt);
        }
        out[0].0.push(s.cg_lateral_speed_m_s);
        out[0].1.push(lateral[k + 1] / 3.6);
        out[1].0.push(s.yaw_rate_rad_s);
        out[1].1.push(rate[k + 1].to_radians());
        out[2].0.push(s.y_m + 2.4 * s.yaw_rad.sin());
        out[2].1.push(y[k + 1]);
    }
    out
}

#[test]
fn the_paper_s_released_two_axle_model_is_reproduced_by_configuration() {
    let folder =
        PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/reference_traces");
    let m = model(&released_two_axle());
    for wheel in [15, 60] {
        let path = folder.join(format!("steer_step_80kph_sw{wheel}deg_18t.csv"));
        if !path.exists() {
            println!("skipped: {} is absent", path.display());
            return;
        }
        let [lateral, rate, position] = replay(&m, &path);
        let a = [&lateral, &rate, &position].map(|(sim, truth)| accuracy(sim, truth));
        println!("released model, {wheel} degrees: lateral speed, yaw rate, y: {a:.4?}");
        assert!(a[1] >= 0.98 && a[2] >= 0.98, "{wheel}: {a:?}");
    }
}
