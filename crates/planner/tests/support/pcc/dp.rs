//! Dynamic-programming reference for the speed planner, with its own truck, its own edges and its
//! own search: nothing here is linearised, and nothing is shared with the planner but the statement
//! of the problem (data sheet, grades, speed bounds, both end speeds, price of a shift, Eq. 18).
//!
//! Backward value iteration over specific energy `E` and gear at the course's own step. From each
//! grid energy the truck is taken through the interval to a set of end energies between coasting and
//! full load (coasting with the brakes where the ceiling lies lower); the value at the end is
//! interpolated, so that edges do not have to end on the grid. A policy is only as good as its grid,
//! but its cost is not an estimate: the trip is driven forward from the start with the best of all
//! edges at every step, refined between the candidates. A second, finer grid follows in a tube
//! around that trip. The price of time is adjusted until the trip lasts as long as asked.
//!
//! With [`Task::may_roll`] the driveline may be opened (neutral, engine idling) where a road falls;
//! nowhere else, because on a flat road accelerating and rolling by turns would be cheapest, which no
//! plan should ask for, and never where the truck would have to be braked (it has no engine brake).
//!
//! `beta` is the price of time in g/s; every other quantity is SI.

use tractrix_core::{FuelModel, GRAVITY_M_S2, PowertrainLimits, RoadPiece, VehicleLimits};

/// Price of a speed below the lowest allowed one, g per J/kg: far above any fuel.
const SLOW_PRICE: f64 = 60.0;
/// Step of the truck's tables in energy, J/kg.
const TABLE_STEP: f64 = 0.25;

/// The statement of a problem.
pub(crate) struct Task<'a> {
    pub(crate) limits: &'a VehicleLimits,
    /// Interval length, m.
    pub(crate) h_m: f64,
    pub(crate) road: &'a [RoadPiece],
    /// Bounds of the energy per node, J/kg.
    pub(crate) e_min: &'a [f64],
    pub(crate) e_max: &'a [f64],
    pub(crate) start_e: f64,
    pub(crate) end_e: f64,
    /// Fuel per shift, g.
    pub(crate) shift_g: f64,
    /// Eq. 18's `k_a`, g s³/m².
    pub(crate) accel_g: f64,
    /// Largest planned brake deceleration, m/s².
    pub(crate) brake_m_s2: f64,
    /// Whether the objective charges the flow at vanishing torque at fuel cut-off too. A map that
    /// jumps there otherwise makes full power and cut-off by turns optimal on a flat road.
    pub(crate) charge_cut: bool,
    /// Intervals in which the driveline may be open; `None`: in no interval.
    pub(crate) may_roll: Option<Vec<bool>>,
}

/// Index of the open driveline among the gears.
pub(crate) const NEUTRAL: usize = usize::MAX;

/// Grid sizes.
#[derive(Clone, Copy)]
pub(crate) struct Resolution {
    /// Energy steps: whole band, then in the tube, J/kg.
    pub(crate) band_j_kg: f64,
    pub(crate) tube_j_kg: f64,
    /// Half width of the tube, J/kg.
    pub(crate) half_j_kg: f64,
    /// Candidates between coasting and full load.
    pub(crate) levels: usize,
    /// Adjustments of the price of time per grid.
    pub(crate) prices: usize,
}

/// For tests that always run.
pub(crate) const QUICK: Resolution =
    Resolution { band_j_kg: 2.0, tube_j_kg: 0.5, half_j_kg: 10.0, levels: 16, prices: 4 };
/// For the campaign.
pub(crate) const FINE: Resolution =
    Resolution { band_j_kg: 1.0, tube_j_kg: 0.25, half_j_kg: 12.0, levels: 24, prices: 5 };
/// Half of every step of [`FINE`].
pub(crate) const FINEST: Resolution =
    Resolution { band_j_kg: 0.5, tube_j_kg: 0.125, half_j_kg: 12.0, levels: 48, prices: 5 };

/// A driven trip.
#[derive(Clone, Debug, Default)]
pub(crate) struct Trip {
    /// Energies per node, gears per interval.
    pub(crate) e: Vec<f64>,
    pub(crate) gears: Vec<usize>,
    /// Fuel with shifts, g; time, s.
    pub(crate) fuel_g: f64,
    pub(crate) time_s: f64,
    pub(crate) shifts: usize,
    /// `∫ k_a a² dt`, g.
    pub(crate) accel_g: f64,
    /// Price of time it was found with, g/s.
    pub(crate) beta: f64,
}

