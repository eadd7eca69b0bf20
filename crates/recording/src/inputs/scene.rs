//! The other vehicles exactly and in little room.
//!
//! Vehicles go on as they did: each number is predicted from its last three values (as it was, in a
//! line, in a parabola: whichever came nearest the last time), and only the difference is written,
//! counted in steps of the floating-point numbers (their bits as integers that grow with the
//! number), as a varint (LEB128) with the sign in the lowest bit. Writer and reader make the same
//! predictions, so every bit comes back. Who reads a scene must have read those before it.

use std::collections::BTreeMap;

use tractrix_core::{Neighbour, VehicleClass};

use crate::ros::truck::class_code;

/// Numbers of a vehicle.
const NUMBERS: usize = 10;
/// Vehicles of a scene: more in a file is nonsense.
const MOST_VEHICLES: u64 = 100_000;

/// What was said of a vehicle before.
#[derive(Debug, Clone, Copy, Default)]
struct Track {
    words: [u64; 2],
    numbers: [Course; NUMBERS],
}

/// The last values of a number, the latest first, and the prediction that was the best.
#[derive(Debug, Clone, Copy, Default)]
struct Course {
    values: [f64; 3],
    known: usize,
    best: usize,
}

impl Course {
    /// As it was, in a line, in a parabola.
    fn predictions(&self) -> [f64; 3] {
        let [a, b, c] = self.values;
        let line = if self.known > 1 { 2.0 * a - b } else { a };
        let parabola = if self.known > 2 { 3.0 * (a - b) + c } else { line };
        [a, line, parabola]
    }

    fn predicted(&self) -> f64 {
        self.predictions().get(self.best).copied().unwrap_or_default()
    }

    fn push(&mut self, value: f64) {
        let off = self.predictions().map(|p| steps(value).abs_diff(steps(p)));
        self.best = (0..3).min_by_key(|&i| off.get(i)).unwrap_or_default();
        self.values = [value, self.values[0], self.values[1]];
        self.known = (self.known + 1).min(3);
    }
}

/// Writes scenes one after the other.
#[derive(Debug, Default)]
pub(crate) struct SceneWriter(Memory);

/// Reads them again.
#[derive(Debug, Default)]
pub(super) struct SceneReader(Memory);

#[derive(Debug, Default)]
struct Memory {
    ids: Vec<u64>,
    tracks: BTreeMap<u64, Track>,
}

impl Memory {
    /// What is known of a vehicle; nothing of a new one.
    fn track(&self, id: u64) -> Track {
        self.tracks.get(&id).copied().unwrap_or_default()
    }

    fn replace(&mut self, ids: Vec<u64>, tracks: BTreeMap<u64, Track>) {
        (self.ids, self.tracks) = (ids, tracks);
    }
}

impl SceneWriter {
    /// The next scene.
    pub(crate) fn write(&mut self, vehicles: &[Neighbour]) -> Vec<u8> {
        let ids: Vec<u64> = vehicles.iter().map(|n| n.id).collect();
        let mut out = Vec::with_capacity(24 * vehicles.len());
        let same = ids == self.0.ids;
        put(&mut out, u64::from(!same));
        if !same {
            put(&mut out, ids.len() as u64);
            ids.iter().for_each(|id| put(&mut out, *id));
        }
        let mut tracks = BTreeMap::new();
        for n in vehicles {
            let mut track = self.0.track(n.id);
            let words = words_of(n);
            put(&mut out, u64::from(words != track.words));
            if words != track.words {
                words.iter().for_each(|word| put(&mut out, *word));
                track.words = words;
            }
            for (course, value) in track.numbers.iter_mut().zip(numbers_of(n)) {
                let off = steps(value).wrapping_sub(steps(course.predicted()));
                put(&mut out, (off << 1 ^ off >> 63) as u64);
                course.push(value);
            }
            tracks.insert(n.id, track);
        }
        self.0.replace(ids, tracks);
        out
    }
}

impl SceneReader {
    /// The next scene; `None` if the bytes are none.
    pub(super) fn read(&mut self, bytes: &[u8]) -> Option<Vec<Neighbour>> {
        let mut rest = bytes;
        let ids = match take(&mut rest)? {
            0 => std::mem::take(&mut self.0.ids),
            _ => {
                let count = take(&mut rest).filter(|count| *count <= MOST_VEHICLES)?;
                (0..count).map(|_| take(&mut rest)).collect::<Option<Vec<u64>>>()?
            }
        };
        let mut tracks = BTreeMap::new();
        let mut vehicles = Vec::with_capacity(ids.len());
        for id in &ids {
            let mut track = self.0.track(*id);
            if take(&mut rest)? != 0 {
                track.words = [take(&mut rest)?, take(&mut rest)?];
            }
            let mut numbers = [0.0; NUMBERS];
            for (course, number) in track.numbers.iter_mut().zip(&mut numbers) {
                let raw = take(&mut rest)?;
                let off = (raw >> 1) as i64 ^ -((raw & 1) as i64);
                *number = number_at(steps(course.predicted()).wrapping_add(off));
                course.push(*number);
            }
            vehicles.push(neighbour(*id, track.words, numbers)?);
            tracks.insert(*id, track);
        }
        self.0.replace(ids, tracks);
        rest.is_empty().then_some(vehicles)
    }
}

