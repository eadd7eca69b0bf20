//! The road as the drivers need it: lanes sampled in cells, so that a step only reads tables.
//!
//! Cells of [`CELL_M`]; centre lines and widths are interpolated, limits, grades and neighbours
//! hold for a cell. What seldom changes along a lane is kept once per [`Section`], so that the
//! tables of thousands of kilometres stay in the cache.

/// Length of a cell, m.
pub(crate) const CELL_M: f64 = 10.0;
const CELLS_PER_M: f64 = 1.0 / CELL_M;
/// A lower limit is prepared for from this far on, m.
const SIGHT_M: f64 = 300.0;

/// No lane.
pub(crate) const NO_LANE: u16 = u16::MAX;

/// What a lane is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LaneUse {
    /// Through traffic; it may end (lane drop).
    Through,
    /// An on-ramp: traffic enters at its start and has to leave it before its end.
    Entry,
    /// An off-ramp: only who wants to leave drives there.
    Exit,
    /// Not driven (shoulder).
    Closed,
}

/// One lane track.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Lane {
    pub(crate) usage: LaneUse,
    /// Its end stops whoever is still in it.
    pub(crate) drops: bool,
    /// Its end leads off the road.
    pub(crate) leaves: bool,
    pub(crate) s_start_m: f64,
    pub(crate) s_end_m: f64,
    /// Offset of the centre at the cell borders from `s_start_m`, m.
    center_d_m: Vec<f64>,
    /// Width at the cell borders, m.
    width_m: Vec<f64>,
    /// Offset of the centre and width, m, where they are the same all along.
    throughout_m: Option<(f64, f64)>,
    /// Section of each cell.
    section: Vec<u32>,
    sections: Vec<Section>,
}

/// A stretch of a lane in which drivers see the same rules and neighbours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Section {
    /// Speed limit, m/s.
    pub(crate) limit_m_s: f64,
    /// Start and value of the lower limit ahead that asks for the hardest braking, m, m/s; infinite
    /// where there is none.
    pub(crate) lower: (f64, f64),
    /// Lanes to the left and right.
    beside: (u16, u16),
}

impl Lane {
    /// Cell of a station and the fraction in it.
    fn cell(&self, s_m: f64) -> (usize, f64) {
        let x = ((s_m - self.s_start_m) * CELLS_PER_M).max(0.0);
        let last = self.section.len() - 1;
        let k = (x as usize).min(last);
        (k, (x - k as f64).min(1.0))
    }

    /// Offset of the lane's centre from the reference line, m.
    pub(crate) fn center_d_m(&self, s_m: f64) -> f64 {
        if let Some((center_d_m, _)) = self.throughout_m {
            return center_d_m;
        }
        let (k, f) = self.cell(s_m);
        self.center_d_m[k] + f * (self.center_d_m[k + 1] - self.center_d_m[k])
    }

    /// [`Self::center_d_m`] and the width, m.
    #[inline]
    pub(crate) fn center_and_width_m(&self, s_m: f64) -> (f64, f64) {
        self.throughout_m.unwrap_or_else(|| self.center_and_width_in_cell_m(s_m))
    }

    fn center_and_width_in_cell_m(&self, s_m: f64) -> (f64, f64) {
        let (k, f) = self.cell(s_m);
        let at = |table: &[f64]| table[k] + f * (table[k + 1] - table[k]);
        (at(&self.center_d_m), at(&self.width_m))
    }

    /// [`Self::center_d_m`], and its slope against the reference line, dimensionless, positive to
    /// the left.
    pub(crate) fn center_and_slope(&self, s_m: f64) -> (f64, f64) {
        if let Some((center_d_m, _)) = self.throughout_m {
            return (center_d_m, 0.0);
        }
        let (k, f) = self.cell(s_m);
        let (from_m, to_m) = (self.center_d_m[k], self.center_d_m[k + 1]);
        (from_m + f * (to_m - from_m), (to_m - from_m) * CELLS_PER_M)
    }

