//! The road that the stack drives: reference line, lane tracks, limits.

use alloc::{string::String, vec::Vec};

use crate::small;
use crate::{Cubics, GeoReference, LaneKind, LaneTrack, Line, RoadError};

/// A point on the road surface.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RoadPoint {
    /// Map x, m.
    pub x_m: f64,
    /// Map y, m.
    pub y_m: f64,
    /// Map z, m (bank included).
    pub z_m: f64,
    /// Heading of the reference line, rad.
    pub heading_rad: f64,
    /// Curvature of the reference line, 1/m, positive left.
    pub curvature_1_m: f64,
    /// Grade, rad, positive uphill.
    pub grade_rad: f64,
    /// Bank, rad, left side up.
    pub bank_rad: f64,
}

/// How the road surface lies at a point.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Surface {
    /// Map z, m (bank included).
    pub z_m: f64,
    /// Grade, rad, positive uphill.
    pub grade_rad: f64,
    /// Bank, rad, left side up.
    pub bank_rad: f64,
}

/// A position in road coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RoadPosition {
    /// Station, m.
    pub s_m: f64,
    /// Offset, m, positive left.
    pub d_m: f64,
}

/// One sample of the look-ahead profile.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ProfilePoint {
    /// Station, m.
    pub s_m: f64,
    /// Height, m.
    pub z_m: f64,
    /// Grade, rad.
    pub grade_rad: f64,
    /// Curvature, 1/m.
    pub curvature_1_m: f64,
    /// Bank, rad.
    pub bank_rad: f64,
    /// Heading of the road, rad, map frame.
    pub heading_rad: f64,
    /// Speed limit, m/s.
    pub speed_limit_m_s: f64,
}

/// Something recorded along the road that is not a lane.
#[derive(Debug, Clone, PartialEq)]
pub struct RoadObject {
    /// What it is: `tunnel`, `bridge`.
    pub kind: String,
    /// Its name in the map.
    pub name: String,
    /// First station, m.
    pub s_start_m: f64,
    /// Last station, m.
    pub s_end_m: f64,
}

/// Lanes between two stations at which a lane begins or ends.
#[derive(Debug, Clone, PartialEq)]
struct Section {
    s_m: f64,
    /// Lane ids from right to left.
    lanes: Vec<u16>,
}

/// One carriageway as the ego drives it. Immutable; share it in an `Arc`.
#[derive(Debug, Clone, PartialEq)]
pub struct Road {
    name: String,
    line: Line,
    lanes: Vec<LaneTrack>,
    sections: Vec<Section>,
    limits: Vec<(f64, f64)>,
    objects: Vec<RoadObject>,
    geo_reference: Option<GeoReference>,
    limit_cap_m_s: Option<f64>,
    paved_throughout_m: Option<(f64, f64)>,
}

impl Road {
    /// A road from its parts. `limits` are (from station m, limit m/s) in order, the first at 0;
    /// an infinite limit means that there is none.
    ///
    /// # Errors
    /// [`RoadError::Invalid`] if there is no lane, a lane's index is not its position, a lane's
    /// stations are not finite and in order, or the limits are out of order.
    pub fn new(
        name: &str,
        line: Line,
        lanes: Vec<LaneTrack>,
        limits: Vec<(f64, f64)>,
    ) -> Result<Self, RoadError> {
        let bad = |why: &str| RoadError::Invalid { name: name.into(), why: why.into() };
        if lanes.is_empty() || lanes.len() > usize::from(u16::MAX) {
            return Err(bad("needs 1 to 65535 lanes"));
        }
        if lanes.iter().enumerate().any(|(i, l)| usize::from(l.id) != i) {
            return Err(bad("a lane's id must be its index"));
        }
        let ordered = limits.windows(2).all(|w| w[1].0 > w[0].0);
        if limits.is_empty() || !ordered || limits.iter().any(|l| !(l.1 > 0.0)) {
            return Err(bad("speed limits must be positive and in order of station"));
        }
        if lanes.iter().any(|l| !(l.s_end_m >= l.s_start_m && l.s_end_m.is_finite())) {
            return Err(bad("a lane must end after its start"));
        }
        let sections = sections(&lanes, line.length_m());
        let paved_throughout_m = paved_throughout_m(&lanes, line.length_m());
        Ok(Self {
            name: name.into(),
            line,
            lanes,
            sections,
            limits,
            objects: Vec::new(),
            geo_reference: None,
            limit_cap_m_s: None,
            paved_throughout_m,
        })
    }

    /// The same road with objects recorded along it.
    #[must_use]
    pub fn with_objects(mut self, objects: Vec<RoadObject>) -> Self {
        self.objects = objects;
        self
    }

