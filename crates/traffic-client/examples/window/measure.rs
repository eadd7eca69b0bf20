//! Traffic around a truck that follows its lane, on the whole road and with a window.

use std::sync::Arc;

use driver_models::Idm;
use road::{Road, builtin};
use tractrix_core::{EgoState, Geometry, Scene, Time, TrafficSource};
use traffic_client::native::{Density, NativeTraffic, TrafficConfig, WindowConfig};

/// Distance to which gaps, density and speed are taken, m.
const AROUND_M: f64 = 300.0;
/// Figures are taken from here on, s: the truck has found its place.
const FROM_S: f64 = 60.0;
/// What the truck wants to drive, m/s.
const WANTED_M_S: f64 = 16.67;

/// A scenario family on its road.
#[derive(Clone)]
pub(crate) struct Family {
    pub name: &'static str,
    pub road: Arc<Road>,
    pub config: TrafficConfig,
    /// Where the truck starts, m.
    pub s_m: f64,
}

/// The six of `table2-*` and the paper's congested one.
pub(crate) fn families() -> Vec<Family> {
    let flat = Arc::new(builtin::flat(15_000.0));
    let mut families = Vec::new();
    for (name, density, max_speed_m_s) in [
        ("table2-dense-12.5", Density::Dense, 12.5),
        ("table2-dense-15", Density::Dense, 15.0),
        ("table2-medium-12.5", Density::Medium, 12.5),
        ("table2-medium-15", Density::Medium, 15.0),
        ("table2-sparse-12.5", Density::Sparse, 12.5),
        ("table2-sparse-15", Density::Sparse, 15.0),
    ] {
        let demand = TrafficConfig::family(density, max_speed_m_s, 0);
        let config = TrafficConfig { spawn_interval_s: 0.4, ..demand };
        families.push(Family { name, road: Arc::clone(&flat), config, s_m: 2000.0 });
    }
    let config = TrafficConfig::family(Density::Dense, 12.5, 0);
    let road = Arc::new(builtin::highway_sag());
    families.push(Family { name: "dense-12.5", road, config, s_m: 40.0 });
    families
}

/// What a run came to.
#[derive(Debug, Clone, Default)]
pub(crate) struct Run {
    /// Vehicles per km and lane.
    pub density_1_km: f64,
    pub speed_m_s: f64,
    /// Mean of (wanted - driven)/wanted of the truck.
    pub delta_frac: f64,
    /// Gaps between vehicles of a lane, m.
    pub gaps_m: Vec<f64>,
    pub least_gap_m: f64,
}

/// Drives for `duration_s` in the traffic of a seed.
pub(crate) fn run(
    family: &Family,
    window: Option<WindowConfig>,
    seed: u64,
    duration_s: f64,
) -> Run {
    let config = TrafficConfig { seed, window, ..family.config.clone() };
    let geometry = Geometry { front_m: 4.8, ..Geometry::default() };
    let geometry = Geometry { trailer_rear_m: 11.5, width_m: 2.55, ..geometry };
    let road = &family.road;
    let mut traffic = NativeTraffic::new(Arc::clone(road), geometry, config).unwrap();
    traffic.set_map_poses_within_m(-1.0);
    let lane = road.lanes().iter().find(|lane| lane.s_start_m <= family.s_m).unwrap();
    let through = road.lanes().len() as f64;
    let idm = Idm::new(WANTED_M_S, 1.5, 3.0, 0.5, 1.5, 6.0);
    let mut ego = EgoState { s_m: family.s_m, speed_m_s: 12.0, ..EgoState::default() };
    let mut run = Run { least_gap_m: f64::INFINITY, ..Run::default() };
    let (mut looks, mut vehicles, mut speed_sum, mut delta) = (0.0, 0.0, 0.0, (0.0, 0.0));
    for k in 0..(duration_s * 10.0) as i64 {
        ego.d_m = lane.center_d_m(ego.s_m);
        ego.yaw_rad = road.at(ego.s_m, ego.d_m).heading_rad;
        let scene = traffic.advance(Time(k * 100_000_000), &ego).unwrap();
        let front_m = ego.s_m + geometry.front_m;
        let leader = scene.neighbours.iter().find(|n| {
            n.front_s_m > front_m && (n.d_m - ego.d_m).abs() < 0.5 * (n.width_m + geometry.width_m)
        });
        let taken = leader.map_or(0.0, |n| {
            let (v, w) = (ego.speed_m_s, n.speed_m_s);
            idm.interaction_m_s2(v, n.rear_s_m - front_m, v - w)
        });
        let a_m_s2 = idm.lesser_m_s2(idm.free_m_s2(ego.speed_m_s, f64::INFINITY), taken).max(-6.0);
        if k as f64 >= FROM_S * 10.0 {
            delta = (delta.0 + 1.0 - ego.speed_m_s / WANTED_M_S, delta.1 + 1.0);
            if k % 10 == 0 {
                let (n, v) = look(scene, ego.s_m, &mut run.gaps_m);
                (looks, vehicles, speed_sum) = (looks + 1.0, vehicles + n, speed_sum + v);
            }
            run.least_gap_m = run.least_gap_m.min(traffic.min_gap_m());
        }
        let v = (ego.speed_m_s + 0.1 * a_m_s2).max(0.0);
        ego.s_m += 0.05 * (v + ego.speed_m_s);
        ego.speed_m_s = v;
        if ego.s_m > road.length_m() - AROUND_M {
            break;
        }
    }
    run.density_1_km = vehicles / looks / (2.0 * AROUND_M / 1000.0 * through);
    run.speed_m_s = if vehicles > 0.0 { speed_sum / vehicles } else { 0.0 };
    run.delta_frac = delta.0 / delta.1;
    run
}

