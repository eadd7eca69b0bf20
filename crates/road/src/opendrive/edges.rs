//! Where lanes lie across a road: t of their edges, from lane offset, widths and borders.

use super::model::{Lane, LaneOutline, LaneSection, RoadRecord};

/// A value and its slope along s.
pub(super) type Sloped = (f64, f64);

/// Edges of a lane at one station, t in metres (positive left) and dt/ds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Edges {
    /// Edge next to the centre lane.
    pub(super) inner: Sloped,
    /// Edge away from it.
    pub(super) outer: Sloped,
}

impl RoadRecord {
    /// (inner, outer) edge of a lane at a station, t in metres, positive left; `None` if the lane
    /// is not in that section.
    #[must_use]
    pub fn lane_edges_m(&self, section: usize, lane: i32, s_m: f64) -> Option<(f64, f64)> {
        let e = self.edges_in(self.sections.get(section)?, lane, s_m, s_m)?;
        Some((e.inner.0, e.outer.0))
    }

    /// Edges at `s_m` by the records that hold at `inside_m`, so that the end of a span is seen
    /// from inside it.
    pub(super) fn edges_in(
        &self,
        section: &LaneSection,
        lane: i32,
        s_m: f64,
        inside_m: f64,
    ) -> Option<Edges> {
        let side = f64::from(lane.signum());
        let centre = self.lane_offset.at_with_slope_in(s_m, inside_m);
        let mut inner = centre;
        for l in lanes_outwards(section, lane) {
            let (s, inside) = (s_m - section.s_m, inside_m - section.s_m);
            let outer = match &l.outline {
                LaneOutline::Width(w) => {
                    let (w, dw) = w.at_with_slope_in(s, inside);
                    (inner.0 + side * w, inner.1 + side * dw)
                }
                LaneOutline::Border(b) => {
                    let (b, db) = b.at_with_slope_in(s, inside);
                    (centre.0 + b, centre.1 + db)
                }
            };
            if l.id == lane {
                return Some(Edges { inner, outer });
            }
            inner = outer;
        }
        None
    }

    /// Stations inside a section at which some record of it begins.
    pub(super) fn breaks_in(&self, section: &LaneSection, from_m: f64, to_m: f64) -> Vec<f64> {
        let outlines = section.lanes.iter().flat_map(|l| {
            let (LaneOutline::Width(c) | LaneOutline::Border(c)) = &l.outline;
            c.starts_m().iter().map(|s| s + section.s_m)
        });
        let mut out: Vec<f64> = outlines
            .chain(self.lane_offset.starts_m().iter().copied())
            .filter(|s| *s > from_m + 1e-6 && *s < to_m - 1e-6)
            .collect();
        out.sort_by(f64::total_cmp);
        out.dedup_by(|b, a| *b - *a < 1e-6);
        out
    }
}

/// The lanes on one side, from the centre outwards.
fn lanes_outwards(section: &LaneSection, lane: i32) -> impl Iterator<Item = &Lane> {
    let count = section.lanes.len();
    let order = move |i: usize| if lane < 0 { i } else { count - 1 - i };
    let same_side = move |l: &&Lane| l.id.signum() == lane.signum();
    (0..count).filter_map(move |i| section.lanes.get(order(i))).filter(same_side)
}
