use super::*;
use crate::check::{Carrier, Policy};
use crate::{AddressSet, Id};
use proptest::prelude::*;

const MS: i64 = 1_000_000;
const EEC1: u32 = 61_444;
const TSC1: u32 = 0;

type Supervised = Supervisor<1, 1>;

fn watch(protection: bool) -> Watch {
    Watch {
        pgn: EEC1,
        sa: 0,
        period_nanos: 20 * MS,
        timeout_nanos: 90 * MS,
        protection: protection.then_some((Carrier::TSC1.protection, Policy::Required)),
    }
}

fn supervisor(senders: &[u8], protection: bool) -> Supervised {
    let exclusive = Exclusive { pgn: TSC1, da: 0, senders: AddressSet::of(senders) };
    Supervisor::new(BusBounds::usual(BitRate::Kbit250), [watch(protection)], [exclusive])
}

fn frame(pgn: u32, da: u8, sa: u8, data: [u8; 8]) -> Frame {
    Frame::of(Id::new(3, pgn, da, sa).unwrap(), data)
}

fn new(of: &mut Supervised) -> Vec<(BusFault, i64)> {
    std::iter::from_fn(|| of.take_new()).map(|event| (event.fault, event.since.0 / MS)).collect()
}

/// EEC1 every `period_ms` from `from_ms` until `until_ms`, polled every millisecond.
fn engine(of: &mut Supervised, from_ms: i64, until_ms: i64, period_ms: i64) {
    for ms in from_ms..until_ms {
        if ms % period_ms == 0 {
            of.on_frame(Time(ms * MS), &frame(EEC1, 0xFF, 0, [0xFF; 8]));
        }
        of.poll(Time(ms * MS));
    }
}

#[test]
fn a_lost_message_is_noticed_and_forgotten_when_it_comes_again() {
    let mut of = supervisor(&[3], false);
    of.poll(Time(1_000 * MS));
    assert_eq!(new(&mut of), [], "what never came is not lost");
    engine(&mut of, 1_000, 2_000, 20);
    assert_eq!(new(&mut of), []);
    engine(&mut of, 2_000, 20_000, 1 << 40);
    let lost = BusFault::SignalLost { pgn: EEC1, sa: 0 };
    // last at 1980 ms
    assert_eq!(new(&mut of), [(lost, 2_071)]);
    assert_eq!(of.events().count(), 1, "as long as it is away");
    engine(&mut of, 20_000, 20_001, 20);
    assert_eq!(of.events().count(), 0);
}

#[test]
fn a_second_sender_of_a_message_is_noticed_by_the_rate() {
    let mut of = supervisor(&[3], false);
    engine(&mut of, 0, 10_000, 18);
    assert_eq!(new(&mut of), [], "a tenth early is no violation");
    engine(&mut of, 10_000, 11_000, 10);
    let [(BusFault::RateViolation { pgn: EEC1, sa: 0 }, at)] = new(&mut of)[..] else { panic!() };
    // ten frames of the second sender take 200 ms
    assert!((10_000..10_200).contains(&at), "{at}");
    engine(&mut of, 11_000, 17_000, 20);
    assert_eq!(of.events().count(), 0, "over after a while");
}

#[test]
fn commands_of_others_are_spoofed() {
    let mut of = supervisor(&[3, 0x2A], false);
    for sa in [3, 0x2A, 3] {
        of.on_frame(Time(MS), &frame(TSC1, 0, sa, [0; 8]));
    }
    of.on_frame(Time(MS), &frame(TSC1, 0x29, 0x0B, [0; 8]));
    assert_eq!(new(&mut of), []);
    of.on_frame(Time(2 * MS), &frame(TSC1, 0, 0x0B, [0; 8]));
    assert_eq!(new(&mut of), [(BusFault::Spoofed { pgn: TSC1, sa: 0x0B }, 2)]);
    // when nobody is named, it is the first who may
    let mut of = supervisor(&[], false);
    of.on_frame(Time(MS), &frame(TSC1, 0, 7, [0; 8]));
    of.on_frame(Time(2 * MS), &frame(TSC1, 0, 8, [0; 8]));
    assert_eq!(new(&mut of), [(BusFault::Spoofed { pgn: TSC1, sa: 8 }, 2)]);
}

#[test]
fn what_comes_from_our_own_address_is_another_s() {
    let mut of = supervisor(&[3], false);
    of.set_address(Some(0x2A));
    of.on_frame(Time(MS), &frame(1024, 0x0B, 0x2A, [0; 8]));
    of.on_frame(Time(2 * MS), &Name(77).claim(0x2A));
    assert_eq!(
        new(&mut of),
        [
            (BusFault::Spoofed { pgn: 1024, sa: 0x2A }, 1),
            (BusFault::AddressConflict { address: 0x2A }, 2)
        ]
    );
}