fn numbers_of(n: &Neighbour) -> [f64; NUMBERS] {
    [
        n.front_s_m,
        n.rear_s_m,
        n.d_m,
        n.width_m,
        n.speed_m_s,
        n.lateral_speed_m_s,
        n.accel_m_s2,
        n.x_m,
        n.y_m,
        n.yaw_rad,
    ]
}

/// Every class there is.
const CLASSES: [VehicleClass; 5] = [
    VehicleClass::Car,
    VehicleClass::Van,
    VehicleClass::Truck,
    VehicleClass::Emergency,
    VehicleClass::Barrier,
];

/// Class and lane; the lane to which it changes, from 1, 0 for none.
fn words_of(n: &Neighbour) -> [u64; 2] {
    let class = u64::from(class_code(n.class));
    [class << 16 | u64::from(n.lane), n.target_lane.map_or(0, |lane| u64::from(lane) + 1)]
}

fn neighbour(id: u64, [of_lane, target]: [u64; 2], numbers: [f64; NUMBERS]) -> Option<Neighbour> {
    let [
        front_s_m,
        rear_s_m,
        d_m,
        width_m,
        speed_m_s,
        lateral_speed_m_s,
        accel_m_s2,
        x_m,
        y_m,
        yaw_rad,
    ] = numbers;
    let class = CLASSES.into_iter().find(|class| u64::from(class_code(*class)) == of_lane >> 16)?;
    let target_lane = match target.checked_sub(1) {
        Some(lane) => Some(u16::try_from(lane).ok()?),
        None => None,
    };
    Some(Neighbour {
        id,
        class,
        front_s_m,
        rear_s_m,
        d_m,
        width_m,
        speed_m_s,
        lateral_speed_m_s,
        accel_m_s2,
        lane: (of_lane & 0xFFFF) as u16,
        target_lane,
        x_m,
        y_m,
        yaw_rad,
    })
}

/// The bits of a number as an integer that grows with it; its own inverse on bits.
fn steps(value: f64) -> i64 {
    let bits = value.to_bits() as i64;
    bits ^ (bits >> 63 & i64::MAX)
}

fn number_at(steps: i64) -> f64 {
    f64::from_bits((steps ^ (steps >> 63 & i64::MAX)) as u64)
}

/// Appends a varint.
fn put(out: &mut Vec<u8>, mut word: u64) {
    while word >= 0x80 {
        out.push(word as u8 | 0x80);
        word >>= 7;
    }
    out.push(word as u8);
}

/// Takes a varint off.
fn take(rest: &mut &[u8]) -> Option<u64> {
    let mut word = 0_u64;
    for shift in (0..64).step_by(7) {
        let (&byte, more) = rest.split_first()?;
        *rest = more;
        word |= u64::from(byte & 0x7F) << shift;
        if byte < 0x80 {
            return Some(word);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vehicle(id: u64, k: f64) -> Neighbour {
        let (v, t) = (20.0 + id as f64, 0.01 * k);
        Neighbour {
            id,
            class: VehicleClass::Truck,
            front_s_m: 100.0 * id as f64 + v * t + 0.3 * t * t,
            rear_s_m: 100.0 * id as f64 + v * t + 0.3 * t * t - 16.5,
            d_m: -1.75,
            width_m: 2.55,
            speed_m_s: v + 0.6 * t,
            accel_m_s2: 0.6,
            lane: 1,
            target_lane: (k > 50.0).then_some(0),
            x_m: (v * t).sin() * 1e3,
            ..Neighbour::default()
        }
    }

    fn bits(vehicles: &[Neighbour]) -> Vec<(u64, [u64; 2], [u64; NUMBERS])> {
        vehicles.iter().map(|n| (n.id, words_of(n), numbers_of(n).map(f64::to_bits))).collect()
    }

    #[test]
    fn every_bit_of_every_scene_comes_back_and_steady_ones_take_little_room() {
        let odd = [f64::NAN, -0.0, f64::INFINITY, f64::MIN, f64::MIN_POSITIVE, -1e-310];
        let mut scenes: Vec<Vec<Neighbour>> = (0..200)
            .map(|k| {
                let gone = u64::from(k > 120);
                (gone..8 + u64::from(k > 80)).map(|id| vehicle(id, f64::from(k))).collect()
            })
            .collect();
        scenes.extend(odd.map(|x| vec![Neighbour { d_m: x, id: u64::MAX, ..vehicle(3, x) }]));
        scenes.push(Vec::new());
        scenes.push(vec![vehicle(2, 3.0), vehicle(1, 2.0)]);
        let (mut writer, mut reader) = (SceneWriter::default(), SceneReader::default());
        let mut sizes = Vec::new();
        for scene in &scenes {
            let bytes = writer.write(scene);
            sizes.push(bytes.len());
            assert_eq!(bits(&reader.read(&bytes).unwrap()), bits(scene));
        }
        assert!(sizes[45] < 8 * 25, "{} bytes for 8 vehicles", sizes[45]);
    }

    #[test]
    fn bytes_that_are_no_scene_are_none() {
        let bytes = SceneWriter::default().write(&[vehicle(1, 0.0)]);
        for cut in 0..bytes.len() {
            assert_eq!(SceneReader::default().read(&bytes[..cut]), None);
        }
        let longer = [&bytes[..], &[0]].concat();
        assert_eq!(SceneReader::default().read(&longer), None);
        assert_eq!(SceneReader::default().read(&[1, 0xFF, 0xFF, 0xFF, 0xFF, 0x0F]), None);
        assert_eq!(SceneReader::default().read(&[0xFF; 40]), None);
    }
}
