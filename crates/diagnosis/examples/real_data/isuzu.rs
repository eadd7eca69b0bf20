//! Box truck with known coast-down results (NREL): mass, drag area and rolling resistance.
//!
//! `coastdown*.csv` holds the coast-downs (`direction`, `t_s`, `speed_mph`, both directions on one
//! road), the 5 Hz log the driving (`time[s]`, torque, speeds, altitude, pedal). What a reference
//! knows is printed beside, if `vehicle_params_fastsim.csv` lies there; it is not used.

use std::path::Path;

use diagnosis::RawTable;
use diagnosis::balance::{Body, EnergyWindow};
use diagnosis::coast_down::{CoastDown, Driven, Priors, fit, place};
use diagnosis::fit::Estimate;
use dynamics::TruckParameters;
use dynamics::effects::resistance::air_density_kg_m3;
use tractrix_core::{RPM_PER_RAD_S, ZERO_DEGC_K};

use crate::plot::{Panel, Series, write};
use crate::table::{column, files, read};

const MPH: f64 = 0.447_04;
/// Length of a window of driving, s: the altimeter's error counts once a window.
const WINDOW_S: f64 = 10.0;
/// A uniform error of half width 1 has this standard deviation.
const UNIFORM: f64 = 0.577;

/// What is known beforehand, and from where.
const PRIORS: Priors = Priors {
    // A test road; the published analysis assumes 0.4 %.
    grade: (0.0, 0.01),
    // Coast-downs are run in little wind: SAE J1263 allows 16 km/h.
    wind_m_s: (0.0, 2.0),
    // 5 m in 10 km beyond the common grade.
    run_grade: (0.0, 5e-4),
    // Between none (NREL) and 0.026 s/m (Rakha 2001, radial tyres): the middle of that range.
    rolling_growth_s_m: (0.013, 0.0075),
    // Place and day of the coast-downs are not published: sea level to Denver, around the middle.
    density_ratio: (1.1, 0.06),
    // Driveline 0.94 +- 0.02 (FASTSim), torque of the engine's control unit +- 5 %.
    efficiency: (0.94, 0.05),
    // Fan, alternator, pumps, steering.
    own_power_w: (2000.0, 1500.0),
    // GPS height over ten seconds; torque in steps of one per cent.
    altitude_sigma_m: 1.0,
    work_sigma_j: 10e3,
};

/// Scale of the torque signal if nothing is known of it.
const UNTRUSTED: (f64, f64) = (0.94, 0.3);

