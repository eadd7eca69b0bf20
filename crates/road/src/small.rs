//! Trigonometry of the small angles of roads (slopes, bank, turning within a cell): short Taylor
//! series below 0.1 rad, where they are exact to rounding, and `libm` above.

/// Below this the series hold, rad.
const SMALL: f64 = 0.1;

/// Arc tangent; first term left out: `x¹⁷/17 < 6e-19`.
pub(crate) fn atan(x: f64) -> f64 {
    if x.abs() > SMALL {
        return libm::atan(x);
    }
    let q = -x * x;
    let tail = 1.0 / 9.0 + q * (1.0 / 11.0 + q * (1.0 / 13.0 + q / 15.0));
    x * (1.0 + q * (1.0 / 3.0 + q * (1.0 / 5.0 + q * (1.0 / 7.0 + q * tail))))
}

/// Sine and cosine; first terms left out: `x¹¹/11! < 3e-19`, `x¹²/12! < 3e-21`.
pub(crate) fn sincos(x: f64) -> (f64, f64) {
    if x.abs() > SMALL {
        return libm::sincos(x);
    }
    let q = -x * x;
    let sin = x * (1.0 + q / 6.0 * (1.0 + q / 20.0 * (1.0 + q / 42.0 * (1.0 + q / 72.0))));
    let cos =
        1.0 + q / 2.0 * (1.0 + q / 12.0 * (1.0 + q / 30.0 * (1.0 + q / 56.0 * (1.0 + q / 90.0))));
    (sin, cos)
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_series_agree_with_libm_to_rounding() {
        for i in -2_000..=2_000 {
            let x = f64::from(i) * 1e-4;
            let (sin, cos) = super::sincos(x);
            assert!((sin - libm::sin(x)).abs() < 3e-17, "{x}");
            assert!((cos - libm::cos(x)).abs() < 3e-16, "{x}");
            assert!((super::atan(x) - libm::atan(x)).abs() < 3e-17, "{x}");
        }
    }
}
