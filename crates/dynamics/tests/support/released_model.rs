//! The paper's released longitudinal model, written from the description of its blocks; its tables
//! are read from where they lie. A peer for manoeuvres of which no trace exists.
//!
//! Its faults are kept: the drive force is engine torque times ratio whatever the clutch does, no
//! air drag, no grade below 0.01 m/s, brake pressures five times too fast and counted on both axles.

use std::path::Path;

type Error = Box<dyn std::error::Error>;

/// A table: axis values of rows and columns, values by row.
struct Table {
    rows: Vec<f64>,
    columns: Vec<f64>,
    values: Vec<Vec<f64>>,
}

impl Table {
    fn read(folder: &Path, name: &str) -> Result<Self, Error> {
        let mut reader = csv::ReaderBuilder::new()
            .comment(Some(b'#'))
            .flexible(true)
            .from_path(folder.join(name))?;
        let columns = reader.headers()?.iter().skip(1).map(|h| h.parse().unwrap_or(0.0)).collect();
        let (mut rows, mut values) = (Vec::new(), Vec::new());
        for record in reader.records() {
            let record = record?;
            let numbers: Result<Vec<f64>, _> = record.iter().map(str::parse).collect();
            let numbers = numbers?;
            rows.push(numbers[0].abs());
            values.push(numbers[1..].to_vec());
        }
        if rows.len() > 1 && rows[0] > rows[1] {
            rows.reverse();
            values.reverse();
        }
        Ok(Self { rows, columns, values })
    }

    /// Bilinear, clamped.
    fn at(&self, row: f64, column: f64) -> f64 {
        let (i, u) = place(&self.rows, row);
        let (j, w) = place(&self.columns, column);
        let line = |i: usize| (1.0 - w) * self.values[i][j] + w * self.values[i][j + 1];
        (1.0 - u) * line(i) + u * line(i + 1)
    }

    /// One column, linear, clamped.
    fn column(&self, row: f64, column: usize) -> f64 {
        let (i, u) = place(&self.rows, row);
        (1.0 - u) * self.values[i][column] + u * self.values[i + 1][column]
    }
}

fn place(x: &[f64], at: f64) -> (usize, f64) {
    let last = x.len() - 1;
    let at = at.clamp(x[0], x[last]);
    let i = x.partition_point(|&v| v <= at).clamp(1, last) - 1;
    (i, (at - x[i]) / (x[i + 1] - x[i]))
}

/// The model's tables.
pub(crate) struct ReleasedModel {
    demand: Table,
    delivered: Table,
    up_kmh: Table,
    down_kmh: Table,
    gears: Table,
    pressure_kpa: Table,
}

/// A manoeuvre: constant pedal, or up to a speed, 17 s of coasting, then braking.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Manoeuvre {
    pub(crate) mass_kg: f64,
    pub(crate) pedal_pct: f64,
    pub(crate) grade_deg: f64,
    /// Deceleration and the speed from which it coasts, m/s² and km/h.
    pub(crate) brake: Option<(f64, f64)>,
    pub(crate) duration_s: f64,
}

const STEP_S: f64 = 0.002;
const ENGINE_J: f64 = 6.63;
const FINAL: f64 = 2.85;
const RADIUS_M: f64 = 0.53;

#[derive(PartialEq)]
enum Amt {
    Engaged,
    Opening,
    Synchronising(f64),
    Closing,
}

#[derive(PartialEq)]
enum Ecu {
    Map,
    Reduce(f64),
    Zero,
}

impl ReleasedModel {
    pub(crate) fn read(folder: &Path) -> Result<Self, Error> {
        let table = |name| Table::read(folder, name);
        Ok(Self {
            demand: table("engine_torque_demand_map.csv")?,
            delivered: table("engine_brake_torque_map.csv")?,
            up_kmh: table("upshift_speed_kph.csv")?,
            down_kmh: table("downshift_speed_kph.csv")?,
            gears: table("gearbox.csv")?,
            pressure_kpa: table("brake_pressure_tables_kPa.csv")?,
        })
    }

