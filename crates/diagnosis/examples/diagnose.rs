//! Diagnoses a folder of drives: `diagnose DRIVES_DIR [BASELINE_DIR]`.
#![expect(clippy::disallowed_macros, reason = "an example prints")]

use std::path::Path;

use diagnosis::{Executor, Options, Plant, diagnose, read_drives};
use dynamics::TruckParameters;

struct Threads(usize);

impl Executor for Threads {
    fn run(&self, count: usize, job: &(dyn Fn(usize) + Sync)) {
        let next = std::sync::atomic::AtomicUsize::new(0);
        std::thread::scope(|s| {
            for _ in 0..self.0 {
                s.spawn(|| {
                    loop {
                        let i = next.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                        if i >= count {
                            break;
                        }
                        job(i);
                    }
                });
            }
        });
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let drives = arguments.first().ok_or("usage: diagnose DRIVES_DIR [BASELINE_DIR]")?;
    let plant = Plant::of_truck(&TruckParameters::load("reference")?)?;
    let drives = read_drives(Path::new(drives))?;
    let baseline = arguments.get(1).map(|b| read_drives(Path::new(b))).transpose()?;
    let d =
        diagnose(&plant, &drives, baseline.as_ref(), &Options::default(), &Threads(2), &mut |p| {
            eprintln!("{p:?}")
        })?;
    println!("{}", serde_json::to_string_pretty(&d)?);
    Ok(())
}
