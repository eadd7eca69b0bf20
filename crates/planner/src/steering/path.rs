//! The path in road coordinates: a lane's centre plus, during a lane change, a quintic offset.
//!
//! `d(s) = c(s) + q(u)`, `u = (s - s_0)/l` in 0..1, with `q` a fifth-order polynomial that starts at
//! the present offset, slope and second derivative and ends on the centre with none (the paper's
//! quintic trajectory, laid over station so that the path does not depend on the speed driven).
//! The map curvature follows from the road's curvature `k_r` (Werling 2010, Eq. A.8, without the
//! term of the road's own change of curvature, below 1e-6 1/m here):
//! `k = ( (d'' + k_r d' tan(a)) cos²(a)/(1 - k_r d) + k_r ) cos(a)/(1 - k_r d)`, `tan(a) = d'/(1 - k_r d)`.

use road::Road;
use tractrix_core::PathPoint;

/// Base over which a lane centre's slope is taken, m; lane centres are piecewise linear.
const SLOPE_BASE_M: f64 = 20.0;

/// Lateral position and its derivatives along the road.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Lateral {
    /// Offset from the reference line, m.
    pub d_m: f64,
    /// First derivative by station.
    pub slope: f64,
    /// Second derivative by station, 1/m.
    pub second_1_m: f64,
}

impl Lateral {
    /// Heading relative to the road, rad, and map curvature, 1/m, where the road has this curvature,
    /// 1/m.
    #[must_use]
    pub fn direction(&self, road_curvature_1_m: f64) -> (f64, f64) {
        let (tan, curvature_1_m) = bend(self, road_curvature_1_m);
        (libm::atan(tan), curvature_1_m)
    }
}

/// Fifth-order polynomial from a state to zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quintic {
    start_s_m: f64,
    length_m: f64,
    c: [f64; 6],
}

impl Quintic {
    /// From `start` (relative to the line that it ends on) at `start_s_m` to zero offset, slope and
    /// curvature `length_m` further; `length_m` is at least 1 m.
    #[must_use]
    pub fn to_zero(start: Lateral, start_s_m: f64, length_m: f64) -> Self {
        let l = length_m.max(1.0);
        let (p, v, a) = (start.d_m, start.slope * l, start.second_1_m * l * l);
        // Boundary conditions q(1) = q'(1) = q''(1) = 0 solved for c3, c4, c5
        let c = [
            p,
            v,
            0.5 * a,
            -10.0 * p - 6.0 * v - 1.5 * a,
            15.0 * p + 8.0 * v + 1.5 * a,
            -6.0 * p - 3.0 * v - 0.5 * a,
        ];
        Self { start_s_m, length_m: l, c }
    }

    /// Station at which it has reached zero, m.
    #[must_use]
    pub fn end_s_m(&self) -> f64 {
        self.start_s_m + self.length_m
    }

    /// Length, m.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.length_m
    }

    /// Value and derivatives at a station; zero beyond the end.
    #[must_use]
    pub fn at(&self, s_m: f64) -> Lateral {
        let u = ((s_m - self.start_s_m) / self.length_m).max(0.0);
        if u >= 1.0 {
            return Lateral::default();
        }
        let [c0, c1, c2, c3, c4, c5] = self.c;
        let l = self.length_m;
        Lateral {
            d_m: c0 + u * (c1 + u * (c2 + u * (c3 + u * (c4 + u * c5)))),
            slope: (c1 + u * (2.0 * c2 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))) / l,
            second_1_m: (2.0 * c2 + u * (6.0 * c3 + u * (12.0 * c4 + u * 20.0 * c5))) / (l * l),
        }
    }

    /// Third derivative by station at a station, 1/m²; zero beyond the end.
    #[must_use]
    pub fn third_1_m2(&self, s_m: f64) -> f64 {
        let u = ((s_m - self.start_s_m) / self.length_m).max(0.0);
        if u >= 1.0 {
            return 0.0;
        }
        let [.., c3, c4, c5] = self.c;
        let l = self.length_m;
        (6.0 * c3 + u * (24.0 * c4 + u * 60.0 * c5)) / (l * l * l)
    }
}

/// The driven path: the centre of a lane and the way back to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LateralPath {
    /// Lane track whose centre is followed in the end.
    pub lane: u16,
    /// Remaining offset from that centre.
    pub offset: Option<Quintic>,
}

/// Centre of a lane and its slope; the second derivative is taken as zero.
#[must_use]
pub(super) fn lane_centre(road: &Road, lane: u16, s_m: f64) -> Lateral {
    let Some(track) = road.lanes().get(usize::from(lane)) else {
        return Lateral::default();
    };
    if let Some(d_m) = track.center.as_constant() {
        return Lateral { d_m, ..Lateral::default() };
    }
    let half = 0.5 * SLOPE_BASE_M;
    Lateral {
        d_m: track.center_d_m(s_m),
        slope: (track.center_d_m(s_m + half) - track.center_d_m(s_m - half)) / SLOPE_BASE_M,
        second_1_m: 0.0,
    }
}

