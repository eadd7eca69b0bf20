//! The ways to the truck of a world.

use tractrix_core::{Command, EgoState, Stamped, Time, Vehicle, VehicleLimits};

use crate::{SimError, SimTruck, Simulated};

/// How a stack reaches the truck.
#[derive(Debug, Clone)]
pub enum Truck {
    /// State and command are handed over as they are.
    Direct(SimTruck),
}

impl Simulated for Truck {
    fn sim(&self) -> &SimTruck {
        match self {
            Self::Direct(truck) => truck,
        }
    }
}

impl Vehicle for Truck {
    type Error = SimError;

    fn ego(&mut self, now: Time) -> Result<Stamped<EgoState>, SimError> {
        match self {
            Self::Direct(truck) => Ok(truck.ego(now)?),
        }
    }

    fn command(&mut self, now: Time, command: &Command) -> Result<(), SimError> {
        match self {
            Self::Direct(truck) => Ok(truck.command(now, command)?),
        }
    }

    fn limits(&self) -> &VehicleLimits {
        self.sim().limits()
    }
}
