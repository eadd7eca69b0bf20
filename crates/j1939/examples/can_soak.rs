//! Hours of bus time: all logs of a folder mixed and mutated, heard by everything that listens.
//!
//! `can_soak FOLDER BUS_TIME_S LIMIT_S`: ends after that time on the bus or that time on the clock.
//! Exit code 1 when the memory grew.
#![allow(
    clippy::unwrap_used,
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    reason = "an example may stop, reads the clock and prints"
)]

#[path = "../tests/fuzzed/mod.rs"]
mod fuzzed;

use std::io::BufReader;
use std::path::Path;
use std::time::Instant;

use flate2::read::GzDecoder;
use fuzzed::Listeners;
use j1939::bus::Bus;
use j1939::bus::candump::{Pace, Reader, Replay};
use j1939::{Frame, Id};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use tractrix_core::{Stamped, Time};

/// Of so many frames one is mutated.
const ONE_IN: u32 = 16;
/// Memory that may come and go, kB.
const SLACK_KB: i64 = 1_024;

/// A log that begins again at its end.
struct Endless {
    frames: Vec<Stamped<Frame>>,
    at: usize,
    offset: i64,
}

impl Endless {
    fn read(path: &Path) -> Self {
        let file = std::fs::File::open(path).unwrap();
        let reader = Reader::new(BufReader::new(GzDecoder::new(file)));
        let mut replay = Replay::new(reader, None, Pace::Full, Time::ZERO);
        let frames = std::iter::from_fn(|| replay.receive(Time::ZERO).unwrap()).collect();
        Self { frames, at: 0, offset: 0 }
    }

    fn next_time(&self) -> i64 {
        self.frames[self.at].time.0 + self.offset
    }

    fn take(&mut self) -> Frame {
        let frame = self.frames[self.at].value;
        self.at += 1;
        if self.at == self.frames.len() {
            self.offset = self.frames.last().unwrap().time.0 + self.offset + 1_000_000;
            self.at = 0;
        }
        frame
    }
}

/// Bits turned, bytes cut, another identifier, or a random frame of the transport.
fn mutated(frame: &Frame, random: &mut ChaCha8Rng) -> Frame {
    let raw = frame.id().raw();
    let mut bytes = frame.bytes().to_vec();
    match random.next_u32() % 4 {
        0 if !bytes.is_empty() => {
            let at = random.next_u32() as usize % bytes.len();
            bytes[at] ^= 1 << (random.next_u32() % 8);
        }
        1 => bytes.truncate(random.next_u32() as usize % 9),
        2 => {
            let id = Id::from_raw(raw ^ 1 << (random.next_u32() % 29));
            return Frame::new(id, &bytes).unwrap();
        }
        _ => {
            let groups = [0xEC, 0xEB, 0xC8, 0xC7, 0xEE, 0xEA];
            let group = groups[random.next_u32() as usize % groups.len()];
            let da = [0x2A, 0xFF][random.next_u32() as usize % 2];
            let raw = 7 << 26 | group << 16 | da << 8 | (random.next_u32() & 0xFF);
            let command = [16, 17, 19, 20, 21, 22, 23, 32, 255][random.next_u32() as usize % 9];
            bytes = random.next_u64().to_le_bytes().to_vec();
            bytes[0] = command;
            return Frame::new(Id::from_raw(raw), &bytes).unwrap();
        }
    }
    Frame::new(Id::from_raw(raw), &bytes).unwrap()
}

/// Memory of this process, kB.
fn memory_kb() -> i64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
    line.trim().trim_end_matches(" kB").trim().parse().unwrap()
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, bus_time_s, limit_s] = &arguments[..] else {
        eprintln!("can_soak FOLDER BUS_TIME_S LIMIT_S");
        std::process::exit(2);
    };
    let (bus_time_s, limit_s): (f64, f64) = (bus_time_s.parse().unwrap(), limit_s.parse().unwrap());
    let mut paths: Vec<_> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    paths.retain(|path| path.to_string_lossy().ends_with(".log.gz"));
    paths.sort();
    let mut logs: Vec<Endless> = paths.iter().map(|path| Endless::read(path)).collect();
    let mut random = ChaCha8Rng::seed_from_u64(1939);
    let mut listeners = Listeners::new();
    let (mut frames, mut changed) = (0_u64, 0_u64);
    let start = Instant::now();
    let mut settled_kb = None;
    let now_s = loop {
        let next = logs.iter_mut().min_by_key(|log| log.next_time()).unwrap();
        let now = Time(next.next_time());
        let mut frame = next.take();
        if random.next_u32().is_multiple_of(ONE_IN) {
            frame = mutated(&frame, &mut random);
            changed += 1;
        }
        listeners.hear(now, &frame);
        frames += 1;
        if settled_kb.is_none() && now.seconds() > 0.1 * bus_time_s {
            settled_kb = Some(memory_kb());
        }
        let over = frames.is_multiple_of(4_096) && start.elapsed().as_secs_f64() > limit_s;
        if over || now.seconds() >= bus_time_s {
            break now.seconds();
        }
    };
    let took_s = start.elapsed().as_secs_f64();
    let grown_kb = memory_kb() - settled_kb.unwrap_or_else(memory_kb);
    println!(
        "{} logs, {now_s:.0} s on the bus in {took_s:.1} s: {frames} frames, {changed} mutated, \
         {} numbers, {} long messages; {:.0} ns a frame; memory grew by {grown_kb} kB",
        logs.len(),
        listeners.numbers,
        listeners.messages,
        took_s * 1e9 / frames as f64,
    );
    if grown_kb > SLACK_KB {
        std::process::exit(1);
    }
}
