//! Lanes as continuous tracks along a road.

use tractrix_core::Curve;

/// What a lane is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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
    pub center: Curve,
    /// Width over station, m.
    pub width: Curve,
    /// Speed limit over station, m/s, where the lane has its own.
    pub speed_limit: Option<Curve>,
}

impl LaneTrack {
    /// Whether the lane exists at a station.
    #[must_use]
    pub fn exists_at(&self, s_m: f64) -> bool {
        s_m >= self.s_start_m && s_m <= self.s_end_m
    }

    /// Offset of the lane's centre from the reference line, m, positive left.
    #[must_use]
    pub fn center_d_m(&self, s_m: f64) -> f64 {
        self.center.at(s_m)
    }

    /// Width, m.
    #[must_use]
    pub fn width_m(&self, s_m: f64) -> f64 {
        self.width.at(s_m)
    }
}
