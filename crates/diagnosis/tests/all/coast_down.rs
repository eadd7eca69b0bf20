//! Coast-downs as drives in neutral lead to the road load and say how well it is known.

use std::fmt::Write as _;
use std::path::Path;

use crate::support::random::normal;
use diagnosis::identify::{Identification, identify};
use diagnosis::{Channel, DriveSet, Options, Plant, Serial, Verdict, diagnose, read_drives};
use dynamics::TruckParameters;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

const G: f64 = 9.806_65;

/// A truck that coasts: rolling resistance at rest and its growth, s/m, drag area, m².
struct Truth {
    rolling: f64,
    growth: f64,
    drag_area: f64,
    mass_kg: f64,
    density: f64,
    grade: f64,
    wind: f64,
}

impl Truth {
    fn draw(rng: &mut ChaCha8Rng) -> Self {
        Self {
            rolling: 0.0062 * (1.0 + 0.2 * normal(rng)),
            growth: (0.007 * normal(rng)).max(-0.01),
            drag_area: 6.2 * (1.0 + 0.15 * normal(rng)),
            mass_kg: 30_000.0 * (1.0 + 0.01 * normal(rng)),
            density: 1.19,
            grade: 0.0015 * normal(rng),
            wind: 1.5 * normal(rng),
        }
    }

    /// Speeds every `step_s` from 25 to 3 m/s in a direction, with gusts of `gust_m_s`.
    fn coast(&self, direction: f64, step_s: f64, gust_m_s: f64, rng: &mut ChaCha8Rng) -> Vec<f64> {
        let (mut v, mut gust, mut out, dt) = (25.0, 0.0, Vec::new(), 0.05);
        let (rest, every) = (5e-4 * normal(rng), (step_s / dt).round() as usize);
        let wheels_kg = 288.0 / (0.53 * 0.53);
        let mut i = 0;
        while v > 3.0 && i < 12_000 {
            if i % every == 0 {
                out.push(v);
            }
            gust += -gust * dt / 5.0 + gust_m_s * (2.0_f64 * dt / 5.0).sqrt() * normal(rng);
            let air = v + direction * self.wind + gust;
            let drag = 0.5 * self.density * self.drag_area * air * air.abs();
            let rolling = self.mass_kg * G * self.rolling * (1.0 + self.growth * v);
            let climb = self.mass_kg * G * (direction * self.grade + rest);
            v -= dt * (drag + rolling + climb) / (self.mass_kg + wheels_kg);
            i += 1;
        }
        out
    }
}

/// Writes coast-downs into a folder as a logger, or as readings of a plot, has them.
fn write(dir: &Path, runs: &[(f64, Vec<f64>)], step_s: f64, keys: &str) -> DriveSet {
    let mut index = "schema = 1\ntruck = \"reference\"\n".to_owned();
    for (k, (direction, speeds)) in runs.iter().enumerate() {
        let heading = if *direction > 0.0 { 1.2 } else { 1.2 - core::f64::consts::PI };
        let mut text =
            "time_s,speed_m_s,gear,heading_rad,ambient_temp_degc,baro_pressure_pa\n".to_owned();
        for (i, v) in speeds.iter().enumerate() {
            // 1.19 kg/m³
            writeln!(text, "{},{v},0,{heading},20,100137", i as f64 * step_s).unwrap();
        }
        std::fs::write(dir.join(format!("run_{k}.csv")), text).unwrap();
        writeln!(
            index,
            "\n[[drive]]\nname = \"run_{k}\"\nfile = \"run_{k}.csv\"\nreported_mass_kg = 30000.0\n{keys}"
        )
        .unwrap();
    }
    std::fs::write(dir.join("drives.toml"), index).unwrap();
    read_drives(dir).unwrap()
}

fn told(found: &Identification, path: &str) -> Option<[f64; 2]> {
    found.figures.iter().find(|f| f.path == path).map(|f| f.interval_90)
}

