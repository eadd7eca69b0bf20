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
//! | room | files |
//! |---|---|
//! | data | `channel`, `drive`, `read`, `from_log`, `index`, `table`, `finding`, `plausible`, `clock` |
//! | causes | `hypothesis`, `param`, `sentence`; physics and words stand in `dynamics::catalogue` |
//! | replay | `plant`, `replay`, `signal`, `parts` |
//! | problem | `problem`, `course`, `baseline`, `stats` |
//! | search | `decisions`, `evidence`, `screen`, `fit`, `free`, `refit`, `search`, `gate`, `held_out`, `worth`, `weights` |
//! | outside the catalogue | `unknown`, `catch_all`, `sure` |
//! | answer | `diagnosis`, `causes`, `wrong`, `observable`, `detectable`, `gain`, `verdict`, `overlay` |
//! | run | `outcome`, `report`, `drive_use`, `table_trial`, `executor` |
//! | studies | `identify`, `experiment` with `logger` (simulated), `fidelity`, `whole_run`, `lateral_id` |
#![cfg_attr(test, allow(clippy::indexing_slicing))]

mod baseline;
mod catch_all;
mod causes;
mod channel;
pub mod clock;
mod course;
mod decisions;
mod detectable;
mod diagnosis;
mod drive;
mod drive_use;
mod error;
mod evidence;
mod executor;
pub mod experiment;
pub mod fidelity;
mod finding;
pub mod fit;
mod free;
pub mod from_log;
mod gain;
mod gate;
mod held_out;
mod hypothesis;
pub mod identify;
mod index;
pub mod lateral_id;
pub mod logger;
mod observable;
mod outcome;
mod overlay;
mod param;
mod parts;
mod plant;
mod plausible;
mod problem;
mod read;
mod refit;
mod replay;
pub mod report;
mod report_models;
mod screen;
mod search;
mod sentence;
mod signal;
mod stats;
mod sure;
mod table;
mod table_trial;
mod unknown;
mod verdict;
mod weights;
mod whole_run;
mod worth;
mod wrong;

pub use baseline::Baseline;
pub use channel::Channel;
pub use detectable::Detectable;
pub use diagnosis::{Options, Progress, diagnose, diagnose_with};
pub use drive::{CoastDown, Drive, DriveSet, RoadMap};
pub use drive_use::{DriveRole, DriveUse, SizeAlone};
pub use dynamics::catalogue::CauseKind;
pub use error::DiagnosisError;
pub use executor::{Executor, Serial, collect};
pub use finding::{Action, Finding, FindingKind};
pub use index::drives_index;
pub use outcome::{Outcome, Request, file_name};
pub use overlay::{Extension, extend};
pub use plant::Plant;
pub use read::{RawTable, read_drives, read_drives_with, read_table, read_traces};
pub use replay::Module;
pub use report_models::Models;
pub use table::Table;
pub use table_trial::{TableTrial, try_table};
pub use verdict::{
    BeforeAfter, Cause, Confusion, Diagnosis, Gain, NotObservable, Parameter, SideForcePoint,
    Unknown, Verdict, Wrong,
};
pub use whole_run::{Trace, whole_run};
