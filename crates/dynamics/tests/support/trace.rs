//! Replays a trace of the paper's released model through a truck file and compares the speed.

use std::path::Path;

use dynamics::{RoadPatch, TruckModel, TruckParameters};
use tractrix_core::{BrakeMode, Command};

/// How well a trace was met.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Agreement {
    /// `1 - mean|sim - ref| / mean|ref|` of the speed.
    pub(crate) speed_accuracy_frac: f64,
    /// Share of samples in the same gear (samples during shifts left out).
    pub(crate) gear_frac: f64,
    /// Speed at the end, m/s: of the simulation and of the trace.
    pub(crate) final_speed_m_s: (f64, f64),
}

/// Mass in a trace's name, e.g. `accel_pedal40_18t.csv`, kg.
pub(crate) fn mass_in_name_kg(path: &Path) -> Option<f64> {
    let stem = path.file_stem()?.to_str()?;
    stem.split('_').find_map(|w| w.strip_suffix('t')?.parse::<f64>().ok()).map(|t| t * 1_000.0)
}

/// Columns `t_s, pedal_pct, xbr_mps2, ctrl_mode, steer_rad, grade_deg, gear, shift, v_kph`.
pub(crate) fn replay(
    truck: &str,
    path: &Path,
    mass_kg: f64,
) -> Result<Agreement, Box<dyn std::error::Error>> {
    let mut reader = csv::Reader::from_path(path)?;
    let header = reader.headers()?.clone();
    let column = |name: &str| {
        header.iter().position(|h| h == name).ok_or(format!("{}: no column {name}", path.display()))
    };
    let names = [
        "t_s",
        "pedal_pct",
        "xbr_mps2",
        "ctrl_mode",
        "steer_rad",
        "grade_deg",
        "gear",
        "shift",
        "v_kph",
    ];
    let index = names.map(column);
    let mut rows: Vec<[f64; 9]> = Vec::new();
    for record in reader.records() {
        let record = record?;
        let mut row = [0.0; 9];
        for (cell, i) in row.iter_mut().zip(&index) {
            *cell = record.get(i.clone()?).unwrap_or("").parse()?;
        }
        rows.push(row);
    }
    compare(truck, &rows, mass_kg)
}

/// Drives the truck with the inputs of a trace's rows and compares.
pub(crate) fn compare(
    truck: &str,
    rows: &[[f64; 9]],
    mass_kg: f64,
) -> Result<Agreement, Box<dyn std::error::Error>> {
    let parameters = TruckParameters::load(truck)?;
    let empty_kg = TruckModel::new(parameters.clone(), 0.0)?.mass_kg();
    let model = TruckModel::new(parameters, mass_kg - empty_kg)?;
    let first = rows.first().ok_or("an empty trace")?;
    let mut state = model.initial_state(0.0, 0.0, 0.0, first[8] / 3.6);
    let (mut error, mut size, mut same, mut steady) = (0.0, 0.0, 0.0, 0.0_f64);
    for pair in rows.windows(2) {
        let [t, pedal, xbr, mode, steer, grade, gear, shift, v] = pair[0];
        error += (state.speed_m_s - v / 3.6).abs();
        size += v.abs() / 3.6;
        if shift == 0.0 && v > 5.0 {
            steady += 1.0;
            same += f64::from(u8::from(f64::from(state.shift.gear) == gear));
        }
        let command = Command {
            accelerator_pedal_frac: pedal / 100.0,
            xbr_decel_m_s2: (-xbr).max(0.0),
            brake_mode: if mode == 0.0 { BrakeMode::Off } else { BrakeMode::Maximum },
            steering_wheel_rad: steer,
            ..Command::default()
        };
        let patch = RoadPatch { grade_rad: grade.to_radians(), ..RoadPatch::default() };
        // traces may be sampled between the model's substeps
        let target = (pair[1][0] / dynamics::SUBSTEP_S).round();
        let steps = target - (t / dynamics::SUBSTEP_S).round();
        state = model.step(&state, &command, &patch, steps * dynamics::SUBSTEP_S)?;
    }
    Ok(Agreement {
        speed_accuracy_frac: 1.0 - error / size,
        gear_frac: same / steady.max(1.0),
        final_speed_m_s: (state.speed_m_s, rows[rows.len() - 1][8] / 3.6),
    })
}
