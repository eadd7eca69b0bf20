//! What the simulation gets wrong on measured drives, the named cause, the extended truck and the
//! gain.
//!
//! ```
//! use diagnosis::{Options, Plant, Serial, diagnose, read_drives};
//! use dynamics::TruckParameters;
//! use std::path::Path;
//!
//! let plant = Plant::of_truck(&TruckParameters::load("reference")?)?;
//! let drives = read_drives(Path::new("../../examples/drives"))?;
//! let baseline = read_drives(Path::new("../../examples/baseline"))?;
//! let found =
//!     diagnose(&plant, &drives, Some(&baseline), &Options::default(), &Serial, &mut |_| {})?;
//! assert!(!found.causes.is_empty()); // more drag than the truck file has
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Pure: drives, time, seeds and the [`Executor`] are arguments; only `read` and `from_log` open files
//! that they are given.
//!
//! | room | what is in it |
//! |---|---|
//! | `data` | measured drives: columns, readers, logs of a bus, clocks, defects |
//! | `causes` | hypotheses and their parameters; physics and words stand in [`dynamics::catalogue`] |
//! | `replay` | every module of the truck model driven by measured signals: residuals |
//! | `problem` | a set of drives in one metric: tolerances, courses, what a baseline teaches |
//! | `search` | from nothing to a set of causes, by evidence |
//! | `outside` | what the catalogue does not have |
//! | `answer` | causes with probabilities, gain, the extended truck, the verdict |
//! | `run` | the whole loop and what goes into its files |
//! | `studies` | `identify`, `experiment`, fidelity, tyre laws |
#![cfg_attr(test, allow(clippy::indexing_slicing))]

mod answer;
mod causes;
mod data;
mod error;
mod outside;
mod problem;
mod replay;
mod run;
mod search;
mod studies;

pub use answer::detectable::Detectable;
pub use answer::overlay::{Extension, extend};
pub use answer::verdict::{
    BeforeAfter, Cause, Confusion, Diagnosis, Gain, NotObservable, Parameter, SideForcePoint,
    Unknown, Verdict, Wrong,
};
pub use data::channel::Channel;
pub use data::drive::{CoastDown, Drive, DriveSet, RoadMap};
pub use data::finding::{Action, Finding, FindingKind};
pub use data::index::drives_index;
pub use data::read::{RawTable, read_drives, read_drives_with, read_table, read_traces};
pub use data::table::Table;
pub use data::{clock, from_log};
pub use dynamics::catalogue::CauseKind;
pub use error::DiagnosisError;
pub use problem::baseline::{Baseline, ScatterOfSize};
pub use problem::noise::NoiseOfSums;
pub use replay::Module;
pub use replay::plant::Plant;
pub use run::diagnose::{Options, Progress, diagnose, diagnose_with};
pub use run::drive_use::{DriveRole, DriveUse, SizeAlone};
pub use run::executor::{Executor, Serial, collect};
pub use run::outcome::{Outcome, Request, file_name};
pub use run::report;
pub use run::report_models::Models;
pub use run::table_trial::{TableTrial, try_table};
pub use studies::whole_run::{Trace, whole_run};
pub use studies::{experiment, fidelity, fit, identify, lateral_id, logger};
