//! The whole truck behind its bus on logs of real trucks, in order and under attack. It is not
//! engaged: what these trucks do not send it misses, and says so in its status, not as an event.

use core::cell::Cell;
use core::convert::Infallible;
use std::io::BufReader;

use flate2::read::GzDecoder;
use j1939::bus::candump::{Pace, Reader, Replay};
use j1939::bus::tap::Tap;
use j1939::steering::ExampleSteering;
use j1939::supervise::BusFault;
use j1939::truck::{BusTruck, BusTruckConfig};
use j1939::{BitRate, Id, Message, message::Eec1, message::Tsc1};
use tractrix_core::{
    BusRecorder, BusTrouble, Pose, PoseSource, RawFrame, Stamped, Time, Vehicle, VehicleFault,
    VehicleLimits,
};

struct Here;

impl PoseSource for Here {
    type Error = Infallible;
    fn pose(&mut self, now: Time) -> Result<Stamped<Pose>, Infallible> {
        Ok(Stamped { time: now, value: Pose::default() })
    }
}

/// What the truck says about a log.
struct Heard {
    /// Events with the time at which they were first seen, s.
    events: Vec<(BusFault, f64)>,
    /// When the status first had an intruder, s, and demands of torque from the brakes to the engine
    /// that had come by then.
    intruder: Option<(VehicleFault, f64, usize)>,
}

/// Counts frames, and demands of torque from the brakes to the engine.
struct Counts<'a> {
    frames_and_demands: &'a Cell<(usize, usize)>,
}

impl BusRecorder for Counts<'_> {
    fn received(&mut self, _: Time, what: Result<Option<Stamped<RawFrame>>, BusTrouble>) {
        let Ok(Some(heard)) = what else { return };
        let id = Id::from_raw(heard.value.id);
        let is_demand = id.pgn() == Tsc1::TABLE.pgn && id.sa() == 0x0B && id.da() == 0;
        let (frames, demands) = self.frames_and_demands.get();
        self.frames_and_demands.set((frames + 1, demands + usize::from(is_demand)));
    }

    fn sent(&mut self, _: Time, _: RawFrame, _: Option<BusTrouble>) {}
}

fn heard(log: &str, rate: BitRate) -> Heard {
    let path = format!("{}/../../tests/data/j1939/{log}.log.gz", env!("CARGO_MANIFEST_DIR"));
    let file = std::fs::File::open(&path).unwrap_or_else(|e| panic!("{path}: {e}"));
    let reader = Reader::new(BufReader::new(GzDecoder::new(file)));
    let counted = Cell::new((0, 0));
    let bus = Tap::new(
        Replay::new(reader, None, Pace::Recorded, Time::ZERO),
        Counts { frames_and_demands: &counted },
    );
    let sheet = include_str!("../data/longhaul_sheet.toml");
    let limits = VehicleLimits::from_sheet("longhaul", sheet).unwrap();
    let steering: Option<ExampleSteering> = None;
    let config = BusTruckConfig::default();
    let mut truck = BusTruck::new(bus, rate, Here, steering, limits, config).unwrap();
    let mut found = Heard { events: Vec::new(), intruder: None };
    let (mut now, mut silent) = (Time::ZERO, 0);
    while silent < 100 {
        let before = counted.get().0;
        truck.ego(now).unwrap();
        silent = if counted.get().0 == before { silent + 1 } else { 0 };
        for event in truck.events() {
            if found.events.iter().all(|(fault, _)| *fault != event.fault) && silent == 0 {
                found.events.push((event.fault, event.since.seconds()));
            }
        }
        let status = truck.status();
        let intruder = [VehicleFault::Spoofed, VehicleFault::AddressConflict]
            .into_iter()
            .find(|fault| status.since(*fault).is_some());
        if let (None, Some(fault)) = (found.intruder, intruder) {
            found.intruder = Some((fault, now.seconds(), counted.get().1));
        }
        now = now.plus_nanos(10_000_000);
    }
    found
}

#[test]
fn a_claim_with_name_zero_is_noticed_in_the_tick_in_which_it_comes() {
    let Heard { events, intruder } = heard("t270_address_claim", BitRate::Kbit250);
    let (fault, at_s, _) = intruder.unwrap();
    assert_eq!(fault, VehicleFault::AddressConflict);
    assert!((15.49..=15.51).contains(&at_s), "{at_s}");
    let at = |wanted: BusFault| events.iter().find(|(fault, _)| *fault == wanted).unwrap().1;
    assert!((15.49..15.50).contains(&at(BusFault::NullName { address: 0 })), "{events:?}");
    let silent_s = at(BusFault::SignalLost { pgn: Eec1::TABLE.pgn, sa: 0 });
    assert!(silent_s - 15.488_864 < 0.1, "last heard at 15.488864 s, lost at {silent_s}");
}

#[test]
fn injected_torque_demands_are_noticed_within_ten_frames() {
    let Heard { events, intruder } = heard("t270_tsc1", BitRate::Kbit250);
    let (fault, at_s, demands) = intruder.unwrap();
    assert_eq!(fault, VehicleFault::Spoofed, "{events:?}");
    assert!((1..=10).contains(&demands), "{demands} demands until {at_s} s");
    assert!(at_s - 14.975_137 < 0.010_001, "{at_s}");
}

#[test]
fn trucks_in_order_cause_no_event() {
    for (log, rate) in [
        ("t270_normal", BitRate::Kbit250),
        ("css_truck_idle", BitRate::Kbit250),
        ("uthp_modern_parked", BitRate::Kbit500),
    ] {
        let Heard { mut events, intruder } = heard(log, rate);
        if log == "uthp_modern_parked" {
            // Its recorder lost frames: EEC1 stays away for up to 100 ms, EBC1 for 400 ms
            events.retain(|(fault, _)| !matches!(fault, BusFault::SignalLost { .. }));
        }
        assert_eq!((&events[..], intruder), (&[][..], None), "{log}");
    }
}
