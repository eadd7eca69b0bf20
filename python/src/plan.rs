//! The fuel-optimal plan of a trip.

use std::time::Instant;

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use sim::trip_plan::{COLUMNS, TripPlan, numbers};

use crate::fault::Fault;
use crate::provenance;

/// The text of `plan.json`, and the rows of `plan.csv` one after the other as doubles.
#[pyfunction]
#[pyo3(signature = (truck, road, *, mass_kg, set_speed_m_s, speed_min_m_s, speed_max_m_s, trip_time_s,
    eco_roll))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
#[expect(clippy::disallowed_methods, reason = "a shell measures how long planning takes")]
pub(crate) fn plan_json(
    py: Python<'_>,
    truck: String,
    road: String,
    mass_kg: f64,
    set_speed_m_s: f64,
    speed_min_m_s: f64,
    speed_max_m_s: f64,
    trip_time_s: Option<f64>,
    eco_roll: bool,
) -> Result<(String, Bound<'_, PyBytes>), Fault> {
    let (json, rows) = py.detach(|| {
        let start = Instant::now();
        let trip = TripPlan {
            truck,
            road,
            mass_kg,
            set_speed_m_s,
            speed_min_m_s,
            speed_max_m_s,
            trip_time_s,
            eco_roll,
        };
        let planned = trip
            .plan(provenance(0), &|| start.elapsed().as_secs_f64() * 1e3)
            .map_err(|e| Fault::of_input(&e))?;
        let json =
            serde_json::to_string(&planned.report).map_err(|e| Fault::Work(e.to_string()))?;
        let rows = planned.result.rows.iter().flat_map(numbers).flat_map(f64::to_ne_bytes);
        Ok((json, rows.collect::<Vec<u8>>()))
    })?;
    Ok((json, PyBytes::new(py, &rows)))
}

/// Names of the numbers in a row.
#[pyfunction]
pub(crate) fn plan_columns() -> Vec<&'static str> {
    COLUMNS.to_vec()
}