#[test]
fn intervals_of_the_road_load_hold_as_often_as_they_say() {
    let truck = TruckParameters::load("reference").unwrap();
    for (step_s, gust, noise, keys) in
        [(0.05, 0.5, 0.02, ""), (10.0, 0.0, 0.13, "speed_sigma_m_s = 0.13\n")]
    {
        let (mut inside, mut all) = (0, 0);
        for seed in 0..20 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let truth = Truth::draw(&mut rng);
            let runs: Vec<(f64, Vec<f64>)> = [1.0, -1.0, 1.0, -1.0]
                .map(|direction| {
                    let clean = truth.coast(direction, step_s, gust, &mut rng);
                    (direction, clean.into_iter().map(|v| v + noise * normal(&mut rng)).collect())
                })
                .into();
            let dir = tempfile::tempdir().unwrap();
            let found = identify(&truck, &write(dir.path(), &runs, step_s, keys), &Serial).unwrap();
            for (path, true_value) in [
                ("resistance.rolling_coeff", truth.rolling),
                ("resistance.drag_area_m2", truth.drag_area),
            ] {
                let [low, high] = told(&found, path).unwrap();
                // how rolling resistance grows with speed is not known
                assert!(high - low < true_value, "{path}: {low} to {high}");
                inside += usize::from((low..=high).contains(&true_value));
                all += 1;
            }
        }
        assert!((33..=40).contains(&inside), "{step_s} s: {inside} of {all}");
    }
}

#[test]
fn one_direction_does_not_tell_rolling_resistance_from_a_grade() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let truth = Truth::draw(&mut rng);
    let runs = [1.0, 1.0].map(|d| (d, truth.coast(d, 0.05, 0.3, &mut rng)));
    let dir = tempfile::tempdir().unwrap();
    let truck = TruckParameters::load("reference").unwrap();
    let found = identify(&truck, &write(dir.path(), &runs, 0.05, ""), &Serial).unwrap();
    assert_eq!(told(&found, "resistance.rolling_coeff"), None);
    let why = &found.not_told.iter().find(|n| n.path == "resistance.rolling_coeff").unwrap().why;
    assert!(why.contains("one direction"), "{why}");
    assert_eq!(found.truck.resistance.rolling_coeff, truck.resistance.rolling_coeff);
    let brakes = found.not_told.iter().find(|n| n.path == "brake.gain_scale_coeff").unwrap();
    assert_eq!(brakes.why, "no drive under power");
}

#[test]
fn what_is_known_of_readings_is_for_coast_downs_only() {
    let dir = tempfile::tempdir().unwrap();
    let speeds: Vec<f64> = (0..2_000).map(|i| 20.0 - 0.001 * f64::from(i)).collect();
    let runs = [(1.0, speeds)];
    drop(write(dir.path(), &runs, 0.05, "time_sigma_s = 0.5\n"));
    let table = std::fs::read_to_string(dir.path().join("run_0.csv")).unwrap();
    let shifted = table.replacen(",0,1.2,", ",1,1.2,", 1);
    std::fs::write(dir.path().join("run_0.csv"), shifted).unwrap();
    let said = read_drives(dir.path()).unwrap_err().to_string();
    assert!(said.contains("run_0: time_sigma_s") && said.contains("gear is not 0"), "{said}");
}

/// Nothing but the road load acts on a truck in neutral, whatever its engine does.
#[test]
fn logged_coast_downs_on_a_known_road_show_more_drag_to_the_diagnosis() {
    let truck = TruckParameters::load("reference").unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let coast = |drag_area: f64, rng: &mut ChaCha8Rng| {
        let truth = Truth {
            rolling: truck.resistance.rolling_coeff,
            growth: 0.0,
            drag_area,
            mass_kg: 30_000.0,
            density: 1.19,
            grade: 0.0,
            wind: 0.0,
        };
        let dir = tempfile::tempdir().unwrap();
        let runs = [1.0, -1.0, 1.0, -1.0, 1.0, -1.0].map(|d| (d, truth.coast(d, 0.05, 0.3, rng)));
        let mut set = write(dir.path(), &runs, 0.05, "tyres_warm_at_start = true");
        for d in &mut set.drives {
            let columns = [
                (Channel::GradeFrac, 0.0),
                (Channel::EngineSpeedRpm, 600.0),
                (Channel::EngineTorquePercent, 6.0),
            ];
            columns.into_iter().for_each(|(c, x)| d.set(c, vec![x; d.len]));
        }
        set
    };
    let clean = coast(truck.resistance.drag_area_m2, &mut rng);
    let more = coast(1.25 * truck.resistance.drag_area_m2, &mut rng);
    let plant = Plant::of_truck(&truck).unwrap();
    let options = Options::default();
    let judge = |set| diagnose(&plant, set, Some(&clean), &options, &Serial, &mut |_| {}).unwrap();
    assert_eq!(judge(&clean).verdict, Verdict::NothingToExplain);
    let found = judge(&more);
    let drag = found.causes.iter().find(|c| c.id == "air_drag");
    let size = drag.unwrap_or_else(|| panic!("{:?}", found.causes)).parameters["cd_a_scale"];
    assert!((size.value - 1.25).abs() < 3.0 * size.sigma, "{size:?}");
}