    /// Rows `t_s, pedal_pct, xbr_mps2, ctrl_mode, steer_rad, grade_deg, gear, shift, v_kph`.
    pub(crate) fn run(&self, m: &Manoeuvre) -> Vec<[f64; 9]> {
        let (mut v, mut win, mut wout, mut twist) = (0.0_f64, 62.8319_f64, 0.0_f64, 0.0_f64);
        let (mut demand, mut actuator) = (0.0_f64, 0.0_f64);
        let (mut clutch, mut clutch_lag, mut locked) = (0.0_f64, 0.0_f64, false);
        let (mut gear, mut request) = (0_usize, 2_usize);
        let (mut amt, mut ecu, mut pi) = (Amt::Synchronising(0.0), Ecu::Map, 0.0_f64);
        let (mut down_s, mut coast_from, mut integral) = (0.0_f64, None::<f64>, 0.0_f64);
        let (mut pressure_mpa, mut accel) = (0.0_f64, 0.0_f64);
        let grade = m.grade_deg.to_radians();
        let mut rows = Vec::new();
        for k in 0..=(m.duration_s / STEP_S) as usize {
            let t = k as f64 * STEP_S;
            let (kmh, rpm) = (3.6 * v, win * 9.549_296_585_513_721);
            if let Some((_, from)) = m.brake
                && coast_from.is_none()
                && kmh >= from
            {
                coast_from = Some(t);
            }
            let braking = coast_from.is_some_and(|from| t >= from + 17.0);
            let pedal = if coast_from.is_some() { 0.0 } else { m.pedal_pct };
            let decel = if braking { m.brake.map_or(0.0, |b| b.0) } else { 0.0 };
            if k % 10 == 0 {
                let mode = f64::from(u8::from(braking));
                let shift = f64::from(u8::from(!locked));
                rows.push([t, pedal, -decel, mode, 0.0, m.grade_deg, gear as f64, shift, kmh]);
            }
            // gearbox control: asks on while the gearbox is still busy
            if gear > 0 {
                let up = if request < 12 {
                    self.up_kmh.at(request as f64, pedal / 100.0)
                } else {
                    f64::INFINITY
                };
                let before = request;
                if pedal >= 60.0 {
                    if request <= 8 && kmh > up {
                        request += 2;
                    }
                } else if kmh > up {
                    request += 1;
                }
                down_s = if request > 2 && kmh < self.down_kmh.values[request - 2][0] - 2.0 {
                    down_s + STEP_S
                } else {
                    0.0
                };
                if down_s >= 0.5 {
                    request -= 1;
                    down_s = 0.0;
                }
                if request != before {
                    if matches!(amt, Amt::Engaged | Amt::Closing) {
                        amt = Amt::Opening;
                    }
                    (ecu, pi) = (Ecu::Reduce(0.0), 0.0);
                }
            }
            match &mut amt {
                Amt::Engaged => {}
                Amt::Opening => {
                    clutch -= STEP_S / 0.5;
                    if clutch <= 0.0 {
                        clutch = 0.0;
                        amt = Amt::Synchronising(0.0);
                    }
                }
                Amt::Synchronising(s) => {
                    *s += STEP_S;
                    if *s >= 0.68 {
                        gear = request;
                        amt = Amt::Closing;
                    }
                }
                Amt::Closing => {
                    clutch += STEP_S / 0.5;
                    if clutch >= 1.0 {
                        clutch = 1.0;
                        amt = Amt::Engaged;
                    }
                }
            }
            clutch_lag += (clutch - clutch_lag) * STEP_S * 125.7;
            // engine control
            let busy = matches!(amt, Amt::Opening | Amt::Synchronising(_));
            if ecu == Ecu::Zero && gear == request && locked && !busy {
                ecu = Ecu::Map;
            }
            let wanted = match &mut ecu {
                Ecu::Map => self.demand.at(rpm, pedal),
                Ecu::Zero => 0.0,
                Ecu::Reduce(s) => {
                    *s += STEP_S;
                    let error = 900.0 - rpm;
                    pi = (pi + 0.2 * error * STEP_S).clamp(0.0, 1500.0);
                    let out = (200.0 + 0.05 * error + pi).clamp(0.0, 1500.0);
                    if *s >= 0.7 {
                        ecu = Ecu::Zero;
                    }
                    out
                }
            };
            let rise = if wanted < 220.0 { 2000.0 } else { 300.0 };
            let fall = if wanted < 150.0 { 3000.0 } else { 800.0 };
            demand += (wanted - demand).clamp(-fall * STEP_S, rise * STEP_S);
            actuator += (demand - actuator) * STEP_S * 73.92;
            let torque = self.delivered.at(rpm, actuator).max(0.0);
            // clutch and shafts between engine and wheels; they move the engine's speed only
            let wheel = v / RADIUS_M * FINAL;
            let ratio = self.gears.values[gear][0];
            let (inertia, damping) = (self.gears.values[gear][2], self.gears.values[gear][3]);
            let neutral = gear == 0 || matches!(amt, Amt::Synchronising(_));
            let h = STEP_S / 4.0;
            for _ in 0..4 {
                let shaft = 3556.0 * twist + 76.0 * (wout - wheel);
                let joint = (0.98 * torque
                    - 0.98 * shaft / ratio
                    - (damping / (ratio * ratio) + 4.0) * win)
                    / (ENGINE_J + inertia / (ratio * ratio));
                let through = 0.98 * torque - 4.0 * win - ENGINE_J * joint;
                let (holds, slips) = (3600.0 * clutch_lag, 3000.0 * clutch_lag);
                locked = locked && !neutral && through.abs() <= holds;
                if neutral {
                    win += h * (0.98 * torque - 4.0 * win) / ENGINE_J;
                    wout += h * (-shaft - 0.003 * wout) / 0.2;
                } else if locked {
                    win += h * joint;
                    wout = win / ratio;
                } else {
                    let slip = win - ratio * wout;
                    let passed = slips * (4.0 * slip).tanh();
                    win += h * (0.98 * torque - passed - 4.0 * win) / ENGINE_J;
                    wout += h * (ratio * passed - 0.98 * shaft - damping * wout) / inertia;
                    let met = slip * (win - ratio * wout) <= 0.0 && holds > 50.0;
                    if met && through.abs() <= holds {
                        locked = true;
                        wout = win / ratio;
                    }
                }
                twist += h * (wout - wheel);
            }
            win = win.max(0.0);
            // brakes: the integral runs on a step five times too long and sees g-scaled feedback
            integral = if braking {
                (integral + 0.01 * (decel - (-9.8 * accel).max(0.0))).clamp(0.0, 1.5)
            } else {
                0.0
            };
            let total = if braking { decel + integral } else { 0.0 };
            let heavy = ((m.mass_kg - 18_000.0) / 32_000.0).clamp(0.0, 1.0);
            let table = (1.0 - heavy) * self.pressure_kpa.column(total, 0)
                + heavy * self.pressure_kpa.column(total, 1);
            let goal = if total < 0.001 { 0.0 } else { 0.7e-3 * table };
            pressure_mpa += (goal - pressure_mpa).clamp(-5.0 * STEP_S, 2.5 * STEP_S);
            // body
            let mut force = torque * ratio * FINAL / RADIUS_M;
            if v >= 0.01 {
                let weight = m.mass_kg * 9.801;
                force -= (0.015 + 2.56e-5 * kmh) * weight * grade.cos() + weight * grade.sin();
                force -= 2.0 * 26_750.0 * 10.0 * pressure_mpa;
            }
            accel = force / (m.mass_kg + 2.0 * 24.0 / (RADIUS_M * RADIUS_M));
            v = (v + STEP_S * accel).max(0.0);
        }
        rows
    }
}
