//! Deciders, predictive cruise control, lane-change paths, safety gate, controllers, guard.
