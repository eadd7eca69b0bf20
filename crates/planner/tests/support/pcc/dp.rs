//! Dynamic-programming reference for the speed planner: gears, nonlinear fuel map, trip time.
//!
//! The joint search of `planner::pcc::search` on fine grids, with the price of time found by
//! bisection; the result is driven by the truth. Nothing is linearised around a profile, and every
//! path on the grid is a drivable plan, so the reference is an upper bound of the optimum that
//! closes in on it as the grid is refined. The whole band is searched at 100 m; then a tube around
//! the best path at the course's own step is searched and moved until it rests.

use planner::pcc::drive::{Driven, drive_profile};
use planner::pcc::search::{EngineTables, SearchGrid, SearchPath, SearchPrices, search};
use planner::pcc::trip::Trip;
use planner::pcc::truck::Drive;

/// A driven path.
pub(crate) struct Reference {
    /// The trip.
    pub(crate) driven: Driven,
    /// Price of time, g/s.
    pub(crate) beta_g_s: f64,
}

/// Grid sizes of a reference.
#[derive(Clone, Copy)]
pub(crate) struct Fineness {
    /// Energy steps that full traction covers per interval, whole band at 100 m.
    pub(crate) coarse: f64,
    /// Same in the tube at the course's step.
    pub(crate) fine: f64,
    /// Half width of the tube in steps.
    pub(crate) half: f64,
}

/// For the tests that always run.
pub(crate) const QUICK: Fineness = Fineness { coarse: 16.0, fine: 20.0, half: 24.0 };
/// For the campaign.
pub(crate) const FINE: Fineness = Fineness { coarse: 24.0, fine: 24.0, half: 40.0 };

fn timed(
    trip: &Trip,
    tables: &EngineTables,
    grid: &SearchGrid,
    goal_s: f64,
    guess: f64,
    passes: usize,
) -> Option<(SearchPath, f64)> {
    let (mut low, mut high) = (0.0f64, f64::INFINITY);
    let mut beta = guess;
    let mut best: Option<(SearchPath, f64)> = None;
    for _ in 0..passes {
        let prices = SearchPrices {
            beta_g_s: beta,
            shift_fuel_g: trip.tuning.shift_fuel_g,
            accel_penalty_g_s3_m2: trip.tuning.accel_penalty_g_s3_m2,
            brake_m_s2: trip.course.brake_m_s2,
            free_cut: true,
        };
        let path = search(&trip.truck, tables, grid, &prices, None)?;
        if path.time_s <= goal_s {
            high = beta;
            let close = goal_s - path.time_s < 1e-3 * goal_s;
            if best.as_ref().is_none_or(|(b, _)| path.time_s > b.time_s) {
                best = Some((path, beta));
            }
            if close || beta <= 1e-6 {
                break;
            }
        } else {
            low = beta;
        }
        beta = match (low, high) {
            (l, h) if h.is_infinite() => (l * 1.1).max(0.1),
            (0.0, h) if h < 0.3 => 0.0,
            (0.0, h) => h * 0.9,
            (l, h) => 0.5 * (l + h),
        };
    }
    best
}

/// The reference of a trip in `goal_s` to the end energy `end_e`; `None` if no path is fast enough.
pub(crate) fn reference(trip: &Trip, goal_s: f64, end_e: f64, f: Fineness) -> Option<Reference> {
    let n = trip.course.n();
    let top = trip.e_max.iter().copied().fold(0.0, f64::max);
    let tables = EngineTables::new(&trip.truck, top + 5.0);
    let v = (2.0 * end_e).sqrt();
    let pull = trip.truck.traction_m_s2(trip.truck.strongest_gear(v), v);
    let start = trip.cruise.e_j_kg[0];
    let bounds = (trip.e_min.as_slice(), trip.e_max.as_slice());
    let merge = (100.0 / trip.course.h_m).round().clamp(1.0, n as f64) as usize;
    let step = pull * trip.course.h_m * merge as f64 / f.coarse;
    let grid = SearchGrid::new(&trip.course, merge, step, bounds, start, Some(end_e));
    let (path, mut beta) = timed(trip, &tables, &grid, goal_s, trip.beta_guess(), 16)?;
    let coarse = grid.n();
    let mut centre: Vec<f64> = (0..=n)
        .map(|i| {
            let k = (i * coarse / n).min(coarse - 1);
            let (a, b) = (SearchGrid::node(n, coarse, k), SearchGrid::node(n, coarse, k + 1));
            let t = (i as f64 - a as f64) / (b as f64 - a as f64);
            path.e_j_kg[k] + t * (path.e_j_kg[k + 1] - path.e_j_kg[k])
        })
        .collect();
    let step = pull * trip.course.h_m / f.fine;
    let half = step * f.half;
    let mut best: Option<SearchPath> = None;
    for round in 0..8 {
        let low: Vec<f64> =
            (0..=n).map(|k| trip.e_min[k].max(centre[k] - half).min(trip.e_max[k])).collect();
        let high: Vec<f64> =
            (0..=n).map(|k| trip.e_max[k].min(centre[k] + half).max(low[k])).collect();
        let grid = SearchGrid::new(&trip.course, 1, step, (&low, &high), start, Some(end_e));
        let passes = if round == 0 { 10 } else { 4 };
        let Some((found, price)) = timed(trip, &tables, &grid, goal_s, beta, passes) else { break };
        beta = price;
        let moved =
            found.e_j_kg.iter().zip(&centre).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        centre.copy_from_slice(&found.e_j_kg);
        let cost = |p: &SearchPath| p.cost_g;
        let gain = best.as_ref().map_or(f64::INFINITY, |b| cost(b) - cost(&found));
        best = Some(found);
        if moved < 0.9 * half || gain.abs() < 1.0 {
            break;
        }
    }
    let path = best?;
    let gears: Vec<Drive> = path.gears.iter().map(|&g| Drive::Gear(g)).collect();
    let shift = trip.tuning.shift_fuel_g;
    let driven = drive_profile(&trip.truck, &trip.course, &path.e_j_kg, &gears, &[], shift);
    Some(Reference { driven, beta_g_s: beta })
}
