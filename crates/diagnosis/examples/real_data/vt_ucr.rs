//! Class-8 trucks over 800 m climbs (VT, UC Riverside): fuel and CO2 disagree with load.
//!
//! Every `veh*.csv` or `veh*.csv.gz` with `speed_mph, fuel_gps, co2_gps, engine_rpm, elevation_m`
//! at 1 Hz is a vehicle; without `segment` a stretch ends where altitude or speed jump.

use std::path::Path;

use diagnosis::RawTable;
use diagnosis::balance::Body;
use diagnosis::carbon::{CO2_PER_FUEL_SIGMA, Climb, Consumption, Doubt, FuelRecord, LoadBin};
use diagnosis::clock::{Kind, Rates, Signal, track};
use dynamics::TruckParameters;
use dynamics::effects::fuel::CO2_PER_FUEL;

use crate::plot::{Panel, Series, write};
use crate::table::{column, files, read, stem};

const MPH: f64 = 0.447_04;
const EDGES: [f64; 7] = [0.01, 0.08, 0.2, 0.4, 0.6, 0.8, 1.2];
/// Mean of the air over the route: 20 degC at 300 m.
const DENSITY_KG_M3: f64 = 1.16;
/// Fan, compressor, alternator, pumps of a class-8 tractor.
const OWN_POWER_W: f64 = 5000.0;
/// What the paper leaves open of the truck.
const DOUBT: Doubt = Doubt {
    // 27.4 to 28.5 t.
    mass_frac: 0.02,
    drag_frac: 0.15,
    rolling_frac: 0.2,
    headwind_m_s: 3.0,
    altitude_m: 2.0,
    driveline_frac: 0.02,
};
/// Lowest consumption of a truck diesel, g/kWh: best point of the generic engine of VECTO.
const BEST_G_KWH: f64 = 182.5;
/// Consumption near full load of truck diesels of the nineties and after, g/kWh, and its spread:
/// maps of ADVISOR (DDC S60, Cummins M11 class), 189 to 215.
const TYPICAL_G_KWH: (f64, f64) = (200.0, 8.0);

/// Ratios by load and consumption on climbs of every vehicle.
pub(crate) fn study(
    dir: &Path,
    out: Option<&Path>,
    truck: &TruckParameters,
) -> crate::Outcome<Vec<(Vec<LoadBin>, Option<Consumption>)>> {
    let body = Body::of(truck, DENSITY_KG_M3);
    files(dir, &[".csv", ".csv.gz"])?.iter().map(|file| vehicle(file, out, truck, &body)).collect()
}

fn vehicle(
    file: &Path,
    out: Option<&Path>,
    truck: &TruckParameters,
    body: &Body,
) -> crate::Outcome<(Vec<LoadBin>, Option<Consumption>)> {
    let name = stem(file);
    let mut record = record(&read(file)?, file)?;
    println!(
        "{name}: {:.1} h, full load {:.1} g/s, mass {:.0} kg",
        record.speed_m_s.len() as f64 / 3600.0,
        record.full_load_g_s(),
        body.mass_kg
    );
    let signal = |samples| Signal { samples, kind: Kind::Value };
    let rates = Rates::new(signal(&record.co2_g_s), signal(&record.fuel_g_s), record.step_s);
    if let Some(clock) = track(&rates) {
        let s = clock.stretches[0];
        println!("  CO2 behind fuel by {:.2} +- {:.2} s", s.lag_s, s.lag_sigma_s);
        record.co2_g_s = clock.aligned(&record.co2_g_s, record.step_s);
    } else {
        println!("  CO2 is too smooth against fuel for a lag by the second; windows bridge it");
    }
    let bins = record.ratio_by_load(&EDGES);
    println!(
        "  CO2 over fuel by load; chemistry says {:.3} +- {:.3}",
        CO2_PER_FUEL, CO2_PER_FUEL_SIGMA
    );
    for b in &bins {
        println!(
            "    {:4.0} to {:3.0} % of full load, {:4} windows: {:.3} +- {:.3}",
            100.0 * b.load_frac.0,
            100.0 * b.load_frac.1,
            b.windows,
            b.ratio,
            b.sigma
        );
    }
    let climbs = record.climbs(body);
    for c in &climbs {
        println!(
            "    climb at {:5} s: {:4.0} s, {:4.0} m, wheels {:6.1} MJ, fuel {:5.0} g, by carbon {:5.0} g",
            c.from,
            c.duration_s,
            c.climb_m,
            c.wheel_energy_j / 1e6,
            c.fuel_g,
            c.carbon_fuel_g
        );
    }
    let efficiency = truck.driveline.efficiency_frac();
    let consumption = record.consumption(&climbs, body, &DOUBT, efficiency, OWN_POWER_W);
    match &consumption {
        Some(c) => verdict(&bins, c, body),
        None => println!("  too few climbs: which instrument is wrong stays open"),
    }
    if let Some(out) = out {
        picture(&name, &bins, &climbs, efficiency, out)?;
    }
    Ok((bins, consumption))
}

