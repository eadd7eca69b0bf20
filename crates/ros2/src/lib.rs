//! The ROS 2 node of a simulation, without a ROS installation (`ros2-client` over RustDDS).
//!
//! - [`Node`] joins a domain: it publishes every topic of a recording with the recording's own bytes
//!   ([`Node::listener`]), takes commands, and answers `simulation_interfaces`;
//! - [`Names`] shows the truck under Autoware's names too;
//! - [`Simulator`] is the door to whoever runs the simulation;
//! - [`Network`] says which domain, and who can find the node (this machine unless asked);
//! - [`definitions`] are the field lists that a peer builds.
//!
//! Rates are those of the recording, and at most ten times that in wall time when the run is faster
//! than real time. Nothing here holds the run up. DDS authenticates nobody: whoever reaches the
//! domain can command the run.

mod autoware;
mod bytes;
mod error;
mod feed;
mod interfaces;
mod network;
mod node;
mod room;
mod services;
mod simulator;
mod steps;

pub use autoware::Names;
pub use error::Ros2Error;
pub use interfaces::definitions;
pub use network::{Network, Reach};
pub use node::Node;
pub use simulator::{
    Direction, Entities, Entity, Refused, Request, Simulator, State, World, WorldSource,
};
