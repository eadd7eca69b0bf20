//! Linear algebra on the 4-state model: eigenvalues, steady state, frequency response.

use dynamics::lateral::{LateralModel, LateralParameters, StateSpace};
use nalgebra::{Complex, Matrix4, Vector4};

/// A model of valid parameters.
pub(crate) fn model(p: &LateralParameters) -> LateralModel {
    LateralModel::new(p).unwrap()
}

/// A as a matrix.
pub(crate) fn matrix(ss: &StateSpace) -> Matrix4<f64> {
    Matrix4::from_fn(|i, k| ss.a[i][k])
}

/// `-A^-1 b`: the steady state for one unit of input.
pub(crate) fn steady(m: &LateralModel, v: f64) -> Vector4<f64> {
    let ss = m.state_matrix(v);
    -matrix(&ss).lu().solve(&Vector4::from(ss.b_steer)).unwrap()
}

/// Eigenvalues, largest real part first, upper half plane before lower.
pub(crate) fn eigenvalues(a: &Matrix4<f64>) -> Vec<Complex<f64>> {
    let mut e: Vec<_> = a.complex_eigenvalues().iter().copied().collect();
    e.sort_by(|a, b| b.re.total_cmp(&a.re).then(b.im.total_cmp(&a.im)));
    e
}

/// Smallest damping ratio of the oscillating pairs; `None` when nothing oscillates.
pub(crate) fn damping(a: &Matrix4<f64>) -> Option<f64> {
    eigenvalues(a).iter().filter(|e| e.im > 1e-6).map(|e| -e.re / size(*e)).min_by(f64::total_cmp)
}

/// State's response to a unit road-wheel angle at `omega` rad/s.
pub(crate) fn response(ss: &StateSpace, omega: f64) -> Vector4<Complex<f64>> {
    let a = Matrix4::from_fn(|i, k| {
        let s = if i == k { Complex::new(0.0, omega) } else { Complex::new(0.0, 0.0) };
        s - ss.a[i][k]
    });
    let b = Vector4::from_fn(|i, _| Complex::new(ss.b_steer[i], 0.0));
    a.lu().solve(&b).unwrap()
}

/// Absolute value of a complex number.
pub(crate) fn size(z: Complex<f64>) -> f64 {
    z.re.hypot(z.im)
}
