//! Piecewise-linear tables: the form in which maps travel between truck file, plant and planner.

use alloc::{format, string::ToString, vec::Vec};
use serde::{Deserialize, Serialize};

use crate::CoreError;

/// `y(x)`, piecewise linear, held constant outside its range.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "AnyCurve")]
pub struct Curve {
    x: Vec<f64>,
    y: Vec<f64>,
}

/// A curve as it comes out of a file or a message.
#[derive(Deserialize)]
struct AnyCurve {
    x: Vec<f64>,
    y: Vec<f64>,
}

impl TryFrom<AnyCurve> for Curve {
    type Error = CoreError;

    fn try_from(c: AnyCurve) -> Result<Self, CoreError> {
        Self::new("curve", c.x, c.y)
    }
}

impl Curve {
    /// A curve from equally long abscissae (strictly increasing) and ordinates.
    ///
    /// # Errors
    /// [`CoreError::BadTable`] if sizes differ, the table is empty, a number is not finite, or the
    /// abscissae do not increase.
    pub fn new(name: &str, x: Vec<f64>, y: Vec<f64>) -> Result<Self, CoreError> {
        let bad = |why: alloc::string::String| CoreError::BadTable { name: name.to_string(), why };
        if x.len() != y.len() || x.is_empty() {
            return Err(bad(format!("{} abscissae, {} ordinates", x.len(), y.len())));
        }
        check_axis(name, &x)?;
        if let Some(v) = y.iter().find(|v| !v.is_finite()) {
            return Err(bad(format!("ordinate {v} is not finite")));
        }
        Ok(Self { x, y })
    }

    /// A constant.
    #[must_use]
    pub fn constant(y: f64) -> Self {
        Self { x: alloc::vec![0.0], y: alloc::vec![y] }
    }

    /// Value at `x`.
    #[must_use]
    pub fn at(&self, x: f64) -> f64 {
        let (i, f) = locate(&self.x, x);
        if f == 0.0 { self.y[i] } else { self.y[i] + f * (self.y[i + 1] - self.y[i]) }
    }

    /// Slope at `x`; zero outside the range, the right-hand slope at a knot.
    #[must_use]
    pub fn slope_at(&self, x: f64) -> f64 {
        let n = self.x.len();
        if n < 2 || x < self.x[0] || x >= self.x[n - 1] {
            return 0.0;
        }
        let (i, _) = locate(&self.x, x);
        (self.y[i + 1] - self.y[i]) / (self.x[i + 1] - self.x[i])
    }

    /// Abscissae.
    #[must_use]
    pub fn x(&self) -> &[f64] {
        &self.x
    }

    /// Ordinates.
    #[must_use]
    pub fn y(&self) -> &[f64] {
        &self.y
    }

    /// The same curve with every ordinate multiplied by `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self { x: self.x.clone(), y: self.y.iter().map(|v| v * factor).collect() }
    }
}

/// `z(x, y)`, bilinear, held constant outside its range. Row-major: `z[ix * y.len() + iy]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "AnyGrid")]
pub struct Grid {
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
}

/// A grid as it comes out of a file or a message.
#[derive(Deserialize)]
struct AnyGrid {
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
}

impl TryFrom<AnyGrid> for Grid {
    type Error = CoreError;

    fn try_from(g: AnyGrid) -> Result<Self, CoreError> {
        Self::new("grid", g.x, g.y, g.z)
    }
}

impl Grid {
    /// A grid from strictly increasing axes and `x.len() * y.len()` values.
    ///
    /// # Errors
    /// [`CoreError::BadTable`], as for [`Curve::new`].
    pub fn new(name: &str, x: Vec<f64>, y: Vec<f64>, z: Vec<f64>) -> Result<Self, CoreError> {
        check_axis(name, &x)?;
        check_axis(name, &y)?;
        if z.len() != x.len() * y.len() || z.iter().any(|v| !v.is_finite()) {
            return Err(CoreError::BadTable {
                name: name.to_string(),
                why: format!("{} finite values needed, {} given", x.len() * y.len(), z.len()),
            });
        }
        Ok(Self { x, y, z })
    }

    /// A constant.
    #[must_use]
    pub fn constant(z: f64) -> Self {
        Self { x: alloc::vec![0.0], y: alloc::vec![0.0], z: alloc::vec![z] }
    }

