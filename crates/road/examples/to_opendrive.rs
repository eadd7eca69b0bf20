//! Writes a road as OpenDRIVE: `cargo run --release -p road --example to_opendrive -- builtin:highway`.
#![expect(clippy::disallowed_macros, reason = "a program prints")]

use road::Road;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let name =
        std::env::args().nth(1).ok_or("which road? builtin:highway, a .csv or a .xodr file")?;
    print!("{}", Road::load(&name)?.write_opendrive());
    Ok(())
}
