//! Joint search over speed and gear on a grid: forward value iteration at a given price of time.
//!
//! The quadratic programme is local in its gears: whether a shift before a climb pays depends on
//! the speed profile that it makes possible. This search settles the gears globally on a coarse
//! grid; the quadratic programme then settles the speeds. At a fine grid it is a reference for both.
//!
//! State: specific energy on a grid of step `dE` × gear. Edge: one interval at constant
//! acceleration in one gear, allowed if it needs no more than full load and the planned brakes.
//! Cost: the objective of Eq. 18, `fuel + k_a a² dt + β dt`, plus the shift fuel. Engine figures are
//! tabulated over energy and traction; nothing is linearised around a profile.

use alloc::vec::Vec;

use super::course::Course;
use super::truck::{Drive, Truck};

/// Energy step of the engine tables, J/kg.
const TABLE_STEP: f64 = 0.5;
/// Traction levels of the engine tables.
const LEVELS: usize = 25;

/// One gear at one energy.
#[derive(Debug, Clone)]
struct Point {
    /// Overrun drag per mass, m/s².
    drag: f64,
    /// Traction limit, m/s²; negative where the gear does not drive.
    limit: f64,
    /// Fuel per metre at equal steps of traction from zero to the limit, g/m.
    fuel_g_m: [f64; LEVELS],
}

/// Engine figures over energy, per gear.
#[derive(Debug, Clone)]
pub struct EngineTables {
    rows: usize,
    points: Vec<Point>,
}

impl EngineTables {
    /// Tables up to the energy `top_e`, J/kg.
    #[must_use]
    pub fn new(truck: &Truck, top_e: f64) -> Self {
        let rows = (top_e / TABLE_STEP) as usize + 3;
        let mut points = Vec::with_capacity(rows * truck.gears());
        for g in 0..truck.gears() {
            let (slowest, fastest) = truck.speed_range_m_s(g);
            for r in 0..rows {
                let v = libm::sqrt(2.0 * (r as f64 * TABLE_STEP).max(0.1));
                let near = v >= slowest - 0.5 && v <= fastest + 0.5;
                let top = truck.traction_m_s2(g, v);
                let drive = Drive::Gear(g as u8);
                points.push(Point {
                    drag: truck.overrun_m_s2(g, v),
                    limit: if truck.usable(g, v) { top } else { -1.0 },
                    fuel_g_m: core::array::from_fn(|i| {
                        if !near {
                            return 0.0;
                        }
                        let p = top * i as f64 / (LEVELS - 1) as f64;
                        truck.fuel_charged_g_s(drive, v, p) / v
                    }),
                });
            }
        }
        Self { rows, points }
    }
}

/// Nodes with their windows of energies, and the intervals between them.
#[derive(Debug, Clone, Default)]
pub struct SearchGrid {
    /// Length of an interval, m.
    pub h_m: f64,
    /// sin of the grade per interval.
    pub sin: Vec<f64>,
    /// cos of the grade per interval.
    pub cos: Vec<f64>,
    /// Energy step, J/kg.
    pub step_e: f64,
    /// Energy of index 0 (the start), J/kg.
    pub start_e: f64,
    /// Lowest index per node.
    pub low: Vec<i32>,
    /// Number of indices per node.
    pub count: Vec<u32>,
}

