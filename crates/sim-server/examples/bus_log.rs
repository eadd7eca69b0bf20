//! Drives a scenario over a bus in memory and writes what is said there as `candump -L` does,
//! compressed: `bus_log SCENARIO TRUCK PAYLOAD_KG DURATION_S OUT.log.gz [EVERY_S]`. With `EVERY_S`
//! of every identifier only a frame that comes so long after the one before, as small loggers do.
#![allow(
    dead_code,
    clippy::unwrap_used,
    clippy::indexing_slicing,
    reason = "a program for developers, and a part of a test"
)]

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use j1939::BitRate;
use j1939::bus::Bus;
use j1939::bus::candump::{Form, write};
use j1939::bus::loopback::Loopback;
use sim::{Overrides, Scenario, Status, World};

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let every_s = words.get(5).map_or(0.0, |w| w.parse().unwrap());
    let [payload_kg, duration_s] = [2, 3].map(|i| words[i].parse().unwrap());
    log(&alone(&words[0], &words[1], payload_kg, duration_s), Path::new(&words[4]), every_s);
}

/// A scenario with this truck and nobody else.
pub(crate) fn alone(scenario: &str, truck: &str, payload_kg: f64, duration_s: f64) -> Scenario {
    let mut scenario = Scenario::named(scenario).unwrap();
    let changes = Overrides {
        truck: Some(truck),
        payload_kg: Some(payload_kg),
        duration_s: Some(duration_s),
        traffic: Some("none"),
        ..Overrides::default()
    };
    changes.apply(&mut scenario).unwrap();
    scenario
}

/// Drives and logs.
pub(crate) fn log(scenario: &Scenario, out: &Path, every_s: f64) {
    let mut world = World::new(scenario, 1).unwrap();
    let wire = Loopback::new(BitRate::Kbit250, 3);
    let mut logger = wire.node(2);
    world.put_on_bus(BitRate::Kbit250, Box::new(wire.node(0)), Box::new(wire.node(1))).unwrap();
    // A line comes in pieces of a byte, each of which would cost the compressor a buffer of 32 kB.
    let packed = GzEncoder::new(File::create(out).unwrap(), Compression::best());
    let mut file = BufWriter::new(packed);
    let mut last_s: BTreeMap<u32, f64> = BTreeMap::new();
    loop {
        let status = world.tick(&mut ()).unwrap();
        while let Some(heard) = logger.receive(world.now()).unwrap() {
            let (id, time_s) = (heard.value.id().raw(), heard.time.seconds());
            if last_s.get(&id).is_none_or(|last| time_s - last > every_s) {
                last_s.insert(id, time_s);
                write(&mut file, Form::Log, "can0", &heard).unwrap();
            }
        }
        if status != Status::Running {
            break;
        }
    }
    file.into_inner().unwrap().finish().unwrap();
}
