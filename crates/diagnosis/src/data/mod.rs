//! Measured drives, whatever they come from, and what is wrong with a measurement itself.
//!
//! | file | |
//! |---|---|
//! | `channel` | columns: name, unit, plausible range |
//! | `drive` | drives in memory, on a uniform grid |
//! | `read` | a folder of drives: tables, units, defects |
//! | `index` | `drives.toml` |
//! | `table` | a table as it is written |
//! | `from_log` | from a log of the bus to drives |
//! | `clock` | offset, drift and jumps between two channels |
//! | `plausible` | do the drives belong to this truck? |
//! | `finding` | what is wrong, by drive, channel and time |

pub(crate) mod channel;
pub mod clock;
pub(crate) mod drive;
pub(crate) mod finding;
pub mod from_log;
pub(crate) mod index;
pub(crate) mod plausible;
pub(crate) mod read;
pub(crate) mod table;
