//! The closed loop without a server: a truck model on a road in traffic, driven by the planning
//! stack through [`planner::drive_tick`], the same body that runs on a real truck.
//!
//! A [`Scenario`] says what is driven, a [`World`] drives it tick by tick, [`Metrics`] measures it.
//! Time comes from the tick counter, randomness from the seed: same seed, same bits, whatever
//! records or watches.
//!
//! Left out on purpose: clocks and pacing, sockets, files other than scenarios, roads and trucks.
//!
//! ```
//! use sim::{Scenario, World};
//!
//! let mut scenario = Scenario::builtin("highway")?;
//! scenario.run.duration_s = 5.0;
//! let summary = World::new(&scenario, 1)?.run(&mut ())?;
//! assert!(summary.collisions == 0 && summary.distance_m > 90.0);
//! # Ok::<(), sim::SimError>(())
//! ```
//!
//! A trip is planned with what the truck tells about itself:
//!
//! ```
//! use planner::pcc::{SpeedBand, TripRequest, Tuning, plan_trip, profile_of};
//! use tractrix_core::Vehicle;
//!
//! let world = sim::World::new(&sim::Scenario::builtin("highway-empty")?, 1)?;
//! let trip = plan_trip(&TripRequest {
//!     profile: &profile_of(world.road(), 25.0)[..160],
//!     truck: world.truck().limits(),
//!     band: SpeedBand { set_m_s: 22.2, min_m_s: 20.0, max_m_s: 24.4 },
//!     trip_time_s: None,
//!     eco_roll: false,
//!     tuning: Tuning::default(),
//! })?;
//! assert!(trip.saving_vs_set_speed_frac > 0.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod batch;
mod behind;
mod bus_loop;
mod collision;
mod drivability;
pub mod ecu;
mod error;
mod fault;
mod ghost;
mod in_step;
mod lead;
mod memory;
mod metrics;
mod off_road;
mod outside;
mod overrides;
mod plant;
mod plant_pose;
mod run_report;
mod scenario;
mod sim_truck;
mod stack_change;
mod tick_times;
mod traffic;
mod traffic_section;
pub mod trip_plan;
mod truck;
mod world;

pub use bus_loop::{BusFigures, BusLoop, End, bus_driver_setup};
pub use collision::{Footprint, footprints_overlap};
pub use drivability::{Drivability, Drive, Spread};
pub use error::SimError;
pub use fault::Fault;
pub use ghost::{Ghost, GhostReport};
pub use in_step::in_step;
pub use lead::LeadVehicle;
pub use memory::{MemoryRecord, MemoryRecorder};
pub use metrics::{Metrics, Summary};
pub use off_road::OffRoad;
pub use overrides::{Overrides, decider_word};
pub use plant::{Plant, Simulated};
pub use plant_pose::{PlantPose, PoseNoise, pose_of};
pub use run_report::{EndReason, RunReport, WallClock};
pub use scenario::{EgoStart, RunLimits, Scenario, TruckSection, Weather};
pub use sim_truck::SimTruck;
pub use stack_change::StackChange;
pub use tick_times::{TickTime, TickTimes};
pub use traffic::{Arrivals, Traffic, read_manifest, recording_of, road_fingerprint};
pub use traffic_section::{
    Family, OnFailure, ReplaySection, SumoSection, SumoTimeouts, TrafficKind, TrafficSection,
};
pub use truck::Truck;
pub use world::{Status, World, policy_files, read_policy, stack_of};