impl SearchGrid {
    /// A grid over `course`, `merge` intervals at a time, between `e_min` and `e_max` (per node of
    /// the course), from `start_e` to the index nearest to `end_e` (all within half a step).
    #[must_use]
    pub fn new(
        course: &Course,
        merge: usize,
        step_e: f64,
        (e_min, e_max): (&[f64], &[f64]),
        start_e: f64,
        end_e: Option<f64>,
    ) -> Self {
        let n = course.n();
        let coarse = (n / merge).max(1);
        let mut grid =
            Self { h_m: course.length_m() / coarse as f64, step_e, start_e, ..Self::default() };
        for k in 0..=coarse {
            let node = Self::node(n, coarse, k);
            let (mut low, mut high) = (e_min[node], e_max[node]);
            if k < coarse {
                let range = node..Self::node(n, coarse, k + 1);
                let len = range.len() as f64;
                grid.sin.push(course.sin[range.clone()].iter().sum::<f64>() / len);
                grid.cos.push(course.cos[range].iter().sum::<f64>() / len);
            }
            if k == 0 {
                (low, high) = (start_e, start_e);
            } else if let (true, Some(end)) = (k == coarse, end_e) {
                (low, high) = (end - 0.51 * step_e, end + 0.51 * step_e);
            }
            let first = libm::ceil((low - start_e) / step_e - 1e-9) as i32;
            let last = libm::floor((high - start_e) / step_e + 1e-9) as i32;
            grid.low.push(first.min(last));
            grid.count.push((last - first + 1).max(1) as u32);
        }
        grid
    }

    /// Node of the course that node `k` of `coarse` intervals stands for.
    #[must_use]
    pub fn node(n: usize, coarse: usize, k: usize) -> usize {
        if k >= coarse { n } else { k * n / coarse }
    }

    /// Number of intervals.
    #[must_use]
    pub fn n(&self) -> usize {
        self.sin.len()
    }

    fn energy(&self, k: usize, i: usize) -> f64 {
        self.start_e + f64::from(self.low[k] + i as i32) * self.step_e
    }
}

/// Prices and limits of a search.
#[derive(Debug, Clone, Copy)]
pub struct SearchPrices {
    /// Price of time, g/s.
    pub beta_g_s: f64,
    /// Fuel per shift, g.
    pub shift_fuel_g: f64,
    /// `k_a`, g s³/m².
    pub accel_penalty_g_s3_m2: f64,
    /// Largest brake force per mass, m/s².
    pub brake_m_s2: f64,
    /// Whether fuel cut-off is free, as in truth, or charged the fixed part of the map.
    pub free_cut: bool,
}

/// The cheapest path.
#[derive(Debug, Clone)]
pub struct SearchPath {
    /// Energy per node, J/kg.
    pub e_j_kg: Vec<f64>,
    /// Gear index per interval.
    pub gears: Vec<u8>,
    /// Cost, g.
    pub cost_g: f64,
    /// Duration, s.
    pub time_s: f64,
}

/// The cheapest path through the grid; `None` if there is none. `start_gear` costs a shift to leave.
#[must_use]
pub fn search(
    truck: &Truck,
    tables: &EngineTables,
    grid: &SearchGrid,
    prices: &SearchPrices,
    start_gear: Option<u8>,
) -> Option<SearchPath> {
    let (n, m) = (grid.n(), truck.gears());
    let c0 = grid.count[0] as usize;
    let mut cost = alloc::vec![f64::INFINITY; c0 * m];
    let first = usize::try_from(-grid.low[0]).ok().filter(|&i| i < c0)?;
    for g in 0..m {
        let same = start_gear.is_none_or(|s| s as usize == g);
        cost[first * m + g] = if same { 0.0 } else { prices.shift_fuel_g };
    }
    let mut parents: Vec<Vec<u32>> = Vec::with_capacity(n);
    let mut speeds = alloc::vec![libm::sqrt(2.0 * grid.start_e); c0];
    for k in 0..n {
        let c1 = grid.count[k + 1] as usize;
        let mut next = alloc::vec![f64::INFINITY; c1 * m];
        let mut parent = alloc::vec![u32::MAX; c1 * m];
        let after: Vec<f64> =
            (0..c1).map(|j| libm::sqrt(2.0 * grid.energy(k + 1, j).max(0.02))).collect();
        for (i, row) in cost.chunks_exact(m).enumerate() {
            let best = (0..m).min_by(|&a, &b| row[a].total_cmp(&row[b]))?;
            if !row[best].is_finite() {
                continue;
            }
            for g in 0..m {
                let (base, came) = if row[g] <= row[best] + prices.shift_fuel_g {
                    (row[g], g)
                } else {
                    (row[best] + prices.shift_fuel_g, best)
                };
                let edge = Edge { k, i, g, base, code: (i * m + came) as u32, v0: speeds[i] };
                expand(truck, tables, grid, prices, &edge, &after, &mut next, &mut parent);
            }
        }
        parents.push(parent);
        cost = next;
        speeds = after;
    }
    let mut at = (0..cost.len()).min_by(|&a, &b| cost[a].total_cmp(&cost[b]))?;
    let cost_g = cost[at];
    if !cost_g.is_finite() {
        return None;
    }
    let mut e = alloc::vec![grid.start_e; n + 1];
    let mut gears = alloc::vec![0u8; n];
    for k in (0..n).rev() {
        e[k + 1] = grid.energy(k + 1, at / m);
        gears[k] = (at % m) as u8;
        at = parents[k][at] as usize;
    }
    let time_s = e.windows(2).map(|w| super::drive::duration_s(grid.h_m, w[0], w[1])).sum();
    Some(SearchPath { e_j_kg: e, gears, cost_g, time_s })
}

