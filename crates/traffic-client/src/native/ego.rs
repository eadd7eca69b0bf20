//! The ego as the other drivers see it: every lane that its tractor or its trailer reaches into.
//!
//! Tractor and trailer are two rectangles in road coordinates, hinged at the hitch and turned by
//! the heading error against the road and by the articulation angle. A lane is taken up as soon as
//! a rectangle reaches into it by more than [`MARGIN_M`]. (SUMO's drivers see an externally moved
//! truck only once its centre has crossed the line.)

use tractrix_core::{EgoState, Geometry};

use super::lanes::LaneMap;

/// An intrusion this small leaves a vehicle in that lane its room, m.
const MARGIN_M: f64 = 0.2;

/// Stretch of one lane that the ego takes up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Span {
    pub(crate) lane: u16,
    pub(crate) rear_m: f64,
    pub(crate) front_m: f64,
}

/// The ego in lane coordinates, spans sorted by their front.
#[derive(Debug, PartialEq, Default)]
pub(crate) struct EgoSpans {
    spans: Vec<Span>,
    /// Speed along the road, m/s.
    pub(crate) speed_m_s: f64,
}

impl Clone for EgoSpans {
    fn clone(&self) -> Self {
        Self { spans: self.spans.clone(), speed_m_s: self.speed_m_s }
    }

    fn clone_from(&mut self, from: &Self) {
        self.spans.clone_from(&from.spans);
        self.speed_m_s = from.speed_m_s;
    }
}

/// A rectangle in road coordinates: corner list (s, d), m.
type Corners = [(f64, f64); 4];

impl EgoSpans {
    pub(crate) fn spans(&self) -> &[Span] {
        &self.spans
    }

    /// The span in a lane.
    pub(crate) fn in_lane(&self, lane: u16) -> Option<&Span> {
        self.spans.iter().find(|span| span.lane == lane)
    }

    /// No ego (mode `pure`).
    pub(crate) fn clear(&mut self) {
        self.spans.clear();
    }

    /// Recomputes the spans. `shift_m` moves the ego along the road, m (to another instant);
    /// `road_heading_rad` is the heading of the road at the ego.
    pub(crate) fn update(
        &mut self,
        ego: &EgoState,
        geometry: &Geometry,
        map: &LaneMap,
        road_heading_rad: f64,
        shift_m: f64,
    ) {
        let heading = Turned::by(ego.yaw_rad - road_heading_rad);
        self.speed_m_s = (ego.speed_m_s * heading.cos).max(0.0);
        self.spans.clear();
        let (s, d) = (ego.s_m + shift_m, ego.d_m);
        for body in bodies(s, d, heading, ego.trailer.articulation_rad, geometry) {
            self.add(&body, map);
        }
        self.spans
            .sort_unstable_by(|a, b| a.front_m.total_cmp(&b.front_m).then(a.lane.cmp(&b.lane)));
    }

    fn add(&mut self, body: &Corners, map: &LaneMap) {
        let (mut rear, mut front) = (f64::INFINITY, f64::NEG_INFINITY);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        // No number is NaN here, which `min` and `max` would look for.
        for &(s, d) in body {
            rear = if s < rear { s } else { rear };
            front = if s > front { s } else { front };
            low = if d < low { d } else { low };
            high = if d > high { d } else { high };
        }
        let middle = 0.5 * (rear + front);
        for (k, lane) in map.lanes.iter().enumerate() {
            if lane.s_end_m < rear || lane.s_start_m > front {
                continue;
            }
            let (center, width) = lane.center_and_width_m(middle);
            let half = 0.5 * width - MARGIN_M;
            if low > center + half || high < center - half {
                continue;
            }
            let lane = k as u16;
            match self.spans.iter_mut().find(|span| span.lane == lane) {
                Some(span) => {
                    span.rear_m = span.rear_m.min(rear);
                    span.front_m = span.front_m.max(front);
                }
                None => self.spans.push(Span { lane, rear_m: rear, front_m: front }),
            }
        }
    }
}

