//! Test-only reference for the lateral model.
#![allow(dead_code, reason = "every test binary uses its own part of this module")]

pub(crate) mod trucks;
