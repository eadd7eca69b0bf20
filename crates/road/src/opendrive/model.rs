//! The map as the file states it.

use std::collections::BTreeMap;

use crate::{Cubics, GeoReference, Line, Placed, RoadObject};

/// A whole map.
#[derive(Debug, Clone, PartialEq)]
pub struct Network {
    /// Name of the file, for messages.
    pub name: String,
    /// Header.
    pub header: Header,
    /// Roads in the order of the file.
    pub roads: Vec<RoadRecord>,
    /// Junctions in the order of the file.
    pub junctions: Vec<Junction>,
    /// Objects and signals by type: how many.
    pub objects: BTreeMap<String, usize>,
    /// Elements that would change the geometry and are not read: name, (how many, first line).
    pub unsupported: BTreeMap<String, (usize, u32)>,
    /// Other elements that are not read: name, (how many, first line).
    pub ignored: BTreeMap<String, (usize, u32)>,
}

/// The file's header.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Header {
    /// Major revision.
    pub rev_major: u32,
    /// Minor revision.
    pub rev_minor: u32,
    /// Name of the map.
    pub name: String,
    /// Where the map lies on the earth.
    pub geo_reference: GeoReference,
}

/// Which end of a road is touched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Contact {
    /// Its start (s = 0).
    Start,
    /// Its end.
    End,
}

/// What a road is linked to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Link {
    /// A road, at one of its ends.
    Road {
        /// Its id.
        id: String,
        /// The end that is touched.
        contact: Contact,
    },
    /// A junction.
    Junction {
        /// Its id.
        id: String,
    },
}

/// One `<road>`.
#[derive(Debug, Clone, PartialEq)]
pub struct RoadRecord {
    /// Id.
    pub id: String,
    /// Name.
    pub name: String,
    /// Line of the element in the file.
    pub file_line: u32,
    /// Stated length, m.
    pub length_m: f64,
    /// Junction that it belongs to.
    pub junction: Option<String>,
    /// Left-hand traffic.
    pub left_hand: bool,
    /// What is before its start.
    pub predecessor: Option<Link>,
    /// What is after its end.
    pub successor: Option<Link>,
    /// Plan view as stated.
    pub plan: Vec<Placed>,
    /// The reference line, ready for look-up.
    pub line: Line,
    /// Lane offset over s, m.
    pub lane_offset: Cubics,
    /// Lane sections in order.
    pub sections: Vec<LaneSection>,
    /// Speed limits of the road type: (from s m, m/s), infinite for "no limit".
    pub speed_limits: Vec<(f64, f64)>,
    /// Road types: (from s m, type).
    pub types: Vec<(f64, String)>,
    /// Tunnels and bridges.
    pub objects: Vec<RoadObject>,
}

/// One `<laneSection>`.
#[derive(Debug, Clone, PartialEq)]
pub struct LaneSection {
    /// Start, m.
    pub s_m: f64,
    /// End: start of the next, or of the road, m.
    pub end_m: f64,
    /// Lanes from left to right (ids falling), without the centre lane.
    pub lanes: Vec<Lane>,
}

/// What a lane is used for, as far as driving is concerned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum LaneUse {
    /// Through lane.
    Driving,
    /// `entry`, `onRamp`, `connectingRamp`, `slipLane`.
    Entry,
    /// `exit`, `offRamp`.
    Exit,
    /// `shoulder`, `stop`.
    Shoulder,
    /// Not for vehicles.
    Other,
}

/// How the file states a lane's outline.
#[derive(Debug, Clone, PartialEq)]
pub enum LaneOutline {
    /// Width over station from the section's start, m.
    Width(Cubics),
    /// Outer border over station from the section's start, m from the centre lane.
    Border(Cubics),
}

/// One `<lane>`.
#[derive(Debug, Clone, PartialEq)]
pub struct Lane {
    /// Id: positive left of the centre lane.
    pub id: i32,
    /// Type as written.
    pub kind: String,
    /// Outline.
    pub outline: LaneOutline,
    /// Lanes before it.
    pub predecessors: Vec<i32>,
    /// Lanes after it.
    pub successors: Vec<i32>,
    /// Speed limits: (from the section's start m, m/s), infinite for "no limit".
    pub speed_limits: Vec<(f64, f64)>,
}

/// One `<junction>`.
#[derive(Debug, Clone, PartialEq)]
pub struct Junction {
    /// Id.
    pub id: String,
    /// Name.
    pub name: String,
    /// A direct junction: its connections link roads without a road between.
    pub direct: bool,
    /// Line of the element in the file.
    pub file_line: u32,
    /// Connections.
    pub connections: Vec<Connection>,
}

/// One `<connection>` of a junction.
#[derive(Debug, Clone, PartialEq)]
pub struct Connection {
    /// Road that leads in.
    pub incoming_road: String,
    /// Connecting road of a common junction, linked road of a direct one.
    pub connecting_road: String,
    /// End of the connecting (linked) road that touches the incoming road.
    pub contact: Contact,
    /// (lane of the incoming road, lane of the connecting road).
    pub lane_links: Vec<(i32, i32)>,
}

impl Lane {
    /// What the lane is used for.
    #[must_use]
    pub fn usage(&self) -> LaneUse {
        match self.kind.as_str() {
            "driving" | "bidirectional" | "mwyDriving" => LaneUse::Driving,
            "entry" | "onRamp" | "connectingRamp" | "slipLane" | "mwyEntry" => LaneUse::Entry,
            "exit" | "offRamp" | "mwyExit" => LaneUse::Exit,
            "shoulder" | "stop" => LaneUse::Shoulder,
            _ => LaneUse::Other,
        }
    }

    /// Whether vehicles drive on it.
    #[must_use]
    pub fn is_drivable(&self) -> bool {
        matches!(self.usage(), LaneUse::Driving | LaneUse::Entry | LaneUse::Exit)
    }
}

impl RoadRecord {
    /// The section that holds a station.
    #[must_use]
    pub fn section_at(&self, s_m: f64) -> usize {
        self.sections.partition_point(|x| x.s_m <= s_m).max(1) - 1
    }

    /// Whether a lane is driven along s (else against it).
    #[must_use]
    pub const fn driven_forward(&self, lane: i32) -> bool {
        (lane < 0) != self.left_hand
    }

    /// The limit of the road type at a station, m/s.
    #[must_use]
    pub fn road_limit_m_s(&self, s_m: f64) -> Option<f64> {
        step_at(&self.speed_limits, s_m)
    }

    /// The limit on a lane, m/s: the lane's own, else that of the road type.
    #[must_use]
    pub fn lane_limit_m_s(&self, section: &LaneSection, lane: &Lane, s_m: f64) -> Option<f64> {
        step_at(&lane.speed_limits, s_m - section.s_m).or_else(|| self.road_limit_m_s(s_m))
    }
}

/// The last entry that begins at or before a station.
fn step_at(steps: &[(f64, f64)], s_m: f64) -> Option<f64> {
    let i = steps.partition_point(|l| l.0 <= s_m + 1e-9);
    i.checked_sub(1).map(|i| steps[i].1)
}
