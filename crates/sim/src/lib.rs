//! The closed loop without a server: a truck model on a road in traffic, driven by the planning
//! stack through [`planner::drive_tick`], the same body that runs on a real truck.
//!
//! A [`Scenario`] says what is driven, a [`World`] drives it tick by tick, [`Metrics`] measures it.
//! Time comes from the tick counter, randomness from the seed: same seed, same bits, whatever
//! records or watches.
//!
//! Left out on purpose: clocks and pacing, sockets, files other than scenarios, roads and trucks.

mod bus_loop;
mod collision;
mod drivability;
pub mod ecu;
mod error;
mod ghost;
mod in_step;
mod lead;
mod memory;
mod metrics;
mod off_road;
mod overrides;
mod plant;
mod plant_pose;
mod run_report;
mod scenario;
mod sim_truck;
mod tick_times;
mod traffic;
mod traffic_section;
mod truck;
mod world;

pub use bus_loop::{BusFigures, BusLoop, End};
pub use collision::{Footprint, footprints_overlap};
pub use drivability::{Drivability, Drive, Spread};
pub use error::SimError;
pub use ghost::{Ghost, GhostReport};
pub use in_step::in_step;
pub use lead::LeadVehicle;
pub use memory::{MemoryRecord, MemoryRecorder};
pub use metrics::{Metrics, Summary};
pub use off_road::OffRoad;
pub use overrides::Overrides;
pub use plant::{Plant, Simulated};
pub use plant_pose::{PlantPose, PoseNoise};
pub use run_report::{EndReason, RunReport, WallClock};
pub use scenario::{EgoStart, RunLimits, Scenario, TruckSection, Weather};
pub use sim_truck::SimTruck;
pub use tick_times::{TickTime, TickTimes};
pub use traffic::{Arrivals, Traffic, read_manifest, recording_of};
pub use traffic_section::{
    Family, OnFailure, ReplaySection, SumoSection, SumoTimeouts, TrafficKind, TrafficSection,
};
pub use truck::Truck;
pub use world::{Status, World};
