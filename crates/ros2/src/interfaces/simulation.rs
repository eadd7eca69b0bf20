//! `simulation_interfaces` 2.1.0: the messages and services that the node answers.

use ros2_client::Message;
use serde::{Deserialize, Serialize};

use super::geometry::{Header, Pose, Twist, Vector3};

macro_rules! message {
    ($(#[$doc:meta])* $name:ident { $($(#[$field_doc:meta])* $field:ident: $kind:ty,)* }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
        pub(crate) struct $name {
            $($(#[$field_doc])* pub(crate) $field: $kind,)*
        }
        impl Message for $name {}
    };
}

message! {
    /// A request or message without fields: CDR sends one byte.
    Empty {
        structure_needs_at_least_one_member: u8,
    }
}
message! {
    /// `msg/EntityCategory`.
    EntityCategory { category: u8, }
}
message! {
    /// `msg/TagsFilter`.
    TagsFilter { tags: Vec<String>, filter_mode: u8, }
}
message! {
    /// `msg/Bounds`.
    Bounds { kind: u8, points: Vec<Vector3>, }
}
message! {
    /// `msg/EntityFilters`.
    EntityFilters {
        filter: String,
        categories: Vec<EntityCategory>,
        tags: TagsFilter,
        bounds: Bounds,
    }
}
message! {
    /// `msg/EntityState`.
    EntityState { header: Header, pose: Pose, twist: Twist, acceleration: Twist, }
}
message! {
    /// `msg/Result`.
    Outcome { result: u8, error_message: String, }
}
message! {
    /// `msg/SimulationState`.
    SimulationState { state: u8, }
}
message! {
    /// `msg/SimulatorFeatures`.
    SimulatorFeatures { features: Vec<u16>, spawn_formats: Vec<String>, custom_info: String, }
}
message! {
    /// `msg/Resource`.
    Resource { uri: String, resource_string: String, }
}
message! {
    /// `msg/WorldResource`.
    WorldResource {
        name: String,
        world_resource: Resource,
        description: String,
        tags: Vec<String>,
    }
}
message! {
    /// Response of `srv/GetSimulatorFeatures`.
    Features { features: SimulatorFeatures, }
}
message! {
    /// Response of `srv/GetSimulationState`.
    StateNow { state: SimulationState, result: Outcome, }
}
message! {
    /// Request of `srv/SetSimulationState`.
    SetState { state: SimulationState, }
}
message! {
    /// Response of the services that only say how it went, result of `action/SimulateSteps`.
    Done { result: Outcome, }
}
message! {
    /// Request of `srv/ResetSimulation`.
    Reset { scope: u8, }
}
message! {
    /// Request of `srv/StepSimulation`, goal of `action/SimulateSteps`.
    Step { steps: u64, }
}
impl Copy for Step {}
message! {
    /// Feedback of `action/SimulateSteps`.
    Progress { completed_steps: u64, remaining_steps: u64, }
}
message! {
    /// Request of `srv/GetEntities` and `srv/GetEntitiesStates`.
    Filtered { filters: EntityFilters, }
}
message! {
    /// Response of `srv/GetEntities`.
    Names { result: Outcome, entities: Vec<String>, }
}
message! {
    /// Response of `srv/GetEntitiesStates`.
    States { result: Outcome, entities: Vec<String>, states: Vec<EntityState>, }
}
message! {
    /// Request of `srv/GetEntityState`.
    OfEntity { entity: String, }
}
message! {
    /// Response of `srv/GetEntityState`.
    OneState { result: Outcome, state: EntityState, }
}
message! {
    /// Request of `srv/LoadWorld`.
    LoadWorld {
        world_resource: Resource,
        fail_on_unsupported_element: bool,
        ignore_missing_or_unsupported_assets: bool,
    }
}
message! {
    /// Response of `srv/LoadWorld` and `srv/GetCurrentWorld`.
    OneWorld { result: Outcome, world: WorldResource, }
}
message! {
    /// Request of `srv/GetAvailableWorlds`.
    FindWorlds {
        additional_sources: Vec<String>,
        filter: TagsFilter,
        offline_only: bool,
        continue_on_error: bool,
    }
}
message! {
    /// Response of `srv/GetAvailableWorlds`.
    Worlds { result: Outcome, worlds: Vec<WorldResource>, }
}

/// Result codes; those from 101 belong to a service.
impl Outcome {
    pub(crate) const FEATURE_UNSUPPORTED: u8 = 0;
    pub(crate) const OK: u8 = 1;
    pub(crate) const NOT_FOUND: u8 = 2;
    pub(crate) const INCORRECT_STATE: u8 = 3;
    pub(crate) const OPERATION_FAILED: u8 = 4;
    pub(crate) const ALREADY_IN_TARGET_STATE: u8 = 101;
    pub(crate) const STATE_TRANSITION_ERROR: u8 = 102;
    pub(crate) const INCORRECT_TRANSITION: u8 = 103;
    pub(crate) const NO_WORLD_LOADED: u8 = 101;
    pub(crate) const NO_RESOURCE: u8 = 102;

    pub(crate) fn ok() -> Self {
        Self { result: Self::OK, error_message: String::new() }
    }

    pub(crate) fn error(result: u8, why: impl Into<String>) -> Self {
        Self { result, error_message: why.into() }
    }
}
