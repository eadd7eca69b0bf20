//! How measured drivers follow: the car-following law of the native drivers, fitted to pairs of
//! vehicles, driver by driver; the drivers of every third pair are held back.
//!
//! `cargo run --release -p traffic-client --example fit_following -- PAIRS.parquet` reads the columns
//! `event`, `t_s`, `spacing_m`, `v_follow_mps`, `v_lead_mps`. A follower starts as measured and then
//! drives by itself behind the measured leader; what is judged is its gap, by the mixed error
//! `sqrt(mean((s - s_measured)² / s_measured) / mean(s_measured))` of Kesting & Treiber (Transp. Res.
//! Record 2088 (2008) 148, Eq. 8). On stdout: tables of Markdown.
#![allow(
    clippy::print_stdout,
    clippy::panic,
    clippy::disallowed_macros,
    clippy::unwrap_used,
    reason = "an example"
)]

use std::collections::BTreeMap;
use std::fs::File;

use driver_models::{Idm, ballistic};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use traffic_client::native::TrafficConfig;

/// Headway, standstill gap, acceleration, braking: what is fitted.
type Driver = [f64; 4];

/// Speeds in the pairs stay far below what these drivers wish on a free motorway, so it cannot be
/// fitted: the limit there, 65 mph, m/s.
const DESIRED_M_S: f64 = 29.06;
/// Ranges that a driver may have.
const BOUNDS: [(f64, f64); 4] = [(0.2, 5.0), (0.3, 12.0), (0.2, 5.0), (0.2, 8.0)];
/// Where a pair tells nothing a driver stays near these (Treiber & Kesting 2013, Table 11.2,
/// motorway), within this scatter of the logarithm.
const PUBLISHED: Driver = [1.0, 2.0, 1.0, 1.5];
const PRIOR_SIGMA: f64 = 0.5;
/// Errors of a gap this far apart in time are taken as independent, s.
const INDEPENDENT_S: f64 = 5.0;
/// Collided followers count as this far apart, m.
const TOUCH_M: f64 = 0.1;

/// A measured pair: time, gap, own speed, leader's speed.
type Pair = Vec<[f64; 4]>;

fn number(field: &Field) -> f64 {
    match *field {
        Field::Double(x) => x,
        Field::Float(x) => f64::from(x),
        Field::Long(x) => x as f64,
        Field::Int(x) => f64::from(x),
        Field::Short(x) => f64::from(x),
        ref other => panic!("{other:?} is no number"),
    }
}

fn read(path: &str) -> Vec<Pair> {
    let reader = SerializedFileReader::new(File::open(path).unwrap()).unwrap();
    let mut pairs = BTreeMap::<u64, Pair>::new();
    for row in reader.get_row_iter(None).unwrap() {
        let row = row.unwrap();
        let at = |name: &str| {
            let (_, field) = row.get_column_iter().find(|(n, _)| *n == name).unwrap();
            number(field)
        };
        let sample = ["t_s", "spacing_m", "v_follow_mps", "v_lead_mps"].map(at);
        pairs.entry(at("event") as u64).or_default().push(sample);
    }
    pairs.into_values().filter(|p| p.len() > 50 && p.iter().all(|s| s[1] > 0.0)).collect()
}

/// Mixed error of the gap of a driver who follows the leader of a pair.
fn error(pair: &Pair, [headway_s, min_gap_m, accel_m_s2, decel_m_s2]: Driver) -> f64 {
    let idm = Idm::new(DESIRED_M_S, headway_s, min_gap_m, accel_m_s2, decel_m_s2, 8.0);
    let [_, mut gap_m, mut v, _] = pair[0];
    let (mut sum, mut gaps) = (0.0, 0.0);
    for two in pair.windows(2) {
        let dt = two[1][0] - two[0][0];
        let free = idm.free_m_s2(v, f64::INFINITY);
        let taken = idm.interaction_m_s2(v, gap_m.max(TOUCH_M), v - two[0][3]);
        let a = idm.lesser_m_s2(free, taken).max(-idm.max_decel_m_s2);
        let (next, driven_m) = ballistic(v, a, dt);
        gap_m += 0.5 * (two[0][3] + two[1][3]) * dt - driven_m;
        v = next;
        sum += (gap_m - two[1][1]).powi(2) / two[1][1];
        gaps += two[1][1];
    }
    let n = (pair.len() - 1) as f64;
    ((sum / n) / (gaps / n)).sqrt()
}

