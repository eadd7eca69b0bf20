//! A road under a recording that comes without a map.
//!
//! The stretch is taken along its principal direction u; the offset v of all samples is fitted by a
//! polynomial of degree six in u, which is the reference line. Lanes are the clusters of the samples'
//! distances from it. Good for a stretch of highway that turns by less than about 60°; left out:
//! ramps, grades, anything that is not parallel.

use nalgebra::{SMatrix, SVector};
use road::{Cubics, LaneEnd, LaneKind, LaneTrack, Line, Placed, Road, Shape};

use super::ReplayError;
use super::recording::Recording;

const DEGREE: usize = 6;
const N: usize = DEGREE + 1;
/// Length of the straight pieces that the line is made of, m.
const PIECE_M: f64 = 5.0;
/// Rounds of clustering.
const ROUNDS: usize = 30;

/// A road with `lanes` lanes along the vehicles of a recording in map coordinates.
///
/// # Errors
/// [`ReplayError::Format`] if the samples do not make a stretch of at least 50 m.
pub fn road_of(recording: &Recording, lanes: usize, limit_m_s: f64) -> Result<Road, ReplayError> {
    let bad = |why: &str| ReplayError::Format { name: recording.name.clone(), why: why.to_owned() };
    let samples = || recording.tracks.iter().flat_map(|t| &t.samples);
    let n = samples().count() as f64;
    let mean = |f: &dyn Fn(&super::Sample) -> f64| samples().map(f).sum::<f64>() / n;
    let (mx, my) = (mean(&|s| s.x_m), mean(&|s| s.y_m));
    let (cxx, cyy) = (mean(&|s| (s.x_m - mx).powi(2)), mean(&|s| (s.y_m - my).powi(2)));
    let cxy = mean(&|s| (s.x_m - mx) * (s.y_m - my));
    let mut angle = 0.5 * libm::atan2(2.0 * cxy, cxx - cyy);
    // The direction of travel, not its opposite.
    let along = mean(&|s| s.speed_m_s * libm::cos(s.yaw_rad - angle));
    if along < 0.0 {
        angle += core::f64::consts::PI;
    }
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    let uv: Vec<(f64, f64)> = samples()
        .map(|s| (s.x_m - mx, s.y_m - my))
        .map(|(x, y)| (x * cos + y * sin, y * cos - x * sin))
        .collect();
    let low = uv.iter().map(|p| p.0).fold(f64::INFINITY, f64::min);
    let high = uv.iter().map(|p| p.0).fold(f64::NEG_INFINITY, f64::max);
    if !(high - low >= 50.0) || lanes == 0 || lanes > 12 {
        return Err(bad("needs a stretch of at least 50 m and 1 to 12 lanes"));
    }
    let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
    let fit = polynomial(uv.iter().map(|&(u, v)| ((u - middle) / half, v)))
        .ok_or_else(|| bad("the samples do not fix a line"))?;
    let offset = |u: f64| horner(&fit, (u - middle) / half);
    let pieces = libm::ceil((high - low) / PIECE_M) as usize;
    let at = |k: usize| {
        let u = low + (high - low) * k as f64 / pieces as f64;
        let v = offset(u);
        (mx + u * cos - v * sin, my + u * sin + v * cos)
    };
    let mut elements = Vec::with_capacity(pieces);
    let mut s_m = 0.0;
    for k in 0..pieces {
        let ((x0, y0), (x1, y1)) = (at(k), at(k + 1));
        let length_m = libm::hypot(x1 - x0, y1 - y0);
        let heading_rad = libm::atan2(y1 - y0, x1 - x0);
        elements.push(Placed { s_m, x_m: x0, y_m: y0, heading_rad, length_m, shape: Shape::Line });
        s_m += length_m;
    }
    let line = Line::from_elements(&elements, Cubics::constant(0.0), Cubics::constant(0.0));
    let length_m = line.length_m();
    let centers = clusters(uv.iter().map(|&(u, v)| v - offset(u)).collect(), lanes);
    let spread = centers.last().zip(centers.first()).map_or(0.0, |(a, b)| a - b);
    let width = if lanes > 1 { spread / (lanes - 1) as f64 } else { 3.75 };
    let tracks = centers.iter().enumerate().map(|(k, &d)| LaneTrack {
        id: k as u16,
        s_start_m: 0.0,
        s_end_m: length_m,
        kind: LaneKind::Driving,
        end: LaneEnd::Continues,
        center: Cubics::constant(d),
        width: Cubics::constant(width.max(2.5)),
        speed_limits: Vec::new(),
        sources: Vec::new(),
    });
    Road::new(&recording.name, line, tracks.collect(), vec![(0.0, limit_m_s)])
        .map_err(|e| bad(&e.to_string()))
}

/// Least-squares polynomial through points with abscissae in [-1, 1].
fn polynomial(points: impl Iterator<Item = (f64, f64)>) -> Option<SVector<f64, N>> {
    let mut normal = SMatrix::<f64, N, N>::zeros();
    let mut right = SVector::<f64, N>::zeros();
    for (x, y) in points {
        let mut powers = SVector::<f64, N>::zeros();
        let mut p = 1.0;
        for value in powers.iter_mut() {
            *value = p;
            p *= x;
        }
        normal += powers * powers.transpose();
        right += powers * y;
    }
    normal.lu().solve(&right).filter(|c| c.iter().all(|x| x.is_finite()))
}

fn horner(c: &SVector<f64, N>, x: f64) -> f64 {
    c.iter().rev().fold(0.0, |sum, &a| sum * x + a)
}

/// Centres of `k` clusters on a line, from the right (lowest) to the left.
fn clusters(mut values: Vec<f64>, k: usize) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    let mut centers: Vec<f64> =
        (0..k).map(|i| values[(2 * i + 1) * (values.len() - 1) / (2 * k)]).collect();
    for _ in 0..ROUNDS {
        let mut sums = vec![(0.0, 0.0); k];
        for &v in &values {
            let nearest = (0..k)
                .min_by(|&a, &b| (v - centers[a]).abs().total_cmp(&(v - centers[b]).abs()))
                .unwrap_or(0);
            sums[nearest].0 += v;
            sums[nearest].1 += 1.0;
        }
        for (center, (sum, count)) in centers.iter_mut().zip(sums) {
            if count > 0.0 {
                *center = sum / count;
            }
        }
    }
    centers
}
