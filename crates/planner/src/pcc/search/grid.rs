//! Joint search over speed and gear on a grid: forward value iteration at a given price of time.
//!
//! The quadratic programme is local in its gears: whether a shift before a climb pays depends on
//! the speed profile that it makes possible. This search settles the gears globally on a coarse
//! grid; the quadratic programme then settles the speeds. At a fine grid it is a reference for both.
//!
//! State: specific energy on a grid of step `dE` × gear. Edge: one interval at constant
//! acceleration in one gear, allowed if it needs no more than full load and the planned brakes.
//! Full load ends between grid energies. Rounding down at every node would take several per cent of
//! its power from the truck on a long climb; the end energy is rounded with a threshold that moves
//! from node to node through an evenly spread sequence instead, which leaves no bias.
//! Cost: the objective of Eq. 18, `fuel + k_a a² dt + β dt`, plus the shift fuel. Engine figures are
//! tabulated over energy and traction; nothing is linearised around a profile.

use alloc::vec::Vec;

use tractrix_core::RoadPiece;

use crate::pcc::model::{Course, Drive, Truck};

/// Energy step of the engine tables, J/kg.
const TABLE_STEP: f64 = 0.5;
/// Traction levels from zero wheel force to full load.
const LEVELS: usize = 12;

/// One gear at one energy, one cache line. Fuel is piecewise linear in the traction: one piece from
/// the first injection to zero wheel force, where the driveline's losses change sides, equal pieces
/// from there to full load.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
struct Point {
    /// Overrun drag per mass, which is the traction at zero wheel force, m/s².
    drag: f32,
    /// Traction limit, m/s²; negative where the gear does not drive.
    limit: f32,
    /// Pieces per traction above zero wheel force, s²/m.
    per_traction: f32,
    /// Fuel per metre just above cut-off, g/m.
    least_g_m: f32,
    /// Fuel per metre at the levels, g/m.
    fuel_g_m: [f32; LEVELS],
}

impl Point {
    const IDLE: Self =
        Self { drag: 0.0, limit: -1.0, per_traction: 0.0, least_g_m: 0.0, fuel_g_m: [0.0; LEVELS] };

    fn new(truck: &Truck, g: usize, v: f64) -> Self {
        if !truck.usable(g, v) {
            return Self::IDLE;
        }
        let at = truck.at(g, v);
        let (drag, top) = (at.overrun_m_s2(), at.traction_m_s2());
        let piece = (top - drag).max(0.0) / (LEVELS - 1) as f64;
        let fuel = |p: f64| (at.fuel_charged_g_s(p) / v) as f32;
        Self {
            drag: drag as f32,
            limit: top as f32,
            per_traction: if piece > 1e-9 { (1.0 / piece) as f32 } else { 0.0 },
            least_g_m: fuel(0.0),
            fuel_g_m: core::array::from_fn(|i| fuel(drag + i as f64 * piece)),
        }
    }

    #[inline]
    fn fuel_g_m(&self, p: f32) -> f32 {
        if p < self.drag {
            self.least_g_m + (self.fuel_g_m[0] - self.least_g_m) * p / self.drag
        } else {
            let u = (p - self.drag) * self.per_traction;
            let l = (u as u32).min(LEVELS as u32 - 2) as usize;
            self.fuel_g_m[l] + (u - l as f32) * (self.fuel_g_m[l + 1] - self.fuel_g_m[l])
        }
    }
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
        let speed = |r: usize| libm::sqrt(2.0 * (r as f64 * TABLE_STEP).max(0.1));
        let points = (0..truck.gears())
            .flat_map(|g| (0..rows).map(move |r| (g, r)))
            .map(|(g, r)| Point::new(truck, g, speed(r)))
            .collect();
        Self { rows, points }
    }

    /// Gears that drive somewhere, each with its figures at the mean energies of a grid: entry `m`
    /// belongs to two indices that sum to `m + 2 lowest`.
    fn on(&self, truck: &Truck, grid: &SearchGrid) -> Vec<Gear> {
        let lowest = grid.low.iter().copied().min().unwrap_or(0);
        let highest = grid.low.iter().zip(&grid.count).map(|(l, c)| l + *c as i32).max();
        let count = 2 * (highest.unwrap_or(lowest) - lowest).max(0) as usize + 1;
        let row_of = |m: usize| {
            let mean = grid.start_e + (f64::from(lowest) + 0.5 * m as f64) * grid.step_e;
            ((mean.max(0.0) / TABLE_STEP + 0.5) as usize).min(self.rows - 1)
        };
        self.points
            .chunks_exact(self.rows)
            .enumerate()
            .filter_map(|(g, all)| {
                let points: Vec<Point> = (0..count).map(|m| all[row_of(m)]).collect();
                let first = points.iter().position(|p| p.limit > 0.0)?;
                let last = points.iter().rposition(|p| p.limit > 0.0)?;
                let inertia = truck.inertia(Drive::Gear(g as u8));
                Some(Gear { index: g, inertia, points, drives: (first, last + 1) })
            })
            .collect()
    }
}

