//! Plan-view elements of OpenDRIVE, evaluated exactly in f64: line, arc, spiral, poly3, paramPoly3.
//!
//! Symbols: `ds` distance along the element, m; `k` curvature, 1/m, positive left; `(u, v)` local
//! axes of the element (u along its start heading, v left), m. Source: ASAM OpenDRIVE 1.8,
//! section 9 (geometry).
//!
//! A spiral is a clothoid: `θ(ds) = k0 ds + (k1 - k0) ds²/(2 L)`, its position the Fresnel integral
//! of `(cos θ, sin θ)`, taken by Gauss-Legendre quadrature on panels that turn less than 0.4 rad
//! (error below 1e-15 of the length). poly3 and paramPoly3 are not parametrised by arc length
//! (a paramPoly3 with pRange arcLength only nearly so); `ds` is turned into their parameter by
//! inverting the arc-length integral, a paramPoly3 scaled so that its end lies at its stated length.

/// One element of the plan view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// Straight line.
    Line,
    /// Circular arc.
    Arc {
        /// Curvature, 1/m.
        curvature_1_m: f64,
    },
    /// Clothoid, curvature linear in station.
    Spiral {
        /// Curvature at the start, 1/m.
        start_1_m: f64,
        /// Curvature at the end, 1/m.
        end_1_m: f64,
    },
    /// `v = a + b u + c u² + d u³`.
    Poly3 {
        /// `[a, b, c, d]`.
        v: [f64; 4],
    },
    /// `u(p), v(p)`, both cubic.
    ParamPoly3 {
        /// `[aU, bU, cU, dU]`.
        u: [f64; 4],
        /// `[aV, bV, cV, dV]`.
        v: [f64; 4],
        /// `p` runs from 0 to 1 (else from 0 to the length).
        normalized: bool,
    },
}

/// An element with its place on the map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    /// Station of its start on its road, m.
    pub s_m: f64,
    /// Map x of its start, m.
    pub x_m: f64,
    /// Map y of its start, m.
    pub y_m: f64,
    /// Heading at its start, rad.
    pub heading_rad: f64,
    /// Length, m.
    pub length_m: f64,
    /// What it is.
    pub shape: Shape,
}

/// Point and derivatives of a plan curve with respect to station.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Jet {
    /// Point (x, y), m.
    pub point: [f64; 2],
    /// First derivative; unit length where the parameter is arc length.
    pub first: [f64; 2],
    /// Second derivative, 1/m.
    pub second: [f64; 2],
}

impl Jet {
    /// Direction of travel, rad, in (-π, π].
    #[must_use]
    pub fn heading_rad(&self) -> f64 {
        libm::atan2(self.first[1], self.first[0])
    }

    /// Curvature, 1/m, positive left.
    #[must_use]
    pub fn curvature_1_m(&self) -> f64 {
        let ([x1, y1], [x2, y2]) = (self.first, self.second);
        let q = x1 * x1 + y1 * y1;
        (x1 * y2 - y1 * x2) / (q * libm::sqrt(q))
    }
}

impl Placed {
    /// The element at `ds_m` metres from its start.
    #[must_use]
    pub fn at(&self, ds_m: f64) -> Jet {
        let local = self.shape.local(ds_m, self.length_m);
        let (sin, cos) = libm::sincos(self.heading_rad);
        let turn = |[u, v]: [f64; 2]| [cos * u - sin * v, sin * u + cos * v];
        let [x, y] = turn(local.point);
        Jet {
            point: [self.x_m + x, self.y_m + y],
            first: turn(local.first),
            second: turn(local.second),
        }
    }
}

/// A paramPoly3 must be between half and twice as long as stated.
#[cfg(feature = "std")]
const ODD_LENGTH: f64 = 2.0;

#[cfg(feature = "std")]
impl Placed {
    /// The length of the curve if it has nothing to do with the stated one, m.
    pub(crate) fn odd_length_m(&self) -> Option<f64> {
        let Shape::ParamPoly3 { u, v, normalized } = self.shape else { return None };
        let p_end = if normalized { 1.0 } else { self.length_m };
        let length = integrate(|p| libm::hypot(slope(u, p), slope(v, p)), 0.0, p_end);
        let share = length / self.length_m;
        (!(share < ODD_LENGTH && share > 1.0 / ODD_LENGTH)).then_some(length)
    }
}