/// One gear at one energy.
#[derive(Clone, Copy, Default)]
struct At {
    /// Overrun drag and full load per mass, m/s².
    drag: f64,
    full: f64,
    friction_nm: f64,
}

/// A gear of the truck over energy.
struct Gear {
    index: usize,
    /// Engine radians per metre, efficiency, (mass + rotating mass)/mass.
    i: f64,
    eta: f64,
    mu: f64,
    /// Energies between which the gear drives.
    from_e: f64,
    to_e: f64,
    at: Vec<At>,
}

/// What an interval takes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Edge {
    pub(crate) fuel_g: f64,
    /// Fuel of the objective, g.
    charged_g: f64,
    pub(crate) time_s: f64,
    pub(crate) accel_g: f64,
    /// Force per mass asked of driveline (positive) or brakes (negative), and full load, m/s².
    pub(crate) need: f64,
    pub(crate) full: f64,
}

pub(crate) struct Plant<'a> {
    task: &'a Task<'a>,
    fuel: &'a FuelModel,
    gears: Vec<Gear>,
    mass: f64,
    /// ρ CdA / m.
    air: f64,
    slowest_w: f64,
    aux_w: f64,
    idle_g_s: f64,
}

fn figures(p: &PowertrainLimits, mass: f64, i: f64, eta: f64, v: f64) -> At {
    let w = (v * i).max(p.lugging_speed_rad_s);
    let friction_nm = p.friction_nm.at(w);
    let lost = (friction_nm + p.auxiliary_power_w / w) * i / eta;
    let net = (p.full_load_nm.at(w) - p.auxiliary_power_w / w).max(0.0);
    At { drag: lost / mass, full: (net * i * eta + lost) / mass, friction_nm }
}

impl<'a> Plant<'a> {
    pub(crate) fn new(task: &'a Task<'a>) -> Self {
        let p = &task.limits.powertrain;
        let mass = task.limits.road_load.mass_kg;
        let top = task.e_max.iter().copied().fold(0.0, f64::max);
        let bottom = task.e_min.iter().copied().fold(f64::MAX, f64::min);
        let slowest_w = p.lugging_speed_rad_s;
        let rows = (top / TABLE_STEP) as usize + 3;
        let rolling = task.may_roll.is_some().then(|| Gear {
            index: NEUTRAL,
            i: 0.0,
            eta: 1.0,
            mu: 1.0 + p.rotating_mass_neutral_kg / mass,
            from_e: 0.0,
            to_e: f64::INFINITY,
            at: vec![At::default(); rows],
        });
        let gears = (0..p.gear_ratios.len())
            .map(|g| {
                let i = p.gear_ratios[g] * p.final_drive_ratio / p.wheel_radius_m;
                let eta = p.gear_efficiency_frac[g];
                let from = if g == 0 { 0.0 } else { slowest_w / i };
                let to = p.max_speed_rad_s / i;
                let at = (0..rows)
                    .map(|r| figures(p, mass, i, eta, (2.0 * r as f64 * TABLE_STEP).sqrt()))
                    .collect();
                let mu = 1.0 + p.rotating_mass_kg[g] / mass;
                Gear { index: g, i, eta, mu, from_e: 0.5 * from * from, to_e: 0.5 * to * to, at }
            })
            .filter(|gear| gear.from_e < top && gear.to_e > bottom)
            .chain(rolling)
            .collect();
        Self {
            task,
            fuel: &p.fuel,
            gears,
            mass,
            air: task.limits.road_load.air_density_kg_m3 * task.limits.road_load.cd_a_m2 / mass,
            slowest_w,
            aux_w: p.auxiliary_power_w,
            idle_g_s: p.idle_fuel_g_s,
        }
    }

    fn resistance(&self, k: usize, mean: f64) -> f64 {
        let (load, road) = (&self.task.limits.road_load, &self.task.road[k]);
        let (v, w) = ((2.0 * mean).sqrt(), road.headwind_m_s);
        let roll = load.rolling_coeff + load.rolling_per_speed_s_m * v;
        let curve = load.curve_drag_1_n * self.mass * (v * v * v * v) * road.curvature_squared_1_m2;
        self.air * (mean + w * v + 0.5 * w * w)
            + GRAVITY_M_S2 * (road.sin_grade + roll * road.cos_grade)
            + curve
            + load.constant_drag_n / self.mass
    }

