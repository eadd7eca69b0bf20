//! Questions beside the diagnosis, of the same drives.
//!
//! | file | |
//! |---|---|
//! | `identify` | a truck file from drives |
//! | `experiment` | which manoeuvres tell causes apart |
//! | `fidelity` | the truck in open loop |
//! | `whole_run` | short traces |
//! | `lateral_id` | which tyre law |
//! | `logger` | what a logger makes of the true state |
//! | `fit` | least squares with priors |

pub mod experiment;
pub mod fidelity;
pub mod fit;
pub mod identify;
pub mod lateral_id;
pub mod logger;
pub(crate) mod whole_run;
