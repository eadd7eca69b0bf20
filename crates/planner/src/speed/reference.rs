//! The reference speed ahead (the paper's `Query_Reference_Speed`): set speed, speed limits and
//! curves, with a comfortable deceleration towards whatever is lower ahead.
//!
//! A limit or curve holds until the whole combination has left it.

use alloc::vec::Vec;

use road::{LaneEnd, Road};
use tractrix_core::{Geometry, SpeedPoint};

/// Spacing of the reference, m.
pub(super) const STEP_M: f64 = 10.0;
/// Points of the reference: 500 m ahead.
pub(super) const POINTS: usize = 51;
/// Steps that a combination is long, at most.
const LONGEST: usize = 10;
/// Deceleration towards lower limits ahead, m/s².
const APPROACH_DECEL_M_S2: f64 = 0.5;
/// The truck stops so far before a lane's end, m: room to pull away and move over.
const STOP_BEFORE_END_M: f64 = 45.0;

/// What bounds the reference speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SpeedBounds {
    /// Set speed, m/s.
    pub set_speed_m_s: f64,
    /// Speed limits of the road count.
    pub obey_speed_limits: bool,
    /// Largest lateral acceleration in curves, m/s².
    pub curve_accel_m_s2: f64,
}

impl SpeedBounds {
    /// What limits and curves allow, m/s, where it is one limit all the way that no curve is known
    /// to undercut: most of a highway, at a part of the cost of looking at every point.
    fn even_m_s(&self, road: &Road, lane: u16, from_m: f64, to_m: f64) -> Option<f64> {
        let [from_m, to_m] = [from_m, to_m].map(|s_m| s_m.clamp(0.0, road.length_m()));
        let limit_m_s = road.even_lane_speed_limit_m_s(lane, from_m, to_m)?;
        let line = road.line();
        let allows =
            |curved_1_m: f64| self.curve_accel_m_s2 / curved_1_m.max(1e-6) >= limit_m_s * limit_m_s;
        let holds = self.obey_speed_limits
            && (allows(line.curved_anywhere_at_most_1_m())
                || allows(line.curved_at_most_1_m(from_m, to_m)));
        holds.then_some(limit_m_s)
    }
}

/// One speed all the way.
#[derive(Debug, Clone, Copy)]
struct Even {
    /// Station of the first point, m.
    s_m: f64,
    speed_m_s: f64,
    /// What limits and curves allow, m/s.
    held_m_s: f64,
}

/// Speed reference from a station on.
#[derive(Debug)]
pub(crate) struct ReferenceSpeed {
    /// In place of the points, which nobody asks for in most ticks.
    even: Option<Even>,
    points: Vec<SpeedPoint>,
    /// What limits, curves and the lane's end allow at the points, m/s.
    held_m_s: [f64; POINTS],
}

impl Default for ReferenceSpeed {
    fn default() -> Self {
        Self { even: None, points: Vec::with_capacity(POINTS), held_m_s: [0.0; POINTS] }
    }
}

/// A copy has the room too; `clone_from` copies into it.
impl Clone for ReferenceSpeed {
    fn clone(&self) -> Self {
        let mut copy = Self::default();
        copy.clone_from(self);
        copy
    }

    fn clone_from(&mut self, from: &Self) {
        self.even = from.even;
        if from.even.is_none() {
            self.points.clone_from(&from.points);
            self.held_m_s = from.held_m_s;
        }
    }
}