/// An angle, rad, with its sine and cosine.
#[derive(Debug, Clone, Copy)]
struct Turned {
    angle: f64,
    sin: f64,
    cos: f64,
}

impl Turned {
    fn by(angle: f64) -> Self {
        let (sin, cos) = libm::sincos(angle);
        Self { angle, sin, cos }
    }
}

/// Tractor and trailer rectangles.
fn bodies(s: f64, d: f64, heading: Turned, articulation: f64, g: &Geometry) -> [Corners; 2] {
    let rectangle = |s: f64, d: f64, Turned { sin, cos, .. }: Turned, ahead: f64, behind: f64| {
        let corner = |x: f64, y: f64| (s + x * cos - y * sin, d + x * sin + y * cos);
        let half = 0.5 * g.width_m;
        [corner(ahead, half), corner(ahead, -half), corner(-behind, -half), corner(-behind, half)]
    };
    let (hitch_s, hitch_d) = (s + g.hitch_ahead_m * heading.cos, d + g.hitch_ahead_m * heading.sin);
    let trailer = Turned::by(heading.angle + articulation);
    [
        rectangle(s, d, heading, g.front_m, g.tractor_rear_m),
        rectangle(hitch_s, hitch_d, trailer, g.trailer_front_m, g.trailer_rear_m),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::native::lanes::LaneMap;
    use tractrix_core::TrailerState;

    fn truck() -> Geometry {
        Geometry {
            front_m: 4.8,
            wheelbase_m: 3.4,
            cg_ahead_m: 2.0,
            hitch_ahead_m: 0.3,
            hitch_to_trailer_axle_m: 7.7,
            trailer_front_m: 1.5,
            trailer_rear_m: 11.5,
            tractor_rear_m: 1.0,
            width_m: 2.55,
        }
    }

    fn lanes_of(ego: &EgoState) -> Vec<u16> {
        let mut spans = EgoSpans::default();
        spans.update(ego, &truck(), &LaneMap::straight(2, 1000.0, 3.75, 30.0), 0.0, 0.0);
        let mut lanes: Vec<u16> = spans.spans().iter().map(|s| s.lane).collect();
        lanes.sort_unstable();
        lanes
    }

    #[test]
    fn a_truck_in_the_middle_of_its_lane_takes_up_that_lane_from_bumper_to_bumper() {
        let ego = EgoState { s_m: 500.0, d_m: 1.875, speed_m_s: 20.0, ..EgoState::default() };
        let mut spans = EgoSpans::default();
        spans.update(&ego, &truck(), &LaneMap::straight(2, 1000.0, 3.75, 30.0), 0.0, 0.0);
        let span = spans.in_lane(0).copied();
        assert_eq!(spans.spans().len(), 1);
        let span = span.unwrap();
        assert!((span.front_m - 504.8).abs() < 1e-9 && (span.rear_m - 488.8).abs() < 1e-9);
    }

    #[test]
    fn a_truck_is_seen_in_the_next_lane_long_before_its_centre_crosses_the_line() {
        // Lane line at 3.75 m; the flank is 1.275 m from the centre.
        let at = |d_m: f64| lanes_of(&EgoState { s_m: 500.0, d_m, ..EgoState::default() });
        assert_eq!(at(2.4), [0]);
        assert_eq!(at(2.9), [0, 1]);
    }

    #[test]
    fn a_trailer_that_swings_out_is_seen_though_the_tractor_keeps_its_lane() {
        let ego = EgoState {
            s_m: 500.0,
            d_m: 1.875,
            trailer: TrailerState { articulation_rad: -0.12, yaw_rate_rad_s: 0.0 },
            ..EgoState::default()
        };
        assert_eq!(lanes_of(&ego), [0, 1]);
    }
}
