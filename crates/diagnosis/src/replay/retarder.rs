//! Retarders that the truck file does not have, or not so strong: with the engine brake's stage, with the
//! demand of the brakes, on descents.

use std::sync::Arc;

use dynamics::SUBSTEP_S;
use dynamics::effects::driveline::from_descent_frac;
use tractrix_core::ZERO_DEGC_K;

use super::inputs::pad;
use super::prepared::Prepared;
use super::profiles::Kind;
use crate::{Drive, Plant};

/// Power of a retarder that the truck file did not have, W: typical of a secondary retarder.
pub(crate) const RETARDER_POWER_W: f64 = 400_000.0;
/// Lag of such a retarder behind its stage, s: none, a stage is reported as it acts.
pub(crate) const RETARDER_LAG_S: f64 = 0.005;
/// Lag behind what asks for it otherwise, s: filling with oil takes hydrodynamic ones some tenths of a
/// second (our estimate; not fitted). It tells them from brakes, whose pressure is measured.
const FILLS_S: f64 = 0.4;

/// Force of a retarder that follows its stage, N: the file's, with `extra_nm` more at the propeller
/// shaft, as far as the measured coolant leaves it.
pub(super) fn retarder_n(d: &Prepared, plant: &Plant, extra_nm: f64) -> Option<Arc<[f64]>> {
    let mut driveline = plant.truck.driveline.clone();
    if extra_nm != 0.0 {
        if driveline.retarder_torque_nm == 0.0 {
            driveline.retarder_lag_s = RETARDER_LAG_S;
        }
        driveline.retarder_torque_nm += extra_nm;
        driveline.retarder_power_w = driveline.retarder_power_w.max(RETARDER_POWER_W);
    }
    (driveline.retarder_torque_nm != 0.0).then(|| {
        d.profiles.get(Kind::Retarder, [extra_nm], || {
            let substeps = (Drive::STEP_S / SUBSTEP_S).round() as usize;
            let mut torque_nm = 0.0;
            let left = |coolant_degc: f64| {
                let cooling = plant.truck.cooling.as_ref();
                cooling.map_or(1.0, |c| c.retarder_left_frac(coolant_degc + ZERO_DEGC_K))
            };
            let asked = d.speed.iter().zip(&d.engine_brake).zip(&d.coolant);
            let steps = asked.map(|((v, stage), coolant_degc)| {
                let target_nm = stage * left(*coolant_degc) * driveline.retarder_limit_nm(*v);
                for _ in 0..substeps {
                    torque_nm = driveline.retarder_step_nm(torque_nm, target_nm, SUBSTEP_S);
                }
                driveline.shaft_force_n(torque_nm)
            });
            pad(steps, d.balance.padded)
        })
    })
}

/// How far a retarder is filled that holds the truck on descents steeper than `from_frac` while the
/// accelerator is released, 0 to 1.
pub(super) fn downhill(d: &Prepared, from_frac: f64) -> Arc<[f64]> {
    d.profiles.get(Kind::Downhill, [from_frac], || {
        let asked = d.grade.iter().zip(&d.balance.coasts);
        let asked = asked.map(|(grade, coasts)| coasts * from_descent_frac(-grade, from_frac));
        pad(filled(asked), d.balance.padded)
    })
}

/// Demand of a retarder that blends in with the brakes, m/s²: grows with theirs up to a limit, and
/// comes late as the oil fills.
pub(super) fn blended_m_s2(d: &Prepared, saturation_s2_m: f64) -> Arc<[f64]> {
    d.profiles.get(Kind::Blended, [saturation_s2_m], || {
        let demand = d.balance.xbr.iter().take(d.n).map(|x| x.max(0.0));
        pad(filled(demand.map(|x| x / (1.0 + saturation_s2_m * x))), d.balance.padded)
    })
}

/// What a retarder without a name has of what is asked of it, sample by sample.
fn filled(asked: impl Iterator<Item = f64>) -> impl Iterator<Item = f64> {
    let follow = 1.0 - (-Drive::STEP_S / FILLS_S).exp();
    let mut now = 0.0;
    asked.map(move |asked| {
        now += follow * (asked - now);
        now
    })
}

#[cfg(test)]
mod tests {
    use dynamics::TruckParameters;

    use super::*;
    use crate::Channel as C;

    /// Simulated trucks derate their retarder when the coolant is hot; replayed ones held on with all of
    /// it, which is 8 kN too much on a long descent.
    #[test]
    fn a_hot_retarder_is_replayed_with_what_its_coolant_leaves() {
        let plant = Plant::of_truck(&TruckParameters::load("longhaul").unwrap()).unwrap();
        let force_n = |coolant_degc: f64| {
            let mut drive = Drive::new("descent", 0.0, 400);
            drive.reported_mass_kg = Some(40_000.0);
            for (c, x) in
                [(C::SpeedMS, 20.0), (C::EngineBrakeFrac, 1.0), (C::CoolantTempDegc, coolant_degc)]
            {
                drive.set(c, vec![x; 400]);
            }
            let d = Prepared::new(&drive, &plant);
            retarder_n(&d, &plant, 0.0).unwrap()[390]
        };
        let (cold_n, hot_n) = (force_n(90.0), force_n(102.85));
        assert!(cold_n > 15_000.0, "{cold_n}");
        // Halfway from 371 to 381 K.
        assert!((hot_n / cold_n - 0.5).abs() < 1e-6, "{hot_n} of {cold_n}");
    }
}