impl ReferenceSpeed {
    /// Recomputes the reference from `s_m` on, in `lane`. `planned` is the predictive planner's
    /// speed at a station where it has one, which replaces the set speed; `None` if it plans nothing.
    pub(crate) fn update(
        &mut self,
        road: &Road,
        lane: u16,
        s_m: f64,
        geometry: &Geometry,
        bounds: &SpeedBounds,
        planned: Option<&dyn Fn(f64) -> Option<f64>>,
    ) {
        let behind = libm::ceil(geometry.length_m() / STEP_M).clamp(0.0, LONGEST as f64) as usize;
        let first_m = s_m - behind as f64 * STEP_M;
        let cap = |k: usize| {
            let (at_m, curvature_1_m) = road.line().curvature_1_m(first_m + k as f64 * STEP_M);
            let curve_2 = bounds.curve_accel_m_s2 / curvature_1_m.abs().max(1e-6);
            let limit = if bounds.obey_speed_limits {
                road.lane_speed_limit_m_s(lane, at_m)
            } else {
                f64::INFINITY
            };
            // the root is taken only where the curve is what bounds
            if curve_2 >= limit * limit { limit } else { libm::sqrt(curve_2) }
        };
        let lane_end_m = road
            .lanes()
            .get(usize::from(lane))
            .filter(|l| l.end != LaneEnd::Continues)
            .map_or(f64::INFINITY, |l| l.s_end_m - geometry.front_m - STOP_BEFORE_END_M);
        let last_m = s_m + (POINTS - 1) as f64 * STEP_M;
        // a step farther, so that no rounding of stations leaves it
        if let Some(limit_m_s) = bounds.even_m_s(road, lane, first_m, last_m + STEP_M)
            && last_m < lane_end_m
        {
            if planned.is_none() {
                let speed_m_s = bounds.set_speed_m_s.min(limit_m_s);
                self.even = Some(Even { s_m, speed_m_s, held_m_s: limit_m_s });
                return;
            }
            self.held_m_s = [limit_m_s; POINTS];
        } else {
            let mut caps_m_s = [f64::INFINITY; POINTS + LONGEST];
            for (k, cap_m_s) in caps_m_s.iter_mut().enumerate().take(POINTS + behind) {
                *cap_m_s = cap(k);
            }
            for (i, allowed) in self.held_m_s.iter_mut().enumerate() {
                let held = caps_m_s[i..=i + behind].iter().copied().fold(f64::INFINITY, f64::min);
                *allowed = if s_m + (i as f64) * STEP_M < lane_end_m { held } else { 0.0 };
            }
        }
        self.rise(s_m, |s| planned.and_then(|p| p(s)).unwrap_or(bounds.set_speed_m_s));
    }

    /// Recomputes the reference from what limits, curves and the lane's end allow another one, with
    /// another set speed.
    pub(crate) fn update_like(&mut self, other: &Self, set_speed_m_s: f64) {
        let Some(first) = other.points().next() else { return };
        self.held_m_s = other.even.map_or(other.held_m_s, |even| [even.held_m_s; POINTS]);
        self.rise(first.s_m, |_| set_speed_m_s);
    }

    /// As fast as is wanted and allowed, with a comfortable deceleration towards what is lower.
    fn rise(&mut self, s_m: f64, wanted_m_s: impl Fn(f64) -> f64) {
        self.even = None;
        self.points.clear();
        self.points.extend(self.held_m_s.iter().enumerate().map(|(i, held)| {
            let s_m = s_m + i as f64 * STEP_M;
            SpeedPoint { s_m, speed_m_s: wanted_m_s(s_m).min(*held), accel_m_s2: 0.0 }
        }));
        for i in (0..POINTS - 1).rev() {
            let ahead = self.points[i + 1].speed_m_s;
            let allowed = self.points[i].speed_m_s;
            // more than ahead is always reachable: no root where the speed does not fall
            let here = if allowed <= ahead {
                allowed
            } else {
                allowed.min(libm::sqrt(ahead * ahead + 2.0 * APPROACH_DECEL_M_S2 * STEP_M))
            };
            self.points[i].speed_m_s = here;
            self.points[i].accel_m_s2 = (ahead * ahead - here * here) / (2.0 * STEP_M);
        }
    }

