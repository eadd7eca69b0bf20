//! The other vehicles as the rows of a NumPy structured array.
//!
//! One packed row per vehicle, little-endian, in the order of `tractrix.SCENE_DTYPE`:
//! `id` u64, `class` 9 UCS-4 characters, six lengths and speeds, acceleration, lanes, map pose.

use tractrix_core::{Neighbour, VehicleClass};

/// Characters of the longest class, `emergency`.
const CLASS_CHARS: usize = 9;
/// Bytes of a row.
const ROW_BYTES: usize = 8 + 4 * CLASS_CHARS + 7 * 8 + 2 * 4 + 3 * 8;
/// `target_lane` of a vehicle that keeps its lane.
const NO_LANE: i32 = -1;

/// The rows of a scene.
pub(crate) fn rows(neighbours: &[Neighbour]) -> Vec<u8> {
    let mut out = Vec::with_capacity(neighbours.len() * ROW_BYTES);
    for n in neighbours {
        out.extend(n.id.to_le_bytes());
        let mut class = match n.class {
            VehicleClass::Car => "car",
            VehicleClass::Van => "van",
            VehicleClass::Truck => "truck",
            VehicleClass::Emergency => "emergency",
            VehicleClass::Barrier => "barrier",
        }
        .chars();
        for _ in 0..CLASS_CHARS {
            out.extend(class.next().map_or(0, u32::from).to_le_bytes());
        }
        let along = [n.front_s_m, n.rear_s_m, n.d_m, n.width_m];
        let motion = [n.speed_m_s, n.lateral_speed_m_s, n.accel_m_s2];
        out.extend(along.iter().chain(&motion).flat_map(|x| x.to_le_bytes()));
        out.extend(i32::from(n.lane).to_le_bytes());
        out.extend(n.target_lane.map_or(NO_LANE, i32::from).to_le_bytes());
        out.extend([n.x_m, n.y_m, n.yaw_rad].iter().flat_map(|x| x.to_le_bytes()));
    }
    out
}
