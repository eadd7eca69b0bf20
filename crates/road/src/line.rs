//! The reference line as a table of knots: pose, curvature, height, bank.
//!
//! Between two knots the plan view is a cubic Hermite in x and y over station (error of order
//! `h^4 kappa'`, below a micrometre for clothoids at the knot spacing used here), heights are
//! cubic, curvature and bank linear.

use alloc::vec::Vec;

/// One knot of the reference line.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Knot {
    /// Station, m.
    pub s_m: f64,
    /// Map x, m.
    pub x_m: f64,
    /// Map y, m.
    pub y_m: f64,
    /// Heading, rad, continuous (not wrapped).
    pub heading_rad: f64,
    /// Curvature, 1/m, positive left.
    pub curvature_1_m: f64,
    /// Height, m.
    pub z_m: f64,
    /// Slope dz/ds, dimensionless.
    pub slope: f64,
    /// Bank, rad, left side up.
    pub bank_rad: f64,
}

/// A reference line. Knots are spaced evenly, so that a look-up is a division.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    step_m: f64,
    knots: Vec<Knot>,
}

impl Line {
    /// Integrates curvature, slope and bank given as functions of station into a line that starts
    /// at the map's origin in the direction `heading_rad`.
    pub fn integrate(
        length_m: f64,
        heading_rad: f64,
        curvature_1_m: impl Fn(f64) -> f64,
        slope: impl Fn(f64) -> f64,
        bank_rad: impl Fn(f64) -> f64,
    ) -> Self {
        let intervals = (libm::ceil(length_m / 2.0) as usize).max(1);
        let step_m = length_m / intervals as f64;
        let mut knots = Vec::with_capacity(intervals + 1);
        let mut knot = Knot {
            heading_rad,
            curvature_1_m: curvature_1_m(0.0),
            slope: slope(0.0),
            bank_rad: bank_rad(0.0),
            ..Knot::default()
        };
        knots.push(knot);
        for i in 0..intervals {
            let s0 = i as f64 * step_m;
            let mid = s0 + 0.5 * step_m;
            let s1 = (i + 1) as f64 * step_m;
            let (k0, km, k1) = (knot.curvature_1_m, curvature_1_m(mid), curvature_1_m(s1));
            let heading_mid = knot.heading_rad + step_m * (5.0 * k0 + 8.0 * km - k1) / 24.0;
            let heading_end = knot.heading_rad + step_m * (k0 + 4.0 * km + k1) / 6.0;
            let (sin0, cos0) = libm::sincos(knot.heading_rad);
            let (sinm, cosm) = libm::sincos(heading_mid);
            let (sin1, cos1) = libm::sincos(heading_end);
            let (g0, gm, g1) = (knot.slope, slope(mid), slope(s1));
            knot = Knot {
                s_m: s1,
                x_m: knot.x_m + step_m * (cos0 + 4.0 * cosm + cos1) / 6.0,
                y_m: knot.y_m + step_m * (sin0 + 4.0 * sinm + sin1) / 6.0,
                heading_rad: heading_end,
                curvature_1_m: k1,
                z_m: knot.z_m + step_m * (g0 + 4.0 * gm + g1) / 6.0,
                slope: g1,
                bank_rad: bank_rad(s1),
            };
            knots.push(knot);
        }
        Self { step_m, knots }
    }

    /// Length, m.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.knots[self.knots.len() - 1].s_m
    }

    /// The knots.
    #[must_use]
    pub fn knots(&self) -> &[Knot] {
        &self.knots
    }

    /// The line at a station, clamped to its ends.
    #[must_use]
    pub fn at(&self, s_m: f64) -> Knot {
        let n = self.knots.len();
        let u = s_m / self.step_m;
        let i = if u > 0.0 { (u as usize).min(n - 2) } else { 0 };
        let (a, b) = (&self.knots[i], &self.knots[i + 1]);
        let h = self.step_m;
        let t = ((s_m - a.s_m) / h).clamp(0.0, 1.0);
        let (sa, ca) = libm::sincos(a.heading_rad);
        let (sb, cb) = libm::sincos(b.heading_rad);
        let curve = |p0: f64, m0: f64, p1: f64, m1: f64| {
            let (t2, t3) = (t * t, t * t * t);
            (2.0 * t3 - 3.0 * t2 + 1.0) * p0
                + (t3 - 2.0 * t2 + t) * h * m0
                + (3.0 * t2 - 2.0 * t3) * p1
                + (t3 - t2) * h * m1
        };
        let curvature = a.curvature_1_m + t * (b.curvature_1_m - a.curvature_1_m);
        Knot {
            s_m: a.s_m + t * h,
            x_m: curve(a.x_m, ca, b.x_m, cb),
            y_m: curve(a.y_m, sa, b.y_m, sb),
            heading_rad: curve(a.heading_rad, a.curvature_1_m, b.heading_rad, b.curvature_1_m),
            curvature_1_m: curvature,
            z_m: curve(a.z_m, a.slope, b.z_m, b.slope),
            slope: a.slope + t * (b.slope - a.slope),
            bank_rad: a.bank_rad + t * (b.bank_rad - a.bank_rad),
        }
    }

    /// Station and offset of the point of the line nearest to (x, y); near `hint_s_m` if given,
    /// else over the whole line.
    #[must_use]
    pub fn project(&self, x_m: f64, y_m: f64, hint_s_m: Option<f64>) -> Option<(f64, f64)> {
        if !(x_m.is_finite() && y_m.is_finite()) {
            return None;
        }
        let mut s = match hint_s_m {
            Some(s) => s,
            None => {
                let nearest = self.knots.iter().min_by(|a, b| {
                    let d =
                        |k: &Knot| (k.x_m - x_m) * (k.x_m - x_m) + (k.y_m - y_m) * (k.y_m - y_m);
                    d(a).total_cmp(&d(b))
                })?;
                nearest.s_m
            }
        };
        for _ in 0..12 {
            let k = self.at(s);
            let (sin, cos) = libm::sincos(k.heading_rad);
            let (dx, dy) = (x_m - k.x_m, y_m - k.y_m);
            let along = dx * cos + dy * sin;
            let across = dy * cos - dx * sin;
            let next =
                (s + along / (1.0 - k.curvature_1_m * across).max(0.1)).clamp(0.0, self.length_m());
            let moved = (next - s).abs();
            s = next;
            if moved < 1e-9 {
                break;
            }
        }
        let k = self.at(s);
        let (sin, cos) = libm::sincos(k.heading_rad);
        Some((s, (y_m - k.y_m) * cos - (x_m - k.x_m) * sin))
    }
}
