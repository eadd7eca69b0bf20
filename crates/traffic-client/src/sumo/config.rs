//! What a user sets about SUMO, and its check.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::demand::is_type;
use super::link::Timeouts;
use crate::TrafficError;
use crate::native::TrafficConfig;

/// What a user sets about SUMO.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SumoConfig {
    /// The traffic; `sees_ego` chooses between the modes `inter` and `pure`.
    pub traffic: TrafficConfig,
    /// The native `sumo`; `None`: looked for, see `Programs::find`.
    pub binary: Option<PathBuf>,
    /// Waiting times.
    pub timeouts: Timeouts,
    /// Further options for SUMO, as on its command line.
    pub options: Vec<String>,
    /// SUMO's additional files (detectors, signal programs, vehicle types, ...), loaded after ours.
    pub additional_files: Vec<PathBuf>,
    /// Further options for netconvert, such as `--tls.set`, which makes traffic lights.
    pub netconvert_options: Vec<String>,
    /// Attributes of SUMO's vehicle types `car`, `van`, `truck`, in place of ours or beside them:
    /// `carFollowModel`, `laneChangeModel`, `lcAssertive`, ...
    pub type_attributes: TypeAttributes,
}

/// Attributes of vehicle types: type, then attribute and value.
pub type TypeAttributes = BTreeMap<String, BTreeMap<String, String>>;

impl SumoConfig {
    /// Whether the user sets an option of SUMO, as `--name value` or `--name=value`.
    pub(super) fn has_option(&self, name: &str) -> bool {
        self.options.iter().any(|o| o.split('=').next() == Some(name))
    }

    /// SUMO itself says nothing of a missing file before it is gone, so this is said here.
    pub(super) fn check_files_and_types(&self) -> Result<(), TrafficError> {
        let bad = |why: String| Err(TrafficError::Config { why });
        if let Some(missing) = self.additional_files.iter().find(|file| !file.is_file()) {
            return bad(format!("sumo.additional_files: no file {}", missing.display()));
        }
        for (name, attributes) in &self.type_attributes {
            if !is_type(name) {
                return bad(format!("sumo.type_attributes.{name}: not one of car, van, truck"));
            }
            let plain = |text: &str| !text.contains(['"', '<', '&']);
            if let Some((key, value)) =
                attributes.iter().find(|(key, value)| !plain(key) || !plain(value))
            {
                return bad(format!("sumo.type_attributes.{name}.{key} = {value:?} is not plain"));
            }
        }
        Ok(())
    }
}