/// A gear on a grid.
struct Gear {
    index: usize,
    inertia: f64,
    points: Vec<Point>,
    /// First point at which the gear drives, and the first beyond.
    drives: (usize, usize),
}

/// The cheapest way to a node in a gear.
#[derive(Debug, Clone, Copy)]
struct Way {
    cost_g: f64,
    /// Index and gear slot before: `index × gears + slot`.
    from: u32,
}

impl Way {
    const NONE: Self = Self { cost_g: f64::INFINITY, from: u32::MAX };
}

/// Golden ratio's fraction, the step of the dither.
const GOLDEN: f64 = 0.618_033_988_749_895;

/// Nodes with their windows of energies, and the intervals between them.
#[derive(Debug, Clone, Default)]
pub(crate) struct SearchGrid {
    /// Length of an interval, m.
    pub h_m: f64,
    /// Mean grade, curvature and wind per interval.
    pub road: Vec<RoadPiece>,
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
    pub(crate) fn new(
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
                let pieces = &course.road[range];
                let mean = |of: fn(&RoadPiece) -> f64| pieces.iter().map(of).sum::<f64>() / len;
                grid.road.push(RoadPiece {
                    sin_grade: mean(|p| p.sin_grade),
                    cos_grade: mean(|p| p.cos_grade),
                    curvature_squared_1_m2: mean(|p| p.curvature_squared_1_m2),
                    headwind_m_s: mean(|p| p.headwind_m_s),
                    crosswind_m_s: mean(|p| p.crosswind_m_s),
                });
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
    pub(crate) fn node(n: usize, coarse: usize, k: usize) -> usize {
        if k >= coarse { n } else { k * n / coarse }
    }

    /// Number of intervals.
    #[must_use]
    pub(crate) fn n(&self) -> usize {
        self.road.len()
    }

    fn energy(&self, k: usize, i: usize) -> f64 {
        self.start_e + f64::from(self.low[k] + i as i32) * self.step_e
    }
}

/// Prices and limits of a search.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SearchPrices<'a> {
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
    /// Intervals in which the driveline may be open (empty: in none).
    pub may_roll: &'a [bool],
}

/// The cheapest path.
#[derive(Debug, Clone)]
pub(crate) struct SearchPath {
    /// Energy per node, J/kg.
    pub e_j_kg: Vec<f64>,
    /// Gear per interval.
    pub gears: Vec<Drive>,
}