/// Minus the logarithm of how probable a driver is who drives a pair: error and prior.
fn surprise(pair: &Pair, driver: Driver) -> f64 {
    let seconds = pair[pair.len() - 1][0] - pair[0][0];
    let unusual = driver.iter().zip(PUBLISHED).map(|(x, usual)| (x / usual).ln() / PRIOR_SIGMA);
    seconds / INDEPENDENT_S * error(pair, driver).max(1e-6).ln()
        + 0.5 * unusual.map(|u| u * u).sum::<f64>()
}

/// The driver with the least cost, by pattern search in the logarithms (Hooke & Jeeves 1961).
fn fit(start: Driver, cost: impl Fn(Driver) -> f64) -> Driver {
    let (mut best, mut least, mut step) = (start, cost(start), 0.5);
    while step > 0.005 {
        let before = least;
        for k in 0..4 {
            for factor in [1.0 + step, 1.0 / (1.0 + step)] {
                let mut trial = best;
                trial[k] = (best[k] * factor).clamp(BOUNDS[k].0, BOUNDS[k].1);
                let now = cost(trial);
                if now < least {
                    (best, least) = (trial, now);
                }
            }
        }
        if least >= before {
            step *= 0.5;
        }
    }
    best
}

fn quantile(values: &mut [f64], q: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * q).round() as usize]
}

fn main() {
    let path = std::env::args().nth(1).unwrap();
    let pairs = read(&path);
    let (held, used): (Vec<_>, Vec<_>) = pairs.iter().enumerate().partition(|(k, _)| k % 3 == 2);
    let car = TrafficConfig::default().car;
    let defaults = [car.headway_s, car.min_gap_m, car.accel_m_s2, car.decel_m_s2];
    println!("{} drivers used, {} held back\n", used.len(), held.len());
    let starts = [defaults, PUBLISHED, [1.6, 4.0, 0.6, 3.0]];
    let least = |cost: &dyn Fn(Driver) -> f64| {
        let fits = starts.map(|start| fit(start, cost));
        fits.into_iter().min_by(|a, b| cost(*a).total_cmp(&cost(*b))).unwrap()
    };
    let own = |pair: &Pair| least(&|d| error(pair, d));
    let fitted: Vec<Driver> = used.iter().map(|(_, pair)| least(&|d| surprise(pair, d))).collect();
    println!("| of a driver | 10 % | median | 90 % | mean of ln | sd of ln | at a bound |");
    println!("|---|---|---|---|---|---|---|");
    let names = ["headway, s", "standstill gap, m", "acceleration, m/s²", "braking, m/s²"];
    let mut median = defaults;
    for (k, name) in names.into_iter().enumerate() {
        let mut values: Vec<f64> = fitted.iter().map(|d| d[k]).collect();
        let n = values.len() as f64;
        let mean = values.iter().map(|x| x.ln()).sum::<f64>() / n;
        let sd = (values.iter().map(|x| (x.ln() - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
        let at_bound = values.iter().filter(|&&x| x <= BOUNDS[k].0 || x >= BOUNDS[k].1).count();
        median[k] = quantile(&mut values, 0.5);
        let (low, high) = (quantile(&mut values, 0.1), quantile(&mut values, 0.9));
        println!(
            "| {name} | {low:.2} | {:.2} | {high:.2} | {mean:.3} | {sd:.3} | {:.0} % |",
            median[k],
            100.0 * at_bound as f64 / n
        );
    }
    let pooled = fit(median, |d| used.iter().map(|(_, p)| error(p, d)).sum());
    println!("\none driver for all used pairs: {pooled:.2?}\n");
    println!("| driver | gap error, pairs used: mean | held back: mean | median | 90 % |");
    println!("|---|---|---|---|---|");
    for (name, d) in [
        ("present default car", defaults),
        ("Treiber & Kesting 2013", PUBLISHED),
        ("median of the fitted", median),
        ("one for all", pooled),
    ] {
        let of = |set: &[(usize, &Pair)]| set.iter().map(|(_, p)| error(p, d)).collect::<Vec<_>>();
        row(name, &of(&used), &mut of(&held));
    }
    let best = |set: &[(usize, &Pair)]| -> Vec<f64> {
        set.iter().map(|(_, p)| error(p, own(p))).collect()
    };
    row("each pair its own (the least possible)", &best(&used), &mut best(&held));
}

fn row(name: &str, used: &[f64], held: &mut [f64]) {
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let (u, h) = (mean(used), mean(held));
    println!(
        "| {name} | {u:.3} | {h:.3} | {:.3} | {:.3} |",
        quantile(held, 0.5),
        quantile(held, 0.9)
    );
}