    /// The same road with its place on the earth; a reference without a projection is none.
    #[must_use]
    pub fn with_geo_reference(mut self, geo: &GeoReference) -> Self {
        self.geo_reference = (!geo.projection.is_empty()).then(|| geo.clone());
        self
    }

    /// Where the map lies on the earth, if its file says so.
    #[must_use]
    pub const fn geo_reference(&self) -> Option<&GeoReference> {
        self.geo_reference.as_ref()
    }

    /// The same road with a speed limit (m/s) everywhere, where its own is higher: a limit that
    /// holds for a time.
    #[must_use]
    pub fn with_limit_cap(&self, cap_m_s: f64) -> Self {
        let mut road = self.clone();
        let lanes = road.lanes.iter_mut().flat_map(|lane| &mut lane.speed_limits);
        for (_, limit_m_s) in road.limits.iter_mut().chain(lanes) {
            *limit_m_s = limit_m_s.min(cap_m_s.max(0.1));
        }
        road.limit_cap_m_s = Some(cap_m_s);
        road
    }

    /// The cap of [`Self::with_limit_cap`], m/s; of several the last.
    #[must_use]
    pub const fn limit_cap_m_s(&self) -> Option<f64> {
        self.limit_cap_m_s
    }

    /// Tunnels and bridges along the road.
    #[must_use]
    pub fn objects(&self) -> &[RoadObject] {
        &self.objects
    }

    /// Whether a station lies in a tunnel.
    #[must_use]
    pub fn in_tunnel(&self, s_m: f64) -> bool {
        self.objects.iter().any(|o| o.kind == "tunnel" && o.s_start_m <= s_m && s_m <= o.s_end_m)
    }

    /// (from station m, limit m/s) of the road.
    #[must_use]
    pub fn speed_limits(&self) -> &[(f64, f64)] {
        &self.limits
    }