/// The cheapest path through the grid; `None` if there is none. `start` costs a shift to leave.
#[must_use]
pub(crate) fn search(
    truck: &Truck,
    tables: &EngineTables,
    grid: &SearchGrid,
    prices: &SearchPrices<'_>,
    start: Option<Drive>,
) -> Option<SearchPath> {
    let n = grid.n();
    let gears = tables.on(truck, grid);
    // The open driveline takes the slot behind the gears.
    let mut drives: Vec<Drive> = gears.iter().map(|g| Drive::Gear(g.index as u8)).collect();
    if prices.may_roll.contains(&true) {
        drives.push(Drive::Neutral);
    }
    let m = drives.len();
    let rolling =
        Rolling { idle_g_s: truck.idle_fuel_g_s(), inertia: truck.inertia(Drive::Neutral) };
    let lowest = grid.low.iter().copied().min()?;
    let c0 = grid.count[0] as usize;
    // Ways to the nodes of a stage: gear by gear, energies side by side.
    let mut ways = alloc::vec![Way::NONE; c0 * m];
    let first = usize::try_from(-grid.low[0]).ok().filter(|&i| i < c0)?;
    for (slot, drive) in drives.iter().enumerate() {
        let same = start.is_none_or(|s| s == *drive);
        ways[slot * c0 + first].cost_g = if same { 0.0 } else { prices.shift_fuel_g };
    }
    let mut parents: Vec<Vec<u32>> = Vec::with_capacity(n);
    let mut speeds = alloc::vec![libm::sqrt(2.0 * grid.start_e); c0];
    let mut of_time = Vec::new();
    for k in 0..n {
        let c1 = grid.count[k + 1] as usize;
        let mut next = alloc::vec![Way::NONE; c1 * m];
        let after: Vec<f64> =
            (0..c1).map(|j| libm::sqrt(2.0 * grid.energy(k + 1, j).max(0.02))).collect();
        let mut stage = Stage {
            h: grid.h_m,
            step_e: grid.step_e,
            resistance: (0.0, 0.0),
            rise: grid.low[k + 1] - grid.low[k],
            brake: prices.brake_m_s2,
            free_cut: prices.free_cut,
            dither: (k as f64 * GOLDEN) % 1.0,
            next: &mut next,
        };
        let c = grid.count[k] as usize;
        for i in 0..c {
            let cost_of = |slot: usize| ways[slot * c + i].cost_g;
            let best = (0..m).min_by(|&a, &b| cost_of(a).total_cmp(&cost_of(b)))?;
            let shifted = cost_of(best) + prices.shift_fuel_g;
            if !shifted.is_finite() {
                continue;
            }
            let e0 = grid.energy(k, i);
            let road = &grid.road[k];
            stage.resistance =
                (truck.resistance_m_s2(e0, road), truck.resistance_slope_1_m(e0, road));
            let gained = grid.low[k + 1] - grid.low[k] - i as i32;
            let of_step = grid.step_e / grid.h_m;
            let per_step = prices.accel_penalty_g_s3_m2 * of_step * of_step;
            of_time.clear();
            of_time.extend(after.iter().zip(gained..).map(|(v1, steps)| {
                let steps = f64::from(steps);
                2.0 * grid.h_m / (speeds[i] + v1) * (prices.beta_g_s + per_step * steps * steps)
            }));
            let sum = (grid.low[k] + grid.low[k + 1] - 2 * lowest) as usize + i;
            for (slot, gear) in gears.iter().enumerate() {
                let own = cost_of(slot);
                let (base, came) = if own <= shifted { (own, slot) } else { (shifted, best) };
                let code = (i * m + came) as u32;
                stage.expand(gear, slot, i, (base, code), sum, &of_time);
            }
            if prices.may_roll.get(k).copied().unwrap_or(false) {
                let slot = m - 1;
                let own = cost_of(slot);
                let (base, came) = if own <= shifted { (own, slot) } else { (shifted, best) };
                let idle_g = |j: usize| rolling.idle_g_s * 2.0 * grid.h_m / (speeds[i] + after[j]);
                let way = Way { cost_g: base, from: (i * m + came) as u32 };
                stage.roll(rolling.inertia, slot, i, way, &of_time, idle_g);
            }
        }
        parents.push(next.iter().map(|way| way.from).collect());
        ways = next;
        speeds = after;
    }
    let end = (0..ways.len()).min_by(|&a, &b| ways[a].cost_g.total_cmp(&ways[b].cost_g))?;
    if !ways[end].cost_g.is_finite() {
        return None;
    }
    let last = grid.count[n] as usize;
    let (mut at, mut slot) = (end % last, end / last);
    let mut e = alloc::vec![grid.start_e; n + 1];
    let mut path = alloc::vec![Drive::Neutral; n];
    for k in (0..n).rev() {
        e[k + 1] = grid.energy(k + 1, at);
        path[k] = drives[slot];
        let from = parents[k][slot * grid.count[k + 1] as usize + at] as usize;
        (at, slot) = (from / m, from % m);
    }
    Some(SearchPath { e_j_kg: e, gears: path })
}

