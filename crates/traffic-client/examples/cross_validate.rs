//! Calibrates drivers to all but one recording and judges them on that one, for each in turn.
//!
//! `cross_validate GENERATIONS LANES FILES...` prints a line per recording left out: the
//! Kolmogorov-Smirnov distances of speed, gap and acceleration with the measured start and arrivals
//! (`bounded`), that of the speeds if everyone kept the speed that they came with (`kept`), those of
//! speed and gap with flow, density and speeds at both ends of the others only (`free`; mean, and
//! range, of eight seeds), that of the training recordings
//! themselves (`others`), and lane changes per vehicle-km.
#![allow(clippy::disallowed_macros, reason = "a measurement program")]

use std::error::Error;
use std::path::Path;
use std::sync::Arc;

use traffic_client::calibrate::{Effort, Lesson, calibrate, drive, drive_bounded};
use traffic_client::native::{Boundary, TrafficConfig};
use traffic_client::replay::{Carriageway, Frame, load, road_of};
use traffic_client::stats::{Quantity, Samples, kolmogorov_smirnov, observe_recording};

/// Free traffic is driven with these seeds, none of which the search used, each for this long, s.
const FREE_SEEDS: std::ops::RangeInclusive<u64> = 1..=8;
const FREE_S: f64 = 300.0;

/// Mean, smallest and largest.
fn spread(values: &[f64]) -> (f64, f64, f64) {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    (mean, least, values.iter().copied().fold(f64::NEG_INFINITY, f64::max))
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [generations, lanes, files @ ..] = arguments.as_slice() else {
        return Err("usage: cross_validate GENERATIONS LANES FILES...".into());
    };
    let (generations, lanes) = (generations.parse()?, lanes.parse()?);
    let mut all = Vec::new();
    for file in files {
        let mut recording = load(Path::new(file), Carriageway::Forward, 0.1)?;
        recording.frame = Frame::Map;
        let road = Arc::new(road_of(&recording, lanes, 60.0)?);
        let mut samples = observe_recording(&road, &recording)?;
        samples.replace(Quantity::Speed, recording.speeds_m_s().collect());
        all.push((recording, road, samples));
    }
    for (k, (recording, road, measured)) in all.iter().enumerate() {
        let others: Vec<_> =
            all.iter().enumerate().filter(|&(j, _)| j != k).map(|(_, x)| x).collect();
        let lessons: Vec<Lesson<'_>> = others
            .iter()
            .map(|(recording, road, samples)| Lesson { recording, road, samples })
            .collect();
        let effort = Effort { generations, seed: 1, ..Effort::default() };
        let base = TrafficConfig { seed: 1000, ..TrafficConfig::default() };
        let found = calibrate(&lessons, &base, effort)?;
        // Seeds that the search did not use.
        let config = TrafficConfig { seed: 1, ..found.config };
        let boundary = Arc::new(Boundary::of(road, recording)?);
        let bounded = drive_bounded(road, &config, &boundary, 4)?;
        let free = FREE_SEEDS
            .map(|seed| drive(road, TrafficConfig { seed, ..config.clone() }, FREE_S))
            .collect::<Result<Vec<_>, _>>()?;
        let mut training = Samples::default();
        others.iter().for_each(|(_, _, samples)| training.append(samples));
        let kept: Vec<f64> = recording
            .tracks
            .iter()
            .flat_map(|t| t.samples.iter().map(|_| t.samples[0].speed_m_s))
            .collect();
        let ks = |samples: &Samples, quantity| {
            kolmogorov_smirnov(samples.of(quantity), measured.of(quantity)).unwrap_or(1.0)
        };
        let speed = Quantity::Speed;
        let of_free = |quantity| spread(&free.iter().map(|f| ks(f, quantity)).collect::<Vec<_>>());
        let (free_speed, least, most) = of_free(speed);
        let changes: Vec<f64> = free.iter().map(Samples::lane_changes_1_km).collect();
        println!(
            "{}: bounded speed {:.3} gap {:.3} accel {:.3}, kept {:.3}, free speed {free_speed:.3} \
             ({least:.3} to {most:.3}) gap {:.3}, others {:.3}; lane changes {:.2} measured, {:.2} \
             bounded, {:.2} free",
            recording.name,
            ks(&bounded, speed),
            ks(&bounded, Quantity::Gap),
            ks(&bounded, Quantity::Accel),
            kolmogorov_smirnov(&kept, measured.of(speed)).unwrap_or(1.0),
            of_free(Quantity::Gap).0,
            ks(&training, speed),
            measured.lane_changes_1_km(),
            bounded.lane_changes_1_km(),
            spread(&changes).0,
        );
    }
    Ok(())
}
