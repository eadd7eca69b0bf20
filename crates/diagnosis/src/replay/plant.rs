//! The truck as the replay needs it: a truck file with its tables built.

use dynamics::TruckParameters;
use dynamics::effects::engine::Engine;
use dynamics::effects::table::TableSignal;
use dynamics::lateral::LateralParameters;
use tractrix_core::Curve;

use crate::DiagnosisError;
use crate::causes::param::{P, Theta};

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
    /// The engine that the control unit believes in when it reads the pedal: the friction as it was
    /// calibrated, without the file's factor on it.
    pub(crate) control: Engine,
    /// Lateral parameters, empty trailer.
    pub lateral: LateralParameters,
    /// Its fitted tables: acceleration over a signal.
    pub tables: Vec<(TableSignal, Curve)>,
}

impl Plant {
    /// The truck of a truck file.
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
        let mut calibrated = truck.engine.clone();
        calibrated.friction_scale_coeff = 1.0;
        Ok(Self {
            control: Engine::new(calibrated).map_err(bad)?,
            name: truck.name.clone(),
            mass_kg,
            engine: Engine::new(truck.engine.clone()).map_err(bad)?,
            tables: tables.collect::<Result<_, _>>()?,
            truck: truck.clone(),
            lateral,
        })
    }

    /// Parameters off by `theta` from the truck file, counted from a truck whose instruments, map and
    /// load sheet are right: the file's own faults of these are part of the result.
    pub(crate) fn with_instruments(&self, theta: &Theta) -> Theta {
        let i = &self.truck.instruments;
        let mut t = *theta;
        for (p, scale) in [
            (P::SpeedScale, i.speed_scale_coeff),
            (P::Mass, i.mass_scale_coeff),
            (P::FuelFlow, i.fuel_flow_scale_coeff),
            (P::Co2Scale, i.co2_scale_coeff),
        ] {
            t[p as usize] = scale * (1.0 + t[p as usize]) - 1.0;
        }
        for (p, offset) in [
            (P::YawBias, i.yaw_rate_bias_rad_s),
            (P::GradeBias, i.grade_bias_frac),
            (P::MapShift, i.map_shift_m),
            (P::Bank, i.bank_offset_rad),
            (P::FuelFlowPower, i.fuel_flow_exponent_coeff),
            (P::Co2Power, i.co2_exponent_coeff),
        ] {
            t[p as usize] += offset;
        }
        t
    }
}
