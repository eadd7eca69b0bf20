//! The truck's dynamics without a road, a stack and traffic.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use dynamics::{DynamicsError, RoadPatch, SUBSTEP_S, TruckParameters, TruckState};
use pyo3::prelude::*;
use sim::SimError;
use tractrix_core::{BrakeMode, Command, EgoState, GearRequest, Time};

use crate::ego::Ego;
use crate::fault::Fault;

/// Longest time of one call, s: Python hears Ctrl-C in between.
const MAX_STEP_S: f64 = 60.0;

/// A truck in one loading state, and how it moves at the moment.
#[pyclass(frozen, module = "tractrix._native")]
pub(crate) struct TruckModel {
    model: Arc<dynamics::TruckModel>,
    now: Mutex<Now>,
}

/// The state, and the road and air that it was driven in last.
#[derive(Clone, Copy)]
struct Now {
    state: TruckState,
    patch: RoadPatch,
}

#[pymethods]
impl TruckModel {
    #[new]
    #[pyo3(signature = (truck, *, payload_kg))]
    fn new(py: Python<'_>, truck: &str, payload_kg: f64) -> PyResult<Self> {
        let model = py.detach(|| {
            let parameters = TruckParameters::load(truck)?;
            dynamics::TruckModel::new(parameters, payload_kg)
        });
        let model = model.map_err(|e| Fault::of_input(&SimError::from(e)))?;
        let state = model.initial_state(0.0, 0.0, 0.0, 0.0);
        let now = Mutex::new(Now { state, patch: RoadPatch::default() });
        Ok(Self { model: Arc::new(model), now })
    }

    /// Name that the truck file gives, total mass.
    fn about(&self) -> (String, f64) {
        (self.model.parameters().name.clone(), self.model.mass_kg())
    }

    /// Puts it somewhere, straight, rolling in a fitting gear.
    fn reset(&self, x_m: f64, y_m: f64, yaw_rad: f64, speed_m_s: f64) -> PyResult<()> {
        within(&[
            ("x_m", x_m, -1e7, 1e7),
            ("y_m", y_m, -1e7, 1e7),
            ("yaw_rad", yaw_rad, -1e3, 1e3),
            ("speed_m_s", speed_m_s, 0.0, 60.0),
        ])?;
        let state = self.model.initial_state(x_m, y_m, yaw_rad, speed_m_s);
        *self.lock() = Now { state, patch: RoadPatch::default() };
        Ok(())
    }

    /// Drives on.
    #[pyo3(signature = (duration_s, *, accelerator_pedal_frac, xbr_decel_m_s2, steering_wheel_rad,
        retarder_frac, gear, grade_rad, bank_rad, wind_x_m_s, wind_y_m_s, air_temperature_k,
        air_pressure_pa, altitude_m, adhesion_coeff))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
    fn step(
        &self,
        py: Python<'_>,
        duration_s: f64,
        accelerator_pedal_frac: f64,
        xbr_decel_m_s2: f64,
        steering_wheel_rad: f64,
        retarder_frac: f64,
        gear: Option<i64>,
        grade_rad: f64,
        bank_rad: f64,
        wind_x_m_s: f64,
        wind_y_m_s: f64,
        air_temperature_k: f64,
        air_pressure_pa: f64,
        altitude_m: f64,
        adhesion_coeff: f64,
    ) -> PyResult<()> {
        let steps = (duration_s / SUBSTEP_S).round();
        let whole = (duration_s - steps * SUBSTEP_S).abs() < 1e-9;
        if !(whole && (SUBSTEP_S..=MAX_STEP_S).contains(&duration_s)) {
            let text = format!(
                "duration_s = {duration_s}: a multiple of {SUBSTEP_S} s up to {MAX_STEP_S} s"
            );
            return Err(Fault::Value(text).into());
        }
        let given = [
            ("accelerator_pedal_frac", accelerator_pedal_frac, 0.0, 1.0),
            ("xbr_decel_m_s2", xbr_decel_m_s2, 0.0, 12.5),
            ("steering_wheel_rad", steering_wheel_rad, -50.0, 50.0),
            ("retarder_frac", retarder_frac, 0.0, 1.0),
            ("grade_rad", grade_rad, -0.5, 0.5),
            ("bank_rad", bank_rad, -0.5, 0.5),
            ("wind_x_m_s", wind_x_m_s, -60.0, 60.0),
            ("wind_y_m_s", wind_y_m_s, -60.0, 60.0),
            ("air_temperature_k", air_temperature_k, 200.0, 340.0),
            ("air_pressure_pa", air_pressure_pa, 3e4, 1.2e5),
            ("altitude_m", altitude_m, -500.0, 9_000.0),
            ("adhesion_coeff", adhesion_coeff, 0.01, 2.0),
        ];
        within(&given)?;
        let gears = self.model.parameters().driveline.gear_ratios.len();
        let gear = match gear.map(u8::try_from) {
            None => GearRequest::Automatic,
            Some(Ok(0)) => GearRequest::Neutral,
            Some(Ok(gear)) if usize::from(gear) <= gears => GearRequest::Gear(gear),
            Some(_) => {
                let asked = gear.unwrap_or_default();
                let text = format!("gear = {asked}: None, 0 (neutral) or 1 to {gears}");
                return Err(Fault::Value(text).into());
            }
        };
        let command = Command {
            accelerator_pedal_frac,
            xbr_decel_m_s2,
            brake_mode: if xbr_decel_m_s2 > 0.0 { BrakeMode::Maximum } else { BrakeMode::Off },
            steering_wheel_rad,
            retarder_frac,
            gear,
        };
        let patch = RoadPatch {
            grade_rad,
            bank_rad,
            wind_m_s: (wind_x_m_s, wind_y_m_s),
            air_temperature_k,
            air_pressure_pa,
            altitude_m,
            adhesion_coeff,
        };
        let driven = py.detach(|| {
            let mut now = self.lock();
            let state = self.model.step(&now.state, &command, &patch, steps * SUBSTEP_S)?;
            *now = Now { state, patch };
            Ok::<(), DynamicsError>(())
        });
        driven.map_err(|e| Fault::of_run(&SimError::from(e)).into())
    }

    /// How it moves.
    fn state(&self) -> Ego {
        let Now { state, patch } = *self.lock();
        let time = Time::from_seconds(state.substeps as f64 * SUBSTEP_S);
        let s_m = state.distance_m;
        Ego::new(time, &EgoState { s_m, ..self.model.ego_state(&state, &patch) })
    }

    /// Another truck that goes on from here.
    fn copy(&self) -> Self {
        Self { model: Arc::clone(&self.model), now: Mutex::new(*self.lock()) }
    }
}

impl TruckModel {
    fn lock(&self) -> MutexGuard<'_, Now> {
        self.now.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Refuses what is outside its range: name, value, lowest, highest.
fn within(given: &[(&str, f64, f64, f64)]) -> Result<(), Fault> {
    match given.iter().find(|(_, value, low, high)| !(low..=high).contains(&value)) {
        Some((name, value, low, high)) => {
            Err(Fault::Value(format!("{name} = {value}: {low} to {high}")))
        }
        None => Ok(()),
    }
}