    /// Stations at which a lane begins or ends, from 0 to the road's end.
    pub fn section_starts_m(&self) -> impl Iterator<Item = f64> + '_ {
        self.sections.iter().map(|s| s.s_m)
    }

    /// Name of the road.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Length, m.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.line.length_m()
    }

    /// The reference line.
    #[must_use]
    pub const fn line(&self) -> &Line {
        &self.line
    }

    /// The surface at (s, d); s is clamped to the road.
    #[must_use]
    pub fn at(&self, s_m: f64, d_m: f64) -> RoadPoint {
        let (k, [cos, sin]) = self.line.at_with_tangent(s_m);
        let (sin_bank, cos_bank) = small::sincos(k.bank_rad);
        RoadPoint {
            x_m: k.x_m - d_m * cos_bank * sin,
            y_m: k.y_m + d_m * cos_bank * cos,
            z_m: k.z_m + d_m * sin_bank,
            heading_rad: k.heading_rad,
            curvature_1_m: k.curvature_1_m,
            grade_rad: small::atan(k.slope),
            bank_rad: k.bank_rad,
        }
    }

    /// How the surface lies at (s, d), alone: as [`Road::at`] at a part of its cost.
    #[must_use]
    pub fn surface(&self, s_m: f64, d_m: f64) -> Surface {
        let s_m = s_m.clamp(0.0, self.length_m());
        let (z_m, slope) = self.line.elevation().at_with_slope(s_m);
        let bank_rad = self.line.bank().at(s_m);
        let (sin_bank, _) = small::sincos(bank_rad);
        Surface { z_m: z_m + d_m * sin_bank, grade_rad: small::atan(slope), bank_rad }
    }

    /// Road coordinates of a map point; fast near a hint. `None` for a non-finite point.
    #[must_use]
    pub fn project(&self, x_m: f64, y_m: f64, hint_s_m: Option<f64>) -> Option<RoadPosition> {
        let (s_m, flat) = self.line.project(x_m, y_m, hint_s_m)?;
        let (_, cos_bank) = small::sincos(self.line.bank().at(s_m));
        Some(RoadPosition { s_m, d_m: flat / cos_bank })
    }

    /// All lane tracks; the index is the id.
    #[must_use]
    pub fn lanes(&self) -> &[LaneTrack] {
        &self.lanes
    }

    fn section(&self, s_m: f64) -> &Section {
        let i = self.sections.partition_point(|s| s.s_m <= s_m);
        &self.sections[i.max(1) - 1]
    }

    /// Lanes that exist at a station, from right to left.
    pub fn lanes_at(&self, s_m: f64) -> impl Iterator<Item = &LaneTrack> {
        self.section(s_m).lanes.iter().map(|&id| &self.lanes[usize::from(id)])
    }

    /// The lane that holds the point (s, d), shoulders included; the nearest centre wins where
    /// lanes overlap.
    #[must_use]
    pub fn lane_at(&self, s_m: f64, d_m: f64) -> Option<u16> {
        self.lanes_at(s_m)
            .map(|l| (l.id, (l.center_d_m(s_m) - d_m).abs(), 0.5 * l.width_m(s_m)))
            .filter(|(_, off, half)| off <= half)
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map(|(id, ..)| id)
    }

    /// The drivable lane touching this one on the left at a station.
    #[must_use]
    pub fn left_of(&self, lane: u16, s_m: f64) -> Option<u16> {
        self.beside(lane, s_m, 1.0)
    }

    /// The drivable lane touching this one on the right at a station.
    #[must_use]
    pub fn right_of(&self, lane: u16, s_m: f64) -> Option<u16> {
        self.beside(lane, s_m, -1.0)
    }

    fn beside(&self, lane: u16, s_m: f64, side: f64) -> Option<u16> {
        let own = self.lanes.get(usize::from(lane))?;
        let (d, w) = (own.center_d_m(s_m), own.width_m(s_m));
        self.lanes_at(s_m)
            .filter(|l| l.id != lane && l.kind != LaneKind::Shoulder)
            .map(|l| (l.id, side * (l.center_d_m(s_m) - d), 0.5 * (w + l.width_m(s_m))))
            .filter(|(_, off, reach)| *off > 0.5 && *off < reach + 0.5)
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map(|(id, ..)| id)
    }

    /// Speed limit of the road for the ego, m/s; infinite where the map has none.
    #[must_use]
    pub fn speed_limit_m_s(&self, s_m: f64) -> f64 {
        let i = self.limits.partition_point(|l| l.0 <= s_m);
        self.limits[i.max(1) - 1].1
    }

    /// Speed limit of a lane, m/s: its own if it has one.
    #[must_use]
    pub fn lane_speed_limit_m_s(&self, lane: u16, s_m: f64) -> f64 {
        self.lanes
            .get(usize::from(lane))
            .and_then(|l| l.own_speed_limit_m_s(s_m))
            .unwrap_or_else(|| self.speed_limit_m_s(s_m))
    }

    /// The speed limit of a lane between two stations, m/s, where it is one all the way.
    #[must_use]
    pub fn even_lane_speed_limit_m_s(&self, lane: u16, from_m: f64, to_m: f64) -> Option<f64> {
        let changes = |limits: &[(f64, f64)]| {
            let first = limits.partition_point(|l| l.0 <= from_m);
            limits.get(first).is_some_and(|l| l.0 <= to_m)
        };
        let own = self.lanes.get(usize::from(lane)).map_or(&[][..], |l| &l.speed_limits);
        let changes = changes(own) || own.is_empty() && changes(&self.limits);
        let before_its_own = !own.is_empty() && own[0].0 > from_m;
        (!changes && !before_its_own).then(|| self.lane_speed_limit_m_s(lane, from_m))
    }

    /// Fills `out` with the profile from `s0_m` on, `step_m` apart; clamped at the end.
    pub fn profile(&self, s0_m: f64, step_m: f64, out: &mut [ProfilePoint]) {
        for (i, p) in out.iter_mut().enumerate() {
            let k = self.line.at(s0_m + i as f64 * step_m);
            *p = ProfilePoint {
                s_m: k.s_m,
                z_m: k.z_m,
                grade_rad: small::atan(k.slope),
                curvature_1_m: k.curvature_1_m,
                bank_rad: k.bank_rad,
                heading_rad: k.heading_rad,
                speed_limit_m_s: self.speed_limit_m_s(k.s_m),
            };
        }
    }

    /// Reads a road by file or built-in name.
    ///
    /// # Errors
    /// [`RoadError`] names the file, line and value; a road with [`Road::findings`] that are
    /// refused is an error too.
    #[cfg(feature = "std")]
    pub fn load(name: &str) -> Result<Self, RoadError> {
        let road = match name {
            "builtin:highway" => crate::builtin::highway(),
            "builtin:highway-sag" => crate::builtin::highway_sag(),
            "builtin:test-site" => crate::builtin::test_site(),
            "builtin:flat" => crate::builtin::flat(15_000.0),
            _ if has_extension(name, "xodr") => {
                crate::opendrive::Network::load(name)?.longest_route()?
            }
            _ if has_extension(name, "csv") => crate::csv_profile::read(name)?,
            _ => return Err(RoadError::UnknownRoad { name: name.into() }),
        };
        road.refused(name)
    }

    /// Reads a road from the text of an OpenDRIVE file; `name` stands for the file in messages.
    ///
    /// # Errors
    /// As [`Self::load`].
    #[cfg(feature = "std")]
    pub fn from_xodr(name: &str, text: &str) -> Result<Self, RoadError> {
        crate::opendrive::Network::parse(name, text)?.longest_route()?.refused(name)
    }

    #[cfg(feature = "std")]
    fn refused(self, name: &str) -> Result<Self, RoadError> {
        match crate::findings::refusal(&self.findings()) {
            Some(why) => Err(RoadError::Invalid { name: name.into(), why }),
            None => Ok(self),
        }
    }

    /// Offsets, m, right and left, between which the whole road is paved ([`Road::is_paved`]) by
    /// lanes that run straight along it.
    #[must_use]
    pub const fn paved_throughout_m(&self) -> Option<(f64, f64)> {
        self.paved_throughout_m
    }

    /// Whether the surface is paved at (s, d): inside a lane of any kind, hard shoulders included.
    /// Slits between lanes that are narrower than half a metre count as paved.
    #[must_use]
    pub fn is_paved(&self, s_m: f64, d_m: f64) -> bool {
        const SLIT_M: f64 = 0.5;
        let (mut left, mut right) = (f64::INFINITY, f64::INFINITY);
        for lane in self.lanes_at(s_m).filter(|l| l.width_m(s_m) > 0.0) {
            let (low, high) = (lane.right_edge_d_m(s_m), lane.left_edge_d_m(s_m));
            if low <= d_m && d_m <= high {
                return true;
            }
            if low > d_m {
                left = left.min(low - d_m);
            } else {
                right = right.min(d_m - high);
            }
        }
        left + right < SLIT_M
    }
}

