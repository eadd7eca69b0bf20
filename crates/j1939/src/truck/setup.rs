//! All that a driver of a truck was set up with, so that a recording can hold it.

use serde::{Deserialize, Serialize};
use tractrix_core::{CoreError, PoseSource, VehicleLimits};

use super::{BusTruck, BusTruckConfig};
use crate::BitRate;
use crate::bus::Bus;
use crate::steering::ExampleSteering;

/// What a [`BusTruck`] with the example steering frame, or none, is made of beside its bus, its pose
/// and the truck's sheet.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriverSetup {
    /// Bit rate of the bus.
    pub rate: BitRate,
    /// Addresses, carriers and limits.
    pub config: BusTruckConfig,
    /// Key of the example steering frame; none: the truck is not steered.
    pub steering_key: Option<u8>,
}

impl DriverSetup {
    /// The driver, not engaged.
    ///
    /// # Errors
    /// If the sheet cannot be planned with.
    pub fn driver<B: Bus, P: PoseSource>(
        &self,
        bus: B,
        pose: P,
        limits: VehicleLimits,
    ) -> Result<BusTruck<B, P, ExampleSteering>, CoreError> {
        let steering = self.steering_key.map(ExampleSteering::new);
        BusTruck::new(bus, self.rate, pose, steering, limits, self.config)
    }
}
