//! One physical cause per file: its block of the truck file, its bounds, its pure functions.

pub mod brake;
pub mod cooling;
pub mod driveline;
pub mod engine;
pub mod fuel;
pub mod instruments;
pub mod resistance;
pub mod shift;
pub mod table;
pub mod tcu;
