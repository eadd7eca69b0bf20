//! How people drive: the published equations, once, for everyone who needs them (traffic engines
//! that move drivers, deciders that foresee them).
//!
//! Nothing here has state, randomness or a notion of a road: a function gets speeds and gaps and
//! gives accelerations. SI units. Arithmetic is IEEE-exact (`+ - * /`, square root, comparison), so
//! results have the same bits on every machine.
//!
//! ```
//! use driver_models::Idm;
//! let driver = Idm::new(33.3, 1.5, 2.0, 1.4, 2.0, 8.0);
//! let free = driver.accel_m_s2(25.0, 36.1, f64::INFINITY, 0.0);
//! let close_behind = driver.accel_m_s2(25.0, 36.1, 20.0, 0.0);
//! assert!(free > 0.0 && close_behind < 0.0);
//! ```
#![no_std]

mod idm;
mod mobil;
mod motion;

pub use idm::Idm;
pub use mobil::{Change, Mobil};
pub use motion::ballistic;