/// A lateral state at a station relative to a lane's centre.
#[must_use]
pub(super) fn off_centre(road: &Road, lane: u16, start: Lateral, s_m: f64) -> Lateral {
    let centre = lane_centre(road, lane, s_m);
    Lateral {
        d_m: start.d_m - centre.d_m,
        slope: start.slope - centre.slope,
        second_1_m: start.second_1_m - centre.second_1_m,
    }
}

impl LateralPath {
    /// The lane's centre.
    #[must_use]
    pub fn keep(lane: u16) -> Self {
        Self { lane, offset: None }
    }

    /// A path that leaves from `start` at `s_m` and is on the lane's centre after `length_m`.
    #[must_use]
    pub fn join(road: &Road, lane: u16, start: Lateral, s_m: f64, length_m: f64) -> Self {
        let relative = off_centre(road, lane, start, s_m);
        Self { lane, offset: Some(Quintic::to_zero(relative, s_m, length_m)) }
    }

    /// Lateral position at a station.
    #[must_use]
    pub fn at(&self, road: &Road, s_m: f64) -> Lateral {
        let centre = lane_centre(road, self.lane, s_m);
        let q = self.offset.map(|q| q.at(s_m)).unwrap_or_default();
        Lateral {
            d_m: centre.d_m + q.d_m,
            slope: centre.slope + q.slope,
            second_1_m: centre.second_1_m + q.second_1_m,
        }
    }

    /// Heading relative to the road and map curvature at a station: (rad, 1/m).
    #[must_use]
    pub fn direction(&self, road: &Road, s_m: f64) -> (f64, f64) {
        self.at(road, s_m).direction(road.line().curvature_1_m(s_m).1)
    }

    /// Map curvature alone at a station, 1/m: that of [`Self::direction`].
    #[must_use]
    pub(crate) fn curvature_1_m(&self, road: &Road, s_m: f64) -> f64 {
        bend(&self.at(road, s_m), road.line().curvature_1_m(s_m).1).1
    }

    /// The path as a map point, `time_s` from now.
    #[must_use]
    pub fn point(&self, road: &Road, s_m: f64, time_s: f64) -> PathPoint {
        let lateral = self.at(road, s_m);
        let at = road.at(s_m, lateral.d_m);
        let (angle, curvature_1_m) = lateral.direction(at.curvature_1_m);
        PathPoint {
            time_s,
            s_m,
            d_m: lateral.d_m,
            x_m: at.x_m,
            y_m: at.y_m,
            yaw_rad: at.heading_rad + angle,
            curvature_1_m,
        }
    }
}

/// Tangent of the heading relative to the road, and map curvature, 1/m.
pub(super) fn bend(lateral: &Lateral, road_curvature_1_m: f64) -> (f64, f64) {
    let k_r = road_curvature_1_m;
    let stretch = (1.0 - k_r * lateral.d_m).max(0.05);
    let tan = lateral.slope / stretch;
    let cos2 = 1.0 / (1.0 + tan * tan);
    let cos = libm::sqrt(cos2);
    let bend = (lateral.second_1_m + k_r * lateral.slope * tan) * cos2 / stretch + k_r;
    (tan, bend * cos / stretch)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quintic_keeps_its_six_boundary_conditions() {
        let start = Lateral { d_m: -3.75, slope: 0.01, second_1_m: -2e-4 };
        let q = Quintic::to_zero(start, 100.0, 140.0);
        let first = q.at(100.0);
        assert!((first.d_m - start.d_m).abs() < 1e-12);
        assert!((first.slope - start.slope).abs() < 1e-12);
        assert!((first.second_1_m - start.second_1_m).abs() < 1e-12);
        let last = q.at(240.0 - 1e-9);
        assert!(last.d_m.abs() < 1e-9 && last.slope.abs() < 1e-9 && last.second_1_m.abs() < 1e-9);
    }

    #[test]
    fn peak_lateral_acceleration_and_jerk_equal_the_closed_forms() {
        // 5.7735 d/T² and 60 d/T³ for a change from rest over d = 3.75 m in T = 6 s at 20 m/s
        let (d, t, v) = (3.75, 6.0, 20.0);
        let q = Quintic::to_zero(Lateral { d_m: -d, ..Lateral::default() }, 0.0, v * t);
        let (mut a, mut j) = (0.0_f64, 0.0_f64);
        for i in 0..1200 {
            let s = 0.1 * f64::from(i);
            a = a.max((q.at(s).second_1_m * v * v).abs());
            j = j.max((q.third_1_m2(s) * v * v * v).abs());
        }
        assert!((a - 5.7735 * d / (t * t)).abs() < 1e-3, "{a}");
        assert!((j - 60.0 * d / (t * t * t)).abs() < 1e-3, "{j}");
    }
}
