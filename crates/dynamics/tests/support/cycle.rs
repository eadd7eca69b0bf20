//! Declaration cycles: a driver who follows target speeds over distance in the plant, and what the
//! drive takes. The cycles and the fuel map are read from a folder of the VECTO release (EUPL, not
//! part of this repository).
//!
//! The driver does what VECTO's does: accelerates with 1 m/s² up to 25 km/h, 0.64 at 50 and 0.5 from
//! 60; coasts towards lower targets from where 0.5 m/s² would lead to them, above 50 km/h; slows and
//! stops with 1 m/s² up to 50 km/h and 0.5 from 60; coasts downhill up to 5 km/h above targets of 50
//! km/h and more, and holds the truck there with the service brakes.

use std::path::Path;

use dynamics::effects::fuel::FuelMap;
use dynamics::{RoadPatch, TruckModel, TruckParameters, TruckState};
use tractrix_core::{BrakeMode, Command, Curve, GAS_CONSTANT_AIR_J_KG_K, RPM_PER_RAD_S};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Air of VECTO's declaration mode, kg/m³.
pub(crate) const AIR_DENSITY_KG_M3: f64 = 1.188;
const OVERSPEED_M_S: f64 = 5.0 / 3.6;
/// Deceleration by which the driver judges from where to coast towards a lower target, m/s².
const COASTING_M_S2: f64 = 0.5;
const FORESIGHT_FROM_M_S: f64 = 50.0 / 3.6;
const STEP_S: f64 = 0.05;

/// A cycle over distance.
pub(crate) struct Cycle {
    /// Grade, rad, over distance, m, held from row to row.
    grade: Vec<(f64, f64)>,
    /// Speed that the driver may have, m/s, every metre: targets with slowing ahead of lower ones.
    ahead_m_s: Vec<f64>,
    /// Speed above which the driver coasts towards a lower target, m/s, every metre.
    coasting_m_s: Vec<f64>,
    /// Target speed, m/s, every metre.
    target_m_s: Vec<f64>,
    /// Stops: distance, m, and duration, s.
    stops: Vec<(f64, f64)>,
}

fn table(path: &Path) -> Result<Vec<Vec<f64>>> {
    let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
    let mut rows = Vec::new();
    for (i, line) in text.lines().enumerate().skip(1).filter(|(_, l)| !l.trim().is_empty()) {
        let row: std::result::Result<Vec<f64>, _> =
            line.split(',').map(|v| v.trim().parse()).collect();
        rows.push(row.map_err(|e| format!("{} line {}: {e}", path.display(), i + 1))?);
    }
    if rows.is_empty() || rows.iter().any(|r| r.len() < 3) {
        return Err(format!("{}: no rows of three numbers and more", path.display()).into());
    }
    Ok(rows)
}

impl Cycle {
    /// Reads `s_m, v_kmh, grade_pct, stop_s`.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let rows = table(path)?;
        let length_m = rows[rows.len() - 1][0];
        let at = |s: f64| rows.partition_point(|r| r[0] <= s).saturating_sub(1);
        let stop = |r: &Vec<f64>| r.get(3).copied().unwrap_or(0.0);
        let target_m_s: Vec<f64> = (0..=length_m as usize)
            .map(|m| {
                let row = &rows[at(m as f64)];
                // the row of a stop has speed zero; what follows it is driven at the next target
                let next = rows.get(at(m as f64) + 1).map_or(0.0, |r| r[1]);
                if row[1] > 0.0 { row[1] / 3.6 } else { next / 3.6 }
            })
            .collect();
        let stops: Vec<(f64, f64)> =
            rows.iter().filter(|r| r[1] == 0.0).map(|r| (r[0], stop(r))).collect();
        let mut stopping_m_s = target_m_s.clone();
        for &(s, _) in stops.iter().skip(1) {
            let m = (s as usize).min(stopping_m_s.len() - 1);
            stopping_m_s[m] = 0.0;
        }
        let ahead_m_s = slowed(stopping_m_s.clone(), slowing_m_s2);
        let coasting_m_s = slowed(stopping_m_s, |_| COASTING_M_S2);
        let grade = rows.iter().map(|r| (r[0], (r[2] / 100.0).atan())).collect();
        Ok(Self { grade, ahead_m_s, coasting_m_s, target_m_s, stops })
    }

    fn grade_rad(&self, s_m: f64) -> f64 {
        self.grade[self.grade.partition_point(|g| g.0 <= s_m).saturating_sub(1)].1
    }
}

/// Speeds every metre, slowed ahead of lower ones.
fn slowed(mut speed_m_s: Vec<f64>, decel_m_s2: impl Fn(f64) -> f64) -> Vec<f64> {
    for m in (0..speed_m_s.len() - 1).rev() {
        let next = speed_m_s[m + 1];
        speed_m_s[m] = speed_m_s[m].min((next * next + 2.0 * decel_m_s2(next)).sqrt());
    }
    speed_m_s
}