/// Vehicles in sight and the sum of their speeds; adds the gaps between them.
fn look(scene: &Scene, ego_s_m: f64, gaps_m: &mut Vec<f64>) -> (f64, f64) {
    let near = |s_m: f64| (s_m - ego_s_m).abs() < AROUND_M;
    let seen: Vec<_> = scene.neighbours.iter().filter(|n| near(n.front_s_m)).collect();
    for (i, behind) in seen.iter().enumerate() {
        let ahead = seen[i + 1..].iter().find(|n| n.lane == behind.lane);
        gaps_m.extend(ahead.map(|n| n.rear_s_m - behind.front_s_m));
    }
    (seen.len() as f64, seen.iter().map(|n| n.speed_m_s).sum())
}

/// Greatest distance of two distributions (Kolmogorov, Smirnov).
pub(crate) fn ks(a: &[f64], b: &[f64]) -> f64 {
    let sorted = |x: &[f64]| {
        let mut x = x.to_vec();
        x.sort_by(f64::total_cmp);
        x
    };
    let (a, b) = (sorted(a), sorted(b));
    let (mut i, mut j, mut most) = (0, 0, 0.0_f64);
    while i < a.len() && j < b.len() {
        if a[i] <= b[j] {
            i += 1
        } else {
            j += 1
        }
        most = most.max((i as f64 / a.len() as f64 - j as f64 / b.len() as f64).abs());
    }
    most
}

/// Two groups of runs, held against each other.
pub(crate) struct Compared {
    /// Differences, second group less first, and the 95 % half-widths from the scatter of the pairs:
    /// density (1/km), mean speed (m/s), delta speed of the truck.
    pub differences: [(f64, f64); 3],
    /// KS distance of the gaps, and that which 95 % of other ways to share the runs out into two
    /// groups keep below.
    pub ks: (f64, f64),
}

/// Compares runs of the same seeds.
pub(crate) fn compare(whole: &[Run], window: &[Run]) -> Compared {
    let figures: [fn(&Run) -> f64; 3] = [|r| r.density_1_km, |r| r.speed_m_s, |r| r.delta_frac];
    let differences = figures.map(|figure| {
        let d: Vec<f64> = whole.iter().zip(window).map(|(a, b)| figure(b) - figure(a)).collect();
        let n = d.len() as f64;
        let mean = d.iter().sum::<f64>() / n;
        let variance = d.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / (n - 1.0);
        // Student's t for 7 to 30 degrees of freedom is 2.36 to 2.04.
        (mean, (2.0 + 2.6 / (n - 1.0)) * (variance / n).sqrt())
    });
    let pooled = |runs: &[&Run]| runs.iter().flat_map(|r| r.gaps_m.clone()).collect::<Vec<_>>();
    let pairs: Vec<(&Run, &Run)> = whole.iter().zip(window).collect();
    let distance = |flips: usize| {
        let (mut one, mut other) = (Vec::new(), Vec::new());
        for (k, &(a, b)) in pairs.iter().enumerate() {
            let flipped = flips >> k & 1 == 1;
            one.push(if flipped { b } else { a });
            other.push(if flipped { a } else { b });
        }
        ks(&pooled(&one), &pooled(&other))
    };
    let mut others: Vec<f64> = (1..64).map(|k| distance(k * 37)).collect();
    others.sort_by(f64::total_cmp);
    Compared { differences, ks: (distance(0), others[60]) }
}
