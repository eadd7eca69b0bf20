//! What is odd about a road: values that no highway has, each by its key, place and size.
//!
//! A road with a value that cannot be driven on is refused where it is read ([`Road::load`]); one
//! with a value that is more likely a mistake than a road is read, and its findings say so. `run`
//! and `map check` ask the same question.
//!
//! | key | refused | warned of |
//! |---|---|---|
//! | `width_m` of a lane | below zero, above 50 m | above 8 m; a lane nowhere wide enough for a truck |
//! | `speed_limit_m_s` | above 100 m/s | above 45 m/s (the highest posted limits are 160 km/h) |
//! | `curvature_1_m` | | more side acceleration at the limit than turns a loaded truck over; tighter than an articulated truck can turn |

use alloc::{format, string::String, vec::Vec};
use core::fmt;

use crate::{LaneKind, LaneTrack, Road};

/// Lane widths that are refused beyond, and warned of above, m.
const WIDTH_M: (f64, f64) = (50.0, 8.0);
/// Negative widths within rounding, m.
const ROUNDING_M: f64 = 1e-3;
/// A truck with its mirrors folded, m (Directive 96/53/EC: 2.55 m).
const TRUCK_WIDTH_M: f64 = 2.55;
/// Limits that are refused above, and warned of above, m/s.
const LIMIT_M_S: (f64, f64) = (100.0, 45.0);
/// Speed of a truck where the road has no lower limit, m/s (limiters: Directive 92/6/EEC).
const TRUCK_SPEED_M_S: f64 = 25.0;
/// Side acceleration that turns a loaded truck over, m/s² (0.35 to 0.45 g: C. B. Winkler, "Rollover
/// of heavy commercial vehicles", UMTRI 1999).
const ROLLOVER_M_S2: f64 = 4.0;
/// Outer radius in which an articulated truck must be able to turn, m (Directive 96/53/EC).
const TURNING_CIRCLE_M: f64 = 12.5;
/// Spacing of the samples, m.
const STEP_M: f64 = 5.0;

/// What follows from a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// The road is read; the value is probably a mistake.
    Warned,
    /// The road is not read.
    Refused,
}

/// A stretch on which a value is odd.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Finding {
    /// What follows from it.
    pub severity: Severity,
    /// The value's name: `width_m`, `speed_limit_m_s`, `curvature_1_m`.
    pub key: &'static str,
    /// The lane, where the value is a lane's.
    pub lane: Option<u16>,
    /// Where the stretch begins, m.
    pub s_m: f64,
    /// The worst value on it, in the key's unit.
    pub value: f64,
    /// Why it is odd.
    pub why: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {:.4}", self.key, self.value)?;
        if let Some(lane) = self.lane {
            write!(f, " of lane {lane}")?;
        }
        write!(f, " at s = {:.1} m: {}", self.s_m, self.why)
    }
}

impl Road {
    /// Everything odd about the road, in order of station. Sampled every 5 m and where a width or a
    /// limit changes.
    #[must_use]
    pub fn findings(&self) -> Vec<Finding> {
        let mut out = Vec::new();
        for lane in self.lanes() {
            widths(lane, &mut out);
            limits(Some(lane.id), &lane.speed_limits, &mut out);
        }
        limits(None, self.speed_limits(), &mut out);
        self.curves(&mut out);
        out.sort_by(|a, b| a.s_m.total_cmp(&b.s_m));
        out
    }

    fn curves(&self, out: &mut Vec<Finding>) {
        let mut stretch = Stretch::new("curvature_1_m", None);
        for s_m in stations(0.0, self.length_m(), self.line().joints_m()) {
            let k = self.line().at(s_m).curvature_1_m;
            let v = self.speed_limit_m_s(s_m).min(TRUCK_SPEED_M_S);
            let odd = if k.abs() * TURNING_CIRCLE_M > 1.0 {
                Some(format!("no articulated truck turns within {TURNING_CIRCLE_M} m"))
            } else if k.abs() * v * v > ROLLOVER_M_S2 {
                let (radius_m, side) = (1.0 / k.abs(), k.abs() * v * v);
                Some(format!(
                    "a radius of {radius_m:.1} m asks {side:.1} m/s2 of a truck at {v:.1} m/s, \
                     {ROLLOVER_M_S2} m/s2 turn it over"
                ))
            } else {
                None
            };
            stretch.at(s_m, k, odd.map(|why| (Severity::Warned, why)), out);
        }
        stretch.end(out);
    }
}