impl Shape {
    /// Point and derivatives in the element's own axes.
    fn local(&self, ds: f64, length: f64) -> Jet {
        match *self {
            Self::Line => Jet { point: [ds, 0.0], first: [1.0, 0.0], second: [0.0, 0.0] },
            Self::Arc { curvature_1_m: k } => clothoid(k, 0.0, ds),
            Self::Spiral { start_1_m, end_1_m } => {
                clothoid(start_1_m, (end_1_m - start_1_m) / length, ds)
            }
            Self::Poly3 { v } => {
                let speed = |u: f64| libm::hypot(1.0, slope(v, u));
                let u = invert_arc_length(speed, ds, ds);
                by_arc_length([u, cubic(v, u)], [1.0, slope(v, u)], [0.0, bend(v, u)], 1.0)
            }
            Self::ParamPoly3 { u, v, normalized } => {
                let p_end = if normalized { 1.0 } else { length };
                let speed = |p: f64| libm::hypot(slope(u, p), slope(v, p));
                // The whole curve is driven over the stated length, so that its end is met.
                let scale = integrate(speed, 0.0, p_end) / length;
                let p = invert_arc_length(speed, ds * scale, ds / length * p_end);
                by_arc_length(
                    [cubic(u, p), cubic(v, p)],
                    [slope(u, p), slope(v, p)],
                    [bend(u, p), bend(v, p)],
                    scale,
                )
            }
        }
    }
}

fn cubic([a, b, c, d]: [f64; 4], p: f64) -> f64 {
    a + p * (b + p * (c + p * d))
}

fn slope([_, b, c, d]: [f64; 4], p: f64) -> f64 {
    b + p * (2.0 * c + p * 3.0 * d)
}

fn bend([_, _, c, d]: [f64; 4], p: f64) -> f64 {
    2.0 * c + 6.0 * d * p
}

/// Turns derivatives by a parameter `p` into those by station, where one metre of station is
/// `scale` metres of curve: `T = c'/|c'|`, curvature vector `(c'' - (c''·T) T)/|c'|²`.
fn by_arc_length(point: [f64; 2], d1: [f64; 2], d2: [f64; 2], scale: f64) -> Jet {
    let q = (d1[0] * d1[0] + d1[1] * d1[1]).max(1e-24);
    let speed = libm::sqrt(q);
    let t = [d1[0] / speed, d1[1] / speed];
    let along = d2[0] * t[0] + d2[1] * t[1];
    let n = [(d2[0] - along * t[0]) / q, (d2[1] - along * t[1]) / q];
    Jet {
        point,
        first: [t[0] * scale, t[1] * scale],
        second: [n[0] * scale * scale, n[1] * scale * scale],
    }
}

/// Clothoid from the origin along the u axis: curvature `k + dk s`.
fn clothoid(k: f64, dk: f64, s: f64) -> Jet {
    let theta = |s: f64| s * (k + 0.5 * dk * s);
    let (sin, cos) = libm::sincos(theta(s));
    let kappa = k + dk * s;
    let first = [cos, sin];
    let second = [-kappa * sin, kappa * cos];
    if dk == 0.0 && libm::fabs(k * s) > 1e-3 {
        return Jet { point: [sin / k, (1.0 - cos) / k], first, second };
    }
    let turned = libm::fabs(k * s) + 0.5 * libm::fabs(dk) * s * s;
    let panels = libm::ceil(turned / 0.4).clamp(1.0, 1e4) as usize;
    let h = s / panels as f64;
    let mut point = [0.0, 0.0];
    for i in 0..panels {
        let mid = (i as f64 + 0.5) * h;
        for (x, w) in GAUSS_8 {
            for at in [mid - 0.5 * h * x, mid + 0.5 * h * x] {
                let (sin, cos) = libm::sincos(theta(at));
                point[0] += 0.5 * h * w * cos;
                point[1] += 0.5 * h * w * sin;
            }
        }
    }
    Jet { point, first, second }
}

