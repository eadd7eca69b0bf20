//! How a session is set now, where that may change while it drives.

use planner::SpeedPlannerKind;
use serde::Serialize;
use sim::World;

use super::{Pace, State};

/// Who decides, who sets the speed, who drives, and what is broken.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Settings {
    /// Who decides on lane changes, as `--decider` has it.
    pub(crate) decider: String,
    pub(crate) speed_planner: SpeedPlannerKind,
    /// Somebody else drives.
    pub(crate) driven_from_outside: bool,
    /// Faults that are set.
    pub(crate) faults: Vec<&'static str>,
}

impl Settings {
    pub(crate) fn of(world: &World) -> Self {
        let config = world.stack().config();
        Self {
            decider: sim::decider_word(&config.decider),
            speed_planner: config.speed_planner,
            driven_from_outside: world.stack().outside_demand().is_some(),
            faults: world.faults().map(sim::Fault::word).collect(),
        }
    }
}

/// All that commands change.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Controls {
    pub(crate) settings: Settings,
    pub(crate) set_speed_m_s: f64,
    pub(crate) pace: Pace,
}

impl Controls {
    pub(crate) fn of(world: &World, pace: Pace) -> Self {
        let set_speed_m_s = world.stack().config().set_speed_m_s;
        Self { settings: Settings::of(world), set_speed_m_s, pace }
    }
}

/// What is told when it changes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Standing {
    pub(crate) state: State,
    /// None before the first run.
    pub(crate) controls: Option<Controls>,
}