    /// Limits and neighbours at a station.
    pub(crate) fn section(&self, s_m: f64) -> &Section {
        if let [only] = &self.sections[..] {
            return only;
        }
        &self.sections[self.section[self.cell(s_m).0] as usize]
    }

    /// Speed limit, m/s.
    pub(crate) fn limit_m_s(&self, s_m: f64) -> f64 {
        self.section(s_m).limit_m_s
    }
}

/// One lane as functions of station, before it is put into cells.
pub(crate) struct LaneSource<'a> {
    pub(crate) usage: LaneUse,
    /// Its end stops whoever is still in it.
    pub(crate) drops: bool,
    /// Its end leads off the road.
    pub(crate) leaves: bool,
    pub(crate) s_start_m: f64,
    pub(crate) s_end_m: f64,
    pub(crate) center_d_m: &'a dyn Fn(f64) -> f64,
    pub(crate) width_m: &'a dyn Fn(f64) -> f64,
    pub(crate) limit_m_s: &'a dyn Fn(f64) -> f64,
    pub(crate) beside: &'a dyn Fn(f64) -> (u16, u16),
}

impl LaneSource<'_> {
    pub(crate) fn sample(&self) -> Lane {
        let cells = libm::ceil((self.s_end_m - self.s_start_m) * CELLS_PER_M).max(1.0) as usize;
        let border = |k: usize| (self.s_start_m + k as f64 * CELL_M).min(self.s_end_m);
        let middle = |k: usize| 0.5 * (border(k) + border(k + 1));
        let limit_m_s: Vec<f64> = (0..cells).map(|k| (self.limit_m_s)(middle(k))).collect();
        let lower = lower_limits(&limit_m_s, self.s_start_m);
        let (mut section, mut sections) = (Vec::with_capacity(cells), Vec::<Section>::new());
        for (k, (&limit_m_s, lower)) in limit_m_s.iter().zip(lower).enumerate() {
            let here = Section { limit_m_s, lower, beside: (self.beside)(middle(k)) };
            if sections.last() != Some(&here) {
                sections.push(here);
            }
            section.push((sections.len() - 1) as u32);
        }
        let center_d_m: Vec<f64> = (0..=cells).map(|k| (self.center_d_m)(border(k))).collect();
        let width_m: Vec<f64> = (0..=cells).map(|k| (self.width_m)(border(k))).collect();
        let is_even = |table: &[f64]| table.windows(2).all(|w| w[0].to_bits() == w[1].to_bits());
        Lane {
            usage: self.usage,
            drops: self.drops,
            leaves: self.leaves,
            s_start_m: self.s_start_m,
            s_end_m: self.s_end_m,
            // plus zero, as the sum in a cell has it
            throughout_m: (is_even(&center_d_m) && is_even(&width_m))
                .then(|| (center_d_m[0] + 0.0, width_m[0] + 0.0)),
            center_d_m,
            width_m,
            section,
            sections,
        }
    }
}

/// For each cell the lower limit within [`SIGHT_M`] ahead that asks for the hardest braking from the
/// limit of the cell, `(v² - v_lower²) / (2 x)`.
fn lower_limits(limit_m_s: &[f64], s_start_m: f64) -> Vec<(f64, f64)> {
    let sight = (SIGHT_M * CELLS_PER_M) as usize;
    let at = |k: usize| limit_m_s.get(k).copied().unwrap_or(f64::INFINITY);
    (0..limit_m_s.len())
        .map(|k| {
            let mut hardest = (0.0, (f64::INFINITY, f64::INFINITY));
            for j in k + 1..=k + sight {
                if at(j) < at(j - 1) && at(j) < at(k) {
                    let x_m = (j - k) as f64 * CELL_M;
                    let braking = (at(k) * at(k) - at(j) * at(j)) / x_m;
                    if braking > hardest.0 {
                        hardest = (braking, (s_start_m + j as f64 * CELL_M, at(j)));
                    }
                }
            }
            hardest.1
        })
        .collect()
}

