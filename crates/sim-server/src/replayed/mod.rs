//! What a recording holds, in the places from which the stack and the truck's driver were given it.

mod again;
mod compare;
mod pair;
mod recorded;
mod setup;

pub(crate) use again::Again;
pub(crate) use compare::{Comparison, Difference};
pub(crate) use pair::compare;
pub(crate) use recorded::{
    AsRecorded, RecordedBus, RecordedPose, RecordedTraffic, RecordedVehicle,
};
pub(crate) use setup::{Setup, check_road, driver_setup};
