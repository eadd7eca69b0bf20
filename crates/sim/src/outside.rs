//! What of a scenario reaches out of the program: files that it reads, programs that it starts.

use dynamics::TruckParameters;

use crate::scenario::Scenario;
use crate::traffic_section::SumoSection;

impl Scenario {
    /// Keys that name a file or a program, or give a program options. A scenario whose text comes
    /// from a network should have none of them: it would read any file of this machine, and start
    /// any program.
    #[must_use]
    pub fn reaches_out(&self) -> Vec<&'static str> {
        let SumoSection { type_attributes, timeouts, .. } = &self.traffic.sumo;
        let harmless = SumoSection {
            type_attributes: type_attributes.clone(),
            timeouts: *timeouts,
            ..SumoSection::default()
        };
        let is_builtin = |file: &str| file.starts_with("builtin:");
        [
            ("road", !is_builtin(&self.road)),
            ("truck.file", !TruckParameters::names().any(|name| name == self.truck.file)),
            ("policy_file", self.policy_file.as_ref().is_some_and(|file| !is_builtin(file))),
            ("traffic.manifest", self.traffic.manifest.is_some()),
            ("traffic.detectors", self.traffic.detectors.is_some()),
            ("traffic.replay.file", self.traffic.replay.file.is_some()),
            ("traffic.sumo", self.traffic.sumo != harmless),
        ]
        .into_iter()
        .filter_map(|(key, reaches)| reaches.then_some(key))
        .collect()
    }

    /// The files among what [`Self::reaches_out`] names, by their keys.
    pub fn files_mut(&mut self) -> Vec<(&'static str, &mut String)> {
        let outside = self.reaches_out();
        let traffic = &mut self.traffic;
        [
            ("road", Some(&mut self.road)),
            ("truck.file", Some(&mut self.truck.file)),
            ("policy_file", self.policy_file.as_mut()),
            ("traffic.manifest", traffic.manifest.as_mut()),
            ("traffic.detectors", traffic.detectors.as_mut()),
            ("traffic.replay.file", traffic.replay.file.as_mut()),
        ]
        .into_iter()
        .filter_map(|(key, file)| outside.contains(&key).then_some((key, file?)))
        .collect()
    }
}