/// Is a lane at its start the leftmost of three or more through lanes?
fn is_left_of_three(lanes: &[Lane], k: u16) -> bool {
    let s_m = lanes[k as usize].s_start_m;
    let beside = |k: u16| {
        let lane = lanes.get(k as usize).filter(|l| l.usage == LaneUse::Through)?;
        (s_m >= lane.s_start_m && s_m <= lane.s_end_m).then(|| lane.section(s_m).beside)
    };
    let to_the_right = |k: u16| beside(k).map(|(_, right)| right);
    beside(k).is_some_and(|(left, _)| beside(left).is_none())
        && to_the_right(k).and_then(to_the_right).and_then(beside).is_some()
}

/// All lanes and the grade.
#[derive(Debug, Clone, PartialEq)]
pub struct LaneMap {
    pub(crate) lanes: Vec<Lane>,
    /// Off-ramps in the order of their stations.
    pub(crate) exits: Vec<u16>,
    /// Start and end of the road, m.
    pub(crate) s_start_m: f64,
    pub(crate) s_end_m: f64,
    /// Sine of the grade in each cell; one where it is the same all along.
    sin_grade: Vec<f64>,
    ends_early: Vec<bool>,
    left_of_three: Vec<bool>,
    one_limit: bool,
    needs: bool,
    /// Lanes to the left and right, where they are the same from the start of the road to its end.
    beside_throughout: Vec<Option<(u16, u16)>>,
}

impl LaneMap {
    pub(crate) fn new(
        lanes: Vec<Lane>,
        s_start_m: f64,
        s_end_m: f64,
        grade_rad: &dyn Fn(f64) -> f64,
    ) -> Self {
        let mut exits: Vec<u16> =
            (0..lanes.len() as u16).filter(|&k| lanes[k as usize].usage == LaneUse::Exit).collect();
        exits.sort_by(|&a, &b| lanes[a as usize].s_start_m.total_cmp(&lanes[b as usize].s_start_m));
        let cells = libm::ceil((s_end_m - s_start_m) * CELLS_PER_M).max(1.0) as usize;
        let mut sin_grade: Vec<f64> = (0..cells)
            .map(|k| libm::sin(grade_rad((s_start_m + (k as f64 + 0.5) * CELL_M).min(s_end_m))))
            .collect();
        if sin_grade.windows(2).all(|w| w[0] == w[1]) {
            sin_grade.truncate(1);
        }
        let ends_early: Vec<bool> = lanes
            .iter()
            .map(|lane| (lane.drops || lane.leaves) && lane.s_end_m < s_end_m - 1.0)
            .collect();
        let left_of_three = (0..lanes.len()).map(|k| is_left_of_three(&lanes, k as u16)).collect();
        let rules = |s: &Section| (s.limit_m_s, s.lower);
        let mut sections = lanes.iter().flat_map(|lane| &lane.sections).map(rules);
        let first = sections.next();
        let one_limit = sections.all(|rules| Some(rules) == first);
        let needs = !exits.is_empty() || ends_early.contains(&true);
        let is_throughout = |k: u16| {
            let whole = |l: &Lane| l.s_start_m <= s_start_m && l.s_end_m >= s_end_m;
            k == NO_LANE || lanes.get(k as usize).is_some_and(whole)
        };
        let beside_throughout = lanes.iter().map(|lane| match lane.sections[..] {
            [Section { beside, .. }] => {
                (is_throughout(beside.0) && is_throughout(beside.1)).then_some(beside)
            }
            _ => None,
        });
        Self {
            exits,
            s_start_m,
            s_end_m,
            sin_grade,
            ends_early,
            left_of_three,
            one_limit,
            needs,
            beside_throughout: beside_throughout.collect(),
            lanes,
        }
    }

    /// Does anybody on it have to change lanes, if nothing happens?
    pub(crate) fn has_needs(&self) -> bool {
        self.needs
    }

    /// Does one speed limit hold in all lanes, all along?
    pub(crate) fn has_one_limit(&self) -> bool {
        self.one_limit
    }