/// The findings that refuse a road, in one line; none if it can be driven on.
#[cfg(any(feature = "std", test))]
pub(crate) fn refusal(findings: &[Finding]) -> Option<String> {
    let refused: Vec<_> = findings.iter().filter(|f| f.severity == Severity::Refused).collect();
    let first = refused.first()?;
    let more = refused.len() - 1;
    Some(if more > 0 { format!("{first} (and {more} more)") } else { format!("{first}") })
}

fn widths(lane: &LaneTrack, out: &mut Vec<Finding>) {
    let mut stretch = Stretch::new("width_m", Some(lane.id));
    let mut widest = f64::NEG_INFINITY;
    for s_m in stations(lane.s_start_m, lane.s_end_m, lane.width.starts_m().iter().copied()) {
        let w = lane.width_m(s_m);
        widest = widest.max(w);
        let odd = if !(w >= -ROUNDING_M) {
            Some((Severity::Refused, "a lane is not narrower than nothing".into()))
        } else if w > WIDTH_M.0 {
            Some((Severity::Refused, format!("no lane is wider than {} m", WIDTH_M.0)))
        } else if w > WIDTH_M.1 {
            Some((Severity::Warned, format!("lanes are at most {} m wide", WIDTH_M.1)))
        } else {
            None
        };
        stretch.at(s_m, w, odd, out);
    }
    stretch.end(out);
    if lane.kind == LaneKind::Driving && (0.0..TRUCK_WIDTH_M).contains(&widest) {
        out.push(Finding {
            severity: Severity::Warned,
            key: "width_m",
            lane: Some(lane.id),
            s_m: lane.s_start_m,
            value: widest,
            why: format!("the lane is nowhere as wide as a truck ({TRUCK_WIDTH_M} m)"),
        });
    }
}

fn limits(lane: Option<u16>, limits: &[(f64, f64)], out: &mut Vec<Finding>) {
    for &(s_m, v) in limits.iter().filter(|l| l.1.is_finite() && l.1 > LIMIT_M_S.1) {
        let severity = if v > LIMIT_M_S.0 { Severity::Refused } else { Severity::Warned };
        let why =
            format!("no sign shows {:.0} km/h; {v} km/h would be {:.4} m/s", v * 3.6, v / 3.6);
        out.push(Finding { severity, key: "speed_limit_m_s", lane, s_m, value: v, why });
    }
}

/// Stations from `from_m` to `to_m`, [`STEP_M`] apart at most, the given ones and both sides of
/// them among them.
fn stations(from_m: f64, to_m: f64, given: impl Iterator<Item = f64>) -> Vec<f64> {
    const ASIDE_M: f64 = 1e-6;
    let steps = libm::ceil((to_m - from_m) / STEP_M).clamp(1.0, 1e7) as usize;
    let mut out: Vec<f64> =
        (0..=steps).map(|i| from_m + (to_m - from_m) * i as f64 / steps as f64).collect();
    let inside = |s: &f64| *s >= from_m && *s <= to_m;
    out.extend(given.flat_map(|s| [s - ASIDE_M, s]).filter(inside));
    out.sort_by(f64::total_cmp);
    out
}

/// The odd stretch that is being walked along: one finding each, with its worst value.
struct Stretch {
    key: &'static str,
    lane: Option<u16>,
    open: Option<Finding>,
}

impl Stretch {
    fn new(key: &'static str, lane: Option<u16>) -> Self {
        Self { key, lane, open: None }
    }

    fn at(
        &mut self,
        s_m: f64,
        value: f64,
        odd: Option<(Severity, String)>,
        out: &mut Vec<Finding>,
    ) {
        let Some((severity, why)) = odd else { return self.end(out) };
        match &mut self.open {
            Some(open) if open.severity == severity => {
                if !(value.abs() <= open.value.abs()) {
                    (open.value, open.why) = (value, why);
                }
            }
            _ => {
                self.end(out);
                let (key, lane) = (self.key, self.lane);
                self.open = Some(Finding { severity, key, lane, s_m, value, why });
            }
        }
    }