    /// Interval `k` from `e0` to `e1` in gear `slot` with the figures `at` of its mean energy.
    fn edge_at(&self, k: usize, slot: usize, e0: f64, e1: f64, at: At) -> Edge {
        let gear = &self.gears[slot];
        let h = self.task.h_m;
        let mean = 0.5 * (e0 + e1);
        let accel = (e1 - e0) / h;
        let need = gear.mu * accel + at.drag + self.resistance(k, mean);
        let time_s = 2.0 * h / ((2.0 * e0).sqrt() + (2.0 * e1).sqrt());
        let accel_g = time_s * self.task.accel_g * accel * accel;
        if gear.index == NEUTRAL {
            let fuel_g = self.idle_g_s * time_s;
            return Edge { fuel_g, charged_g: fuel_g, time_s, accel_g, need, full: 0.0 };
        }
        let w = ((2.0 * mean).sqrt() * gear.i).max(self.slowest_w);
        let pull = (need - at.drag) * self.mass;
        let net = if pull >= 0.0 { pull / (gear.i * gear.eta) } else { pull * gear.eta / gear.i };
        let gas_nm = net + at.friction_nm + self.aux_w / w;
        let injects = need >= 1e-7 && gas_nm >= 1e-6;
        let charged_g = if injects || self.task.charge_cut {
            time_s * self.fuel.rate_g_s(w, gas_nm.max(1e-6))
        } else {
            0.0
        };
        let fuel_g = if injects { charged_g } else { 0.0 };
        Edge { fuel_g, charged_g, time_s, accel_g, need, full: at.full }
    }

    /// The same with exact figures, for checking a profile that was planned elsewhere.
    pub(crate) fn exact_edge(&self, k: usize, gear: usize, e0: f64, e1: f64) -> Option<Edge> {
        let slot = self.gears.iter().position(|g| g.index == gear)?;
        let g = &self.gears[slot];
        let p = &self.task.limits.powertrain;
        Some(self.edge_at(k, slot, e0, e1, figures(p, self.mass, g.i, g.eta, (e0 + e1).sqrt())))
    }

    fn table(&self, slot: usize, mean: f64) -> At {
        let rows = &self.gears[slot].at;
        let x = (mean / TABLE_STEP).max(0.0);
        let r = (x as usize).min(rows.len() - 2);
        let (a, b, f) = (rows[r], rows[r + 1], x - r as f64);
        let mix = |a: f64, b: f64| a + f * (b - a);
        At {
            drag: mix(a.drag, b.drag),
            full: mix(a.full, b.full),
            friction_nm: mix(a.friction_nm, b.friction_nm),
        }
    }

    /// Highest energy after interval `k` with `share` of the full load (0: coasting).
    fn reach(&self, k: usize, slot: usize, e0: f64, share: f64) -> f64 {
        let mut e1 = e0;
        for _ in 0..4 {
            let mean = 0.5 * (e0 + e1);
            let at = self.table(slot, mean);
            let surplus = share * at.full - at.drag - self.resistance(k, mean);
            e1 = (e0 + surplus * self.task.h_m / self.gears[slot].mu).max(0.2);
        }
        e1
    }

    fn drives(&self, slot: usize, mean: f64) -> bool {
        (self.gears[slot].from_e..=self.gears[slot].to_e).contains(&mean)
    }
}

/// Values over energy and gear at one node: `W(E, gear engaged before)`, shift included.
struct Layer {
    low: i64,
    count: usize,
    values: Vec<f64>,
}

struct Sweep<'a> {
    plant: &'a Plant<'a>,
    step: f64,
    beta: f64,
    levels: usize,
    layers: Vec<Layer>,
}

impl<'a> Sweep<'a> {
    fn energy(&self, index: i64) -> f64 {
        self.plant.task.end_e + index as f64 * self.step
    }

