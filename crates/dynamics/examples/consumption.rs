//! What a truck file burns on VECTO's declaration cycles, driven in the plant:
//! `cargo run --release -p dynamics --example consumption -- FOLDER [--truck longhaul
//! --payload-kg 21000]`. FOLDER holds `fuel_map.csv` and `cycles/*.csv` of the generic 40 t truck of
//! the VECTO release. Without `--truck` the truck is `vecto-40t` with VECTO's own fuel map, beside
//! what VECTO declares.
#![expect(clippy::disallowed_macros, reason = "an example prints")]

#[path = "../tests/support/cycle.rs"]
mod cycle;
#[path = "../tests/support/declared.rs"]
mod declared;

use std::path::PathBuf;

use dynamics::TruckParameters;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (mut folder, mut truck, mut payload_kg) = (None, None, 0.0);
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--truck" => truck = Some(args.next().ok_or("--truck needs a name")?),
            "--payload-kg" => payload_kg = args.next().ok_or("--payload-kg needs kg")?.parse()?,
            _ => folder = Some(PathBuf::from(arg)),
        }
    }
    let folder = folder.ok_or("give the folder of the VECTO release")?;
    let read = |name: &str| cycle::Cycle::read(&folder.join("cycles").join(name));
    if let Some(name) = truck {
        let truck = TruckParameters::load(&name)?;
        for file in ["LongHaul.csv", "RegionalDelivery.csv"] {
            let t = cycle::drive(truck.clone(), payload_kg, &read(file)?)?;
            let litres = t.g_km() / truck.engine.fuel.density_kg_m3 * 100.0;
            println!(
                "{name} {file}: {litres:.1} l/100 km, {:.1} g/kWh, {:.1} km/h",
                t.fuel_g / t.engine_kwh,
                t.distance_m / t.time_s * 3.6
            );
        }
        return Ok(());
    }
    println!("cycle, payload kg: g/km driven, declared, difference; energies kWh driven/declared");
    for d in declared::DECLARED {
        let t = declared::drive(&folder, &d)?;
        println!(
            "{} {:.0}: {:.1} {:.1} {:+.2} %; engine {:.1}/{:.1} overrun {:.1}/{:.1} brake {:.1}/{:.1}; \
             {:.1}/{:.1} km/h",
            d.cycle,
            d.payload_kg,
            t.g_km(),
            d.g_km,
            100.0 * (t.g_km() / d.g_km - 1.0),
            t.engine_kwh,
            d.engine_kwh,
            t.overrun_kwh,
            d.overrun_kwh,
            t.brake_kwh,
            d.brake_kwh,
            t.distance_m / t.time_s * 3.6,
            d.speed_kmh
        );
    }
    Ok(())
}
