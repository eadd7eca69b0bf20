//! Short traces, from standstill if need be: the truck model driven by a trace's inputs in one open
//! loop at the trace's own times, shifting by itself, and its outputs compared with the trace's
//! (the check of Wang et al., Fig. 8).
//!
//! Inputs: pedal, deceleration demand, engine-brake demand, hand wheel, grade. Everything else is
//! compared. A trace that never moves is one of a bench: the brake control unit is told the logged
//! acceleration, if one is logged, instead of the standing truck's.
//!
//! Columns are those of measured drives, with three more for the pressures of the axle groups, or
//! those of traces of the paper's released model ([`RELEASED`]).

use dynamics::effects::brake::GROUPS;
use dynamics::{RoadPatch, SUBSTEP_S, TruckModel, TruckParameters, TruckState};
use tractrix_core::{BrakeMode, Command, GRAVITY_M_S2, RPM_PER_RAD_S};

use crate::studies::fidelity::{DriveFidelity, Replayed, SignalFidelity, compare};
use crate::{DiagnosisError, Drive, RawTable};

/// Longest trace, s: the whole of it is one open loop, which says nothing after that.
const MAX_TRACE_S: f64 = 4.0 * 3_600.0;
/// Largest step between two rows, s.
const MAX_STEP_S: f64 = 1.0;

/// A trace as it was read.
#[derive(Debug, Clone, PartialEq)]
pub struct Trace {
    /// Name, of the index or the file.
    pub name: String,
    /// Total mass, kg.
    pub mass_kg: f64,
    /// Columns as written.
    pub table: RawTable,
}

/// Columns of the released model's traces: name, column of a measured drive, factor.
const RELEASED: [(&str, &str, f64); 13] = [
    ("t_s", "time_s", 1.0),
    ("pedal_pct", "accelerator_pedal_frac", 0.01),
    ("xbr_mps2", "xbr_decel_m_s2", -1.0),
    ("cmd_mps2", "xbr_decel_m_s2", -1.0),
    ("steer_rad", "steering_wheel_rad", 1.0),
    ("eng_spd_rpm", "engine_speed_rpm", 1.0),
    ("v_kph", "speed_m_s", 1.0 / 3.6),
    ("yawrate_dps", "yaw_rate_rad_s", core::f64::consts::PI / 180.0),
    ("ax_mps2", "accel_x_m_s2", 1.0),
    ("ax_g_feedback", "accel_x_m_s2", GRAVITY_M_S2),
    ("p_front_MPa", "brake_pressure_steer_kpa", 1e3),
    ("p_drive_MPa", "brake_pressure_drive_kpa", 1e3),
    ("p_trailer_MPa", "brake_pressure_trailer_kpa", 1e3),
];

/// Outputs that are compared.
const OUTPUTS: [&str; 11] = [
    "speed_m_s",
    "gear",
    "engine_speed_rpm",
    "engine_torque_percent",
    "brake_pressure_kpa",
    "brake_pressure_steer_kpa",
    "brake_pressure_drive_kpa",
    "brake_pressure_trailer_kpa",
    "fuel_rate_g_s",
    "yaw_rate_rad_s",
    "trailer_yaw_rate_rad_s",
];

/// Drives a truck through a trace. Only whole-trace figures are filled; there are no free runs.
///
/// # Errors
/// [`DiagnosisError::Column`] names a column that is missing or holds a value that cannot be, with
/// its row; [`DiagnosisError::Truck`] if the truck cannot carry the mass or does not stay finite.
pub fn whole_run(truck: &TruckParameters, trace: &Trace) -> Result<DriveFidelity, DiagnosisError> {
    let inputs = Inputs::of(trace)?;
    let of = |payload_kg: f64| {
        TruckModel::new(truck.clone(), payload_kg).map_err(|e| DiagnosisError::Truck(e.to_string()))
    };
    let mut empty = truck.lateral;
    empty.payload.mass_kg = 0.0;
    let model = of((trace.mass_kg - empty.total_mass_kg()).max(0.0))?;
    let mut s = model.initial_state(0.0, 0.0, 0.0, inputs.speed_m_s[0].max(0.0));
    let mut outputs: Vec<[f64; OUTPUTS.len()]> = Vec::with_capacity(inputs.time_s.len());
    for (i, t) in inputs.time_s.iter().enumerate() {
        outputs.push(observe(&model, &s, &inputs.patch(i)));
        let Some(next) = inputs.time_s.get(i + 1) else { break };
        s.brake.bench_decel_m_s2 = inputs.bench_decel_m_s2(i);
        // traces may be sampled between the model's substeps
        let steps = (next / SUBSTEP_S).round() - (t / SUBSTEP_S).round();
        s = model
            .step(&s, &inputs.command(i), &inputs.patch(i), steps * SUBSTEP_S)
            .map_err(|e| DiagnosisError::Truck(format!("trace {}: {e}", trace.name)))?;
    }
    let (mut signals, mut replayed): (Vec<SignalFidelity>, Vec<Replayed>) = Default::default();
    for (k, quantity) in OUTPUTS.iter().enumerate() {
        let Some(measured) = column(&trace.table, quantity) else { continue };
        let simulated: Vec<f64> = outputs.iter().map(|o| o[k]).collect();
        signals.extend(compare(quantity, None, &measured, &simulated, |_| true));
        let shown = |x: &[f64]| inputs.on_grid(x);
        replayed.push(Replayed {
            quantity,
            measured: shown(&measured),
            open_loop: shown(&simulated),
            free_runs: Vec::new(),
        });
    }
    Ok(DriveFidelity { drive: trace.name.clone(), signals, replayed })
}