/// What a drive took. Energies in kWh.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Taken {
    pub(crate) distance_m: f64,
    pub(crate) time_s: f64,
    pub(crate) fuel_g: f64,
    /// Work of the engine while it drives, auxiliaries included.
    pub(crate) engine_kwh: f64,
    /// Work that the engine takes while it is driven, auxiliaries not counted.
    pub(crate) overrun_kwh: f64,
    pub(crate) brake_kwh: f64,
}

impl Taken {
    pub(crate) fn g_km(&self) -> f64 {
        self.fuel_g / self.distance_m * 1e3
    }
}

/// The truck with VECTO's own fuel map from a folder of its release.
pub(crate) fn with_map_of(mut truck: TruckParameters, folder: &Path) -> Result<TruckParameters> {
    let rows = table(&folder.join("fuel_map.csv"))?;
    let torque_nm: Vec<f64> = (0..=12).map(|i| 200.0 * f64::from(i)).collect();
    let (mut speed_rpm, mut fuel_g_s) = (Vec::<f64>::new(), Vec::new());
    let mut begin = 0;
    while begin < rows.len() {
        let rpm = rows[begin][0];
        let end = begin + rows[begin..].iter().take_while(|r| (r[0] - rpm).abs() < 1.0).count();
        let row: Vec<&Vec<f64>> = rows[begin..end].iter().filter(|r| r[1] >= 0.0).collect();
        begin = end;
        if row.len() < 2 {
            continue;
        }
        let flow = |r: &[f64]| r[2] / 3600.0;
        let (t, f) = row.iter().map(|r| (r[1], flow(r))).unzip();
        let curve = Curve::new("fuel_map.csv", t, f)?;
        // rows end at full load: beyond it the slope of the row's upper half goes on
        let (mid, last) = (row[row.len() / 2], row[row.len() - 1]);
        let slope = (flow(last) - flow(mid)) / (last[1] - mid[1]);
        speed_rpm.push(rpm.round());
        let on = |t: &f64| curve.at(*t) + slope * (t - last[1]).max(0.0);
        fuel_g_s.push(torque_nm.iter().map(on).collect());
    }
    truck.engine.fuel_map = Some(FuelMap {
        source: "fuel_map.csv of the VECTO release".into(),
        speed_rpm,
        torque_nm,
        fuel_g_s: Some(fuel_g_s),
        bsfc_g_kwh: None,
        zero_torque_g_s: None,
        extrapolate: true,
    });
    Ok(truck)
}

/// The committed file holds resistances at 33.9 t: VECTO's rolling resistance falls with the load to
/// the power 0.1; what grows with speed in it (wind from the sides, gearbox) has nothing to do with
/// the mass.
pub(crate) fn with_rolling_of_mass(
    truck: TruckParameters,
    mass_kg: f64,
) -> Result<TruckParameters> {
    let loaded = mass_kg / 33_900.0;
    let r = &truck.resistance;
    let (coeff, slope) = (r.rolling_coeff * loaded.powf(-0.1), r.rolling_per_speed_s_m / loaded);
    Ok(truck
        .with_parameter("resistance.rolling_coeff", coeff)?
        .with_parameter("resistance.rolling_per_speed_s_m", slope)?)
}

