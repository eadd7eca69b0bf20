//! What the simulation gets wrong before anything is explained.

use crate::answer::gain::{DriveError, HORIZON_S, drive_error, rms};
use crate::causes::sentence;
use crate::problem::Problem;
use crate::replay::Module;
use crate::{Drive, Wrong};

/// Errors beyond those of drives in order (`floor`: free runs of the baseline).
pub(crate) fn wrong(problem: &Problem<'_>, floor: &[DriveError]) -> Vec<Wrong> {
    let zero = problem.reference.theta;
    let errors: Vec<DriveError> =
        problem.drives.iter().map(|d| drive_error(d, problem.plant, &zero)).collect();
    let mut out = Vec::new();
    let samples: f64 = errors.iter().map(|e| e.speed[1]).sum();
    if samples > 0.0 {
        let rmse = rms(errors.iter().map(|e| e.speed));
        let power = (errors.iter().map(|e| e.speed_power).sum::<f64>() / samples).sqrt();
        out.push(Wrong {
            quantity: "speed_m_s",
            horizon_s: HORIZON_S,
            rmse,
            bias: errors.iter().map(|e| e.speed_sum).sum::<f64>() / samples,
            accuracy_frac: 1.0 - rmse / power.max(1e-9),
            r#where: sentence::places(problem, Module::Force),
            noise_floor: rms(floor.iter().map(|e| e.speed)),
        });
    }
    for m in Module::ALL {
        let i = m as usize;
        if m == Module::Force || !problem.drives.iter().any(|d| d.available[i]) {
            continue;
        }
        let (mut chi, mut rows, mut sum) = (0.0, 0.0, 0.0);
        for k in 0..problem.drives.len() {
            let w = problem.whitened(k, &zero);
            for (x, ok) in w[i].iter().zip(&problem.drives[k].valid[i]) {
                if *ok {
                    chi += x * x;
                    sum += x;
                    rows += 1.0;
                }
            }
        }
        let sigma = problem.reference.whiteners[i].sigma;
        let ratio = chi / f64::max(rows, 1.0);
        let floor = problem.reference.ratio[i].max(1.0);
        if ratio > 1.5 * floor {
            out.push(Wrong {
                quantity: m.quantity(),
                horizon_s: 0.0,
                rmse: sigma * ratio.sqrt(),
                bias: -sigma * sum / rows,
                accuracy_frac: 1.0 - sigma * ratio.sqrt() / signal_rms(problem, m).max(1e-12),
                r#where: sentence::places(problem, m),
                noise_floor: sigma * floor.sqrt(),
            });
        }
    }
    out
}

/// Root mean square of the measured signal of a module over its rows.
fn signal_rms(problem: &Problem<'_>, m: Module) -> f64 {
    let step = m.row_step();
    if m == Module::Shift {
        return rms(problem.drives.iter().flat_map(|d| &d.shifts).map(|s| {
            let duration_s = s.1 as f64 * Drive::STEP_S;
            [duration_s * duration_s, 1.0]
        }));
    }
    rms(problem.drives.iter().map(|d| {
        let x = d.measured(m);
        d.valid[m as usize]
            .iter()
            .enumerate()
            .filter(|(k, ok)| **ok && k * step < x.len())
            .fold([0.0, 0.0], |a, (k, _)| [a[0] + x[k * step] * x[k * step], a[1] + 1.0])
    }))
}
