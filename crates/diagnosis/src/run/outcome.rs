//! A diagnosis with everything that goes into its files, for every shell: the report's figures, the
//! extended truck, `diagnosis.json`.

use std::collections::BTreeMap;
use std::path::Path;

use dynamics::{Overlay, TruckParameters};
use serde::Serialize;
use serde_json::{Value, json};

use crate::causes::hypothesis::CATALOGUE;
use crate::run::report::{Report, report};
use crate::{
    Cause, Diagnosis, DiagnosisError, DriveSet, Executor, Extension, NotObservable, Options, Plant,
    Progress, TableTrial, Verdict, diagnose, extend, try_table,
};

/// What is asked for.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// The truck file that the simulation uses.
    pub truck: &'a TruckParameters,
    /// Its built-in name or path, as the user gave it.
    pub truck_name: &'a str,
    /// The measured drives.
    pub drives: &'a DriveSet,
    /// Where they came from; the last part names them in the files.
    pub drives_at: &'a Path,
    /// Drives that are known to be in order.
    pub baseline: Option<&'a DriveSet>,
    /// Choices.
    pub options: &'a Options,
    /// Tries what is left without a name as a table.
    pub table_effect: bool,
    /// Seed of the intervals of the gain.
    pub seed: u64,
}

/// A diagnosis with everything that goes into its files.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// What the drives are called.
    pub drives_name: String,
    /// The diagnosis.
    pub found: Diagnosis,
    /// Figures of the report.
    pub figures: Report,
    /// The extended truck.
    pub extension: Extension,
    /// What is left without a name, tried as a table.
    pub table: Option<TableTrial>,
    /// Files of the extended truck: name and text. The truck file that it builds on is among them,
    /// if it is not built in.
    pub truck_files: Vec<(String, String)>,
}

impl Request<'_> {
    /// Diagnoses the drives, computes the report's figures and extends the truck.
    ///
    /// # Errors
    /// Drives that cannot be used, a drive to hold out that does not exist, another truck.
    pub fn run(
        &self,
        executor: &dyn Executor,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Outcome, DiagnosisError> {
        let (drives, baseline, options) = (self.drives, self.baseline, self.options);
        let plant = Plant::of_truck(self.truck)?;
        let found = diagnose(&plant, drives, baseline, options, executor, progress)?;
        progress(Progress::Report);
        let figures = report(&plant, drives, baseline, options, &found, self.seed)?;
        let last = self.drives_at.file_name();
        let drives_name =
            last.map_or_else(|| "drives".to_owned(), |n| n.to_string_lossy().into_owned());
        let origin = format!("diagnosis of {} on {drives_name}", found.truck);
        let table = self
            .table_effect
            .then(|| try_table(self.truck, drives, options, &found, &origin, executor))
            .transpose()?;
        let extension = Extension { overlay: None, not_carried: Vec::new() };
        let truck_files = Vec::new();
        let mut outcome = Outcome { drives_name, found, figures, extension, table, truck_files };
        outcome.doubt();
        outcome.extend(self, &origin)?;
        Ok(outcome)
    }
}

impl Outcome {
    /// Causes that make an error on the drives held out larger are not sure.
    fn doubt(&mut self) {
        let Self { found, figures, .. } = self;
        for g in figures.gains.iter().filter(|g| g.lost) {
            for cause in found.causes.iter_mut().filter(|c| g.blamed.contains(&c.id)) {
                let doubt =
                    format!(" Not sure: drives held out have more error in {}.", g.quantity);
                if !cause.sentence.ends_with(&doubt) {
                    cause.sentence.push_str(&doubt);
                }
                if found.verdict == Verdict::Explained {
                    found.verdict = Verdict::Ambiguous;
                }
            }
        }
    }