    fn end(&mut self, out: &mut Vec<Finding>) {
        out.extend(self.open.take());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Cubics, Line, builtin};
    use alloc::{vec, vec::Vec};

    /// 2 km with a curve from 1 km on.
    fn road(width: Cubics, limits: Vec<(f64, f64)>, curvature_1_m: f64) -> Road {
        let bend = [(0.0, 0.0), (1_000.0, 0.0), (1_050.0, curvature_1_m), (2_000.0, curvature_1_m)];
        let line = Line::from_curvature(0.0, &bend, Cubics::default(), Cubics::default());
        let mut lanes = crate::road::parallel_lanes(2, 3.75, 2_000.0);
        lanes[1].width = width;
        Road::new("odd", line, lanes, limits).unwrap()
    }

    fn found(road: &Road) -> Vec<(Severity, &'static str, f64, f64)> {
        road.findings().iter().map(|f| (f.severity, f.key, f.s_m, f.value)).collect()
    }

    #[test]
    fn the_built_in_roads_are_in_order() {
        for road in
            [builtin::highway(), builtin::highway_sag(), builtin::test_site(), builtin::flat(3e3)]
        {
            assert_eq!(road.findings(), vec![], "{}", road.name());
        }
    }

    #[test]
    fn odd_values_are_named_with_their_key_place_and_size() {
        // A map with lanes of 1e9 m, one with negative widths, one with limits of 80 m/s and one
        // with a bend of 20 m were all driven without a word.
        let plain = || Cubics::constant(3.75);
        let wide = Cubics::linear(&[(0.0, 3.75), (500.0, 3.75), (500.5, 1e9), (2_000.0, 1e9)]);
        let r = road(wide, vec![(0.0, 25.0)], 0.0);
        let all = found(&r);
        assert!(all.iter().any(|f| f.0 == Severity::Refused && f.1 == "width_m" && f.3 == 1e9));
        assert!(all.iter().all(|f| f.2 >= 500.0), "{all:?}");
        assert!(refusal(&r.findings()).unwrap().contains("width_m"));

        let thin = Cubics::linear(&[(0.0, 3.75), (700.0, -2.0), (1_400.0, 3.75)]);
        let all = found(&road(thin, vec![(0.0, 25.0)], 0.0));
        assert_eq!(all.len(), 1, "{all:?}");
        assert!(all[0].0 == Severity::Refused && (all[0].3 + 2.0).abs() < 0.05, "{all:?}");
        assert!((all[0].2 - 456.5).abs() < 5.0, "{all:?}");

        let fast = road(plain(), vec![(0.0, 25.0), (600.0, 80.0), (900.0, f64::INFINITY)], 0.0);
        assert_eq!(found(&fast), [(Severity::Warned, "speed_limit_m_s", 600.0, 80.0)]);
        assert_eq!(refusal(&fast.findings()), None);

        let all = found(&road(plain(), vec![(0.0, 25.0)], -0.05));
        assert_eq!(all.len(), 1, "{all:?}");
        assert!(all[0].1 == "curvature_1_m" && (all[0].3 + 0.05).abs() < 1e-9, "{all:?}");
        assert!(all[0].2 > 1_000.0 && all[0].2 < 1_050.0, "{all:?}");
        // At 5 m/s the same bend is an ordinary one.
        assert_eq!(found(&road(plain(), vec![(0.0, 5.0)], -0.05)), []);
    }

    #[test]
    fn a_lane_that_tapers_is_in_order_and_one_that_no_truck_fits_in_is_not() {
        let taper = Cubics::smooth_steps(&[(0.0, 0.0), (200.0, 3.75), (2_000.0, 3.75)]);
        assert_eq!(found(&road(taper, vec![(0.0, 25.0)], 0.0)), []);
        let all = found(&road(Cubics::constant(2.2), vec![(0.0, 25.0)], 0.0));
        assert_eq!(all, [(Severity::Warned, "width_m", 0.0, 2.2)]);
    }
}
