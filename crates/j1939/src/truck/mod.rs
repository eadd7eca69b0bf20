//! A truck behind its bus: [`BusTruck`] is a [`tractrix_core::Vehicle`] that reads and commands a
//! truck over J1939.
//!
//! | file | holds |
//! |---|---|
//! | `bus_truck` | a tick: what has come in, who drives, what goes out |
//! | `config` | addresses, carriers and limits of a truck |
//! | `heard` | the latest of every signal, with its time |
//! | `ego` | the ego state made of it |
//! | `watch` | what is supervised on a truck's bus |
//! | `engagement` | who drives |
//! | `demand` | a command as messages and back, for both ends |
//! | `torque` | torque in TSC1 and EEC1, for both ends |
//! | `send` | what goes out, and when |
//! | `setup` | all of its set-up, for a recording |

mod bus_truck;
mod config;
mod demand;
mod ego;
mod engagement;
mod heard;
mod send;
#[cfg(feature = "std")]
mod setup;
mod torque;
mod watch;

pub use bus_truck::{BusTruck, Readiness, TruckError};
pub use config::{BusTruckConfig, lost_after_s};
pub use demand::{
    Urgency, XBR_DECEL_MAX_M_S2, brake_demand, brakes_asked, engine_demand, gear_asked,
    gear_demand, retarder_demand, torque_asked, torque_release,
};
pub use engagement::Engagement;
pub use heard::Lead;
#[cfg(feature = "std")]
pub use setup::DriverSetup;
pub use torque::{TORQUE_STEP_FRAC, Torque};

/// Which of [`BusTruckConfig::retarders`] acts behind the gearbox.
const DRIVELINE_RETARDER: usize = 1;
