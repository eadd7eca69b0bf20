//! Messages that a node receives or answers with: owned structs whose field order is that of the
//! ROS definitions (CDR has no names).

pub(crate) mod autoware;
pub(crate) mod command;
pub mod definitions;
pub(crate) mod geometry;
pub(crate) mod simulation;
