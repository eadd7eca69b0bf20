//! What a conversion says of its choices.

use serde::Serialize;

use super::observable::Causes;
use super::{Choice, LeftOut, Span, Unfilled};

/// What `conversion.json` holds.
#[derive(Debug, Serialize)]
pub struct Report {
    /// The truck, as the user gave it.
    pub(super) truck: String,
    /// The road, as the user gave it.
    pub(super) map: Option<String>,
    pub(super) logs: Vec<LogReport>,
    #[serde(flatten)]
    pub(super) causes: Causes,
}

/// A log.
#[derive(Debug, Serialize)]
pub(super) struct LogReport {
    pub(super) log: String,
    pub(super) duration_s: f64,
    pub(super) messages: u64,
    pub(super) channels: usize,
    pub(super) mass_kg: Option<f64>,
    pub(super) mass_from: &'static str,
    pub(super) columns: Vec<Choice>,
    pub(super) missing: Vec<Unfilled>,
    pub(super) drives: Vec<DriveReport>,
    pub(super) left_out: Vec<LeftOut>,
}

/// A drive of it.
#[derive(Debug, Serialize)]
pub(super) struct DriveReport {
    pub(super) name: String,
    #[serde(flatten)]
    pub(super) span: Span,
    pub(super) distance_m: f64,
    pub(super) on_map: bool,
    pub(super) notes: Vec<String>,
}

impl Report {
    /// What was made, for people.
    #[must_use]
    pub fn sentences(&self) -> String {
        let mut lines = Vec::new();
        for log in &self.logs {
            for drive in &log.drives {
                let place = if drive.on_map { ", on the map" } else { "" };
                lines.push(format!(
                    "{}: {:.0} s, {:.1} km{place}",
                    drive.name,
                    drive.span.duration_s(),
                    1e-3 * drive.distance_m
                ));
                lines.extend(drive.notes.iter().map(|note| format!("  {note}")));
            }
            for part in &log.left_out {
                lines.push(format!(
                    "{} at {:.0} s left out: {}",
                    log.log, part.span.from_s, part.why
                ));
            }
            lines.extend(log.columns.iter().map(Choice::sentence));
            lines.extend(log.missing.iter().map(|m| format!("  no {}: {}", m.column, m.why)));
            if log.mass_kg.is_none() {
                lines.push("  no mass: neither --mass-kg nor a message (CVW)".to_owned());
            }
        }
        lines.extend(self.causes.sentences());
        lines.join("\n")
    }
}

impl Choice {
    fn sentence(&self) -> String {
        let more = if self.others.is_empty() {
            String::new()
        } else {
            format!("; also {}", self.others.join(", "))
        };
        format!(
            "  {} from {} of {:02X} every {:.0} ms, there {:.0} % of the time{more}",
            self.column,
            self.signal,
            self.address,
            1e3 * self.period_s,
            100.0 * self.fresh_frac
        )
    }
}
