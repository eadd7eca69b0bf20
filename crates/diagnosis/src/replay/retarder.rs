//! Retarders that the truck file does not have, or not so strong: with the engine brake's stage, with the
//! demand of the brakes, on descents.

use std::sync::Arc;

use dynamics::SUBSTEP_S;

use super::force::step;
use super::inputs::pad;
use super::prepared::Prepared;
use super::profiles::Kind;
use crate::{Drive, Plant};

/// Power of a retarder that the truck file did not have, W: typical of a secondary retarder.
pub(crate) const RETARDER_POWER_W: f64 = 400_000.0;
/// Lag of such a retarder, s: at once, for nobody knows what it is.
pub(crate) const RETARDER_LAG_S: f64 = 0.005;

/// Time that a retarder without a name takes to fill with oil once it is asked for, s: some tenths of a
/// second in hydrodynamic ones. It is what tells them from brakes, whose pressure is measured.
const OIL_FILLS_S: f64 = 0.4;
/// Descent from which such a retarder may hold the truck, and over how much of grade it does so more and
/// more, 1.
const DESCENT_FRAC: f64 = 0.01;
const DESCENT_WIDTH_FRAC: f64 = 0.002;

/// Force of a retarder that follows its stage, N: the file's, with `extra_nm` more at the propeller
/// shaft.
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
            let steps = d.speed.iter().zip(&d.engine_brake).map(|(v, stage)| {
                let target_nm = stage * driveline.retarder_limit_nm(*v);
                for _ in 0..substeps {
                    torque_nm = driveline.retarder_step_nm(torque_nm, target_nm, SUBSTEP_S);
                }
                driveline.shaft_force_n(torque_nm)
            });
            pad(steps, d.balance.padded)
        })
    })
}

/// How far a retarder is filled that holds the truck on descents while the accelerator is released, 0 to
/// 1: those steeper than one per cent and `offset_frac`.
pub(super) fn downhill(d: &Prepared, offset_frac: f64) -> Arc<[f64]> {
    d.profiles.get(Kind::Downhill, [offset_frac], || {
        let follow = 1.0 - (-Drive::STEP_S / OIL_FILLS_S).exp();
        let mut filled = 0.0;
        let steps = d.grade.iter().zip(&d.balance.coasts).map(|(grade, coasts)| {
            let steeper = step(-grade - DESCENT_FRAC - offset_frac, DESCENT_WIDTH_FRAC);
            filled += follow * (coasts * steeper - filled);
            filled
        });
        pad(steps, d.balance.padded)
    })
}

/// Demand of a retarder that blends in with the brakes, m/s²: grows with theirs up to a limit, and
/// comes late as the oil fills.
pub(super) fn blended_m_s2(d: &Prepared, saturation_s2_m: f64) -> Arc<[f64]> {
    d.profiles.get(Kind::Blended, [saturation_s2_m], || {
        let follow = 1.0 - (-Drive::STEP_S / OIL_FILLS_S).exp();
        let mut filled = 0.0;
        let steps = d.balance.xbr.iter().take(d.n).map(|demand| {
            filled +=
                follow * (demand.max(0.0) / (1.0 + saturation_s2_m * demand.max(0.0)) - filled);
            filled
        });
        pad(steps, d.balance.padded)
    })
}