/// A column under its own name or that of the released model's traces.
fn column(table: &RawTable, name: &str) -> Option<Vec<f64>> {
    if let Some(values) = table.column(name) {
        return Some(values.to_vec());
    }
    RELEASED.iter().filter(|r| r.1 == name).find_map(|(theirs, _, factor)| {
        Some(table.column(theirs)?.iter().map(|x| factor * x).collect())
    })
}

/// What drives the model, row by row.
struct Inputs {
    time_s: Vec<f64>,
    speed_m_s: Vec<f64>,
    pedal_frac: Vec<f64>,
    decel_m_s2: Vec<f64>,
    retarder_frac: Vec<f64>,
    wheel_rad: Vec<f64>,
    grade_rad: Vec<f64>,
    /// Logged acceleration, m/s², on a bench.
    bench_accel_m_s2: Option<Vec<f64>>,
}

impl Inputs {
    fn of(trace: &Trace) -> Result<Self, DiagnosisError> {
        let bad = |column: &'static str, why: String| DiagnosisError::Column {
            drive: trace.name.clone(),
            column,
            why,
        };
        let table = &trace.table;
        let time_s = column(table, "time_s").ok_or_else(|| bad("time_s", "is missing".into()))?;
        let rows = time_s.len();
        if let Some((name, values)) = table.columns.iter().find(|c| c.1.len() != rows) {
            let why = format!("has {rows} rows, {name} has {}", values.len());
            return Err(bad("time_s", why));
        }
        if rows < 2 {
            return Err(bad("time_s", format!("has {rows} rows, at least 2 are needed")));
        }
        for (row, w) in time_s.windows(2).enumerate() {
            let step = w[1] - w[0];
            if !(step > 0.0 && step <= MAX_STEP_S) {
                let why = format!("steps by {step} s after row {row}, not by 0 to {MAX_STEP_S} s");
                return Err(bad("time_s", why));
            }
        }
        if time_s[rows - 1] - time_s[0] > MAX_TRACE_S {
            return Err(bad("time_s", format!("spans more than {MAX_TRACE_S} s")));
        }
        let or_zero = |name: &'static str| {
            let values = column(table, name).unwrap_or_else(|| vec![0.0; rows]);
            match values.iter().position(|x| !x.is_finite()) {
                Some(row) => Err(bad(name, format!("is not a number in row {row}"))),
                None => Ok(values),
            }
        };
        let speed_m_s = or_zero("speed_m_s")?;
        let grade_rad = match table.column("grade_deg") {
            Some(deg) => deg.iter().map(|d| d.to_radians()).collect(),
            None => or_zero("grade_frac")?.into_iter().map(f64::atan).collect(),
        };
        let bench = speed_m_s.iter().all(|v| v.abs() < 1e-6);
        let accel = or_zero("accel_x_m_s2")?;
        Ok(Self {
            speed_m_s,
            pedal_frac: or_zero("accelerator_pedal_frac")?,
            decel_m_s2: or_zero("xbr_decel_m_s2")?,
            retarder_frac: or_zero("engine_brake_frac")?,
            wheel_rad: or_zero("steering_wheel_rad")?,
            grade_rad,
            bench_accel_m_s2: bench.then_some(accel),
            time_s,
        })
    }

    /// Rows on the grid of drives, for pictures: the last row not after each grid time.
    fn on_grid(&self, rows: &[f64]) -> Vec<f64> {
        let (first, last) = (self.time_s[0], self.time_s[self.time_s.len() - 1]);
        let samples = ((last - first) / Drive::STEP_S + 1e-6) as usize + 1;
        let at = |k: usize| {
            let t = first + k as f64 * Drive::STEP_S + 1e-9;
            rows[self.time_s.partition_point(|x| *x <= t).clamp(1, rows.len()) - 1]
        };
        (0..samples).map(at).collect()
    }

    fn command(&self, i: usize) -> Command {
        let decel = self.decel_m_s2[i].max(0.0);
        Command {
            accelerator_pedal_frac: self.pedal_frac[i],
            xbr_decel_m_s2: decel,
            brake_mode: if decel > 0.0 { BrakeMode::Maximum } else { BrakeMode::Off },
            steering_wheel_rad: self.wheel_rad[i],
            retarder_frac: self.retarder_frac[i],
            ..Command::default()
        }
    }

    fn patch(&self, i: usize) -> RoadPatch {
        RoadPatch { grade_rad: self.grade_rad[i], ..RoadPatch::default() }
    }

    fn bench_decel_m_s2(&self, i: usize) -> Option<f64> {
        self.bench_accel_m_s2.as_ref().map(|a| (-a[i]).max(0.0))
    }
}

