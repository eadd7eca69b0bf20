//! How fast many vehicles are, on one thread and on several.
//!
//! `many_vehicles VEHICLES THREADS SECONDS` drives a level road of two lanes, 20 vehicles per km and
//! lane, long enough for so many, and prints wall time, processor time and the fingerprint of the
//! state, which does not depend on the threads.
#![allow(clippy::disallowed_macros, clippy::disallowed_methods, reason = "a measurement program")]

use std::error::Error;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use road::builtin;
use tractrix_core::{EgoState, Geometry, Time, TrafficSource};
use traffic_client::native::{NativeTraffic, Piece, TrafficConfig, Workers};

const PER_KM_AND_LANE: f64 = 20.0;
const LANES: f64 = 2.0;

/// Threads that take the next piece when they are done with one.
#[derive(Debug)]
struct Threads(usize);

impl Workers for Threads {
    fn run<'a>(&self, pieces: Vec<Piece<'a>>) {
        let left = Mutex::new(pieces.into_iter());
        let work = || {
            loop {
                let next = left.lock().unwrap_or_else(PoisonError::into_inner).next();
                let Some(piece) = next else { break };
                piece();
            }
        };
        std::thread::scope(|scope| {
            for _ in 1..self.0 {
                scope.spawn(work);
            }
            work();
        });
    }
}

/// Processor time of this process so far, s.
fn processor_s() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after_name = stat.rsplit(')').next().unwrap_or_default();
    let fields = after_name.split_whitespace().skip(11).take(2);
    fields.filter_map(|x| x.parse::<f64>().ok()).sum::<f64>() / 100.0
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<usize> =
        std::env::args().skip(1).map(|x| x.parse()).collect::<Result<_, _>>()?;
    let [vehicles, threads, seconds] = arguments[..] else {
        return Err("usage: many_vehicles VEHICLES THREADS SECONDS".into());
    };
    let length_m = 1000.0 * vehicles as f64 / (PER_KM_AND_LANE * LANES);
    let config = TrafficConfig {
        initial_density_1_km: Some(PER_KM_AND_LANE),
        max_speed_m_s: 25.0,
        spawn_probability: 0.045,
        warm_up_s: 0.0,
        sees_ego: false,
        scene_radius_m: 300.0,
        ..TrafficConfig::default()
    };
    let road = Arc::new(builtin::flat(length_m));
    let mut traffic = NativeTraffic::new(road, Geometry::default(), config)?;
    traffic.set_workers(Arc::new(Threads(threads)));
    let ego = EgoState { s_m: 0.5 * length_m, ..EgoState::default() };
    traffic.advance(Time(0), &ego)?;
    let (start, before_s, ticks) = (Instant::now(), processor_s(), 10 * seconds);
    for k in 1..=ticks as i64 {
        traffic.advance(Time(k * 100_000_000), &ego)?;
    }
    let (wall_s, processor_s) = (start.elapsed().as_secs_f64(), processor_s() - before_s);
    let counts = traffic.counts();
    println!(
        "{} vehicles, {threads} threads, {seconds} s: wall {wall_s:.2} s ({:.1} x real time), \
         processor {processor_s:.2} s, {:.0} ns per vehicle and tick; {} bytes per vehicle; \
         fingerprint {:016x}",
        counts.vehicles,
        seconds as f64 / wall_s,
        processor_s * 1e9 / (ticks * counts.vehicles) as f64,
        NativeTraffic::bytes_per_vehicle(),
        traffic.fingerprint(),
    );
    Ok(())
}
