//! The other vehicles as the rows of a NumPy structured array.
//!
//! One packed row per vehicle, little-endian, in the order of `tractrix.SCENE_DTYPE`:
//! `id` u64, `class` 9 UCS-4 characters, six lengths and speeds, acceleration, lanes, map pose.

use tractrix_core::{Neighbour, VehicleClass};

use crate::fault::Fault;

/// Characters of the longest class, `emergency`.
const CLASS_CHARS: usize = 9;
/// Bytes of a row.
const ROW_BYTES: usize = 8 + 4 * CLASS_CHARS + 7 * 8 + 2 * 4 + 3 * 8;
/// `target_lane` of a vehicle that keeps its lane.
const NO_LANE: i32 = -1;

/// The words for classes.
const CLASSES: [(&str, VehicleClass); 5] = [
    ("car", VehicleClass::Car),
    ("van", VehicleClass::Van),
    ("truck", VehicleClass::Truck),
    ("emergency", VehicleClass::Emergency),
    ("barrier", VehicleClass::Barrier),
];

/// The vehicles of rows, but for their lanes and places on the map.
pub(crate) fn vehicles(rows: &[u8]) -> Result<Vec<Neighbour>, Fault> {
    let (rows, []) = rows.as_chunks::<ROW_BYTES>() else {
        return Err(Fault::Value("vehicles: rows of tractrix.SCENE_DTYPE".to_owned()));
    };
    let vehicle = |row: &[u8; ROW_BYTES]| {
        let (id, rest) = row.split_at(8);
        let (class, rest) = rest.split_at(4 * CLASS_CHARS);
        let (letters, _) = class.as_chunks::<4>();
        let letters = letters.iter().map(|c| u32::from_le_bytes(*c)).take_while(|c| *c != 0);
        let word: String = letters.filter_map(char::from_u32).collect();
        let known = CLASSES.iter().find(|(name, _)| *name == word);
        let (_, class) = *known.ok_or_else(|| {
            let words = CLASSES.map(|(name, _)| name).join(", ");
            Fault::Value(format!("class = {word:?}: {words}"))
        })?;
        let mut numbers = rest.as_chunks::<8>().0.iter().map(|x| f64::from_le_bytes(*x));
        let mut next = || numbers.next().unwrap_or(f64::NAN);
        Ok(Neighbour {
            id: id.try_into().map_or(0, u64::from_le_bytes),
            class,
            front_s_m: next(),
            rear_s_m: next(),
            d_m: next(),
            width_m: next(),
            speed_m_s: next(),
            lateral_speed_m_s: next(),
            accel_m_s2: next(),
            ..Neighbour::default()
        })
    };
    rows.iter().map(vehicle).collect()
}

/// The rows of a scene.
pub(crate) fn rows(neighbours: &[Neighbour]) -> Vec<u8> {
    let mut out = Vec::with_capacity(neighbours.len() * ROW_BYTES);
    for n in neighbours {
        out.extend(n.id.to_le_bytes());
        let word = CLASSES.iter().find(|(_, class)| *class == n.class).map_or("", |(word, _)| word);
        let mut class = word.chars();
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
