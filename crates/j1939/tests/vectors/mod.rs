//! Frames whose content is known from outside: public examples and recorded frames. Plain data, for
//! the unit tests, the tests and the firmware alike.
#![allow(dead_code, unreachable_pub, reason = "nobody uses all of them")]

use core::f64::consts::TAU;

/// Identifier and bytes.
pub type Known = (u32, [u8; 8]);

/// TSC1 with a right checksum: public examples of the standard's formula, then an A26 engine's
/// transmission.
pub const TSC1: [Known; 9] = [
    (0x0C00_100B, [0x30, 0xFF, 0xFF, 0x7D, 0xFF, 0xFF, 0xFF, 0x73]),
    (0x0C00_100B, [0x30, 0xFF, 0xFF, 0x7D, 0xFF, 0x0F, 0x00, 0x70]),
    (0x0C00_0F0B, [0x30, 0xFF, 0xFF, 0x7D, 0xFF, 0x0F, 0x00, 0x50]),
    (0x0C00_0F0B, [0x30, 0xFF, 0xFF, 0x7D, 0xFF, 0xFF, 0xFF, 0x63]),
    (0x0C00_0003, [0xC3, 0xFF, 0xFA, 0x7D, 0xFF, 0xFF, 0xFF, 0x71]),
    (0x0C00_0003, [0xC3, 0xFF, 0xFA, 0x7D, 0xFF, 0xFF, 0xFF, 0x02]),
    (0x0C00_0003, [0xC3, 0xFF, 0xFA, 0x7D, 0xFF, 0xFF, 0xFF, 0x23]),
    (0x0C00_0003, [0xC3, 0xFF, 0xFA, 0x7D, 0xFF, 0xFF, 0xFF, 0x34]),
    (0x0C00_0F03, [0xC2, 0xFF, 0xFF, 0x7D, 0xFF, 0xFF, 0xFF, 0x04]),
];

/// XBR with a right checksum: -2.0 m/s² as near as 1/2048 comes to it, maximum mode.
pub const XBR: Known = (0x0C04_0B80, [0x7F, 0x6D, 0x20, 0, 0, 0, 0, 0x54]);

/// EEC1 of an engine at 1,520.25 rpm: 30 % torque of which the driver wants 24 %, 0.375 % fraction,
/// mode 3; the demand is an error.
pub const EEC1: Known = (0x0CF0_0400, [0x33, 149, 155, 0x82, 0x2F, 0x00, 0xF0, 0xFE]);

/// Signals of [`EEC1`] and [`XBR`] in SI; none: an error.
pub const NUMBERS: [(Known, &str, Option<f64>); 9] = [
    (EEC1, "torque_mode", Some(3.0)),
    (EEC1, "engine_speed_rad_s", Some(1_520.25 * TAU / 60.0)),
    (EEC1, "torque_frac", Some(0.30)),
    (EEC1, "driver_torque_demand_frac", Some(0.24)),
    (EEC1, "torque_fine_frac", Some(0.003_75)),
    (EEC1, "torque_demand_frac", None),
    (EEC1, "controlling_address", Some(0.0)),
    (XBR, "control_mode", Some(2.0)),
    (XBR, "acceleration_demand_m_s2", Some(28_031.0 / 2_048.0 - 15.687)),
];