fn observe(model: &TruckModel, s: &TruckState, patch: &RoadPatch) -> [f64; OUTPUTS.len()] {
    let e = model.measured(&model.ego_state(s, patch));
    let p = &e.powertrain;
    let kpa: [f64; GROUPS] = s.brake.pressure_pa.map(|pa| 1e-3 * pa);
    [
        e.speed_m_s,
        f64::from(p.gear),
        p.engine_speed_rad_s * RPM_PER_RAD_S,
        100.0 * p.engine_torque_nm / model.parameters().engine.reference_torque_nm,
        1e-3 * p.brake_pressure_pa,
        kpa[0],
        kpa[1],
        kpa[2],
        p.fuel_rate_g_s,
        e.yaw_rate_rad_s,
        e.trailer.yaw_rate_rad_s,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bench(decel: f64, felt: f64) -> Trace {
        let rows = 500;
        let column = |name: &str, f: &dyn Fn(f64) -> f64| {
            (name.to_owned(), (0..rows).map(|i| f(0.01 * f64::from(i))).collect())
        };
        let nothing: &dyn Fn(f64) -> f64 = &|_| 0.0;
        Trace {
            name: "bench".into(),
            mass_kg: 18_000.0,
            table: RawTable {
                columns: vec![
                    column("t_s", &|t| t),
                    column("cmd_mps2", &|t| if t >= 1.0 { -decel } else { 0.0 }),
                    column("ax_g_feedback", &|_| -felt / GRAVITY_M_S2),
                    column("p_front_MPa", nothing),
                    column("p_drive_MPa", nothing),
                    column("p_trailer_MPa", nothing),
                ],
            },
        }
    }

    fn last_kpa(trace: &Trace) -> [f64; 3] {
        let truck = TruckParameters::load("iits").unwrap();
        let run = whole_run(&truck, trace).unwrap();
        let of = |q: &str| {
            let r = run.replayed.iter().find(|r| r.quantity == q).unwrap();
            r.open_loop[r.open_loop.len() - 1]
        };
        ["steer", "drive", "trailer"].map(|g| of(&format!("brake_pressure_{g}_kpa")))
    }

    /// The released control unit adds up to 1.5 m/s² while the truck does not slow: its pressures on
    /// a bench are those of twice the demand, of three tables (18 t, 3.0 m/s²: 222.5 and 95 kPa,
    /// times 0.3, 0.7 and 1.1).
    #[test]
    fn a_bench_that_feels_no_deceleration_gets_the_demand_and_the_whole_loop() {
        let kpa = last_kpa(&bench(1.5, 0.0));
        for (got, want) in kpa.iter().zip([66.75, 66.5, 104.5]) {
            assert!((got - want).abs() < 0.1, "{kpa:?}");
        }
    }

    #[test]
    fn a_bench_that_feels_the_demanded_deceleration_gets_the_demand_alone() {
        let kpa = last_kpa(&bench(1.0, 1.0));
        for (got, want) in kpa.iter().zip([0.3 * 85.0, 0.7 * 45.0, 1.1 * 45.0]) {
            assert!((got - want).abs() < 0.1, "{kpa:?}");
        }
    }

    #[test]
    fn wrong_times_and_values_are_named() {
        let truck = TruckParameters::load("iits").unwrap();
        let mut trace = bench(1.0, 0.0);
        trace.table.columns[0].1[7] = 0.0;
        let e = whole_run(&truck, &trace).unwrap_err().to_string();
        assert!(e.contains("time_s") && e.contains("row 6"), "{e}");
        let mut trace = bench(1.0, 0.0);
        trace.table.columns[1].1[9] = f64::NAN;
        let e = whole_run(&truck, &trace).unwrap_err().to_string();
        assert!(e.contains("xbr_decel_m_s2") && e.contains("row 9"), "{e}");
    }
}
