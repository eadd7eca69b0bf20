//! The native half of the Python package `tractrix`.
//!
//! The package's Python modules are what users see; this crate turns their calls into calls of
//! [`sim`] and the results into plain Python objects: numbers, words, dictionaries, JSON text, and
//! bytes that NumPy reads as a table. The only crate that knows PyO3. As a shell it reads the clock,
//! to measure ticks and to let Python look at signals.
//!
//! Left out on purpose: everything that can be said in Python without loss.

mod batch;
mod decision;
mod diagnose;
mod drives;
mod ego;
mod fault;
mod plan;
mod policy;
mod scenario;
mod scene;
mod truck_model;
mod world;

/// What produced an output that this seed determines.
const fn provenance(seed: u64) -> tractrix_core::Provenance {
    tractrix_core::Provenance {
        schema: 1,
        version: env!("CARGO_PKG_VERSION"),
        git_revision: shell::GIT_REVISION,
        seed,
    }
}

/// What `tractrix` is made of; not to be imported by users.
#[pyo3::pymodule]
mod _native {
    #[pymodule_export]
    use crate::batch::Batch;
    #[pymodule_export]
    use crate::diagnose::diagnose_json;
    #[pymodule_export]
    use crate::drives::drives_from_logs;
    #[pymodule_export]
    use crate::plan::{plan_columns, plan_json};
    #[pymodule_export]
    use crate::policy::{Policy, observation_hash, observation_size};
    #[pymodule_export]
    use crate::scenario::{scenario_json, scenario_list};
    #[pymodule_export]
    use crate::truck_model::TruckModel;
    #[pymodule_export]
    use crate::world::{Snapshot, World};

    #[pymodule_init]
    fn init(module: &pyo3::Bound<'_, pyo3::types::PyModule>) -> pyo3::PyResult<()> {
        use pyo3::types::PyModuleMethods as _;
        module.add("VERSION", env!("CARGO_PKG_VERSION"))?;
        module.add("GIT_REVISION", shell::GIT_REVISION)
    }
}