    /// Value at `(x, y)`.
    #[must_use]
    pub fn at(&self, x: f64, y: f64) -> f64 {
        let (i, fx) = locate(&self.x, x);
        let (j, fy) = locate(&self.y, y);
        let n = self.y.len();
        let row = |i: usize| {
            let a = self.z[i * n + j];
            if fy == 0.0 { a } else { a + fy * (self.z[i * n + j + 1] - a) }
        };
        let a = row(i);
        if fx == 0.0 { a } else { a + fx * (row(i + 1) - a) }
    }

    /// First axis.
    #[must_use]
    pub fn x(&self) -> &[f64] {
        &self.x
    }

    /// Second axis.
    #[must_use]
    pub fn y(&self) -> &[f64] {
        &self.y
    }

    /// Values, row-major.
    #[must_use]
    pub fn z(&self) -> &[f64] {
        &self.z
    }
}

/// Interval index and fraction in it; fraction 0 at the ends, so that callers never read past them.
fn locate(axis: &[f64], x: f64) -> (usize, f64) {
    let last = axis.len() - 1;
    if x.is_nan() || x <= axis[0] {
        return (0, 0.0);
    }
    if x >= axis[last] {
        return (last, 0.0);
    }
    let i = axis.partition_point(|&v| v <= x) - 1;
    (i, (x - axis[i]) / (axis[i + 1] - axis[i]))
}

fn check_axis(name: &str, axis: &[f64]) -> Result<(), CoreError> {
    let bad = axis.is_empty()
        || axis.iter().any(|v| !v.is_finite())
        || axis.windows(2).any(|w| w[1] <= w[0]);
    if bad {
        return Err(CoreError::BadTable {
            name: name.to_string(),
            why: "the axis must be finite and strictly increasing".to_string(),
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_is_linear_between_knots_and_constant_outside() {
        let c = Curve::new("t", alloc::vec![0.0, 1.0, 3.0], alloc::vec![0.0, 2.0, 0.0]).unwrap();
        assert_eq!(c.at(-1.0), 0.0);
        assert_eq!(c.at(0.5), 1.0);
        assert_eq!(c.at(2.0), 1.0);
        assert_eq!(c.at(9.0), 0.0);
        assert_eq!(c.slope_at(2.0), -1.0);
        assert_eq!(c.at(f64::NAN), 0.0);
    }

    #[test]
    fn a_grid_reproduces_a_bilinear_function() {
        let (x, y) = (alloc::vec![0.0, 1.0, 4.0], alloc::vec![-1.0, 2.0]);
        let f = |x: f64, y: f64| 1.0 + 2.0 * x - y + 0.5 * x * y;
        let z = x.iter().flat_map(|&a| y.iter().map(move |&b| f(a, b))).collect();
        let g = Grid::new("g", x, y, z).unwrap();
        for (a, b) in [(0.3, 0.1), (3.9, 1.9), (1.0, -1.0)] {
            assert!((g.at(a, b) - f(a, b)).abs() < 1e-12);
        }
    }

    #[test]
    fn a_table_without_an_axis_does_not_come_out_of_a_message() {
        let curve = |x: &[f64], y: &[f64]| Curve::try_from(AnyCurve { x: x.into(), y: y.into() });
        assert!(curve(&[], &[]).is_err());
        assert!(curve(&[0.0, 1.0], &[1.0]).is_err());
        assert!(curve(&[0.0, 1.0], &[1.0, 2.0]).is_ok());
        let grid = |x: &[f64], y: &[f64], z: &[f64]| {
            Grid::try_from(AnyGrid { x: x.into(), y: y.into(), z: z.into() })
        };
        assert!(grid(&[], &[0.0], &[]).is_err());
        assert!(grid(&[1.0], &[1.0, 0.0], &[1.0, 2.0]).is_err());
        assert!(grid(&[1.0], &[0.0, 1.0], &[1.0, 2.0]).is_ok());
    }

    #[test]
    fn a_table_that_goes_back_is_refused_by_name() {
        let e = Curve::new("full_load", alloc::vec![1.0, 1.0], alloc::vec![0.0, 0.0]);
        assert!(e.unwrap_err().to_string().contains("full_load"));
    }
}
