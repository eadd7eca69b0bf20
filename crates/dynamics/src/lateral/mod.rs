//! Lateral dynamics of a tractor with a semitrailer: steering, kinematics, yaw and sideslip, limits.
//!
//! [`LateralParameters`] is what a truck file says; [`LateralModel::new`] checks it once and
//! precomputes axle loads, cornering stiffnesses and effective lengths; [`LateralModel::step`] is a
//! pure function of state, inputs and step length; [`LateralModel::outputs`] gives what sensors and
//! other effects want to know.
//!
//! | file | holds |
//! |---|---|
//! | `parameters` | the truck file's lateral part, checks, axle loads from masses and payload |
//! | `tyre` | cornering stiffness over load, saturation, friction ellipse |
//! | `kinematic` | Eq. 1 of the paper, corrected, with effective lengths of axle groups |
//! | `yaw_sideslip` | Eq. 3-10 of the paper, corrected: the 4-state model |
//! | `relaxation` | side force that builds up over a rolled distance |
//! | `steering` | hand wheel to road wheel: limits, offset, free play, ratio, lag |
//! | `limits` | articulation stop, load transfer, rollover threshold |
//! | `interface` | state, inputs, outputs |
//! | `rosenbrock` | the integration method's linear systems |
//! | `model` | all of them in one step, from standstill to the stability limit |
//!
//! Frames: ISO 8855 (x forward, y left, yaw counter-clockwise). Reference point: centre of the
//! tractor's drive-axle group, on the ground. Articulation is trailer heading minus tractor heading
//! (the paper's psi of Eq. 1); the 4-state model's gamma is its negative.
//!
//! Left out: roll and pitch dynamics, left-right differences, steering compliance, longitudinal load
//! transfer.

mod interface;
mod kinematic;
mod limits;
mod model;
mod parameters;
mod relaxation;
mod rosenbrock;
mod steering;
mod tyre;
mod yaw_sideslip;

pub use interface::{BodyForce, LateralInputs, LateralOutputs, LateralState};
pub use kinematic::{EffectiveLengths, Kinematic};
pub use limits::{LoadTransfer, LoadTransferParameters};
pub use model::{BLEND_HIGH_M_S, BLEND_LOW_M_S, LateralModel};
pub use parameters::{
    LateralError, LateralParameters, PayloadParameters, TractorParameters, TrailerParameters,
};
pub use steering::{SteeringParameters, SteeringState};
pub use tyre::{GROUP_AXLES, LoadedAxle, TyreLaw, TyreParameters};
pub use yaw_sideslip::{StateSpace, YawSideslip};

/// Number of axles: steer, two drive, three trailer. A single axle is a group of zero spread.
pub const AXLES: usize = 6;
