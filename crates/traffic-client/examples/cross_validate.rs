//! Calibrates one population to a part of the recordings and judges it on the others, then the
//! other way round: every recording is judged by drivers who were found without it.
//!
//! `cross_validate GENERATIONS[:SEED] PARTS FILE:LANES...` deals the files out to so many parts in
//! turn (1: learn from all, and judge on the same), searches with that seed (1) and prints a line per
//! recording: Kolmogorov-Smirnov distances of speed and gap with the measured start and arrivals
//! (`bounded`), that of the speeds if everyone kept the speed that they came with (`kept`), those of
//! speed and gap with flow and speeds at both ends only (`free`: eight seeds together, as bounded
//! traffic is four; `alone`: mean and range of single seeds; `among`: mean distance of the seeds from
//! each other), and the mean distance of the speeds from the other recordings of its name up to the
//! first digit (`others`).
#![allow(clippy::disallowed_macros, reason = "a measurement program")]

use std::error::Error;
use std::path::Path;
use std::sync::Arc;

use road::Road;
use traffic_client::calibrate::{Calibration, Effort, Lesson, calibrate, drive, drive_bounded};
use traffic_client::native::{Boundary, TrafficConfig};
use traffic_client::replay::{Carriageway, Frame, Recording, load, road_of};
use traffic_client::stats::{Quantity, Samples, kolmogorov_smirnov, observe_recording};

/// Free traffic is driven with these seeds, none of which the search used, each for this long, s.
const FREE_SEEDS: std::ops::RangeInclusive<u64> = 1..=8;
const FREE_S: f64 = 30.0;
/// Drives of bounded traffic.
const BOUNDED_DRIVES: u64 = 4;

/// A recording on its road, looked at.
struct Looked {
    name: String,
    recording: Recording,
    road: Arc<Road>,
    samples: Samples,
}

impl Looked {
    fn at(file: &str) -> Result<Self, Box<dyn Error>> {
        let (path, lanes) = file.rsplit_once(':').ok_or("FILE:LANES")?;
        let mut recording = load(Path::new(path), Carriageway::Forward, 0.1)?;
        recording.frame = Frame::Map;
        let road = Arc::new(road_of(&recording, lanes.parse()?, 60.0)?);
        let mut samples = observe_recording(&road, &recording)?;
        samples.replace(Quantity::Speed, recording.speeds_m_s().collect());
        let name = Path::new(path).file_name().map(|n| n.to_string_lossy().into_owned());
        Ok(Self { name: name.unwrap_or_default(), recording, road, samples })
    }

    fn lesson(&self) -> Lesson<'_> {
        Lesson { recording: &self.recording, road: &self.road, samples: &self.samples }
    }

    /// The name up to its first digit: recordings of one kind.
    fn kind(&self) -> &str {
        self.name.split(|c: char| c.is_ascii_digit()).next().unwrap_or_default()
    }

    fn distance(&self, samples: &Samples, quantity: Quantity) -> f64 {
        kolmogorov_smirnov(samples.of(quantity), self.samples.of(quantity)).unwrap_or(1.0)
    }
}

/// Distances of speed and gap in bounded and free traffic, what kept speeds would give, and the
/// other recordings.
struct Verdict {
    bounded: [f64; 2],
    kept: f64,
    free: [f64; 2],
    /// Distances of the speeds of single seeds, and the mean distance of these from each other.
    alone: Vec<f64>,
    among: f64,
    others: Option<f64>,
    lane_changes_1_km: [f64; 3],
}