#[cfg(feature = "std")]
fn has_extension(name: &str, want: &str) -> bool {
    std::path::Path::new(name).extension().is_some_and(|e| e.eq_ignore_ascii_case(want))
}

/// The widest band of lanes side by side that are everywhere and everywhere the same.
fn paved_throughout_m(lanes: &[LaneTrack], length_m: f64) -> Option<(f64, f64)> {
    let edges = |l: &LaneTrack| {
        let (centre_m, half_m) = (l.center.as_constant()?, 0.5 * l.width.as_constant()?);
        let whole = l.s_start_m <= 0.0 && l.s_end_m >= length_m && half_m > 0.0;
        whole.then_some((centre_m - half_m, centre_m + half_m))
    };
    let mut bands: Vec<(f64, f64)> = lanes.iter().filter_map(edges).collect();
    bands.sort_by(|a, b| a.0.total_cmp(&b.0));
    bands.dedup_by(|next, band| {
        let touches = next.0 <= band.1 + 1e-6;
        if touches {
            band.1 = band.1.max(next.1);
        }
        touches
    });
    bands.into_iter().max_by(|a, b| (a.1 - a.0).total_cmp(&(b.1 - b.0)))
}

/// Splits the road where a lane begins or ends and orders the lanes of each part by their offset
/// in its middle.
fn sections(lanes: &[LaneTrack], length_m: f64) -> Vec<Section> {
    let mut starts: Vec<f64> = lanes.iter().flat_map(|l| [l.s_start_m, l.s_end_m]).collect();
    starts.push(0.0);
    starts.retain(|&s| s >= 0.0 && s < length_m - 1e-6);
    starts.sort_by(f64::total_cmp);
    starts.dedup_by(|b, a| *b - *a < 1e-6);
    let mut out = Vec::with_capacity(starts.len());
    for (i, &s_m) in starts.iter().enumerate() {
        let mid = 0.5 * (s_m + starts.get(i + 1).copied().unwrap_or(length_m));
        let mut here: Vec<u16> = lanes.iter().filter(|l| l.exists_at(mid)).map(|l| l.id).collect();
        let d = |id: u16| lanes[usize::from(id)].center_d_m(mid);
        here.sort_by(|&a, &b| d(a).total_cmp(&d(b)));
        out.push(Section { s_m, lanes: here });
    }
    out
}

/// Lane tracks of equal width along a whole road, rightmost first, the reference line between the
/// first two (or in the middle of one).
pub(crate) fn parallel_lanes(count: u16, width_m: f64, length_m: f64) -> Vec<LaneTrack> {
    (0..count)
        .map(|id| LaneTrack {
            id,
            s_start_m: 0.0,
            s_end_m: length_m,
            kind: LaneKind::Driving,
            end: crate::LaneEnd::Continues,
            center: Cubics::constant((f64::from(id) - 0.5 * (f64::from(count) - 1.0)) * width_m),
            width: Cubics::constant(width_m),
            speed_limits: Vec::new(),
            sources: Vec::new(),
        })
        .collect()
}