/// Positive abscissae and weights of the 8-point Gauss-Legendre rule (Abramowitz and Stegun 25.4).
const GAUSS_8: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
];

fn integrate(f: impl Fn(f64) -> f64, a: f64, b: f64) -> f64 {
    const PANELS: usize = 8;
    let h = (b - a) / PANELS as f64;
    let mut sum = 0.0;
    for i in 0..PANELS {
        let mid = a + (i as f64 + 0.5) * h;
        for (x, w) in GAUSS_8 {
            sum += 0.5 * h * w * (f(mid - 0.5 * h * x) + f(mid + 0.5 * h * x));
        }
    }
    sum
}

/// The parameter at which the arc length from 0 is `arc`: Newton, held inside a bracket.
fn invert_arc_length(speed: impl Fn(f64) -> f64, arc: f64, guess: f64) -> f64 {
    let (mut low, mut high) = if arc >= 0.0 { (0.0, f64::MAX) } else { (f64::MIN, 0.0) };
    let mut p = guess;
    for _ in 0..40 {
        let excess = integrate(&speed, 0.0, p) - arc;
        if libm::fabs(excess) <= 1e-12 * (1.0 + libm::fabs(arc)) {
            break;
        }
        if excess > 0.0 {
            high = p
        } else {
            low = p
        }
        let newton = p - excess / speed(p).max(1e-9);
        let inside = newton > low && newton < high;
        p = if inside || high == f64::MAX || low == f64::MIN { newton } else { 0.5 * (low + high) };
        if !p.is_finite() {
            return guess;
        }
    }
    p
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::PI;

    fn at(shape: Shape, length_m: f64, ds: f64) -> Jet {
        Placed { s_m: 0.0, x_m: 0.0, y_m: 0.0, heading_rad: 0.0, length_m, shape }.at(ds)
    }

    fn near(a: f64, b: f64, tolerance: f64) {
        assert!((a - b).abs() <= tolerance, "{a} is not {b}");
    }

    /// Fresnel integrals by their power series (Abramowitz and Stegun 7.3.11, 7.3.13).
    fn fresnel(x: f64) -> (f64, f64) {
        let q = 0.5 * PI * x * x;
        let (mut c, mut s, mut term) = (0.0, 0.0, x);
        for n in 0..60 {
            let k = f64::from(n);
            if n % 2 == 0 {
                c += if n % 4 == 0 { term } else { -term } / (2.0 * k + 1.0);
            } else {
                s += if n % 4 == 1 { term } else { -term } / (2.0 * k + 1.0);
            }
            term *= q / (k + 1.0);
        }
        (c, s)
    }

    /// Length of the parabola `v = c u²` from 0 to u.
    fn parabola_length(c: f64, u: f64) -> f64 {
        0.5 * u * (1.0 + 4.0 * c * c * u * u).sqrt() + (2.0 * c * u).asinh() / (4.0 * c)
    }

    #[test]
    fn an_arc_is_a_circle() {
        for k in [1.0 / 600.0, -0.02, 1e-9] {
            let j = at(Shape::Arc { curvature_1_m: k }, 300.0, 250.0);
            near(j.point[0], (k * 250.0).sin() / k, 1e-9);
            near(j.point[1], 2.0 * (k * 125.0).sin().powi(2) / k, 1e-9);
            near(libm::remainder(j.heading_rad() - k * 250.0, 2.0 * PI), 0.0, 1e-12);
            near(j.curvature_1_m(), k, 1e-15);
        }
    }

    #[test]
    fn a_clothoid_ends_where_the_fresnel_series_says() {
        for (length, k) in [(150.0, 1.0 / 600.0), (80.0, -1.0 / 40.0), (40.0, 0.2)] {
            let j = at(Shape::Spiral { start_1_m: 0.0, end_1_m: k }, length, length);
            let scale = (PI * length / f64::abs(k)).sqrt();
            let (c, s) = fresnel(length / scale);
            near(j.point[0], scale * c, 1e-9);
            near(j.point[1], k.signum() * scale * s, 1e-9);
            near(j.first[0], (0.5 * k * length).cos(), 1e-12);
            near(j.curvature_1_m(), k, 1e-12);
        }
    }

    #[test]
    fn a_clothoid_between_two_curvatures_is_a_part_of_one_from_zero() {
        let rate = 1e-4;
        let whole = at(Shape::Spiral { start_1_m: 0.0, end_1_m: rate * 200.0 }, 200.0, 200.0);
        let first = Placed {
            s_m: 0.0,
            x_m: 0.0,
            y_m: 0.0,
            heading_rad: 0.0,
            length_m: 120.0,
            shape: Shape::Spiral { start_1_m: 0.0, end_1_m: rate * 120.0 },
        };
        let joint = first.at(120.0);
        let second = Placed {
            s_m: 120.0,
            x_m: joint.point[0],
            y_m: joint.point[1],
            heading_rad: joint.heading_rad(),
            length_m: 80.0,
            shape: Shape::Spiral { start_1_m: rate * 120.0, end_1_m: rate * 200.0 },
        };
        let end = second.at(80.0);
        near(end.point[0], whole.point[0], 1e-9);
        near(end.point[1], whole.point[1], 1e-9);
    }

    #[test]
    fn a_poly3_parabola_has_the_parabolas_arc_length() {
        let c = 0.004;
        for u in [5.0, 60.0, 120.0] {
            let j = at(Shape::Poly3 { v: [0.0, 0.0, c, 0.0] }, 150.0, parabola_length(c, u));
            near(j.point[0], u, 1e-9);
            near(j.point[1], c * u * u, 1e-9);
            near(j.curvature_1_m(), 2.0 * c / (1.0 + 4.0 * c * c * u * u).powf(1.5), 1e-12);
        }
    }

    #[test]
    fn a_param_poly3_runs_by_arc_length_in_both_ranges() {
        let (c, u_end) = (0.004, 100.0);
        let length = parabola_length(c, u_end);
        let by_unit = Shape::ParamPoly3 {
            u: [0.0, u_end, 0.0, 0.0],
            v: [0.0, 0.0, c * u_end * u_end, 0.0],
            normalized: true,
        };
        let k = u_end / length;
        let by_length = Shape::ParamPoly3 {
            u: [0.0, k, 0.0, 0.0],
            v: [0.0, 0.0, c * k * k, 0.0],
            normalized: false,
        };
        for shape in [by_unit, by_length] {
            for u in [0.0, 20.0, 77.0, 100.0] {
                let j = at(shape, length, parabola_length(c, u));
                near(j.point[0], u, 1e-9);
                near(j.point[1], c * u * u, 1e-9);
                near(libm::hypot(j.first[0], j.first[1]), 1.0, 1e-12);
            }
        }
    }

    #[test]
    fn a_param_poly3_whose_stated_length_is_off_still_meets_its_end() {
        let shape = Shape::ParamPoly3 {
            u: [0.0, 100.0, 0.0, 0.0],
            v: [0.0, 0.0, 10.0, 0.0],
            normalized: true,
        };
        let end = at(shape, 98.0, 98.0);
        near(end.point[0], 100.0, 1e-9);
        near(end.point[1], 10.0, 1e-9);
    }

    #[test]
    fn derivatives_are_those_of_the_position() {
        let shapes = [
            Shape::Line,
            Shape::Arc { curvature_1_m: -0.01 },
            Shape::Spiral { start_1_m: 0.01, end_1_m: -0.02 },
            Shape::Poly3 { v: [0.5, 0.1, -0.002, 1e-5] },
            Shape::ParamPoly3 {
                u: [0.0, 90.0, 5.0, -3.0],
                v: [0.0, 0.0, 12.0, -5.0],
                normalized: true,
            },
        ];
        for shape in shapes {
            for ds in [10.0, 45.0, 80.0] {
                let h = 1e-3;
                let (a, j, b) =
                    (at(shape, 95.0, ds - h), at(shape, 95.0, ds), at(shape, 95.0, ds + h));
                for i in 0..2 {
                    near((b.point[i] - a.point[i]) / (2.0 * h), j.first[i], 1e-7);
                    near((b.first[i] - a.first[i]) / (2.0 * h), j.second[i], 1e-7);
                }
            }
        }
    }
}
