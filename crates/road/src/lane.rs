//! Lanes as continuous tracks along a road.

use alloc::{string::String, vec::Vec};

use crate::Cubics;

/// What a lane is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LaneKind {
    /// A through lane.
    Driving,
    /// An on-ramp with its acceleration lane.
    Entry,
    /// An off-ramp with its deceleration lane.
    Exit,
    /// Hard shoulder: not driven.
    Shoulder,
}

/// What happens at the far end of a lane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LaneEnd {
    /// It goes on beyond the end of the road.
    Continues,
    /// It ends: vehicles must change before.
    Drops,
    /// It leaves the road: vehicles on it leave too.
    Leaves,
}

/// Where a part of a track comes from in the map file: the key to other programs that read the
/// same file.
#[derive(Debug, Clone, PartialEq)]
pub struct LaneSource {
    /// Station on this road at which the part begins, m.
    pub s_start_m: f64,
    /// The file's road id.
    pub road: String,
    /// The file's lane id.
    pub lane: i32,
    /// Station on the file's road at which the part begins in driving direction, m.
    pub road_s_m: f64,
    /// Whether it is driven against the file's s.
    pub reversed: bool,
}

/// One lane followed along the road.
#[derive(Debug, Clone, PartialEq)]
pub struct LaneTrack {
    /// Index in [`crate::Road::lanes`].
    pub id: u16,
    /// First station, m.
    pub s_start_m: f64,
    /// Last station, m.
    pub s_end_m: f64,
    /// What it is for.
    pub kind: LaneKind,
    /// What happens at its end.
    pub end: LaneEnd,
    /// Offset of the centre over station, m.
    pub center: Cubics,
    /// Width over station, m.
    pub width: Cubics,
    /// The lane's own speed limits: (from station m, limit m/s); infinite for "no limit". Before
    /// the first the road's limit holds.
    pub speed_limits: Vec<(f64, f64)>,
    /// Parts of the map file that make the track; empty for roads that are not from a map.
    pub sources: Vec<LaneSource>,
}

impl LaneTrack {
    /// Whether the lane exists at a station.
    #[must_use]
    pub fn exists_at(&self, s_m: f64) -> bool {
        s_m >= self.s_start_m && s_m <= self.s_end_m
    }

    /// Offset of the lane's centre from the reference line, m, positive left.
    #[inline]
    #[must_use]
    pub fn center_d_m(&self, s_m: f64) -> f64 {
        self.center.at(s_m)
    }

    /// Slope of the centre's offset, m/m.
    #[must_use]
    pub fn center_slope(&self, s_m: f64) -> f64 {
        self.center.at_with_slope(s_m).1
    }

    /// Width, m.
    #[inline]
    #[must_use]
    pub fn width_m(&self, s_m: f64) -> f64 {
        self.width.at(s_m)
    }

    /// Offset of the left edge, m, positive left of the reference line.
    #[must_use]
    pub fn left_edge_d_m(&self, s_m: f64) -> f64 {
        self.center_d_m(s_m) + 0.5 * self.width_m(s_m)
    }

    /// Offset of the right edge, m, positive left of the reference line.
    #[must_use]
    pub fn right_edge_d_m(&self, s_m: f64) -> f64 {
        self.center_d_m(s_m) - 0.5 * self.width_m(s_m)
    }

    /// The lane's own limit, m/s, where it has one.
    #[must_use]
    pub fn own_speed_limit_m_s(&self, s_m: f64) -> Option<f64> {
        let i = self.speed_limits.partition_point(|l| l.0 <= s_m);
        i.checked_sub(1).map(|i| self.speed_limits[i].1)
    }
}
