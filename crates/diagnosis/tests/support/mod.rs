//! A generator of measured drives with hidden effects: the reference truck's data sheet as plain
//! code of its own, a driver in the loop on drawn roads, tolerances per drive, J1939 resolution and
//! rates, sensor noise. It shares nothing with the truck model or the replay of the project; causes
//! with thresholds, time constants or knees have shapes of the generator's own.

pub(crate) mod bodies;
pub(crate) mod drive;
pub(crate) mod driver;
pub(crate) mod effects;
pub(crate) mod engine;
pub(crate) mod logger;
pub(crate) mod nominal;
pub(crate) mod outside;
pub(crate) mod random;
pub(crate) mod road;
pub(crate) mod second;
pub(crate) mod sheet;

use diagnosis::{Drive, DriveSet};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use drive::Setting;
use effects::Effect;
use random::{between, normal};

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

/// Payload kg, altitude m, air °C, spread of the grade, mean grade, cruise m/s, engine brake.
const SETTINGS: [[f64; 7]; 8] = [
    [34.6e3, 290.0, 12.0, 0.014, 0.000, 24.2, 1.00],
    [34.6e3, 890.0, 32.0, 0.024, 0.006, 22.5, 0.35],
    [19.1e3, 1700.0, 22.0, 0.018, 0.000, 24.1, 1.00],
    [0.0, 410.0, 5.0, 0.012, 0.002, 24.1, 0.60],
    [28.9e3, 2290.0, 28.0, 0.028, 0.006, 22.5, 0.35],
    [11.6e3, 715.0, 37.5, 0.014, 0.003, 24.1, 1.00],
    [35.0e3, 1285.0, 16.0, 0.021, 0.008, 22.5, 0.50],
    [7.8e3, 250.0, 25.0, 0.011, 0.001, 24.0, 0.80],
];

/// A set of drives of the truck with hidden effects.
pub(crate) fn generate(hidden: &[Effect], campaign: &Campaign, seed: u64) -> DriveSet {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    set((0..campaign.drives).map(|i| one(i, hidden, campaign, &mut rng)).collect())
}

/// The same with random numbers of its own for every drive: road, load, weather and tolerances are
/// the same whatever is hidden.
pub(crate) fn generate_apart(hidden: &[Effect], campaign: &Campaign, seed: u64) -> DriveSet {
    let drives = (0..campaign.drives).map(|i| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(i as u64);
        one(i, hidden, campaign, &mut rng)
    });
    set(drives.collect())
}

fn set(drives: Vec<Drive>) -> DriveSet {
    DriveSet { truck: "reference".to_owned(), drives, findings: Vec::new() }
}

fn one(i: usize, hidden: &[Effect], campaign: &Campaign, rng: &mut ChaCha8Rng) -> Drive {
    let [payload, altitude, air, hills, climb, cruise, stage] = SETTINGS[i % 8];
    let setting = Setting {
        payload_kg: payload * between(rng, 0.97, 1.03),
        altitude_m: altitude + 30.0 * normal(rng),
        air_degc: air + 2.0 * normal(rng),
        hills: hills * between(rng, 0.8, 1.2),
        climb,
        cruise,
        engine_brake: stage,
        warm: i % 3 == 2,
    };
    let name = format!("drive_{i}");
    drive::drive(&name, hidden, &setting, campaign.duration_s, campaign.tolerance, rng)
}
