//! Calibrates drivers to all but one recording and judges them on that one, for each in turn.
//!
//! `cross_validate GENERATIONS LANES FILES...` prints a line per recording left out: the
//! Kolmogorov-Smirnov distances of speed, gap and acceleration with the measured start and arrivals
//! (`bounded`), that of the speeds if everyone kept the speed that they came with (`kept`), those of
//! speed and gap with measured flow and density only (`free`), that of the training recordings
//! themselves (`others`), and lane changes per vehicle-km.
#![allow(clippy::disallowed_macros, reason = "a measurement program")]

use std::error::Error;
use std::path::Path;
use std::sync::Arc;

use traffic_client::calibrate::{Effort, Lesson, calibrate, drive, drive_bounded};
use traffic_client::native::{Boundary, TrafficConfig};
use traffic_client::replay::{Carriageway, Frame, load, road_of};
use traffic_client::stats::{Quantity, Samples, kolmogorov_smirnov, observe_recording};

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
        let free = drive(road, config, 600.0)?;
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
        println!(
            "{}: bounded speed {:.3} gap {:.3} accel {:.3}, kept {:.3}, free speed {:.3} gap {:.3}, \
             others {:.3}; lane changes {:.2} measured, {:.2} bounded, {:.2} free",
            recording.name,
            ks(&bounded, speed),
            ks(&bounded, Quantity::Gap),
            ks(&bounded, Quantity::Accel),
            kolmogorov_smirnov(&kept, measured.of(speed)).unwrap_or(1.0),
            ks(&free, speed),
            ks(&free, Quantity::Gap),
            ks(&training, speed),
            measured.lane_changes_1_km(),
            bounded.lane_changes_1_km(),
            free.lane_changes_1_km(),
        );
    }
    Ok(())
}
