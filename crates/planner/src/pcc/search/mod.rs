//! Discrete choices: which gear where.
//!
//! | file | idea |
//! |---|---|
//! | `grid` | joint search over speed and gear on a grid |
//! | `gears` | shift places along a profile |

mod gears;
mod grid;

pub(crate) use gears::{GearChoice, choose_gears, gear_bit};
pub(crate) use grid::{EngineTables, SearchGrid, SearchPrices, search};