/// The fit and what the reference says of mass, drag area and rolling resistance.
pub(crate) fn study(
    dir: &Path,
    out: Option<&Path>,
    truck: &TruckParameters,
) -> crate::Outcome<(Estimate, Option<[f64; 3]>)> {
    let runs = coast_downs(dir)?;
    let (driven, density) = driving(dir, truck)?;
    let base = Body::of(truck, density);
    println!(
        "{} coast-downs, {} windows of {WINDOW_S} s under power, air {density:.3} kg/m3",
        runs.len(),
        driven.len()
    );
    let e = fit(&base, &runs, &driven, &PRIORS).ok_or("the data say nothing")?;
    let reference = reference(dir);
    let show = |name: &str, k: usize, factor: f64, truth: Option<f64>| {
        let (v, s) = (e.value[k] * factor, e.sigma(k) * factor);
        print!(
            "  {name}: {v:.4} +- {s:.4}, 95 % interval {:.4} to {:.4}",
            v - 1.96 * s,
            v + 1.96 * s
        );
        match truth {
            Some(t) => println!("; reference {t:.4}, {:+.1} sigma", (v - t) / s),
            None => println!(),
        }
    };
    show("mass when driven, kg", place::MASS, 1.0, reference.map(|r| r[0]));
    show("drag area, m2", place::DRAG_AREA, 1.0, reference.map(|r| r[1]));
    show("rolling resistance coefficient at rest", place::ROLLING, 1.0, reference.map(|r| r[2]));
    show("growth of rolling resistance, s/m", place::GROWTH, 1.0, None);
    show("grade of the road, %", place::GRADE, 100.0, None);
    show("wind against north, m/s", place::WIND, 1.0, None);
    show("density ratio", place::DENSITY, 1.0, None);
    show("efficiency times torque scale", place::EFFICIENCY, 1.0, None);
    show("own power, W", place::OWN_POWER, 1.0, None);
    for (name, k) in
        [("efficiency", place::EFFICIENCY), ("density", place::DENSITY), ("growth", place::GROWTH)]
    {
        println!(
            "  correlation with {name}: mass {:+.2}, drag area {:+.2}, rolling {:+.2}",
            e.correlation(place::MASS, k),
            e.correlation(place::DRAG_AREA, k),
            e.correlation(place::ROLLING, k)
        );
    }
    let apart = (e.value[place::MASS] - e.value[place::COAST_MASS])
        / e.sigma(place::MASS).hypot(e.sigma(place::COAST_MASS));
    println!("  mass when driven against mass when coasting: {apart:+.1} sigma");
    let untrusted = Priors { efficiency: UNTRUSTED, ..PRIORS };
    if let Some(u) = fit(&base, &runs, &driven, &untrusted) {
        println!(
            "  with a torque signal of unknown scale: mass when driven {:.0} +- {:.0} kg, efficiency times scale {:.2} +- {:.2}",
            u.value[place::MASS],
            u.sigma(place::MASS),
            u.value[place::EFFICIENCY],
            u.sigma(place::EFFICIENCY)
        );
    }
    let coast: usize = runs.iter().map(|r| r.time_s.len()).sum();
    let chi: f64 = e.residuals[..coast].iter().map(|r| r * r).sum();
    println!("  coast-downs: chi squared {chi:.1} of {coast} points");
    if let Some(out) = out {
        picture(&base, &runs, &driven, &e.value, &e.residuals[coast..], out)?;
    }
    Ok((e, reference))
}

fn coast_downs(dir: &Path) -> Result<Vec<CoastDown>, Box<dyn std::error::Error>> {
    let mut runs = Vec::new();
    for file in files(dir, &["coastdown_digitised.csv", "coastdown.csv"])? {
        let table = read(&file)?;
        let (t, v) = (column(&table, &file, "t_s")?, column(&table, &file, "speed_mph")?);
        // Every run begins at time zero; directions alternate by name, which is no number.
        let text = std::fs::read_to_string(&file)?;
        let names: Vec<&str> = text.lines().skip(1).filter_map(|l| l.split(',').next()).collect();
        let mut last = "";
        for (i, name) in names.iter().enumerate().take(t.len()) {
            if *name != last || (i > 0 && t[i] < t[i - 1]) {
                runs.push(CoastDown {
                    direction: if name.eq_ignore_ascii_case("north") { 1.0 } else { -1.0 },
                    // Read off a plot to +-1 s and +-0.5 mph.
                    time_sigma_s: UNIFORM,
                    speed_sigma_m_s: 0.5 * MPH * UNIFORM,
                    ..CoastDown::default()
                });
                last = name;
            }
            if let Some(run) = runs.last_mut() {
                run.time_s.push(t[i]);
                run.speed_m_s.push(v[i] * MPH);
            }
        }
    }
    Ok(runs)
}