/// Drives a cycle from its first row to its last.
pub(crate) fn drive(truck: TruckParameters, payload_kg: f64, cycle: &Cycle) -> Result<Taken> {
    let model = TruckModel::new(truck, payload_kg)?;
    let air_k = 101_325.0 / (GAS_CONSTANT_AIR_J_KG_K * AIR_DENSITY_KG_M3);
    let mut s = model.initial_state(0.0, 0.0, 0.0, 0.0);
    let mut taken = Taken::default();
    let mut stops = cycle.stops.iter().copied();
    let mut wait_s = stops.next().map_or(0.0, |stop| stop.1);
    let mut stop = stops.next();
    let mut left_m: f64 = 0.0;
    let end_m = cycle.target_m_s.len() as f64 - 1.0;
    while let Some((stop_m, stop_s)) = stop.or((s.distance_m < end_m).then_some((end_m, 0.0))) {
        let m = (s.distance_m as usize).min(cycle.target_m_s.len() - 1);
        let patch = RoadPatch {
            grade_rad: cycle.grade_rad(s.distance_m),
            air_temperature_k: air_k,
            ..RoadPatch::default()
        };
        if wait_s <= 0.0 && s.speed_m_s < 0.3 && stop_m - s.distance_m < 2.0 {
            wait_s = stop_s.max(STEP_S);
            left_m = stop_m;
            stop = stops.next();
        }
        // the brakes answer after half a second; slowing ends at walking speed before the line
        let seen = (s.distance_m + 0.5 * s.speed_m_s).max(left_m + 1.0) as usize;
        let at = |m: usize| m.min(cycle.ahead_m_s.len() - 1);
        let ahead = cycle.ahead_m_s[at(seen)];
        let ahead = if stop_m - s.distance_m > 1.5 { ahead.max(0.7) } else { ahead };
        let command = if wait_s > 0.0 {
            wait_s -= STEP_S;
            hold()
        } else {
            {
                let coasts = s.speed_m_s > FORESIGHT_FROM_M_S.max(cycle.coasting_m_s[at(seen)])
                    && cycle.coasting_m_s[at(seen)] < cycle.target_m_s[m] - 1e-6;
                command(&model, &s, cycle.target_m_s[m], ahead, coasts)
            }
        };
        let before = s;
        s = model.step(&s, &command, &patch, STEP_S)?;
        let (f, ds) = (&s.forces, (s.distance_m - before.distance_m) / 3.6e6);
        let crank = |s: &TruckState| {
            let p = &model.parameters().engine;
            let friction = p.friction_constant_nm
                + p.friction_per_rpm_nm * s.engine_speed_rad_s * RPM_PER_RAD_S;
            (s.engine_torque_nm - friction) * s.engine_speed_rad_s * STEP_S / 3.6e6
        };
        taken.engine_kwh += crank(&s).max(0.0);
        taken.overrun_kwh -= if s.clutch_locked { crank(&s).min(0.0) } else { 0.0 };
        taken.brake_kwh += f.brake_n * ds;
        if s.substeps as f64 * dynamics::SUBSTEP_S > 40_000.0 {
            return Err(format!("stuck at {} m", s.distance_m).into());
        }
    }
    taken.distance_m = s.distance_m;
    taken.time_s = s.substeps as f64 * dynamics::SUBSTEP_S;
    taken.fuel_g = s.fuel_g;
    Ok(taken)
}

fn hold() -> Command {
    Command { xbr_decel_m_s2: 1.0, brake_mode: BrakeMode::Maximum, ..Command::default() }
}

/// Deceleration ahead of lower targets at a speed, m/s² (VECTO's driver for trucks).
fn slowing_m_s2(v_m_s: f64) -> f64 {
    1.0 - ((v_m_s * 3.6 - 50.0) / 10.0).clamp(0.0, 1.0) * 0.5
}

/// Largest acceleration at a speed, m/s² (VECTO's driver for trucks).
fn most_m_s2(v_m_s: f64) -> f64 {
    let kmh = v_m_s * 3.6;
    match kmh {
        _ if kmh <= 25.0 => 1.0,
        _ if kmh <= 50.0 => 1.0 - (kmh - 25.0) / 25.0 * 0.357,
        _ => (0.643 - (kmh - 50.0) / 10.0 * 0.143).max(0.5),
    }
}

fn command(
    model: &TruckModel,
    s: &TruckState,
    target_m_s: f64,
    ahead_m_s: f64,
    coasts: bool,
) -> Command {
    let p = model.parameters();
    let (d, e) = (&p.driveline, &p.engine);
    let v = s.speed_m_s;
    let f = &s.forces;
    let resisting_n = f.rolling_n + f.drag_n + f.grade_n;
    let mass_kg = f.effective_mass_kg.max(model.mass_kg());
    let slowing = ahead_m_s < target_m_s - 1e-6;
    let force_for = |reference: f64| {
        let falls = if slowing { slowing_m_s2(v) } else { 0.0 };
        let accel = (0.5 * (reference - v) - falls).clamp(-1.5, most_m_s2(v));
        mass_kg * accel + resisting_n
    };
    let allowed = match slowing {
        false if target_m_s >= FORESIGHT_FROM_M_S => target_m_s + OVERSPEED_M_S,
        _ => ahead_m_s,
    };
    let gear = if s.shift.gear > 0 { s.shift.gear } else { s.shift.target };
    let n = s.engine_speed_rad_s;
    let friction = e.friction_constant_nm + e.friction_per_rpm_nm * n * RPM_PER_RAD_S;
    let lost = friction + e.auxiliary_power_w / n.max(30.0);
    let per_nm = d.force_n(1.0, gear.max(1));
    let full =
        Curve::new("full load", e.full_load_speed_rpm.clone(), e.full_load_torque_nm.clone())
            .map_or(0.0, |c| c.at(n * RPM_PER_RAD_S));
    let pedal = (force_for(ahead_m_s) / per_nm + lost) / (full + friction);
    let surplus_n = f.drive_n.min(0.0) - force_for(allowed);
    let brakes = v > allowed && surplus_n > 0.0;
    Command {
        accelerator_pedal_frac: if brakes || coasts { 0.0 } else { pedal.clamp(0.0, 1.0) },
        xbr_decel_m_s2: if brakes { surplus_n / model.mass_kg() } else { 0.0 },
        brake_mode: if brakes { BrakeMode::Addition } else { BrakeMode::Off },
        ..Command::default()
    }
}