/// Names what is inconsistent, and what the climbs decide about it.
fn verdict(bins: &[LoadBin], c: &Consumption, body: &Body) {
    let (Some(first), Some(last)) = (bins.first(), bins.last()) else { return };
    let sigma = first.sigma.hypot(last.sigma);
    let z = (first.ratio - last.ratio) / sigma;
    let fall = 1.0 - last.ratio / first.ratio;
    println!(
        "  co2_gps and fuel_gps {}: the ratio changes by {:.1} % from the lowest to the highest load ({z:.1} sigma)",
        if z.abs() > 4.0 { "disagree with load" } else { "agree" },
        -100.0 * fall
    );
    let spread = c.shared_sigma_frac.hypot(c.scatter_sigma_frac);
    println!(
        "  consumption on climbs: {:.0} g/kWh by fuel_gps, {:.0} by co2_gps; both +- {:.1} % ({:.1} shared, {:.1} scatter)",
        c.fuel_g_kwh,
        c.carbon_g_kwh,
        100.0 * spread,
        100.0 * c.shared_sigma_frac,
        100.0 * c.scatter_sigma_frac
    );
    for (name, value) in [("fuel_gps", c.fuel_g_kwh), ("co2_gps", c.carbon_g_kwh)] {
        let below = (BEST_G_KWH / value).ln() / spread;
        let error = value / TYPICAL_G_KWH.0 - 1.0;
        let sigma = spread.hypot(TYPICAL_G_KWH.1 / TYPICAL_G_KWH.0);
        // The mass that would make this instrument right with a typical engine.
        let mass = body.mass_kg * (1.0 + error);
        println!(
            "    {name}: {:+.1} +- {:.1} % against a typical engine; {}right if the truck weighed about {:.1} t",
            100.0 * error,
            100.0 * sigma,
            if below > 2.0 { "below the best engine, so low; " } else { "" },
            mass / 1000.0
        );
    }
}

fn record(table: &RawTable, file: &Path) -> Result<FuelRecord, Box<dyn std::error::Error>> {
    let take = |name: &str| column(table, file, name).map(<[f64]>::to_vec);
    // Names of this project's copy, or of the published files.
    let either = |ours: &str, theirs: &str| take(ours).or_else(|_| take(theirs));
    let speed_m_s: Vec<f64> =
        either("speed_mph", "vel (mph)")?.into_iter().map(|v| v * MPH).collect();
    let altitude_m = either("elevation_m", "elevation (m)")?;
    let segment = take("segment").unwrap_or_else(|_| {
        let mut number = 0.0;
        (0..speed_m_s.len())
            .map(|i| {
                let jumps = i > 0
                    && ((altitude_m[i] - altitude_m[i - 1]).abs() > 3.0
                        || (speed_m_s[i] - speed_m_s[i - 1]).abs() > 5.4);
                number += f64::from(u8::from(jumps));
                number
            })
            .collect()
    });
    Ok(FuelRecord {
        step_s: 1.0,
        speed_m_s,
        altitude_m,
        segment,
        engine_rpm: either("engine_rpm", "engine (rpm)")?,
        fuel_g_s: either("fuel_gps", "fuel (g/s)")?,
        co2_g_s: either("co2_gps", "CO2 (g/s)")?,
    })
}

fn picture(
    name: &str,
    bins: &[LoadBin],
    climbs: &[Climb],
    efficiency: f64,
    out: &Path,
) -> crate::Outcome {
    let line = |f: fn(&LoadBin) -> f64| bins.iter().map(|b| (b.fuel_g_s, f(b))).collect();
    let points = |f: fn(&Climb) -> f64| {
        climbs
            .iter()
            .map(|c| {
                let kwh = (c.wheel_energy_j / efficiency + OWN_POWER_W * c.duration_s) / 3.6e6;
                (3600.0 * kwh / c.duration_s, f(c) / kwh)
            })
            .collect()
    };
    write(
        &out.join(format!("fuel-{name}.svg")),
        &[
            Panel {
                title: "CO2 over fuel",
                x: "fuel rate, g/s",
                y: "g/g",
                series: vec![
                    Series { name: "measured", points: line(|b| b.ratio), line: true },
                    Series { name: "chemistry", points: line(|_| CO2_PER_FUEL), line: true },
                    Series {
                        name: "+ 2 sigma",
                        points: line(|b| b.ratio + 2.0 * b.sigma),
                        line: false,
                    },
                    Series {
                        name: "- 2 sigma",
                        points: line(|b| b.ratio - 2.0 * b.sigma),
                        line: false,
                    },
                ],
            },
            Panel {
                title: "specific consumption of every climb",
                x: "mean power at the crank, kW",
                y: "g/kWh",
                series: vec![
                    Series { name: "by fuel_gps", points: points(|c| c.fuel_g), line: false },
                    Series { name: "by co2_gps", points: points(|c| c.carbon_fuel_g), line: false },
                ],
            },
        ],
    )?;
    Ok(())
}
