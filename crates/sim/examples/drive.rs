//! Drives a scenario as fast as it goes: `cargo run --release -p sim --example drive -- NAME SEED`.
#![expect(clippy::disallowed_macros, reason = "an example prints")]

use sim::{Scenario, World};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let name = args.next().unwrap_or_else(|| "highway".into());
    let seed = args.next().map_or(Ok(1), |s| s.parse())?;
    let mut world = World::new(&Scenario::builtin(&name)?, seed)?;
    let summary = world.run(&mut ())?;
    println!("{:?}\n{summary:#?}", world.status());
    Ok(())
}