    /// Is the road the same all along: no lane begins or ends, one limit for each, one grade?
    pub(crate) fn is_even(&self) -> bool {
        let whole = |lane: &Lane| {
            lane.usage == LaneUse::Closed
                || lane.sections.len() == 1
                    && lane.s_start_m < self.s_start_m + 1.0
                    && lane.s_end_m > self.s_end_m - 1.0
        };
        self.lanes.iter().all(whole) && self.sin_grade.len() == 1
    }

    /// Is it the leftmost of three or more lanes?
    pub(crate) fn is_left_of_three(&self, lane: u16) -> bool {
        self.left_of_three[lane as usize]
    }

    /// Sine of the grade angle, positive uphill.
    pub(crate) fn sin_grade(&self, s_m: f64) -> f64 {
        if let [only] = self.sin_grade[..] {
            return only;
        }
        let k = ((s_m - self.s_start_m) * CELLS_PER_M).max(0.0) as usize;
        self.sin_grade[k.min(self.sin_grade.len() - 1)]
    }

    /// Lanes to the left and right of a lane at a station, [`NO_LANE`] if there is none.
    pub(crate) fn beside(&self, lane: u16, s_m: f64) -> (u16, u16) {
        if let Some(beside) = self.beside_throughout[lane as usize]
            && s_m >= self.s_start_m
            && s_m <= self.s_end_m
        {
            return beside;
        }
        let lane = &self.lanes[lane as usize];
        let there = |k: u16| {
            let reaches = |l: &Lane| s_m >= l.s_start_m && s_m <= l.s_end_m;
            if k != NO_LANE && reaches(&self.lanes[k as usize]) { k } else { NO_LANE }
        };
        let (left, right) = lane.section(s_m).beside;
        (there(left), there(right))
    }

    /// Does the lane end, for those who stay on the road, before the road does?
    pub(crate) fn ends_early(&self, lane: u16) -> bool {
        self.ends_early[lane as usize]
    }

    /// May a vehicle of this exit wish drive in the lane?
    pub(crate) fn is_open_to(&self, lane: u16, exit: u16) -> bool {
        match self.lanes[lane as usize].usage {
            LaneUse::Through => true,
            LaneUse::Entry | LaneUse::Closed => false,
            LaneUse::Exit => lane == exit,
        }
    }
}

#[cfg(test)]
impl LaneMap {
    /// A level straight road with lanes of one width, lane 0 rightmost, reference line at the right
    /// edge.
    pub(crate) fn straight(count: u16, length_m: f64, width_m: f64, limit_m_s: f64) -> Self {
        let lanes = (0..count).map(|k| {
            LaneSource {
                usage: LaneUse::Through,
                drops: false,
                leaves: false,
                s_start_m: 0.0,
                s_end_m: length_m,
                center_d_m: &|_| (f64::from(k) + 0.5) * width_m,
                width_m: &|_| width_m,
                limit_m_s: &|_| limit_m_s,
                beside: &|_| {
                    let left = if k + 1 < count { k + 1 } else { NO_LANE };
                    (left, k.checked_sub(1).unwrap_or(NO_LANE))
                },
            }
            .sample()
        });
        Self::new(lanes.collect(), 0.0, length_m, &|_| 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lane_that_is_the_same_all_along_is_read_as_its_cells_would_be() {
        let map = LaneMap::straight(3, 1003.7, 3.6, 30.0);
        for lane in &map.lanes {
            assert!(lane.throughout_m.is_some());
            let by_cell = Lane { throughout_m: None, ..lane.clone() };
            for s_m in (-20..1100).map(|k| 0.997 * f64::from(k)) {
                assert_eq!(lane.center_and_width_m(s_m), by_cell.center_and_width_m(s_m));
                assert_eq!(lane.center_and_slope(s_m), by_cell.center_and_slope(s_m));
                assert_eq!(lane.center_d_m(s_m), by_cell.center_d_m(s_m));
            }
        }
    }
}
