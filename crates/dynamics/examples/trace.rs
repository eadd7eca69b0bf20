//! How well a truck file meets traces of the paper's released model:
//! `cargo run --release -p dynamics --example trace -- TRACE.csv... [--truck iits] [--mass-kg M]`.
#![expect(clippy::disallowed_macros, reason = "an example prints")]

#[path = "../tests/support/trace.rs"]
mod trace;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (mut files, mut truck, mut mass_kg) = (Vec::new(), String::from("iits"), None);
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--truck" => truck = args.next().ok_or("--truck needs a name")?,
            "--mass-kg" => mass_kg = Some(args.next().ok_or("--mass-kg needs a number")?.parse()?),
            _ => files.push(std::path::PathBuf::from(arg)),
        }
    }
    for file in &files {
        let mass_kg = mass_kg.or_else(|| trace::mass_in_name_kg(file));
        let mass_kg = mass_kg.ok_or("no mass in the file's name: give --mass-kg")?;
        let a = trace::replay(&truck, file, mass_kg)?;
        println!(
            "{}: speed {:.2} %, gear {:.1} %, end {:.2} m/s (trace {:.2} m/s)",
            file.display(),
            100.0 * a.speed_accuracy_frac,
            100.0 * a.gear_frac,
            a.final_speed_m_s.0,
            a.final_speed_m_s.1
        );
    }
    Ok(())
}
