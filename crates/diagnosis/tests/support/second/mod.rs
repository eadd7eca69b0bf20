//! The second family of generated drives, written apart from the first and from the diagnosis:
//! other laws for every cause (gates, knees, memory, points of attack), another driver, other roads,
//! and noise of the process itself (gusts along the road, surface, errors of the map, torque that
//! drifts). Sizes have the units of the first family, so that named sizes can be judged. It reports
//! only: nothing of the diagnosis may be tuned on it. Common to both families are the data sheet,
//! the logger, drawn numbers and the list of causes.

pub(crate) mod braking;
pub(crate) mod chassis;
pub(crate) mod colour;
pub(crate) mod drive;
pub(crate) mod driver;
pub(crate) mod engine;
pub(crate) mod faults;
pub(crate) mod gearbox;
pub(crate) mod instruments;
pub(crate) mod meters;
pub(crate) mod outside;
pub(crate) mod resistance;
pub(crate) mod road;
pub(crate) mod steering;
pub(crate) mod tolerances;
pub(crate) mod wind;

use diagnosis::DriveSet;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::Campaign;
use super::effects::Effect;
use super::random::{between, normal};

/// Where, when and with what a drive goes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Trip {
    pub(crate) payload_kg: f64,
    pub(crate) altitude_m: f64,
    pub(crate) air_degc: f64,
    /// Standard deviation of the grade.
    pub(crate) hills: f64,
    pub(crate) climb: f64,
    pub(crate) cruise_m_s: f64,
    /// Highest stage of the engine brake that the driver takes.
    pub(crate) most_stage: f64,
    pub(crate) warm: bool,
}

/// Payload t, altitude m, air °C, spread of the grade, mean grade, cruise m/s, engine brake, warm.
const TRIPS: [[f64; 8]; 8] = [
    [24.0, 520.0, 18.0, 0.016, 0.001, 23.6, 0.8, 0.0],
    [35.0, 1450.0, 30.0, 0.024, 0.005, 22.0, 0.4, 0.0],
    [4.0, 330.0, 3.0, 0.013, 0.000, 24.3, 1.0, 1.0],
    [30.5, 2150.0, 24.0, 0.026, 0.007, 22.3, 0.4, 0.0],
    [15.0, 800.0, 35.5, 0.015, 0.003, 23.8, 0.6, 1.0],
    [34.0, 200.0, 9.0, 0.018, 0.001, 23.9, 1.0, 0.0],
    [21.5, 1050.0, 26.5, 0.021, 0.006, 22.8, 0.6, 0.0],
    [9.5, 1800.0, 14.0, 0.014, 0.002, 24.0, 0.8, 1.0],
];

/// A set of drives; road, load, weather and tolerances are the same whatever is hidden.
pub(crate) fn generate(hidden: &[Effect], campaign: &Campaign, seed: u64) -> DriveSet {
    let drives = (0..campaign.drives).map(|i| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x00fa_3117);
        rng.set_stream(i as u64);
        let [t, altitude, air, hills, climb, cruise, stage, warm] = TRIPS[i % TRIPS.len()];
        let trip = Trip {
            payload_kg: 1e3 * t * between(&mut rng, 0.95, 1.0),
            altitude_m: altitude + between(&mut rng, -50.0, 50.0),
            air_degc: air + 2.5 * normal(&mut rng),
            hills: hills * between(&mut rng, 0.85, 1.15),
            climb,
            cruise_m_s: cruise,
            most_stage: stage,
            warm: warm > 0.0,
        };
        drive::drive(&format!("drive_{i}"), hidden, &trip, campaign, &mut rng)
    });
    DriveSet { truck: "reference".to_owned(), drives: drives.collect(), findings: Vec::new() }
}
