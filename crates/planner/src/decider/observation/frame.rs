//! The paper's frame: the nearest vehicles around the truck, and the stack of four frames.

use alloc::collections::VecDeque;
use road::{LaneKind, Road};
use tractrix_core::{EgoState, Neighbour, Scene};

/// Rows of a frame.
pub const ROWS: usize = 9;
/// Columns of a frame.
pub const COLUMNS: usize = 6;
/// Numbers in a frame.
pub const FRAME: usize = ROWS * COLUMNS;
/// Frames in an observation.
pub const FRAMES: usize = 4;
/// Numbers in the stack of frames.
pub const SIZE: usize = FRAME * FRAMES;

const AHEAD_M: f64 = 100.0;
const BEHIND_M: f64 = 50.0;
const AHEAD_ROWS: usize = 6;
const BEHIND_ROWS: usize = 2;
const PROFILE_S: f64 = 3.0;

/// One frame.
pub type Frame = [f32; FRAME];

/// The frame of this instant. `reference_speed_m_s` gives the reference speed at a station.
#[must_use]
pub fn frame(
    ego: &EgoState,
    scene: &Scene,
    road: &Road,
    reference_speed_m_s: impl Fn(f64) -> f64,
) -> Frame {
    let mut out = [0.0; FRAME];
    let leftmost = road
        .lanes_at(ego.s_m)
        .filter(|l| l.kind == LaneKind::Driving)
        .map(|l| l.center_d_m(ego.s_m))
        .fold(f64::NEG_INFINITY, f64::max);
    let from_left = if leftmost.is_finite() { leftmost - ego.d_m } else { 0.0 };
    let ego_row = [1.0, 100.0, from_left, ego.speed_m_s, -ego.lateral_speed_m_s];
    write_row(&mut out, 0, ego_row);
    let dx = |n: &Neighbour| 0.5 * (n.front_s_m + n.rear_s_m) - ego.s_m;
    let mut put = |first_row: usize, rows: usize, wanted: &dyn Fn(f64) -> bool| {
        // The nearest first; ties go by identifier
        let mut nearest: [Option<((f64, u64), &Neighbour)>; AHEAD_ROWS] = [None; AHEAD_ROWS];
        let nearest = &mut nearest[..rows];
        for n in scene.neighbours.iter().filter(|n| wanted(dx(n))) {
            let key = (libm::hypot(dx(n), n.d_m - ego.d_m), n.id);
            let is_place = |other: &Option<((f64, u64), _)>| other.is_none_or(|(k, _)| key < k);
            if let Some(place) = nearest.iter().position(is_place).filter(|_| key.0 >= 0.0) {
                nearest[place..].rotate_right(1);
                nearest[place] = Some((key, n));
            }
        }
        for (row, (_, n)) in nearest.iter().flatten().enumerate() {
            let right = ego.d_m - n.d_m;
            let closing = ego.speed_m_s - n.speed_m_s;
            let drift = ego.lateral_speed_m_s - n.lateral_speed_m_s;
            write_row(&mut out, first_row + row, [1.0, dx(n), right, closing, drift]);
        }
    };
    put(1, BEHIND_ROWS, &|dx| (-BEHIND_M..0.0).contains(&dx));
    put(1 + BEHIND_ROWS, AHEAD_ROWS, &|dx| (0.0..=AHEAD_M).contains(&dx));
    for row in 0..ROWS {
        let time_s = PROFILE_S * row as f64 / (ROWS - 1) as f64;
        let speed = reference_speed_m_s(ego.s_m + ego.speed_m_s * time_s);
        out[row * COLUMNS + 5] = scaled(speed, 40.0);
    }
    out
}

fn write_row(out: &mut Frame, row: usize, [presence, along, right, speed, drift]: [f64; 5]) {
    let values = [
        scaled(presence, 1.0),
        scaled(along, 100.0),
        scaled(right, 8.0),
        scaled(speed, 40.0),
        scaled(drift, 40.0),
    ];
    out[row * COLUMNS..row * COLUMNS + 5].copy_from_slice(&values);
}

pub(super) fn scaled(value: f64, by: f64) -> f32 {
    (value / by).clamp(-1.0, 1.0) as f32
}

