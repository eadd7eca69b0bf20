//! Native traffic: IDM car following, MOBIL lane changes, inflow, ramps, grades, the ego seen by
//! lateral overlap.
mod accelerations;
mod asleep;
mod boundary;
mod changes;
mod config;
mod driver;
mod ego;
mod engine;
mod equilibrium;
mod fill;
mod fleet;
mod from_road;
mod happenings;
mod human;
mod imagine;
mod inflow;
mod lanes;
mod neighbours;
mod publish;
mod rim;
mod source;
mod takeover;
mod window;
mod workers;

pub use boundary::Boundary;
pub use config::{ClassConfig, Density, FAMILY_MAX_SPEEDS_M_S, TrafficConfig};
pub(crate) use ego::EgoSpans;
pub use equilibrium::Capacity;
pub(crate) use from_road::lane_map;
pub use human::HumanConfig;
pub use lanes::LaneMap;
pub(crate) use publish::carry_on;
pub use source::{NativeCounts, NativeSnapshot, NativeTraffic};
pub(crate) use takeover::stopping_gap_m;
pub use window::WindowConfig;
pub use workers::{InTurn, Piece, Workers};

#[cfg(test)]
mod population_tests;
#[cfg(test)]
mod standing_tests;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod workers_tests;
