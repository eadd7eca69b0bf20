//! The closed loop without a server: SimTruck, World, scenarios.
