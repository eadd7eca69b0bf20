//! The whole loop, for every shell.
//!
//! | file | |
//! |---|---|
//! | `diagnose` | drives in, diagnosis out |
//! | `executor` | where the work runs |
//! | `drive_use` | what each drive was used for |
//! | `table_trial` | what has no name as a table in the truck |
//! | `report_models` | the two models of a report |
//! | `report` | what a report shows |
//! | `outcome` | everything that goes into files |

pub(crate) mod diagnose;
pub(crate) mod drive_use;
pub(crate) mod executor;
pub(crate) mod outcome;
pub mod report;
pub(crate) mod report_models;
pub(crate) mod table_trial;
