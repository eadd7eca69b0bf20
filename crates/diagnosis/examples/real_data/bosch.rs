//! Shuffled snapshots of a 38 t and a 49 t truck (Bosch): does a balance without time know the mass?
//!
//! ```text
//! F = eta (T_inner + T_drag - T_accessories) w/v = m g sin(slope) + m g f0 + c v² + m a
//! ```
//! Rows have no time, so a is not known, and on a climb at full load the truck slows down: a goes
//! with the slope. Force and slope are both uncertain regressors; the mass lies between the direct
//! and the reverse regression (Frisch 1934), each after a constant and v² are taken out.

use std::path::Path;

use diagnosis::RawTable;
use tractrix_core::{GRAVITY_M_S2, RPM_PER_RAD_S};

use crate::table::{column, files, read};

/// Efficiency of a truck's driveline in its upper gears.
const EFFICIENCY: f64 = 0.94;

/// Label, rows, direct and reverse mass, t.
pub(crate) type Bounds = (f64, usize, f64, f64);

pub(crate) fn study(dir: &Path) -> crate::Outcome<Vec<Bounds>> {
    let mut found = Vec::new();
    for file in files(dir, &[".csv"])? {
        let table = read(&file)?;
        let mut labels = column(&table, &file, "Vehicle_Mass")?.to_vec();
        labels.sort_by(f64::total_cmp);
        labels.dedup();
        for label in labels.into_iter().filter(|l| l.is_finite()) {
            if let Some((rows, direct, reverse)) = bounds(&table, &file, label)? {
                println!(
                    "labelled {label} t, {rows} rows under power: between {direct:.0} and {reverse:.0} t"
                );
                found.push((label, rows, direct, reverse));
            }
        }
    }
    let told = found.windows(2).all(|w| w[0].3 < w[1].2 || w[1].3 < w[0].2);
    println!(
        "the intervals {}",
        if told {
            "tell the labels apart"
        } else {
            "overlap: the rows do not tell the labels apart"
        }
    );
    Ok(found)
}

fn bounds(table: &RawTable, file: &Path, label: f64) -> crate::Outcome<Option<(usize, f64, f64)>> {
    let take = |name: &str| column(table, file, name);
    let (rpm, speed) = (take("Epm_nEng_100ms")?, take("VehV_v_100ms")?);
    let (inner, drag) = (take("ActMod_trqInr_100ms")?, take("RngMod_trqCrSmin_100ms")?);
    let (own, slope) = (take("CoVeh_trqAcs_100ms")?, take("RoadSlope_100ms")?);
    let mass = take("Vehicle_Mass")?;
    // Under power and above walking pace: force, g sin(slope), v².
    let rows: Vec<[f64; 3]> = (0..mass.len())
        .filter(|&i| mass[i] == label && inner[i] > 300.0 && speed[i] > 40.0)
        .map(|i| {
            let v = speed[i] / 3.6;
            let torque = inner[i] + drag[i] - own[i];
            let force = EFFICIENCY * torque * rpm[i] / RPM_PER_RAD_S / v;
            [force, GRAVITY_M_S2 * (0.01 * slope[i]).atan().sin(), v * v]
        })
        .collect();
    if rows.len() < 100 {
        return Ok(None);
    }
    let n = rows.len() as f64;
    let mean = |k: usize| rows.iter().map(|r| r[k]).sum::<f64>() / n;
    let means = [mean(0), mean(1), mean(2)];
    let covariance = |a: usize, b: usize| {
        rows.iter().map(|r| (r[a] - means[a]) * (r[b] - means[b])).sum::<f64>() / n
    };
    // What v² explains is taken out of force and slope.
    let vv = covariance(2, 2).max(1e-9);
    let partial = |a: usize, b: usize| covariance(a, b) - covariance(a, 2) * covariance(b, 2) / vv;
    let direct = partial(0, 1) / partial(1, 1);
    let reverse = partial(0, 0) / partial(0, 1);
    Ok(Some((rows.len(), direct / 1000.0, reverse / 1000.0)))
}
