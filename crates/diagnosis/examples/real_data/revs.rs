//! Race car with measured sideslip (Stanford Revs): is the tyre linear?
//!
//! Every table with `t, vx, vy, delta, yawRate, axCG` (SI, 100 Hz) is a drive. With several, each
//! is held out in turn; a single one is cut into five parts, each held out in turn.

use std::path::Path;

use diagnosis::lateral_id::{Fitted, LateralDrive, TyreModel, Vehicle, fit, place};
use dynamics::TruckParameters;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::plot::{Panel, Series, write};
use crate::table::{column, files, read};

type Window = (usize, usize);

/// Held-out gain of the saturating tyre under load over the linear one: fraction of the yaw error,
/// and its 90 % interval.
pub(crate) fn study(
    dir: &Path,
    out: Option<&Path>,
    truck: &TruckParameters,
) -> crate::Outcome<(f64, f64, f64)> {
    let vehicle = Vehicle::of(&truck.lateral);
    let mut drives = Vec::new();
    for file in files(dir, &["100hz.parquet", ".csv", ".csv.gz"])? {
        drives.push(drive(&file)?);
    }
    let all: Vec<Window> = drives
        .iter()
        .enumerate()
        .flat_map(|(d, drive)| drive.windows().into_iter().map(move |w| (d, w)))
        .collect();
    let single = drives.len() == 1;
    let folds = if single { 5 } else { drives.len() };
    let fold = |k: usize, w: &Window| if single { k * folds / all.len() } else { w.0 };
    println!("{} drives, {} windows of 5 s, {folds} held out in turn", drives.len(), all.len());
    let yaw: Vec<f64> = drives.iter().flat_map(|d| d.yaw_rate_rad_s.iter().copied()).collect();
    let spread = deviation(&yaw);
    let mut errors = vec![vec![(0.0, 0.0); all.len()]; TyreModel::ALL.len()];
    for (m, model) in TyreModel::ALL.into_iter().enumerate() {
        for held in 0..folds {
            let train: Vec<Window> = all
                .iter()
                .enumerate()
                .filter(|(k, w)| fold(*k, w) != held)
                .map(|(_, w)| *w)
                .collect();
            let fitted = fit(&drives, &train, &vehicle, model).ok_or("the drives say nothing")?;
            for (k, w) in all.iter().enumerate().filter(|(k, w)| fold(*k, w) == held) {
                let e = drives[w.0].window_error(&vehicle, &fitted, w.1);
                errors[m][k] = (e.yaw_rad2_s2, e.sideslip_rad2);
            }
        }
        let fitted = fit(&drives, &all, &vehicle, model).ok_or("the drives say nothing")?;
        print_model(&fitted, &errors[m], &errors[0], spread);
    }
    saturation(&drives, &all, &errors);
    if let Some(out) = out {
        picture(&drives, &all, &vehicle, &errors, out)?;
    }
    Ok(gain(&errors[3], &errors[0]))
}

fn deviation(v: &[f64]) -> f64 {
    let mean = v.iter().sum::<f64>() / v.len() as f64;
    (v.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / v.len() as f64).sqrt()
}

fn rms(errors: &[(f64, f64)], pick: fn(&(f64, f64)) -> f64) -> f64 {
    (errors.iter().map(pick).sum::<f64>() / errors.len() as f64).sqrt()
}

/// Relative change of the held-out yaw error, with the interval of a bootstrap over runs of four
/// windows.
fn gain(after: &[(f64, f64)], before: &[(f64, f64)]) -> (f64, f64, f64) {
    let ratio = |ks: &[usize]| {
        let sum = |e: &[(f64, f64)]| ks.iter().map(|k| e[*k].0).sum::<f64>();
        1.0 - (sum(after) / sum(before)).sqrt()
    };
    let n = after.len();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut draws: Vec<f64> = (0..2000)
        .map(|_| {
            let ks: Vec<usize> = (0..n.div_ceil(4))
                .flat_map(|_| {
                    let from = (rng.random::<f64>() * n as f64) as usize;
                    (0..4).map(move |i| (from + i) % n)
                })
                .collect();
            ratio(&ks)
        })
        .collect();
    draws.sort_by(f64::total_cmp);
    let all: Vec<usize> = (0..n).collect();
    (ratio(&all), draws[100], draws[1899])
}

fn print_model(f: &Fitted, held: &[(f64, f64)], linear: &[(f64, f64)], spread: f64) {
    let e = &f.estimate;
    println!("{:?}", f.model);
    println!(
        "  held out: yaw rate {:.4} rad/s ({:.3} of its standard deviation), sideslip {:.2} deg",
        rms(held, |e| e.0),
        rms(held, |e| e.0) / spread,
        rms(held, |e| e.1).to_degrees()
    );
    let (gain, low, high) = gain(held, linear);
    println!(
        "  yaw error less than linear by {:.1} % (90 % interval {:.1} to {:.1})",
        100.0 * gain,
        100.0 * low,
        100.0 * high
    );
    let show = |name: &str, k: usize| println!("  {name}: {:.4} +- {:.4}", e.value[k], e.sigma(k));
    show("front stiffness per load, 1/rad", place::FRONT);
    show("rear stiffness per load, 1/rad", place::REAR);
    show("yaw inertia, kg m2", place::INERTIA);
    show("steering offset, rad", place::OFFSET);
    show("height of CG, m", place::HEIGHT);
    if e.value.len() > place::FRICTION {
        show("friction coefficient, front", place::FRICTION);
        show("friction coefficient, rear", place::REAR_FRICTION);
    }
}

