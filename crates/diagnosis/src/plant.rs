//! The truck as the replay needs it: a truck file with its tables built.

use dynamics::TruckParameters;
use dynamics::effects::engine::Engine;
use dynamics::effects::table::TableSignal;
use dynamics::lateral::LateralParameters;
use tractrix_core::Curve;

use crate::DiagnosisError;

/// A truck file, and what is made of it once for all drives.
#[derive(Debug, Clone, PartialEq)]
pub struct Plant {
    /// Name of the truck file.
    pub name: String,
    /// Mass assumed where a drive reports none, kg: the truck file's own, with its payload.
    pub mass_kg: f64,
    /// The truck file.
    pub truck: TruckParameters,
    /// Its engine.
    pub engine: Engine,
    /// Lateral parameters, empty trailer.
    pub lateral: LateralParameters,
    /// Its fitted tables: acceleration over a signal.
    pub tables: Vec<(TableSignal, Curve)>,
}

impl Plant {
    /// The truck of a truck file. Left out are the faults of instruments that an extended truck
    /// file carries.
    ///
    /// # Errors
    /// [`DiagnosisError::Truck`] if a table cannot be used.
    pub fn of_truck(truck: &TruckParameters) -> Result<Self, DiagnosisError> {
        let bad = |e: tractrix_core::CoreError| DiagnosisError::Truck(e.to_string());
        truck.brake.pressure_table(truck.lateral.total_mass_kg()).map_err(bad)?;
        let tables = truck.table_effects.iter().map(|t| t.curve().map_err(bad));
        let mut lateral = truck.lateral;
        let mass_kg = lateral.total_mass_kg();
        lateral.payload.mass_kg = 0.0;
        Ok(Self {
            name: truck.name.clone(),
            mass_kg,
            engine: Engine::new(truck.engine.clone()).map_err(bad)?,
            tables: tables.collect::<Result<_, _>>()?,
            truck: truck.clone(),
            lateral,
        })
    }
}
