//! `diagnostic_msgs`: how the stack is.

use serde::Serialize;

use super::Message;
use super::standard::{Header, names};

/// Levels of `diagnostic_msgs/msg/DiagnosticStatus`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Level {
    /// As it should be.
    Ok = 0,
    /// It goes on, but not as planned.
    Warn = 1,
    /// What it is for is not done.
    Error = 2,
}

/// `diagnostic_msgs/msg/DiagnosticArray`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct DiagnosticArray {
    pub(crate) header: Header,
    pub(crate) status: Vec<DiagnosticStatus>,
}

/// `diagnostic_msgs/msg/DiagnosticStatus`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct DiagnosticStatus {
    level: u8,
    name: &'static str,
    message: String,
    hardware_id: &'static str,
    values: Vec<KeyValue>,
}

/// `diagnostic_msgs/msg/KeyValue`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct KeyValue {
    pub(crate) key: &'static str,
    pub(crate) value: String,
}

impl DiagnosticStatus {
    /// Of a part of the stack.
    pub(crate) fn new(
        level: Level,
        name: &'static str,
        message: String,
        values: Vec<KeyValue>,
    ) -> Self {
        Self { level: level as u8, name, message, hardware_id: "tractrix", values }
    }
}

names! {
    DiagnosticArray: "diagnostic_msgs" / "DiagnosticArray";
}