/// Smallest integer not below `x`, saturating. A cast is one instruction where `ceil` is a call.
fn round_up(x: f64) -> i32 {
    let cut = x as i32;
    cut.saturating_add(i32::from(f64::from(cut) < x))
}

/// The truck with an open driveline.
struct Rolling {
    idle_g_s: f64,
    inertia: f64,
}

/// One interval of a search.
struct Stage<'a> {
    h: f64,
    step_e: f64,
    /// Resistance per mass at the energy before, m/s², and its slope in the energy, 1/m.
    resistance: (f64, f64),
    /// Lowest index after minus lowest index before.
    rise: i32,
    brake: f64,
    free_cut: bool,
    /// Part of an energy step by which full load may be exceeded, 0 to 1.
    dither: f64,
    next: &'a mut [Way],
}

impl Stage<'_> {
    /// The one edge from index `i` with the driveline open: to where the truck rolls, the end energy
    /// rounded by the dither. `way` is the cheapest so far.
    fn roll(
        &mut self,
        inertia: f64,
        slot: usize,
        i: usize,
        way: Way,
        of_time: &[f64],
        idle_g: impl Fn(usize) -> f64,
    ) {
        let (level, resistance_slope) = self.resistance;
        let slope = self.step_e * (inertia / self.h + 0.5 * resistance_slope);
        let steps = round_up(self.dither - level / slope) - 1;
        let j = (steps - (self.rise - i as i32)) as usize;
        if j < of_time.len() {
            let total = way.cost_g + of_time[j] + idle_g(j);
            let to = &mut self.next[slot * of_time.len() + j];
            if total < to.cost_g {
                *to = Way { cost_g: total, ..way };
            }
        }
    }

    /// All edges from index `i` in one gear, at the cost `base` so far.
    fn expand(
        &mut self,
        gear: &Gear,
        slot: usize,
        i: usize,
        (base, code): (f64, u32),
        sum: usize,
        of_time: &[f64],
    ) {
        // need = level + slope × (energy steps gained) + drag
        let inertia = gear.inertia / self.h;
        let (level, resistance_slope) = self.resistance;
        let slope = self.step_e * (inertia + 0.5 * resistance_slope);
        // Braking pays only where the next node's ceiling lies below coasting.
        let level_point = ((sum as i32 - self.rise) as usize + i).min(gear.points.len() - 1);
        let coast = -(level + f64::from(gear.points[level_point].drag)) / (inertia * self.step_e);
        let gained = self.rise - i as i32;
        let ceiling = f64::from(gained + of_time.len() as i32 - 1);
        let first = (round_up(coast.min(ceiling) - 1.5) - gained).max(0) as usize;
        let h = self.h;
        let spare = (self.dither * inertia * self.step_e) as f32;
        // Only where the gear drives at the mean energy.
        let count = of_time.len();
        let begin = first.max(gear.drives.0.saturating_sub(sum));
        let end = count.min(gear.drives.1.saturating_sub(sum));
        if begin >= end {
            return;
        }
        let points = &gear.points[sum + begin..sum + end];
        let ways = &mut self.next[slot * count + begin..slot * count + end];
        for (((j, point), time), way) in
            (begin..end).zip(points).zip(&of_time[begin..end]).zip(ways)
        {
            let steps = gained + j as i32;
            let need = (level + slope * f64::from(steps)) as f32 + point.drag;
            if need > point.limit + spare {
                if steps > 0 {
                    break;
                }
                continue;
            }
            let before = base + time;
            if before >= way.cost_g || f64::from(need) < -self.brake {
                continue;
            }
            let fuel = if need > 0.0 || !self.free_cut {
                h * f64::from(point.fuel_g_m(need.max(0.0)))
            } else {
                0.0
            };
            let total = before + fuel;
            if total < way.cost_g {
                *way = Way { cost_g: total, from: code };
            }
        }
    }
}