/// Where the linear tyre fails: held-out error over the lateral acceleration of the window.
fn saturation(drives: &[LateralDrive], all: &[Window], errors: &[Vec<(f64, f64)>]) {
    let peak = |w: &Window| {
        let d = &drives[w.0];
        (w.1..w.1 + d.window())
            .map(|i| (d.speed_m_s[i] * d.yaw_rate_rad_s[i]).abs())
            .fold(0.0, f64::max)
    };
    println!("held-out yaw error, rad/s, by the largest lateral acceleration of the window:");
    for (low, high) in [(0.0, 3.0), (3.0, 6.0), (6.0, 9.0), (9.0, 20.0)] {
        let pick = |e: &[(f64, f64)]| {
            let some: Vec<(f64, f64)> = all
                .iter()
                .zip(e)
                .filter(|(w, _)| (low..high).contains(&peak(w)))
                .map(|(_, e)| *e)
                .collect();
            (some.len(), rms(&some, |e| e.0))
        };
        let row: Vec<String> = errors.iter().map(|e| format!("{:.4}", pick(e).1)).collect();
        println!(
            "  {low:4.0} to {high:2.0} m/s2, {:3} windows: {}",
            pick(&errors[0]).0,
            row.join("  ")
        );
    }
    // Evidence by Bayes' information criterion, one window counting as one observation.
    let n = all.len() as f64;
    let score = |m: usize, k: f64| {
        -0.5 * n * errors[m].iter().map(|e| e.0).sum::<f64>().ln() - 0.5 * k * n.ln()
    };
    println!(
        "evidence for saturation under load over linear: {:.1} nats from {n} held-out windows",
        score(3, 7.0) - score(0, 4.0)
    );
}

fn drive(path: &Path) -> Result<LateralDrive, Box<dyn std::error::Error>> {
    let table = read(path)?;
    let take = |name: &str| column(&table, path, name).map(<[f64]>::to_vec);
    let t = take("t")?;
    let step_s = (t[t.len() - 1] - t[0]) / (t.len() - 1) as f64;
    // Isolated spikes of single samples: median of five.
    let delta = take("delta")?;
    let median = |i: usize| {
        let mut near: Vec<f64> = delta[i.saturating_sub(2)..(i + 3).min(delta.len())].to_vec();
        near.sort_by(f64::total_cmp);
        near[near.len() / 2]
    };
    // To 50 Hz: the model's fastest motion takes a tenth of a second.
    let skip = ((0.02 / step_s).round() as usize).max(1);
    let thin = |v: Vec<f64>| v.into_iter().step_by(skip).collect::<Vec<f64>>();
    Ok(LateralDrive {
        step_s: step_s * skip as f64,
        speed_m_s: thin(take("vx")?),
        accel_x_m_s2: thin(take("axCGFilt").or_else(|_| take("axCG"))?),
        road_wheel_rad: thin((0..delta.len()).map(median).collect()),
        yaw_rate_rad_s: thin(take("yawRate")?),
        lateral_speed_m_s: thin(take("vy")?),
    })
}

fn picture(
    drives: &[LateralDrive],
    all: &[Window],
    vehicle: &Vehicle,
    errors: &[Vec<(f64, f64)>],
    out: &Path,
) -> crate::Outcome {
    let points = |m: usize| {
        all.iter()
            .zip(&errors[m])
            .map(|(w, e)| {
                let d = &drives[w.0];
                let peak = (w.1..w.1 + d.window())
                    .map(|i| (d.speed_m_s[i] * d.yaw_rate_rad_s[i]).abs())
                    .fold(0.0, f64::max);
                (peak, e.0.sqrt())
            })
            .collect()
    };
    let law = |model| {
        let f = fit(drives, all, vehicle, model).ok_or("the drives say nothing")?;
        let p = f.estimate.value;
        let tyre = |slip: f64| {
            if p.len() > place::FRICTION {
                dynamics::lateral::TyreLaw::Saturating { friction_coeff: p[place::FRICTION] }
                    .under_load(p[place::FRONT], 1.0, 0.0)
                    .side_force_n(slip)
            } else {
                p[place::FRONT] * slip
            }
        };
        Ok::<Vec<(f64, f64)>, &str>(
            (0..60).map(|k| f64::from(k) * 0.002).map(|a| (a.to_degrees(), tyre(a))).collect(),
        )
    };
    write(
        &out.join("lateral-tyre.svg"),
        &[
            Panel {
                title: "held-out yaw error of 5 s open-loop windows",
                x: "largest lateral acceleration of the window, m/s²",
                y: "rms, rad/s",
                series: vec![
                    Series { name: "linear tyre", points: points(0), line: false },
                    Series { name: "saturating tyre under load", points: points(3), line: false },
                ],
            },
            Panel {
                title: "front tyre, as fitted",
                x: "slip angle, deg",
                y: "side force over load",
                series: vec![
                    Series { name: "linear", points: law(TyreModel::Linear)?, line: true },
                    Series {
                        name: "saturating",
                        points: law(TyreModel::SaturatingWithLoad)?,
                        line: true,
                    },
                ],
            },
        ],
    )?;
    Ok(())
}