    /// Value after arriving at node `k` with `e` in gear `slot`; outside the grid it is held and the
    /// distance charged.
    fn value(&self, k: usize, slot: usize, e: f64) -> f64 {
        let layer = &self.layers[k];
        let x = (e - self.energy(layer.low)) / self.step;
        let last = (layer.count - 1) as f64;
        let inside = x.clamp(0.0, last);
        let outside = (x - inside).abs() * self.step;
        let i = (inside as usize).min(layer.count.saturating_sub(2));
        let m = self.plant.gears.len();
        let at = |i: usize| layer.values[i.min(layer.count - 1) * m + slot];
        let f = inside - i as f64;
        let (a, b) = (at(i), at(i + 1));
        let slow = (self.plant.task.e_min[k] - e).max(0.0);
        a + f * (b - a) + SLOW_PRICE * (outside + slow)
    }

    /// Cost of an edge with what follows it.
    fn total(&self, k: usize, slot: usize, e0: f64, e1: f64) -> f64 {
        let at = self.plant.table(slot, 0.5 * (e0 + e1));
        let edge = self.plant.edge_at(k, slot, e0, e1, at);
        edge.charged_g + edge.accel_g + self.beta * edge.time_s + self.value(k + 1, slot, e1)
    }

    /// The best end energy in a gear, with its cost; `None` where the gear does not drive.
    fn best(&self, k: usize, slot: usize, e0: f64, refine: bool) -> Option<(f64, f64)> {
        let plant = self.plant;
        let ceiling = plant.task.e_max[k + 1];
        let coast = plant.reach(k, slot, e0, 0.0);
        if plant.gears[slot].index == NEUTRAL {
            let may = plant.task.may_roll.as_ref().is_some_and(|may| may[k]) && coast <= ceiling;
            return may.then(|| (coast, self.total(k, slot, e0, coast)));
        }
        let low = coast.min(ceiling);
        let strongest = plant.task.brake_m_s2 * plant.task.h_m / plant.gears[slot].mu;
        if coast - low > strongest || !plant.drives(slot, 0.5 * (e0 + low)) {
            return None;
        }
        let high = plant.reach(k, slot, e0, 1.0).min(ceiling).max(low);
        let width = (high - low) / self.levels as f64;
        let mut best = (low, self.total(k, slot, e0, low));
        if width > 1e-9 {
            for i in 1..=self.levels {
                let e1 = low + width * i as f64;
                let cost = self.total(k, slot, e0, e1);
                if cost < best.1 {
                    best = (e1, cost);
                }
            }
            if refine && best.0 > low {
                best = self.golden(k, slot, e0, (best.0 - width).max(low), best.0, best);
                best = self.golden(k, slot, e0, best.0, (best.0 + width).min(high), best);
            }
            // Constant speed is a candidate of its own.
            if e0 > low && e0 < high {
                let cost = self.total(k, slot, e0, e0);
                if cost < best.1 {
                    best = (e0, cost);
                }
            }
        }
        plant.drives(slot, 0.5 * (e0 + best.0)).then_some(best)
    }

    fn golden(
        &self,
        k: usize,
        slot: usize,
        e0: f64,
        mut low: f64,
        mut high: f64,
        mut best: (f64, f64),
    ) -> (f64, f64) {
        for _ in 0..12 {
            let (a, b) = (high - 0.618 * (high - low), low + 0.618 * (high - low));
            let (fa, fb) = (self.total(k, slot, e0, a), self.total(k, slot, e0, b));
            for (e, f) in [(a, fa), (b, fb)] {
                if f < best.1 {
                    best = (e, f);
                }
            }
            if fa < fb { high = b } else { low = a }
        }
        best
    }

    /// Fills the layers backward; `around` limits them to a tube of half width `half`.
    fn backward(&mut self, around: Option<(&[f64], f64)>) {
        let task = self.plant.task;
        let (n, m) = (task.road.len(), self.plant.gears.len());
        self.layers = (0..=n)
            .map(|k| {
                let (mut low, mut high) = (task.e_min[k] - 1.0, task.e_max[k]);
                if let Some((e, half)) = around {
                    low = low.max(e[k] - half).min(e[k]);
                    high = high.min(e[k] + half).max(low);
                }
                let low = ((low - task.end_e) / self.step).floor() as i64;
                let high = ((high - task.end_e) / self.step).ceil() as i64;
                let count = (high - low).max(1) as usize + 1;
                Layer { low, count, values: vec![0.0; count * m] }
            })
            .collect();
        for i in 0..self.layers[n].count {
            let missing = (task.end_e - self.energy(self.layers[n].low + i as i64)).max(0.0);
            self.layers[n].values[i * m..(i + 1) * m].fill(10.0 * SLOW_PRICE * missing);
        }
        for k in (0..n).rev() {
            for i in 0..self.layers[k].count {
                let e0 = self.energy(self.layers[k].low + i as i64).max(0.3);
                let mut own: Vec<f64> = (0..m)
                    .map(|slot| self.best(k, slot, e0, false).map_or(1e9, |(_, cost)| cost))
                    .collect();
                let other = own.iter().copied().fold(f64::INFINITY, f64::min) + task.shift_g;
                for value in &mut own {
                    *value = value.min(other);
                }
                self.layers[k].values[i * m..(i + 1) * m].copy_from_slice(&own);
            }
        }
    }