fn judge(one: &Looked, all: &[Looked], found: &Calibration) -> Result<Verdict, Box<dyn Error>> {
    // Seeds that the search did not use.
    let config = TrafficConfig { seed: 1, ..found.config.clone() };
    let boundary = Arc::new(Boundary::of(&one.road, &one.recording)?);
    let bounded = drive_bounded(&one.road, &config, &boundary, BOUNDED_DRIVES)?;
    let free_config = found.free_traffic(&one.lesson())?;
    let free = FREE_SEEDS
        .map(|seed| drive(&one.road, TrafficConfig { seed, ..free_config.clone() }, FREE_S))
        .collect::<Result<Vec<_>, _>>()?;
    let both = |s: &Samples| [Quantity::Speed, Quantity::Gap].map(|q| one.distance(s, q));
    let tracks = one.recording.tracks.iter();
    let kept: Vec<f64> =
        tracks.flat_map(|t| t.samples.iter().map(|_| t.samples[0].speed_m_s)).collect();
    let others: Vec<f64> = all
        .iter()
        .filter(|o| o.kind() == one.kind() && o.name != one.name)
        .map(|o| one.distance(&o.samples, Quantity::Speed))
        .collect();
    let free_changes = free.iter().map(Samples::lane_changes_1_km).sum::<f64>();
    let mut together = free[0].clone();
    free[1..].iter().for_each(|more| together.append(more));
    let pairs = free.iter().enumerate().flat_map(|(k, a)| free[..k].iter().map(move |b| (a, b)));
    let apart = |(a, b): (&Samples, &Samples)| {
        kolmogorov_smirnov(a.of(Quantity::Speed), b.of(Quantity::Speed)).unwrap_or(1.0)
    };
    let among: Vec<f64> = pairs.map(apart).collect();
    Ok(Verdict {
        bounded: both(&bounded),
        kept: kolmogorov_smirnov(&kept, one.samples.of(Quantity::Speed)).unwrap_or(1.0),
        free: both(&together),
        alone: free.iter().map(|s| one.distance(s, Quantity::Speed)).collect(),
        among: among.iter().sum::<f64>() / among.len() as f64,
        others: (!others.is_empty()).then(|| others.iter().sum::<f64>() / others.len() as f64),
        lane_changes_1_km: [
            one.samples.lane_changes_1_km(),
            bounded.lane_changes_1_km(),
            free_changes / free.len() as f64,
        ],
    })
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [generations, parts, files @ ..] = arguments.as_slice() else {
        return Err("usage: cross_validate GENERATIONS[:SEED] PARTS FILE:LANES...".into());
    };
    let (generations, seed) = generations.split_once(':').unwrap_or((generations, "1"));
    let (generations, parts): (usize, usize) = (generations.parse()?, parts.parse()?);
    let seed: u64 = seed.parse()?;
    let all = files.iter().map(|f| Looked::at(f)).collect::<Result<Vec<_>, _>>()?;
    let (mut bounded_met, mut free_met, mut sums) = (0, 0, [0.0; 6]);
    for part in 0..parts {
        let is_out = |k: usize| k % parts == part;
        let learned = all.iter().enumerate().filter(|(k, _)| parts == 1 || !is_out(*k));
        let lessons: Vec<Lesson<'_>> = learned.map(|(_, l)| l.lesson()).collect();
        let effort = Effort { generations, seed, ..Effort::default() };
        let base = TrafficConfig { seed: 1000 * seed, ..TrafficConfig::default() };
        let found = calibrate(&lessons, &base, effort)?;
        println!("part {part}: {} trials, distance {:.3}", found.trials, found.distance);
        for (key, x, (low, high)) in found.population.iter().chain(&found.free) {
            println!("  {key} = {x:.3} (searched {low:.3} to {high:.3})");
        }
        for (_, one) in all.iter().enumerate().filter(|(k, _)| is_out(*k)) {
            let v = judge(one, &all, &found)?;
            let alone = v.alone.iter().sum::<f64>() / v.alone.len() as f64;
            let least = v.alone.iter().copied().fold(f64::INFINITY, f64::min);
            let most = v.alone.iter().copied().fold(0.0, f64::max);
            println!(
                "{}: bounded speed {:.3} gap {:.3}, kept {:.3}, free speed {:.3} gap {:.3}, \
                 alone {alone:.3} ({least:.3} to {most:.3}), among {:.3}, others {:.3}; lane changes per km {:.2} measured, {:.2} \
                 bounded, {:.2} free",
                one.name,
                v.bounded[0],
                v.bounded[1],
                v.kept,
                v.free[0],
                v.free[1],
                v.among,
                v.others.unwrap_or(f64::NAN),
                v.lane_changes_1_km[0],
                v.lane_changes_1_km[1],
                v.lane_changes_1_km[2],
            );
            bounded_met += usize::from(v.bounded[0] <= 0.15);
            free_met += usize::from(v.free[0] <= 0.15);
            let others = v.others.unwrap_or(0.0);
            for (sum, x) in
                sums.iter_mut().zip([v.bounded[0], v.kept, v.free[0], alone, v.among, others])
            {
                *sum += x / all.len() as f64;
            }
        }
    }
    println!(
        "within 0.15: bounded {bounded_met}, free {free_met} of {}; means: bounded {:.3}, kept \
         {:.3}, free {:.3}, alone {:.3}, among {:.3}, others {:.3}",
        all.len(),
        sums[0],
        sums[1],
        sums[2],
        sums[3],
        sums[4],
        sums[5],
    );
    Ok(())
}