struct Edge {
    k: usize,
    i: usize,
    g: usize,
    base: f64,
    code: u32,
    v0: f64,
}

/// All edges from one state in one gear.
fn expand(
    truck: &Truck,
    tables: &EngineTables,
    grid: &SearchGrid,
    prices: &SearchPrices,
    edge: &Edge,
    after: &[f64],
    next: &mut [f64],
    parent: &mut [u32],
) {
    let (k, g, m, h) = (edge.k, edge.g, truck.gears(), grid.h_m);
    let e0 = grid.energy(k, edge.i);
    let mu = truck.inertia(Drive::Gear(g as u8));
    let road = truck.resistance_m_s2(0.0, grid.sin[k], grid.cos[k]);
    let at0 = ((e0 / TABLE_STEP + 0.5) as usize).min(tables.rows - 1);
    let drag0 = tables.points[g * tables.rows + at0].drag;
    // Braking pays only where the next node's ceiling lies below coasting.
    let coast = e0 - h * (road + drag0 + truck.drag_1_m * e0) / mu;
    let ceiling = grid.energy(k + 1, after.len() - 1);
    let lowest = coast.min(ceiling) - 1.5 * grid.step_e;
    let first = libm::ceil((lowest - grid.start_e) / grid.step_e) as i32 - grid.low[k + 1];
    for (j, &v1) in after.iter().enumerate().skip(first.max(0) as usize) {
        let e1 = grid.energy(k + 1, j);
        let mean = 0.5 * (e0 + e1);
        let row = ((mean / TABLE_STEP + 0.5) as usize).min(tables.rows - 1);
        let point = &tables.points[g * tables.rows + row];
        let accel = (e1 - e0) / h;
        let need = mu * accel + point.drag + road + truck.drag_1_m * mean;
        if need > point.limit {
            if accel > 0.0 {
                break;
            }
            continue;
        }
        if need < -prices.brake_m_s2 {
            continue;
        }
        let u = need.max(0.0) / point.limit * (LEVELS - 1) as f64;
        let l = (u as usize).min(LEVELS - 2);
        let f = &point.fuel_g_m;
        let fuel = if prices.free_cut && need <= 0.0 {
            0.0
        } else {
            h * (f[l] + (u - l as f64) * (f[l + 1] - f[l]))
        };
        let seconds = 2.0 * h / (edge.v0 + v1);
        let total = edge.base
            + fuel
            + seconds * (prices.beta_g_s + prices.accel_penalty_g_s3_m2 * accel * accel);
        let slot = j * m + g;
        if total < next[slot] {
            next[slot] = total;
            parent[slot] = edge.code;
        }
    }
}