    /// Drives the trip.
    #[allow(clippy::expect_used)]
    fn forward(&self) -> Trip {
        let task = self.plant.task;
        let mut trip = Trip { e: vec![task.start_e], beta: self.beta, ..Trip::default() };
        let mut before = None;
        for k in 0..task.road.len() {
            let e0 = trip.e[k];
            let mut best = (f64::INFINITY, 0, e0);
            for slot in 0..self.plant.gears.len() {
                let Some((e1, cost)) = self.best(k, slot, e0, true) else { continue };
                let shift = before.is_some_and(|b| b != slot);
                let cost = cost + if shift { task.shift_g } else { 0.0 };
                if cost < best.0 {
                    best = (cost, slot, e1);
                }
            }
            let (_, slot, e1) = best;
            let gear = self.plant.gears[slot].index;
            let edge = self.plant.exact_edge(k, gear, e0, e1).expect("a gear of the plant");
            if before.is_some_and(|b| b != slot) {
                trip.shifts += 1;
                trip.fuel_g += task.shift_g;
            }
            before = Some(slot);
            trip.fuel_g += edge.fuel_g;
            trip.time_s += edge.time_s;
            trip.accel_g += edge.accel_g;
            trip.e.push(e1);
            trip.gears.push(gear);
        }
        trip
    }
}

impl Trip {
    /// Fuel that the trip would take in `time_s`, to first order: a second is worth `beta`.
    pub(crate) fn fuel_at(&self, time_s: f64) -> f64 {
        self.fuel_g + self.beta * (self.time_s - time_s)
    }
}

/// The reference for a trip that lasts `goal_s`, found from the guess `beta` of the price of time.
pub(crate) fn reference(task: &Task<'_>, goal_s: f64, beta: f64, r: Resolution) -> Trip {
    let plant = Plant::new(task);
    let mut best = Trip { beta, ..Trip::default() };
    for (step, tube) in [(r.band_j_kg, false), (r.tube_j_kg, true), (r.tube_j_kg, true)] {
        let centre = best.e.clone();
        // Root of the trip time over the price, by secants within the bracket.
        let mut seen: Vec<Trip> = Vec::new();
        let mut price = best.beta;
        for _ in 0..r.prices {
            let mut sweep =
                Sweep { plant: &plant, step, beta: price, levels: r.levels, layers: Vec::new() };
            sweep.backward(tube.then_some((centre.as_slice(), r.half_j_kg)));
            seen.push(sweep.forward());
            let late = |t: &Trip| t.time_s - goal_s;
            seen.sort_by(|a, b| a.beta.total_cmp(&b.beta));
            if seen.iter().any(|t| late(t).abs() < 2e-5 * goal_s) {
                break;
            }
            let slow = seen.iter().rfind(|t| late(t) > 0.0);
            let fast = seen.iter().find(|t| late(t) <= 0.0);
            price = match (slow, fast) {
                (Some(a), Some(b)) => {
                    let f = (late(a) / (late(a) - late(b))).clamp(0.1, 0.9);
                    a.beta + f * (b.beta - a.beta)
                }
                (Some(a), None) => 1.15 * a.beta + 0.02,
                (None, Some(b)) if b.beta < 0.02 => break,
                (None, Some(b)) => 0.85 * b.beta - 0.01,
                (None, None) => break,
            }
            .max(0.0);
        }
        let near = |t: &Trip| (t.time_s - goal_s).abs();
        seen.sort_by(|a, b| near(a).total_cmp(&near(b)));
        best = seen.swap_remove(0);
    }
    best
}
