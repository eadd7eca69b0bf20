//! The moving state: a structure of arrays, sorted by the station of the front bumper.
//!
//! `clone_from` copies into the arrays that are there, so a snapshot or a restore is a handful of
//! memory copies and no allocation.

use std::ops::Range;

use super::driver::Driver;
use super::human::Mind;
use super::lanes::NO_LANE;

/// All vehicles, one array per quantity, the vehicle furthest back first.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Fleet {
    /// Station of the front bumper, m.
    pub(crate) s_m: Vec<f64>,
    /// Speed along the road, m/s.
    pub(crate) v_m_s: Vec<f64>,
    /// Acceleration in force until the next tick, m/s².
    pub(crate) a_m_s2: Vec<f64>,
    /// Lane track that it is in, or leaves.
    pub(crate) lane: Vec<u16>,
    /// Lane track that it changes to, or [`NO_LANE`].
    pub(crate) target: Vec<u16>,
    /// During a change: time since its start, s. Otherwise: minus the time until the next may
    /// begin, s.
    pub(crate) clock_s: Vec<f64>,
    /// Vehicle number.
    pub(crate) id: Vec<u64>,
    /// Driver and vehicle.
    pub(crate) driver: Vec<Driver>,
    /// What changes in the driver.
    pub(crate) mind: Vec<Mind>,
}

impl Clone for Fleet {
    fn clone(&self) -> Self {
        let mut copy = Self::default();
        copy.clone_from(self);
        let room = self.s_m.capacity() - self.len();
        copy.make_room(room.max(self.len() / 4 + 16));
        copy
    }

    fn clone_from(&mut self, from: &Self) {
        self.s_m.clone_from(&from.s_m);
        self.v_m_s.clone_from(&from.v_m_s);
        self.a_m_s2.clone_from(&from.a_m_s2);
        self.lane.clone_from(&from.lane);
        self.target.clone_from(&from.target);
        self.clock_s.clone_from(&from.clock_s);
        self.id.clone_from(&from.id);
        self.driver.clone_from(&from.driver);
        self.mind.clone_from(&from.mind);
    }
}

impl Fleet {
    /// Memory of a vehicle, bytes.
    pub(crate) const BYTES: usize = 4 * size_of::<f64>()
        + 2 * size_of::<u16>()
        + size_of::<u64>()
        + size_of::<Driver>()
        + size_of::<Mind>();

    /// Memory for so many more.
    pub(crate) fn make_room(&mut self, more: usize) {
        self.s_m.reserve(more);
        self.v_m_s.reserve(more);
        self.a_m_s2.reserve(more);
        self.lane.reserve(more);
        self.target.reserve(more);
        self.clock_s.reserve(more);
        self.id.reserve(more);
        self.driver.reserve(more);
        self.mind.reserve(more);
    }

    /// Gives what is worked out about each vehicle its length, with the fleet's room to grow.
    pub(crate) fn fit<T: Clone>(&self, values: &mut Vec<T>, value: T) {
        if values.len() != self.len() {
            values.reserve(self.s_m.capacity().saturating_sub(values.len()));
            values.resize(self.len(), value);
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.s_m.len()
    }

    /// Station of the rear bumper, m.
    pub(crate) fn rear_m(&self, i: usize) -> f64 {
        self.s_m[i] - self.driver[i].length_m
    }

    pub(crate) fn is_changing(&self, i: usize) -> bool {
        self.target[i] != NO_LANE
    }

    /// Does the vehicle take up room in this lane?
    pub(crate) fn occupies(&self, i: usize, lane: u16) -> bool {
        self.lane[i] == lane || self.target[i] == lane
    }

    /// Puts a vehicle where its station belongs.
    pub(crate) fn insert(&mut self, s_m: f64, v_m_s: f64, lane: u16, id: u64, driver: Driver) {
        let at = self.s_m.partition_point(|&s| s < s_m);
        self.s_m.insert(at, s_m);
        self.v_m_s.insert(at, v_m_s);
        self.a_m_s2.insert(at, 0.0);
        self.lane.insert(at, lane);
        self.target.insert(at, NO_LANE);
        self.clock_s.insert(at, 0.0);
        self.id.insert(at, id);
        self.driver.insert(at, driver);
        self.mind.insert(at, Mind::default());
    }

    /// Takes out all vehicles for which `keep` is false, keeping the order.
    pub(crate) fn retain(&mut self, mut keep: impl FnMut(&Self, usize) -> bool) {
        let mut kept = 0;
        for i in 0..self.len() {
            if keep(self, i) {
                if kept != i {
                    self.swap(kept, i);
                }
                kept += 1;
            }
        }
        self.s_m.truncate(kept);
        self.v_m_s.truncate(kept);
        self.a_m_s2.truncate(kept);
        self.lane.truncate(kept);
        self.target.truncate(kept);
        self.clock_s.truncate(kept);
        self.id.truncate(kept);
        self.driver.truncate(kept);
        self.mind.truncate(kept);
    }

    /// Restores the order of a range after a step. Insertion sort: in one step few vehicles overtake.
    pub(crate) fn sort(&mut self, range: Range<usize>) {
        for i in range.start + 1..range.end {
            if self.s_m[i - 1] < self.s_m[i] {
                continue;
            }
            let mut j = i;
            while j > range.start && self.is_ahead(j - 1, j) {
                self.swap(j - 1, j);
                j -= 1;
            }
        }
    }

    /// Strict order: station, then vehicle number.
    fn is_ahead(&self, i: usize, j: usize) -> bool {
        self.s_m[i] > self.s_m[j] || (self.s_m[i] == self.s_m[j] && self.id[i] > self.id[j])
    }

    fn swap(&mut self, i: usize, j: usize) {
        self.s_m.swap(i, j);
        self.v_m_s.swap(i, j);
        self.a_m_s2.swap(i, j);
        self.lane.swap(i, j);
        self.target.swap(i, j);
        self.clock_s.swap(i, j);
        self.id.swap(i, j);
        self.driver.swap(i, j);
        self.mind.swap(i, j);
    }
}