/// Whether a frame shows any neighbour.
#[must_use]
pub(crate) fn sees_anyone(frame: &Frame) -> bool {
    (1..ROWS).any(|row| frame[row * COLUMNS] > 0.0)
}

/// The frames of the last three seconds.
#[derive(Debug)]
pub struct Observer {
    frames: VecDeque<Frame>,
    per_second: usize,
}

impl Clone for Observer {
    fn clone(&self) -> Self {
        let mut frames = VecDeque::with_capacity(self.frames.capacity());
        frames.extend(self.frames.iter().copied());
        Self { frames, per_second: self.per_second }
    }

    fn clone_from(&mut self, from: &Self) {
        self.frames.clone_from(&from.frames);
        self.per_second = from.per_second;
    }
}

impl Observer {
    /// An observer that is given a frame every `period_s`, at most one second.
    #[must_use]
    pub fn new(period_s: f64) -> Self {
        let per_second = libm::round(1.0 / period_s.clamp(1e-3, 1.0)) as usize;
        // one more while the newest is in and the oldest not yet out
        Self { frames: VecDeque::with_capacity((FRAMES - 1) * per_second + 2), per_second }
    }

    /// Takes the frame of this instant.
    pub fn push(&mut self, frame: Frame) {
        self.frames.push_front(frame);
        self.frames.truncate((FRAMES - 1) * self.per_second + 1);
    }

    /// Forgets everything: the start of an episode.
    pub fn clear(&mut self) {
        self.frames.clear();
    }

    /// The latest frame.
    #[must_use]
    pub fn latest(&self) -> Option<&Frame> {
        self.frames.front()
    }

    /// Writes the stack of frames, newest first; `out` has [`SIZE`] numbers.
    pub(super) fn write(&self, out: &mut [f32]) {
        for (i, part) in out.chunks_exact_mut(FRAME).enumerate() {
            match self.frames.get(i * self.per_second) {
                Some(frame) => part.copy_from_slice(frame),
                None => part.fill(0.0),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    fn car(id: u64, centre_s_m: f64, d_m: f64, speed_m_s: f64) -> Neighbour {
        Neighbour {
            id,
            front_s_m: centre_s_m + 2.0,
            rear_s_m: centre_s_m - 2.0,
            d_m,
            width_m: 1.8,
            speed_m_s,
            ..Neighbour::default()
        }
    }

    #[test]
    fn rows_hold_the_nearest_vehicles_and_the_ranges_are_cut() {
        let road = road::builtin::flat(2000.0);
        let d = road.lanes()[0].center_d_m(0.0);
        let ego = EgoState { s_m: 500.0, d_m: d, speed_m_s: 20.0, ..EgoState::default() };
        let neighbours: Vec<_> =
            [(1, 460.0), (2, 440.0), (3, 490.0), (4, 480.0), (5, 540.0), (6, 605.0)]
                .map(|(id, s)| car(id, s, d + 3.75, 25.0))
                .into();
        let scene = Scene { neighbours, ..Scene::default() };
        let f = frame(&ego, &scene, &road, |_| 20.0);
        let row = |r: usize| &f[r * COLUMNS..(r + 1) * COLUMNS];
        assert_eq!(row(1)[1], -0.1);
        assert_eq!(row(2)[1], -0.2);
        assert_eq!(row(3)[1], 0.4);
        assert_eq!(row(4)[0], 0.0, "605 m is 105 m ahead");
        assert!((row(3)[2] + 3.75 / 8.0).abs() < 1e-6, "a car on the left is at negative right");
        assert!((row(3)[3] + 5.0 / 40.0).abs() < 1e-6);
        assert_eq!(row(8)[5], 0.5);
    }

    #[test]
    fn the_stack_of_frames_goes_back_in_whole_seconds() {
        let mut o = Observer::new(0.1);
        for i in 0..40 {
            o.push([i as f32 / 40.0; FRAME]);
        }
        let mut x = [f32::NAN; SIZE];
        o.write(&mut x);
        let at = |frame: usize| (x[frame * FRAME] * 40.0).round() as i32;
        assert_eq!([at(0), at(1), at(2), at(3)], [39, 29, 19, 9]);
        o.clear();
        o.push([0.5; FRAME]);
        o.write(&mut x);
        assert!(x[..FRAME].iter().all(|v| *v == 0.5) && x[FRAME..].iter().all(|v| *v == 0.0));
    }
}
