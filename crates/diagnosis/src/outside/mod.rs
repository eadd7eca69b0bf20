//! What the catalogue does not have.
//!
//! | file | |
//! |---|---|
//! | `unknown` | a free function of a signal |
//! | `catch_all` | forces that any error resembles |
//! | `sure` | named causes against both |

pub(crate) mod catch_all;
pub(crate) mod sure;
pub(crate) mod unknown;
