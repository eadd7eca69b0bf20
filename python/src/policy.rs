//! A learned policy's forward pass, the one that drives the truck.

use std::path::PathBuf;

use planner::decider::observation::ObservationSpec;
use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;
use sim::SimError;

use crate::fault::Fault;

/// What the words for an environment's kind observe.
const SPECS: [(&str, ObservationSpec); 2] =
    [("ours", ObservationSpec::Tractrix1), ("paper", ObservationSpec::Paper216)];

fn named(spec: &str) -> Result<ObservationSpec, Fault> {
    let known = SPECS.iter().find(|(word, _)| *word == spec);
    let (_, of) = known.ok_or_else(|| Fault::Value(format!("spec = {spec:?}: ours or paper")))?;
    Ok(*of)
}

/// The hash of an observation that a policy's sidecar has to name.
#[pyfunction]
pub(crate) fn observation_hash(spec: &str) -> Result<String, Fault> {
    Ok(format!("{:016x}", named(spec)?.hash()))
}

/// Numbers in an observation.
#[pyfunction]
pub(crate) fn observation_size(spec: &str) -> Result<usize, Fault> {
    Ok(named(spec)?.size())
}

/// Weights with their sidecar.
#[pyclass(frozen, module = "tractrix._native")]
pub(crate) struct Policy {
    inner: planner::decider::Policy,
    sidecar: String,
}

#[pymethods]
impl Policy {
    /// Reads a file of weights and the `.json` beside it, or `builtin:table2`.
    #[new]
    fn new(py: Python<'_>, file: PathBuf) -> PyResult<Self> {
        let read = || {
            let (weights, sidecar) = sim::policy_files(&file)?;
            let inner = planner::decider::Policy::from_files(&weights, &sidecar)?;
            Ok(Self { inner, sidecar })
        };
        py.detach(read).map_err(|e: SimError| Fault::of_input(&e).into())
    }

    /// The text beside the weights.
    fn sidecar(&self) -> &str {
        &self.sidecar
    }

    /// The kind of environment that makes the policy's observation.
    fn spec(&self) -> &'static str {
        let known = SPECS.iter().find(|(_, of)| *of == self.inner.spec());
        known.map_or("", |(word, _)| word)
    }

    /// Numbers in an observation.
    fn observation_size(&self) -> usize {
        self.inner.spec().size()
    }

    /// Writes the values of the actions, in output order, for rows of observations.
    fn values(
        &self,
        py: Python<'_>,
        observations: PyBuffer<f32>,
        out: PyBuffer<f32>,
    ) -> PyResult<()> {
        let observations = observations.to_vec(py)?;
        let values: Vec<f32> = py.detach(|| {
            let mut scratch = self.inner.scratch();
            let rows = observations.chunks_exact(self.observation_size());
            rows.flat_map(|row| self.inner.values(row, &mut scratch)).collect()
        });
        out.copy_from_slice(py, &values)
    }
}