    /// Reference speed, m/s, and acceleration, m/s², at a station; rises are not fed forward beyond
    /// 0.3 m/s². `None` before the first update.
    #[must_use]
    pub(crate) fn at(&self, s_m: f64) -> Option<(f64, f64)> {
        if let Some(even) = self.even {
            return Some((even.speed_m_s, 0.0));
        }
        let first = self.points.first()?;
        let x = ((s_m - first.s_m) / STEP_M).clamp(0.0, (self.points.len() - 1) as f64);
        let i = (x as usize).min(self.points.len() - 2);
        let (p, q) = (&self.points[i], &self.points[i + 1]);
        let f = x - i as f64;
        // Kinetic energy is linear between the points, so that the acceleration is constant there.
        let v2 =
            p.speed_m_s * p.speed_m_s + f * (q.speed_m_s * q.speed_m_s - p.speed_m_s * p.speed_m_s);
        Some((libm::sqrt(v2.max(0.0)), p.accel_m_s2.clamp(-2.0 * APPROACH_DECEL_M_S2, 0.3)))
    }

    /// Whether there was no update yet.
    #[must_use]
    pub(crate) fn is_empty(&self) -> bool {
        self.even.is_none() && self.points.is_empty()
    }

    /// The points.
    pub(crate) fn points(&self) -> impl Iterator<Item = SpeedPoint> {
        let one_speed = |even: Even| {
            (0..POINTS).map(move |i| {
                let s_m = even.s_m + i as f64 * STEP_M;
                SpeedPoint { s_m, speed_m_s: even.speed_m_s, accel_m_s2: 0.0 }
            })
        };
        let kept = if self.even.is_some() { &[][..] } else { &self.points };
        self.even.into_iter().flat_map(one_speed).chain(kept.iter().copied())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::reference_geometry;
    use road::{ProfilePoint, builtin};

    /// What a truck in `lane` at `s_m` would drive without others, with this set speed, whatever a
    /// plan of 12 m/s makes of its reference.
    fn wish(road: &Road, lane: u16, s_m: f64, bounds: &SpeedBounds) -> ReferenceSpeed {
        let mut planned = ReferenceSpeed::default();
        planned.update(road, lane, s_m, &reference_geometry(), bounds, Some(&|_| Some(12.0)));
        let mut wish = ReferenceSpeed::default();
        wish.update_like(&planned, bounds.set_speed_m_s);
        wish
    }

    #[test]
    fn the_wish_speed_is_the_set_speed_below_limits_and_curves_whatever_is_planned() {
        let road = builtin::highway();
        let (mut by_set_speed, mut by_limit, mut by_curve) = (0, 0, 0);
        for (set_speed_m_s, curve_accel_m_s2, obey_speed_limits) in
            [(18.0, 1.5, true), (35.0, 1.5, true), (35.0, 0.2, true), (35.0, 0.2, false)]
        {
            let bounds = SpeedBounds { set_speed_m_s, obey_speed_limits, curve_accel_m_s2 };
            for s_m in (0..25).map(|i| 500.0 + 500.0 * f64::from(i)) {
                let wish = wish(&road, 0, s_m, &bounds);
                // By hand: the lowest under the whole combination, and what is reached from behind
                // at 0.5 m/s² from anything lower ahead.
                let mut by_hand = f64::INFINITY;
                let mut reason = &mut by_set_speed;
                let behind = (reference_geometry().length_m() / STEP_M).ceil() as i32;
                for i in -behind..POINTS as i32 {
                    let (off, mut here) = (STEP_M * f64::from(i), [ProfilePoint::default()]);
                    road.profile(s_m + off, STEP_M, &mut here);
                    let limit = if obey_speed_limits {
                        road.lane_speed_limit_m_s(0, here[0].s_m)
                    } else {
                        f64::INFINITY
                    };
                    let bend = here[0].curvature_1_m.abs().max(1e-6);
                    let curve = (curve_accel_m_s2 / bend).sqrt();
                    for (bound, why) in [(set_speed_m_s, 0), (limit, 1), (curve, 2)] {
                        let from_here = (bound * bound + off.max(0.0)).sqrt();
                        if from_here < by_hand - 1e-9 {
                            by_hand = from_here;
                            reason = match why {
                                0 => &mut by_set_speed,
                                1 => &mut by_limit,
                                _ => &mut by_curve,
                            };
                        }
                    }
                }
                let (is, _) = wish.at(s_m).unwrap();
                assert!((is - by_hand).abs() < 1e-6, "{bounds:?} at {s_m} m: {is} and {by_hand}");
                *reason += 1;
            }
        }
        assert!(by_set_speed > 10 && by_limit > 10 && by_curve > 10);
    }

    #[test]
    fn an_even_stretch_gives_what_looking_at_every_point_gives() {
        // The shortcut for even stretches must not change a bit.
        let road = builtin::highway();
        let (mut even, mut uneven) = (0, 0);
        for (curve_accel_m_s2, obey_speed_limits) in [(1.5, true), (0.3, true), (1.5, false)] {
            let bounds = SpeedBounds { set_speed_m_s: 30.0, obey_speed_limits, curve_accel_m_s2 };
            for s_m in (0..1480).map(|i| 10.123 * f64::from(i)) {
                let mut reference = ReferenceSpeed::default();
                reference.update(&road, 0, s_m, &reference_geometry(), &bounds, None);
                let behind = (reference_geometry().length_m() / STEP_M).ceil();
                let is_even = bounds
                    .even_m_s(&road, 0, s_m - behind * STEP_M, s_m + POINTS as f64 * STEP_M)
                    .is_some();
                if is_even {
                    even += 1
                } else {
                    uneven += 1
                }
                // every point by itself, as the doc of the module has it
                let mut by_points = [0.0; POINTS];
                for (i, speed_m_s) in by_points.iter_mut().enumerate() {
                    *speed_m_s = bounds.set_speed_m_s;
                    for k in 0..=behind as i32 {
                        let at_m = s_m - behind * STEP_M + (i as f64 + f64::from(k)) * STEP_M;
                        let (at_m, bend_1_m) = road.line().curvature_1_m(at_m);
                        let curve_m_s = (curve_accel_m_s2 / bend_1_m.abs().max(1e-6)).sqrt();
                        let limit_m_s = road.lane_speed_limit_m_s(0, at_m);
                        let limit_m_s = if obey_speed_limits { limit_m_s } else { f64::INFINITY };
                        *speed_m_s = speed_m_s.min(curve_m_s).min(limit_m_s);
                    }
                }
                for i in (0..POINTS - 1).rev() {
                    let ahead = by_points[i + 1];
                    let reached = (ahead * ahead + 2.0 * APPROACH_DECEL_M_S2 * STEP_M).sqrt();
                    by_points[i] = by_points[i].min(reached);
                }
                assert_eq!(reference.points().count(), POINTS);
                for (point, speed_m_s) in reference.points().zip(by_points) {
                    assert_eq!(point.speed_m_s.to_bits(), speed_m_s.to_bits(), "at {s_m} m");
                    let (there_m_s, _) = reference.at(point.s_m).unwrap();
                    assert!((there_m_s - speed_m_s).abs() < 1e-9, "at {s_m} m");
                }
            }
        }
        assert!(even > 500 && uneven > 500, "{even} {uneven}");
    }

    #[test]
    fn the_wish_speed_falls_to_a_stop_before_a_lane_that_ends_and_waits_for_a_reference() {
        let road = builtin::highway();
        let ending = road.lanes().iter().find(|l| l.end != LaneEnd::Continues).unwrap();
        let bounds =
            SpeedBounds { set_speed_m_s: 20.0, obey_speed_limits: false, curve_accel_m_s2: 4.0 };
        // 2 * 0.5 m/s² * room is what is left of v², to the 10 m step.
        for room_m in [60.0, 150.0, 300.0] {
            let stop_m = ending.s_end_m - reference_geometry().front_m - STOP_BEFORE_END_M;
            let (is, _) =
                wish(&road, ending.id, stop_m - room_m, &bounds).at(stop_m - room_m).unwrap();
            let step = (is * is - room_m).abs();
            assert!(step <= STEP_M + 1e-6, "{is} m/s with {room_m} m of room");
        }
        let mut before = ReferenceSpeed::default();
        before.update_like(&ReferenceSpeed::default(), 20.0);
        assert_eq!(before.at(0.0), None);
    }
}