#[test]
fn a_second_name_and_a_name_of_zero_are_noticed() {
    let mut of = supervisor(&[3], false);
    for (name, address) in [(5, 0), (5, 0), (6, 1), (6, NULL_ADDRESS), (7, NULL_ADDRESS)] {
        of.on_frame(Time(MS), &Name(name).claim(address));
    }
    assert_eq!(new(&mut of), []);
    of.on_frame(Time(2 * MS), &Name(4).claim(0));
    of.on_frame(Time(3 * MS), &Name(0).claim(1));
    assert_eq!(
        new(&mut of),
        [(BusFault::AddressConflict { address: 0 }, 2), (BusFault::NullName { address: 1 }, 3)]
    );
}

#[test]
fn counters_and_checksums_are_judged() {
    let mut of = supervisor(&[3], true);
    let send = |of: &mut Supervised, ms: i64, counter: u8, wrong: u8| {
        let id = Id::new(3, EEC1, 0xFF, 0).unwrap();
        let mut data = [1, 2, 3, 4, 5, 6, 7, counter];
        data[7] |= (Carrier::TSC1.protection.checksum(id, data) ^ wrong) << 4;
        of.on_frame(Time(ms * MS), &Frame::of(id, data));
    };
    for (i, counter) in (0..20).map(|i| (i, (i % 8) as u8)) {
        send(&mut of, i * 20, counter, 0);
    }
    assert_eq!(new(&mut of), []);
    send(&mut of, 400, 4, 1);
    send(&mut of, 420, 4, 0);
    send(&mut of, 440, 4, 0);
    send(&mut of, 460, 6, 0);
    let (pgn, sa) = (EEC1, 0);
    assert_eq!(
        new(&mut of),
        [
            (BusFault::Checksum { pgn, sa }, 400),
            (BusFault::CounterStuck { pgn, sa }, 440),
            (BusFault::CounterJump { pgn, sa }, 460),
        ]
    );
    // demanded and not there
    let mut of = supervisor(&[3], true);
    of.on_frame(Time(0), &frame(EEC1, 0xFF, 0, [0xFF; 8]));
    assert_eq!(new(&mut of), [(BusFault::Checksum { pgn, sa }, 0)]);
}

#[test]
fn floods_of_announcements_and_of_anything_are_noticed() {
    for (pgn, da, command) in [(60_416, 0xFF, 32), (60_416, 0x2A, 16), (51_200, 0x2A, 20)] {
        let mut of = supervisor(&[3], false);
        let data = [command, 14, 0, 2, 255, 0xCA, 0xFE, 0];
        for sa in 0..40 {
            of.on_frame(Time(MS), &frame(pgn, da, sa, data));
        }
        assert_eq!(new(&mut of), []);
        of.on_frame(Time(900 * MS), &frame(pgn, da, 100, data));
        assert_eq!(new(&mut of), [(BusFault::Flooded, 900)]);
    }
    let mut of = supervisor(&[3], false);
    for i in 0..2_000 {
        of.on_frame(Time(i * 540_000), &frame(0xEF00, 0x55, 0x66, [0x55; 8]));
        of.poll(Time(i * 540_000));
    }
    assert!(of.load(Time(1_079 * MS)) > 0.9);
    let [(BusFault::Overloaded, at)] = new(&mut of)[..] else { panic!() };
    assert!((800..1_000).contains(&at), "{at}");
}

#[test]
fn the_list_is_bounded() {
    let mut of = supervisor(&[3], false);
    for sa in 0..100 {
        of.on_frame(Time(MS), &frame(TSC1, 0, sa, [0; 8]));
    }
    assert_eq!(of.events().count(), EVENTS);
    assert_eq!(of.dropped(), 99 - EVENTS as u64);
    let counts: Vec<_> = of.events().map(|event| event.count).collect();
    assert!(counts.iter().all(|count| *count == 1));
}

proptest! {
    #[test]
    fn any_frames_at_any_times_are_taken(
        frames in prop::collection::vec((any::<u32>(), any::<[u8; 8]>(), 0_usize..9, any::<i64>()), 0..200),
    ) {
        let mut of = supervisor(&[], true);
        of.set_address(Some(0));
        for (raw, data, len, time) in frames {
            let raw = if raw & 1 == 0 { raw } else { [0x0CF0_0400, 0x0C00_0003, 0x18EE_FF00][(raw >> 1) as usize % 3] };
            of.on_frame(Time(time), &Frame::new(Id::from_raw(raw), &data[..len]).unwrap());
            of.poll(Time(time));
            prop_assert!(of.events().count() <= EVENTS);
        }
    }
}