    fn extend(&mut self, request: &Request<'_>, origin: &str) -> Result<(), DiagnosisError> {
        let name = file_name(&request.truck.name);
        let built_in = TruckParameters::names().any(|n| n == request.truck_name);
        let base =
            if built_in { request.truck_name.to_owned() } else { format!("{name}.base.toml") };
        let extended = format!("{name}.extended");
        self.extension = match &self.found.gain {
            Some(gain) if !gain.significant => Extension {
                overlay: None,
                not_carried: not_carried(&self.found.causes, |_| Some(NOT_SIGNIFICANT.to_owned())),
            },
            _ => {
                let causes = &self.found.causes;
                let kept = causes.iter().filter(|c| self.speaks_against(c).is_none());
                let kept: Vec<Cause> = kept.cloned().collect();
                let mut out = extend(request.truck, &base, &extended, &kept, origin);
                out.not_carried.extend(not_carried(causes, |c| self.speaks_against(c)));
                out
            }
        };
        if let Some(effect) = self.table.as_ref().and_then(|t| t.effect.clone()) {
            let overlay = self.extension.overlay.get_or_insert_with(|| Overlay {
                schema: 1,
                base: base.clone(),
                name: extended.clone(),
                set: BTreeMap::new(),
                table_effects: Vec::new(),
            });
            overlay.table_effects.push(effect);
        }
        self.found.extended_truck = None;
        if let Some(overlay) = &self.extension.overlay {
            let text = |e: toml::ser::Error| DiagnosisError::Truck(e.to_string());
            if !built_in {
                self.truck_files.push((base, toml::to_string(request.truck).map_err(text)?));
            }
            let file = format!("{extended}.toml");
            self.truck_files.push((file.clone(), toml::to_string(overlay).map_err(text)?));
            self.found.extended_truck = Some(file);
        }
        Ok(())
    }

    /// Why a cause must not enter the extended truck: what it does makes an error on the drives held
    /// out larger beyond its interval, or its size is where the search was not allowed to go on.
    fn speaks_against(&self, cause: &Cause) -> Option<String> {
        let hypotheses = || CATALOGUE.iter().filter(|h| h.id == cause.id);
        let models = &self.found.models;
        if hypotheses().any(|h| h.is_at_bound(&models.after, &models.before)) {
            return Some("its size has run to a bound".to_owned());
        }
        let mut lost = self.figures.gains.iter().filter(|g| g.lost);
        let worse = lost.find(|g| g.blamed.contains(&cause.id))?;
        Some(format!(
            "on the drives held out the error of {} grows by {:.0} % ({:.3e} to {:.3e})",
            worse.quantity,
            -100.0 * worse.fall_frac,
            worse.before,
            worse.after
        ))
    }

    /// Writes the extended truck into a folder that exists, and loads it again.
    ///
    /// # Errors
    /// [`DiagnosisError::Io`] names the file; [`DiagnosisError::Truck`] if it does not load.
    pub fn write_truck(&self, folder: &Path) -> Result<(), DiagnosisError> {
        for (name, text) in &self.truck_files {
            let path = folder.join(name);
            std::fs::write(&path, text)
                .map_err(|e| DiagnosisError::Io { path, why: e.to_string() })?;
        }
        self.check_truck(folder)
    }

    /// Loads the extended truck from the folder that its files were written into.
    ///
    /// # Errors
    /// [`DiagnosisError::Truck`] if it does not load.
    pub fn check_truck(&self, folder: &Path) -> Result<(), DiagnosisError> {
        if let Some(file) = &self.found.extended_truck {
            TruckParameters::load(&folder.join(file).display().to_string())
                .map_err(|e| DiagnosisError::Truck(e.to_string()))?;
        }
        Ok(())
    }

    /// The object of `diagnosis.json`; `provenance` gives its first keys.
    ///
    /// # Errors
    /// A number or key that JSON does not have.
    pub fn json(&self, provenance: &impl Serialize) -> Result<Value, serde_json::Error> {
        let mut json = serde_json::to_value(provenance)?;
        let rest = serde_json::to_value(&self.found)?;
        if let (Some(all), Value::Object(rest)) = (json.as_object_mut(), rest) {
            all.extend(rest);
            let lost = self.extension.not_carried.iter();
            let lost: Vec<Value> = lost.map(|n| json!({ "id": n.id, "why": n.why })).collect();
            all.insert("not_carried".to_owned(), lost.into());
            all.insert("effects".to_owned(), serde_json::to_value(&self.figures.effects)?);
            if let Some(Value::Object(gain)) = all.get_mut("gain") {
                gain.insert("errors".to_owned(), serde_json::to_value(&self.figures.gains)?);
            }
            if let Some(table) = &self.table {
                all.insert("table_effect".to_owned(), serde_json::to_value(table)?);
            }
        }
        Ok(json)
    }
}

const NOT_SIGNIFICANT: &str = "the drives held out do not show that it makes the truck better";

/// The causes that `why` gives a reason for.
fn not_carried(causes: &[Cause], why: impl Fn(&Cause) -> Option<String>) -> Vec<NotObservable> {
    let of = |c: &Cause| {
        let why = why(c)?;
        Some(NotObservable { id: c.id, why, missing_channels: Vec::new() })
    };
    causes.iter().filter_map(of).collect()
}

/// A truck's name as a file name.
#[must_use]
pub fn file_name(name: &str) -> String {
    name.chars().map(|c| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' }).collect()
}
