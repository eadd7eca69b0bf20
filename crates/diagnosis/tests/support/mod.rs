//! A generator of measured drives with hidden effects: a driver in the closed loop of
//! `dynamics::TruckModel` on drawn roads, with tolerances per drive, a J1939 logger and sensor
//! noise. It shares the truck model's code with the diagnosis, but not the replay, and effects with
//! a shape (thresholds, time constants, hysteresis) are made by formulas of its own.

pub(crate) mod drive;
pub(crate) mod effects;
pub(crate) mod logger;
pub(crate) mod road;

use diagnosis::DriveSet;
use dynamics::catalogue::{Cause, cause};
use dynamics::{DynamicsError, TruckParameters};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use drive::Setting;
use effects::{Effect, Shape};
use road::between;

/// What a set of drives is like.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Campaign {
    pub(crate) drives: usize,
    pub(crate) duration_s: f64,
    /// Size of the tolerances, 1 = as usual.
    pub(crate) tolerance: f64,
}

impl Campaign {
    /// Eight drives of 25 minutes.
    pub(crate) const FULL: Self = Self { drives: 8, duration_s: 1500.0, tolerance: 1.0 };
}

/// A set of drives of the truck with hidden effects.
pub(crate) fn generate(
    base: &TruckParameters,
    hidden: &[Effect],
    campaign: &Campaign,
    seed: u64,
) -> Result<DriveSet, DynamicsError> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let truck = effects::truck(base, hidden)?;
    let mut drives = Vec::new();
    let loads = [34e3, 34e3, 19e3, 5e3, 29e3, 11.6e3, 35e3, 8e3];
    let altitudes = [200.0, 900.0, 1600.0, 300.0, 2300.0, 50.0, 700.0, 1900.0];
    let temperatures = [14.0, 27.0, 21.0, 6.0, 25.0, 36.0, 33.0, -2.0];
    for i in 0..campaign.drives {
        let k = i % 8;
        let setting = Setting {
            payload_kg: loads[k] * between(&mut rng, 0.95, 1.0),
            altitude_m: altitudes[k] + between(&mut rng, 0.0, 150.0),
            air_degc: temperatures[k] + between(&mut rng, -1.5, 1.5),
            hilliness: between(&mut rng, 0.012, 0.025),
            warm: k == 2 || k == 5,
            yaw_rad: between(&mut rng, -3.0, 3.0),
        };
        let name = format!("drive_{i}");
        drives.push(drive::drive(
            &name,
            &truck,
            hidden,
            &setting,
            campaign.duration_s,
            campaign.tolerance,
            &mut rng,
        )?);
    }
    Ok(DriveSet { truck: base.name.clone(), drives, findings: Vec::new() })
}

/// How large a hidden cause is, in prior spreads of the catalogue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Magnitude {
    Small,
    Medium,
    Large,
}

impl Magnitude {
    fn range(self) -> (f64, f64) {
        match self {
            Self::Small => (0.35, 0.55),
            Self::Medium => (0.8, 1.2),
            Self::Large => (1.6, 2.2),
        }
    }
}

/// Draws size and shape of a cause.
pub(crate) fn hide(id: &str, magnitude: Magnitude, rng: &mut ChaCha8Rng) -> Option<Effect> {
    let c: &'static Cause = cause(id)?;
    let p = &c.sizes[0];
    let (low, high) = magnitude.range();
    let mut size = p.prior_sigma * between(rng, low, high);
    if p.bounds[0] < -1e-9 && rng.random::<bool>() {
        size = (-size).max(0.9 * p.bounds[0]);
    }
    Some(Effect::Cause { id: c.id, size, shape: Shape::draw(rng) })
}
