//! How a run is set now, where that may change while it drives.

use planner::SpeedPlannerKind;
use serde::Serialize;
use sim::World;

/// Who decides, who sets the speed, who drives, and what is broken.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Settings {
    /// Who decides on lane changes, as `--decider` has it.
    pub(super) decider: String,
    pub(super) speed_planner: SpeedPlannerKind,
    /// Somebody else drives.
    pub(super) driven_from_outside: bool,
    /// Faults that are set.
    pub(super) faults: Vec<&'static str>,
}

impl Settings {
    pub(super) fn of(world: &World) -> Self {
        let config = world.stack().config();
        Self {
            decider: sim::decider_word(&config.decider),
            speed_planner: config.speed_planner,
            driven_from_outside: world.stack().outside_demand().is_some(),
            faults: world.faults().map(sim::Fault::word).collect(),
        }
    }
}
