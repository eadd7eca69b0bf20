//! Calibrates one population to a part of the recordings and judges it on the others, then the
//! other way round: every recording is judged by drivers who were found without it.
//!
//! `cross_validate GENERATIONS[:SEED] PARTS FILE:LANES...` deals the files out to so many parts in
//! turn (1: learn from all, and judge on the same), searches with that seed (1) and prints a line per
//! recording, and the means of all. Kolmogorov-Smirnov distances of speed, where nothing else is said:
//! * `bounded`, `bounded gap`: with the measured start and arrivals;
//! * `kept`: if everyone kept the speed that they came with;
//! * `free`, `free gap`: with flow, density and speeds at both ends only, the eight seeds that flow as
//!   counted together, as bounded traffic is four; `alone` the mean of these, `among` their mean
//!   distance from each other; `any` the first eight seeds together;
//! * `others`: from the other recordings of its name up to the first digit, mean of these; `scaled`:
//!   from all of these together, times the factor that gives them its mean speed.
#![allow(clippy::disallowed_macros, reason = "a measurement program")]

use std::error::Error;
use std::path::Path;
use std::sync::Arc;

use road::Road;
use traffic_client::calibrate::{
    Calibration, Effort, Lesson, RejectionSampling, calibrate, drive_bounded, drives_as_counted,
};
use traffic_client::native::{Boundary, TrafficConfig};
use traffic_client::replay::{Carriageway, Frame, Recording, load, road_of};
use traffic_client::stats::{Quantity, Samples, kolmogorov_smirnov, moments, observe_recording};

/// Free traffic is driven for this long, s, with seeds that the search did not use.
const FREE_S: f64 = 30.0;
/// What counts as near.
const BOUND: f64 = 0.15;
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

/// Its distances by name, and lane changes per km: measured, of bounded and of free traffic.
struct Verdict {
    distances: [(&'static str, f64); 10],
    lane_changes_1_km: [f64; 3],
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    moments(&values.collect::<Vec<_>>()).map_or(f64::NAN, |m| m.mean)
}

fn judge(one: &Looked, all: &[Looked], found: &Calibration) -> Result<Verdict, Box<dyn Error>> {
    // Seeds that the search did not use.
    let config = TrafficConfig { seed: 1, ..found.config.clone() };
    let boundary = Arc::new(Boundary::of(&one.road, &one.recording)?);
    let bounded = drive_bounded(&one.road, &config, &boundary, BOUNDED_DRIVES)?;
    let free_config = TrafficConfig { seed: 0, ..found.free_traffic(&one.lesson())? };
    let driven = |candidates, accepted| {
        let sampling = RejectionSampling { candidates, accepted };
        let drives = drives_as_counted(&one.lesson(), &free_config, FREE_S, sampling)?;
        Ok::<Vec<Samples>, Box<dyn Error>>(drives.into_iter().map(|(_, samples)| samples).collect())
    };
    let RejectionSampling { candidates, accepted } = RejectionSampling::default();
    let free = driven(candidates, accepted)?;
    let any = Samples::pooled(&driven(accepted as u64, accepted)?);
    let speed = |s: &Samples| one.distance(s, Quantity::Speed);
    let measured = one.samples.of(Quantity::Speed);
    let to_measured = |speeds: &[f64]| kolmogorov_smirnov(speeds, measured).unwrap_or(1.0);
    let tracks = one.recording.tracks.iter();
    let kept: Vec<f64> =
        tracks.flat_map(|t| t.samples.iter().map(|_| t.samples[0].speed_m_s)).collect();
    let of_its_kind = || all.iter().filter(|o| o.kind() == one.kind() && o.name != one.name);
    let pooled = || of_its_kind().flat_map(|o| o.samples.of(Quantity::Speed)).copied();
    let factor = mean(measured.iter().copied()) / mean(pooled());
    let scaled: Vec<f64> = pooled().map(|v| v * factor).collect();
    let pairs = free.iter().enumerate().flat_map(|(k, a)| free[..k].iter().map(move |b| (a, b)));
    let apart = |(a, b): (&Samples, &Samples)| {
        kolmogorov_smirnov(a.of(Quantity::Speed), b.of(Quantity::Speed)).unwrap_or(1.0)
    };
    let among = mean(pairs.map(apart));
    let alone = mean(free.iter().map(speed));
    let lane_changes = mean(free.iter().map(Samples::lane_changes_1_km));
    let free = Samples::pooled(&free);
    Ok(Verdict {
        distances: [
            ("bounded", speed(&bounded)),
            ("bounded gap", one.distance(&bounded, Quantity::Gap)),
            ("kept", to_measured(&kept)),
            ("free", speed(&free)),
            ("free gap", one.distance(&free, Quantity::Gap)),
            ("any", speed(&any)),
            ("alone", alone),
            ("among", among),
            ("others", mean(of_its_kind().map(|o| speed(&o.samples)))),
            ("scaled", to_measured(&scaled)),
        ],
        lane_changes_1_km: [
            one.samples.lane_changes_1_km(),
            bounded.lane_changes_1_km(),
            lane_changes,
        ],
    })
}

fn line(distances: &[(&str, f64)]) -> String {
    distances.iter().map(|(name, x)| format!("{name} {x:.3}")).collect::<Vec<_>>().join(", ")
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
    let mut judged: Vec<Verdict> = Vec::new();
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
            let verdict = judge(one, &all, &found)?;
            let [measured, bounded, free] = verdict.lane_changes_1_km;
            println!(
                "{}: {}; lane changes per km {measured:.2} measured, {bounded:.2} bounded, {free:.2} \
                 free",
                one.name,
                line(&verdict.distances)
            );
            judged.push(verdict);
        }
    }
    let Some(first) = judged.first() else { return Err("no recording".into()) };
    let (mut means, mut met) = (first.distances, first.distances);
    for (k, (mean_of, met)) in means.iter_mut().zip(&mut met).enumerate() {
        mean_of.1 = mean(judged.iter().map(|v| v.distances[k].1).filter(|x| x.is_finite()));
        met.1 = judged.iter().filter(|v| v.distances[k].1 <= BOUND).count() as f64;
    }
    println!("means: {}", line(&means));
    let within = met.map(|(name, n)| format!("{name} {n}")).join(", ");
    println!("within {BOUND} of {}: {within}", judged.len());
    Ok(())
}