fn driving(
    dir: &Path,
    truck: &TruckParameters,
) -> Result<(Vec<Driven>, f64), Box<dyn std::error::Error>> {
    let (mut driven, mut density) = (Vec::new(), 1.2);
    for file in files(dir, &["onroad_5hz.csv"])? {
        let table: RawTable = read(&file)?;
        let take = |name: &str| column(&table, &file, name);
        let (t, v) = (take("time[s]")?, take("gps_Speed[km/h]")?);
        let (torque, rpm) = (take("EngPercentTorque_ACT[%]")?, take("EngSpeed[RPM]")?);
        let (altitude, pedal) =
            (take("gps_Altitude[m]")?, take("Accelerator_Pedal_Position_D[%]")?);
        let kelvin = take("Ambient_Air_Temperature[ºC]")?[0] + ZERO_DEGC_K;
        density = air_density_kg_m3(1000.0 * take("Barometric_Pressure[kPa]")?[0], kelvin);
        let step_s = (t[t.len() - 1] - t[0]) / (t.len() - 1) as f64;
        let n = (WINDOW_S / step_s).round() as usize;
        let idle = pedal.iter().copied().fold(f64::INFINITY, f64::min);
        let mut from = 0;
        while from + n < t.len() {
            let range = from..=from + n;
            // The foot is on the accelerator, so not on the brake; the converter is near its lock.
            let powered = range.clone().all(|i| pedal[i] > idle + 1.0 && v[i] > 3.6 * 4.0);
            if !powered {
                from += n / 10;
                continue;
            }
            let power = |i: usize| {
                0.01 * torque[i] * truck.engine.reference_torque_nm * rpm[i] / RPM_PER_RAD_S
            };
            let engine_work_j =
                (from..from + n).map(|i| 0.5 * (power(i) + power(i + 1)) * step_s).sum();
            driven.push(Driven {
                window: EnergyWindow {
                    start_s: t[from],
                    step_s,
                    speed_m_s: v[range].iter().map(|v| v / 3.6).collect(),
                    climb_m: altitude[from + n] - altitude[from],
                    engine_rpm: (rpm[from], rpm[from + n]),
                },
                engine_work_j,
            });
            from += n;
        }
    }
    Ok((driven, density))
}

/// Mass, drag area and rolling resistance of the FASTSim vehicle file, if there is one.
fn reference(dir: &Path) -> Option<[f64; 3]> {
    let text = std::fs::read_to_string(dir.join("vehicle_params_fastsim.csv")).ok()?;
    let value = |key: &str| {
        text.lines().find_map(|l| {
            let mut f = l.split(',').skip(1);
            (f.next() == Some(key)).then(|| f.next()?.parse::<f64>().ok()).flatten()
        })
    };
    Some([
        value("veh_override_kg")?,
        value("drag_coef")? * value("frontal_area_m2")?,
        value("wheel_rr_coef")?,
    ])
}

fn picture(
    base: &Body,
    runs: &[CoastDown],
    driven: &[Driven],
    p: &[f64],
    windows: &[f64],
    out: &Path,
) -> crate::Outcome {
    let measured = |k: usize| Series {
        name: if k == 0 { "north" } else { "south" },
        points: runs[k].time_s.iter().copied().zip(runs[k].speed_m_s.iter().copied()).collect(),
        line: false,
    };
    let model = |k: usize| Series {
        name: "fitted",
        points: (0..=75)
            .map(|i| f64::from(i) * runs[k].time_s.last().unwrap_or(&0.0) / 75.0)
            .zip(diagnosis::coast_down::speeds(base, runs, k, p, 76))
            .collect(),
        line: true,
    };
    let mut series: Vec<Series<'_>> = (0..runs.len().min(2)).map(measured).collect();
    series.extend((0..runs.len().min(2)).map(model));
    write(
        &out.join("coast-down.svg"),
        &[
            Panel { title: "coast-downs in both directions", x: "time, s", y: "m/s", series },
            Panel {
                title: "driving under power: energy of the wheels minus that of the engine",
                x: "time, s",
                y: "standard deviations",
                series: vec![Series {
                    name: "",
                    points: driven
                        .iter()
                        .map(|d| d.window.start_s)
                        .zip(windows.iter().copied())
                        .collect(),
                    line: false,
                }],
            },
        ],
    )?;
    Ok(())
}
