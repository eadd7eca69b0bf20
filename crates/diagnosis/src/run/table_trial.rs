//! What is left without a name as a fitted table in the truck, tried on drives held out.
//!
//! The free function that the search found in the force balance becomes an acceleration over its
//! signal ([`dynamics::effects::table`]). It enters the extended truck only if free runs of 60 s of
//! the whole truck model come closer to the measured speed on every drive that was held out.

use dynamics::TruckParameters;
use dynamics::effects::table::{TableEffect, TableSignal};
use serde::Serialize;

use crate::replay::Module;
use crate::run::diagnose::split;
use crate::studies::fidelity::{HORIZONS_S, fidelity};
use crate::{
    BeforeAfter, Channel, Diagnosis, DiagnosisError, Drive, DriveSet, Executor, Options, Unknown,
    collect, extend,
};

/// A table and what came of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TableTrial {
    /// The table, if it enters the extended truck.
    pub effect: Option<TableEffect>,
    /// Names of the drives that it was tried on.
    pub held_out: Vec<String>,
    /// Error of the speed over free runs of 60 s there, without and with it, m/s.
    pub speed_rmse_m_s: Option<BeforeAfter>,
    /// Why it does not enter.
    pub why_not: Option<String>,
}

/// Tries what `found` leaves without a name as a table on the drives held out.
///
/// # Errors
/// [`DiagnosisError::Truck`] if the truck cannot be replayed.
pub fn try_table(
    truck: &TruckParameters,
    drives: &DriveSet,
    options: &Options,
    found: &Diagnosis,
    origin: &str,
    executor: &dyn Executor,
) -> Result<TableTrial, DiagnosisError> {
    let no = |why: String| TableTrial {
        effect: None,
        held_out: Vec::new(),
        speed_rmse_m_s: None,
        why_not: Some(why),
    };
    let Some(unknown) = &found.unknown else {
        return Ok(no("nothing is left without a name".to_owned()));
    };
    let effect = match table(unknown, origin) {
        Ok(effect) => effect,
        Err(why) => return Ok(no(why)),
    };
    let (_, held) = split(drives, &options.hold_out)?;
    if held.is_empty() {
        return Ok(no("no drive is held out to try it on".to_owned()));
    }
    let failed = |e: dynamics::DynamicsError| DiagnosisError::Truck(e.to_string());
    let named = extend(truck, &truck.name, &truck.name, &found.causes, origin).overlay;
    let before = named.map_or_else(|| Ok(truck.clone()), |o| truck.with_overlay(&o));
    let before = before.map_err(failed)?;
    let mut after = before.clone();
    after.table_effects.push(effect.clone());
    let of: Vec<&Drive> = held.iter().map(|i| &drives.drives[*i]).collect();
    let (plain, tabled) = (errors(&before, &of, executor)?, errors(&after, &of, executor)?);
    let rms = |e: &[[f64; 2]]| {
        let sums = e.iter().fold([0.0, 0.0], |a, e| [a[0] + e[0], a[1] + e[1]]);
        (sums[0] / sums[1].max(1.0)).sqrt()
    };
    let better = plain.iter().zip(&tabled).all(|(b, a)| a[0] < b[0]);
    Ok(TableTrial {
        effect: better.then_some(effect),
        held_out: of.iter().map(|d| d.name.clone()).collect(),
        speed_rmse_m_s: Some(BeforeAfter { before: rms(&plain), after: rms(&tabled) }),
        why_not: (!better).then(|| "it does not help on every drive held out".to_owned()),
    })
}

/// The free function as a table effect.
fn table(unknown: &Unknown, origin: &str) -> Result<TableEffect, String> {
    if unknown.quantity != Module::Force.quantity() || unknown.table.is_empty() {
        return Err(format!(
            "only what acts on the force balance can be a table; this shows in {}",
            unknown.quantity
        ));
    }
    if unknown.is_factor || unknown.memory_s > 0.0 {
        return Err(format!("only what is added over a signal can be a table; {}", unknown.shape));
    }
    let name = unknown.signals.first().copied().unwrap_or("no signal");
    let signal = TableSignal::of(name)
        .ok_or_else(|| format!("the truck model has no state {name} that a table could follow"))?;
    let (signal_values, accel_m_s2) = unknown.table.iter().copied().unzip();
    let source = format!("{origin}: fitted over {name}, cause unknown");
    Ok(TableEffect { source, signal, signal_values, accel_m_s2 })
}

/// Sum of squared errors of the speed over 60 s and number of samples, per drive.
fn errors(
    truck: &TruckParameters,
    drives: &[&Drive],
    executor: &dyn Executor,
) -> Result<Vec<[f64; 2]>, DiagnosisError> {
    let longest = HORIZONS_S.last().copied();
    let mut out = Vec::with_capacity(drives.len());
    for one in collect(executor, drives.len(), |i| fidelity(truck, drives[i])) {
        let one = one?;
        let speed = one
            .signals
            .iter()
            .find(|s| s.quantity == Channel::SpeedMS.name() && s.horizon_s == longest)
            .ok_or_else(|| DiagnosisError::Numerics("no speed in a free run".into()))?;
        let samples = speed.samples as f64;
        out.push([speed.rmse * speed.rmse * samples, samples]);
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unknown(quantity: &'static str, signal: &'static str) -> Unknown {
        Unknown {
            signals: vec![signal],
            quantity,
            shape: String::new(),
            explained_frac: 0.5,
            evidence: 50.0,
            table: vec![(900.0, 0.0), (1200.0, -0.02), (1500.0, 0.0)],
            is_factor: false,
            memory_s: 0.0,
        }
    }

    #[test]
    fn a_force_over_a_state_of_the_truck_becomes_a_table_and_nothing_else_does() {
        let t = table(&unknown("speed_m_s", "engine_speed_rpm"), "drives").unwrap();
        assert_eq!(t.signal, TableSignal::EngineSpeedRpm);
        assert_eq!(t.accel_m_s2, [0.0, -0.02, 0.0]);
        assert!(t.source.contains("cause unknown"));
        assert!(table(&unknown("speed_m_s", "time_s"), "d").unwrap_err().contains("time_s"));
        let error = table(&unknown("fuel_rate_g_s", "engine_speed_rpm"), "d").unwrap_err();
        assert!(error.contains("fuel_rate_g_s"), "{error}");
        let factor = Unknown { is_factor: true, ..unknown("speed_m_s", "engine_speed_rpm") };
        assert!(table(&factor, "d").unwrap_err().contains("added"));
        let memory = Unknown { memory_s: 300.0, ..unknown("speed_m_s", "engine_speed_rpm") };
        assert!(table(&memory, "d").unwrap_err().contains("added"));
    }
}
