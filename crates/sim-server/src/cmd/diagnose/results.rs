//! What a diagnosis writes and says: `diagnosis.json`, `report.html`, and sentences for a terminal.

use std::path::Path;

use diagnosis::{Diagnosis, Finding, Outcome, TableTrial, Verdict};
use serde_json::{Value, json};

use super::example::{ClosedLoop, Hidden};
use super::report;
use crate::cmd::rounded;
use crate::failure::Failure;
use crate::out_folder::OutFolder;
use crate::provenance::Provenance;

/// A diagnosis with everything that goes into its files.
pub(super) struct Results {
    pub(super) outcome: Outcome,
    /// What was hidden, and the trip that closes the loop.
    pub(super) example: Option<(Hidden, ClosedLoop)>,
    pub(super) seed: u64,
}

impl Results {
    /// Writes `diagnosis.json` and `report.html`; the text of the former.
    pub(super) fn write(&self, out: &OutFolder) -> Result<String, Failure> {
        let json = self.json()?;
        let text = serde_json::to_string_pretty(&json).map_err(Failure::work)?;
        out.write("diagnosis.json", &text)?;
        let Outcome { drives_name, found, figures, extension, .. } = &self.outcome;
        let overlay = extension.overlay.as_ref().map(toml::to_string).transpose();
        let overlay = overlay.map_err(Failure::work)?;
        let example = self.example.as_ref().map(|(hidden, closed_loop)| {
            json!({ "hidden": hidden, "loop": closed_loop, "sentence": closed_loop.sentence() })
        });
        let (drives, overlay) = (drives_name.as_str(), overlay.as_deref());
        let page = report::page(found, &json, figures, drives, overlay, example);
        out.write("report.html", page)?;
        Ok(text)
    }

    /// `diagnosis.json`: the diagnosis with its provenance.
    fn json(&self) -> Result<Value, Failure> {
        let mut json = self.outcome.json(&Provenance::of_seed(self.seed)).map_err(Failure::work)?;
        if let (Some(all), Some((hidden, _))) = (json.as_object_mut(), &self.example) {
            let hidden = serde_json::to_value(hidden).map_err(Failure::work)?;
            all.insert("hidden".to_owned(), hidden);
        }
        Ok(json)
    }

    /// The diagnosis for a terminal.
    pub(super) fn sentences(&self, out: &Path) -> String {
        let Outcome { found, figures, extension, table, .. } = &self.outcome;
        let mut lines = vec![verdict(found)];
        lines.extend(figures.gains.iter().filter(|g| g.lost).map(|g| {
            format!(
                "  WORSE by {:.0} % on drives held out: {} (error {:.2e} to {:.2e}, {}), because of {}",
                -100.0 * g.fall_frac,
                g.title,
                g.before,
                g.after,
                g.quantity,
                g.blamed.join(" and ")
            )
        }));
        for cause in &found.causes {
            lines.push(format!(
                "  {} (probability {:.0} %, evidence {:.0} nats)",
                cause.sentence,
                100.0 * cause.probability,
                cause.evidence
            ));
            let effects = figures.effects.iter().filter(|e| e.id == cause.id);
            lines.extend(effects.map(|e| format!("    {}", e.sentence)));
            lines.push(format!("    {}", diagnosis::report::advice(cause.id)));
            for other in &cause.confused_with {
                let percent = 100.0 * other.probability;
                lines.push(format!("    could be {} ({percent:.0} %): {}", other.id, other.why));
            }
        }
        if let Some(u) = &found.unknown {
            let signals = u.signals.join(", ");
            lines.push(format!("  outside the catalogue: {}; it follows {signals}", u.shape));
        }
        lines.extend(table.as_ref().map(tried));
        if let Some(g) = &found.gain {
            let held_out = g.held_out.join(", ");
            let mut claimed = figures.gains.iter().filter(|g| g.claimed).peekable();
            if claimed.peek().is_none() {
                lines.push(format!(
                    "No error falls significantly on {held_out}: no gain is claimed."
                ));
            }
            for e in claimed {
                lines.push(format!(
                    "  {} on {held_out}: error {} to {} ({}), {:.0} % less ({:.0} to {:.0} %)",
                    e.title,
                    rounded(e.before, 3),
                    rounded(e.after, 3),
                    e.quantity,
                    100.0 * e.fall_frac,
                    100.0 * e.fall_frac_interval[0],
                    100.0 * e.fall_frac_interval[1],
                ));
            }
        }
        for n in &extension.not_carried {
            lines.push(format!("Not in the extended truck: {} ({})", n.id, n.why));
        }
        lines.extend(defects(&found.findings));
        if let Some(point) = &found.side_force {
            lines.push(point.sentence.clone());
        }
        if !found.tolerances_from_baseline {
            lines.push("Without a baseline the tolerances are defaults.".to_owned());
        }
        if let Some((hidden, closed_loop)) = &self.example {
            lines.push(format!(
                "Hidden was {}: {} ({:+.3} {})",
                hidden.id, hidden.meaning, hidden.size, hidden.unit
            ));
            lines.push(closed_loop.sentence());
        }
        let open = found.causes.iter().any(|c| !c.confused_with.is_empty());
        if open {
            let json = out.join("diagnosis.json");
            lines.push(format!(
                "What to drive to tell them apart: sim-server experiment suggest --truck {} \
                 --diagnosis {} --out {}",
                found.truck,
                json.display(),
                out.display()
            ));
        }
        lines.push(format!("Report: {}", out.join("report.html").display()));
        lines.join("\n")
    }
}

/// Defects of the data, a line each up to [`MOST_DEFECTS`], the rest counted.
pub(in crate::cmd) fn defects(findings: &[Finding]) -> Vec<String> {
    let of = |f: &Finding| {
        let channel = f.channel.as_ref().map_or_else(String::new, |c| format!(", {c}"));
        let at = f.time_s.map_or_else(String::new, |t| format!(" at {t:.1} s"));
        format!("Data: {}{channel}{at}: {} ({})", f.drive, f.kind, f.action)
    };
    let mut lines: Vec<String> = findings.iter().take(MOST_DEFECTS).map(of).collect();
    if let Some(more) = findings.len().checked_sub(MOST_DEFECTS).filter(|n| *n > 0) {
        lines.push(format!("Data: {more} more defects are in diagnosis.json"));
    }
    lines
}

const MOST_DEFECTS: usize = 12;

/// What came of the table as a sentence.
fn tried(table: &TableTrial) -> String {
    let speed = table.speed_rmse_m_s.map_or_else(String::new, |e| {
        let on = table.held_out.join(", ");
        format!(" (speed over 60 s on {on}: error {:.3} to {:.3} m/s)", e.before, e.after)
    });
    match &table.why_not {
        None => format!("  a fitted table of it is in the extended truck, cause unknown{speed}"),
        Some(why) => format!("  no table of it is in the extended truck: {why}{speed}"),
    }
}

/// The verdict as a sentence.
fn verdict(found: &Diagnosis) -> String {
    match found.verdict {
        Verdict::Explained => "The simulation is wrong, and this is why:",
        Verdict::NothingToExplain => "The drives fit the truck file; there is nothing to explain.",
        Verdict::Unknown => "The simulation is wrong, and no cause of the catalogue explains it.",
        Verdict::Ambiguous => "The simulation is wrong; these drives leave more than one cause:",
    }
    .to_owned()
}
