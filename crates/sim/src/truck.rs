//! The ways to the truck of a world.

use tractrix_core::{Command, EgoState, Stamped, Time, Vehicle, VehicleLimits, VehicleStatus};

use crate::ecu::Ahead;
use crate::{BusLoop, SimError, SimTruck, Simulated};

/// How a stack reaches the truck. A clone goes on bit for bit like its original, except over a bus
/// outside of this process, of which there is one: the clone's next tick is an error that says so.
#[derive(Debug)]
pub enum Truck {
    /// State and command are handed over as they are.
    Direct(SimTruck),
    /// Over a bus, as a real truck is.
    Bus(Box<BusLoop>),
    /// The clone of one on a bus outside.
    Detached(SimTruck),
}

impl Truck {
    /// The true state as of the last tick, where the stack gets another one.
    pub(crate) fn truth(&self) -> Option<&EgoState> {
        match self {
            Self::Bus(looped) => Some(looped.truth()),
            Self::Direct(_) | Self::Detached(_) => None,
        }
    }

    /// Shows the truck's own radar what is ahead.
    pub(crate) fn see(&mut self, ahead: Option<Ahead>) {
        if let Self::Bus(looped) = self {
            looped.see(ahead);
        }
    }
}

impl Clone for Truck {
    fn clone(&self) -> Self {
        match self {
            Self::Direct(truck) => Self::Direct(truck.clone()),
            Self::Detached(truck) => Self::Detached(truck.clone()),
            Self::Bus(looped) => match looped.fork() {
                Some(fork) => Self::Bus(Box::new(fork)),
                None => Self::Detached(looped.sim().clone()),
            },
        }
    }
}

impl Simulated for Truck {
    fn sim(&self) -> &SimTruck {
        match self {
            Self::Direct(truck) | Self::Detached(truck) => truck,
            Self::Bus(looped) => looped.sim(),
        }
    }
}

/// What the clone of a run on a bus outside says.
fn detached() -> SimError {
    SimError::Drive("a copy of a run over a bus cannot go on: there is one bus".to_owned())
}

impl Vehicle for Truck {
    type Error = SimError;

    fn ego(&mut self, now: Time) -> Result<Stamped<EgoState>, SimError> {
        match self {
            Self::Direct(truck) => Ok(truck.ego(now)?),
            Self::Bus(looped) => looped.ego(now),
            Self::Detached(_) => Err(detached()),
        }
    }

    fn command(&mut self, now: Time, command: &Command) -> Result<(), SimError> {
        match self {
            Self::Direct(truck) => Ok(truck.command(now, command)?),
            Self::Bus(looped) => looped.command(now, command),
            // drive_tick lets go before it reports that the state could not be read
            Self::Detached(_) => Ok(()),
        }
    }

    fn limits(&self) -> &VehicleLimits {
        match self {
            Self::Direct(truck) | Self::Detached(truck) => truck.limits(),
            Self::Bus(looped) => looped.limits(),
        }
    }

    fn status(&self) -> VehicleStatus {
        match self {
            Self::Bus(looped) => looped.status(),
            Self::Direct(_) | Self::Detached(_) => VehicleStatus::default(),
        }
    }
}
