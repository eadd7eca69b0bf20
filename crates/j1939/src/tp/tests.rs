mod rig;

use super::*;
use crate::BitRate;
use crate::bus::faults::FaultPlan;
use crate::bus::loopback::Loopback;
use proptest::prelude::*;
use rig::{Node, Rig, Seen, seen};

/// A parameter group to one address and one to everybody.
const PDU1: u32 = 0xEF00;
const DM1: u32 = 65_226;

fn text(len: usize) -> Vec<u8> {
    (0..len).map(|i| (i * 7 + i / 256) as u8).collect()
}

#[test]
fn every_length_of_the_protocol_arrives_with_any_windows() {
    for (len, windows) in [
        (9, [16, 16]),
        (14, [1, 1]),
        (100, [1, 255]),
        (1784, [255, 7]),
        (1785, [255, 255]),
        (1785, [16, 16]),
        (1785, [1, 1]),
    ] {
        let mut rig = Rig::<Node>::new(windows, FaultPlan::default(), 1);
        rig.send(0, PDU1, 0x90, &text(len)).unwrap();
        rig.run_ms(2_500);
        assert_eq!(rig.seen[0], [Seen::Sent { pgn: PDU1 }], "{len}");
        let received = Seen::Received { pgn: PDU1, sa: 0x80, bytes: text(len) };
        assert_eq!(rig.seen[1], [received]);
        let overheard = Seen::Received { pgn: PDU1, sa: 0x80, bytes: text(len) };
        assert_eq!(rig.overheard, [overheard], "a listener has it too");
    }
}

#[test]
fn a_window_is_no_larger_than_receiver_and_sender_want() {
    let mut rig = Rig::<Node>::new([16, 5], FaultPlan::default(), 1);
    rig.send(0, PDU1, 0x90, &text(70)).unwrap();
    rig.run_ms(100);
    let controls = rig.controls();
    let pgn = [0, 0xEF, 0];
    let frame = |head: [u8; 5]| -> [u8; 8] { [&head[..], &pgn].concat().try_into().unwrap() };
    assert_eq!(
        controls,
        [
            (0x80, frame([16, 70, 0, 10, 255])),
            (0x90, frame([17, 5, 1, 255, 255])),
            (0x90, frame([17, 5, 6, 255, 255])),
            (0x90, frame([19, 70, 0, 10, 255])),
        ]
    );
    // an outsider who wants two packets at most
    rig.say(60_416, 0x90, 0x33, frame([16, 20, 0, 3, 2]));
    rig.run_ms(5);
    assert_eq!(rig.controls(), [(0x90, frame([17, 2, 1, 255, 255]))]);
}

#[test]
fn three_broadcasts_and_two_requests_go_at_once() {
    let mut rig = Rig::<Transport<8, 2000>>::plain();
    rig.send(0, DM1, 0xFF, &text(30)).unwrap();
    rig.send(1, DM1, 0xFF, &text(44)).unwrap();
    rig.send(0, PDU1, 0x90, &text(1785)).unwrap();
    rig.send(1, PDU1, 0x80, &text(900)).unwrap();
    // the third broadcast comes from an outsider, packet by packet
    rig.say(60_416, 0xFF, 0x31, [32, 14, 0, 2, 255, 0xCA, 0xFE, 0]);
    for sequence in 1..=2 {
        rig.run_ms(60);
        rig.say(60_160, 0xFF, 0x31, [sequence, 1, 2, 3, 4, 5, 6, 7]);
    }
    rig.run_ms(2_000);
    let received = |of: &Rig<_>, node: usize| {
        let seen = of.seen[node].iter();
        seen.filter(|s| matches!(s, Seen::Received { .. })).count()
    };
    let of_seen = |pgn, sa, bytes| Seen::Received { pgn, sa, bytes };
    assert!(rig.seen[1].contains(&of_seen(DM1, 0x80, text(30))));
    assert!(rig.seen[0].contains(&of_seen(DM1, 0x90, text(44))));
    assert!(rig.seen[1].contains(&of_seen(PDU1, 0x80, text(1785))));
    assert!(rig.seen[0].contains(&of_seen(PDU1, 0x90, text(900))));
    assert!(rig.seen[0].contains(&of_seen(DM1, 0x31, [1, 2, 3, 4, 5, 6, 7].repeat(2))));
    assert_eq!((received(&rig, 0), received(&rig, 1)), (3, 3));
    assert_eq!(rig.overheard.len(), 4, "it does not hear what it sends itself");
}

#[test]
fn packets_of_a_broadcast_are_50_ms_apart() {
    let mut rig = Rig::<Node>::plain();
    rig.send(0, DM1, 0xFF, &text(28)).unwrap();
    rig.run_ms(400);
    let times: Vec<_> = rig.heard.iter().map(|(ms, _)| *ms).collect();
    assert!(times.windows(2).all(|w| (49..=52).contains(&(w[1] - w[0]))), "{times:?}");
    assert_eq!(times.len(), 5);
}

#[test]
fn what_fits_a_frame_is_one_frame() {
    let mut rig = Rig::<Node>::plain();
    rig.send(0, DM1, 0xFF, &[1; 8]).unwrap();
    rig.run_ms(5);
    assert_eq!(rig.heard[0].1, Frame::of(Id::new(6, DM1, 0xFF, 0x80).unwrap(), [1; 8]));
    assert_eq!(rig.seen[0], [Seen::Sent { pgn: DM1 }]);
}

#[test]
fn what_cannot_be_sent_is_refused_by_name() {
    let mut rig = Rig::<Node>::plain();
    let wrong = |e: Result<(), J1939Error>| e.unwrap_err().to_string();
    for (da, len, why) in
        [(0xFF, 1786, "1 to 1785"), (0x90, 2001, "1 to 2000"), (0x90, 0, "0 bytes")]
    {
        let error = wrong(rig.send(0, PDU1, da, &text(len)));
        assert!(error.contains(why), "{error}");
    }
    assert_eq!(rig.send(0, PDU1 + 1, 0x90, &text(20)), Err(J1939Error::Pgn(PDU1 + 1)));
    let destination = J1939Error::Destination { pgn: DM1, da: 0x90 };
    assert_eq!(rig.send(0, DM1, 0x90, &text(8)), Err(destination));
    rig.send(0, PDU1, 0x90, &text(20)).unwrap();
    let busy = J1939Error::TransportBusy { pgn: DM1, da: 0x90 };
    assert_eq!(rig.send(0, DM1, 0x90, &text(20)), Err(busy));
    let mut without = Transport::<1, 100>::new(16);
    assert_eq!(without.send(Time(0), 6, DM1, 0xFF, &text(20)), Err(J1939Error::NoAddress));
}

#[test]
fn more_than_1785_bytes_go_by_etp() {
    let mut rig = Rig::<Transport<2, 20_000>>::new([255, 255], FaultPlan::default(), 1);
    rig.send(0, PDU1, 0x90, &text(20_000)).unwrap();
    rig.run_ms(4_000);
    assert_eq!(rig.seen[0], [Seen::Sent { pgn: PDU1 }]);
    assert_eq!(rig.seen[1], [Seen::Received { pgn: PDU1, sa: 0x80, bytes: text(20_000) }]);
    let controls = rig.controls();
    assert_eq!(controls[0].1, [20, 0x20, 0x4E, 0, 0, 0, 0xEF, 0]);
    assert_eq!(controls[2].1, [22, 255, 0, 0, 0, 0, 0xEF, 0]);
    assert_eq!(controls[4].1, [22, 255, 255, 0, 0, 0, 0xEF, 0]);
}

#[test]
fn what_is_lost_or_doubled_is_asked_for_again() {
    for (plan, len, least) in [
        (FaultPlan { loss: 0.01, ..FaultPlan::default() }, 1785, 17),
        (FaultPlan { loss: 0.1, ..FaultPlan::default() }, 100, 12),
        // clear-to-send that comes four times looks like three requests to send again
        (FaultPlan { duplicate: 0.2, ..FaultPlan::default() }, 1785, 18),
        (FaultPlan { delay_nanos: 100 * MS, ..FaultPlan::default() }, 500, 20),
    ] {
        let mut complete = 0;
        for seed in 0..20 {
            let mut rig = Rig::<Node>::new([16; 2], plan, 2 * seed);
            rig.send(0, PDU1, 0x90, &text(len)).unwrap();
            rig.run_ms(15_000);
            let whole = Seen::Received { pgn: PDU1, sa: 0x80, bytes: text(len) };
            complete += usize::from(rig.seen[1].contains(&whole));
            // never anything else than the whole message, and no session left over
            let wrong =
                rig.seen[1].iter().any(|s| matches!(s, Seen::Received { .. }) && *s != whole);
            assert!(!wrong);
            assert_eq!(rig.nodes.each_ref().map(|(t, _)| t.sessions()), [0, 0]);
        }
        assert!(complete >= least, "{complete} of 20 with {plan:?}");
    }
}

#[test]
fn a_lost_offset_of_etp_never_puts_data_in_the_wrong_place() {
    let plan = FaultPlan { loss: 0.03, ..FaultPlan::default() };
    let mut complete = 0;
    for seed in 0..10 {
        let mut rig = Rig::<Transport<2, 4_000>>::new([16, 30], plan, 2 * seed);
        rig.send(0, PDU1, 0x90, &text(4_000)).unwrap();
        rig.run_ms(30_000);
        for seen in &rig.seen[1] {
            if let Seen::Received { bytes, .. } = seen {
                assert_eq!(*bytes, text(4_000));
                complete += 1;
            }
        }
    }
    assert!(complete >= 3, "{complete}");
}

#[test]
fn a_receiver_can_hold_its_senders() {
    let mut rig = Rig::<Node>::plain();
    rig.nodes[1].0.set_hold(true);
    rig.send(0, PDU1, 0x90, &text(100)).unwrap();
    rig.run_ms(5_000);
    assert_eq!(rig.seen, [vec![], vec![]]);
    let holds = rig.controls().iter().filter(|(_, b)| b[..2] == [17, 0]).count();
    assert!((9..=11).contains(&holds), "one every 500 ms: {holds}");
    rig.nodes[1].0.set_hold(false);
    rig.run_ms(100);
    assert_eq!(rig.seen[0], [Seen::Sent { pgn: PDU1 }]);
}

/// What a sender to 0x33 says after these answers of 0x33: the last control message.
fn sender_after(answers: &[[u8; 5]]) -> ([u8; 8], Vec<Seen>) {
    let mut rig = Rig::<Node>::plain();
    rig.send(0, PDU1, 0x33, &text(100)).unwrap();
    for head in answers {
        rig.run_ms(20);
        let bytes: Vec<u8> = head.iter().copied().chain([0, 0xEF, 0]).collect();
        rig.say(60_416, 0x80, 0x33, bytes.try_into().unwrap());
    }
    rig.run_ms(1_500);
    let last = rig.controls().last().unwrap().1;
    (last, std::mem::take(&mut rig.seen[0]))
}

#[test]
fn a_sender_gives_up_for_the_stated_reasons() {
    let failed = |reason, by_peer| vec![Seen::Failed { reason, by_peer }];
    for (answers, reason) in [
        (&[][..], AbortReason::TIMEOUT),
        (&[[17, 0, 1, 255, 255]], AbortReason::TIMEOUT),
        (&[[17, 2, 3, 255, 255]], AbortReason::BAD_SEQUENCE),
        (&[[17, 2, 0, 255, 255]], AbortReason::BAD_SEQUENCE),
        (&[[17, 5, 1, 255, 255]; 4], AbortReason::RETRANSMIT_LIMIT),
    ] {
        let (last, seen) = sender_after(answers);
        assert_eq!((last[0], last[1], seen), (255, reason.0, failed(reason, false)), "{answers:?}");
    }
    // the receiver's reason is passed on; PACCAR's engine states none
    for reason in [1, 2, 3, 7, 250, 255] {
        let (_, seen) = sender_after(&[[255, reason, 255, 255, 255]]);
        assert_eq!(seen, failed(AbortReason(reason), true));
    }
    // the kernel clears for 255 packets at once, whatever there is
    let (last, seen) = sender_after(&[[17, 255, 1, 255, 255], [19, 100, 0, 15, 255]]);
    assert_eq!((last[0], seen), (16, vec![Seen::Sent { pgn: PDU1 }]));
    // asked again for the end of a window
    let again =
        [[17, 10, 1, 255, 255], [17, 3, 8, 255, 255], [17, 5, 11, 255, 255], [19, 100, 0, 15, 255]];
    assert_eq!(sender_after(&again).1, [Seen::Sent { pgn: PDU1 }]);
}

#[test]
fn clear_to_send_while_sending_is_a_reason_too() {
    let mut sender = Node::new(16);
    sender.set_address(Some(0x80));
    sender.send(Time(0), 6, PDU1, 0x90, &text(1785)).unwrap();
    let wire = Loopback::new(BitRate::Kbit250, 1);
    let mut bus = wire.node(0);
    sender.poll(Time(0), &mut bus).unwrap();
    let cts = |count, next| {
        let id = Id::new(7, 60_416, 0x80, 0x90).unwrap();
        Frame::of(id, [17, count, next, 255, 255, 0, 0xEF, 0])
    };
    // more packets than the queue of the bus has room for: the window is not over
    sender.on_frame(Time(1), &cts(200, 1));
    sender.poll(Time(2), &mut bus).unwrap();
    sender.on_frame(Time(3), &cts(200, 1));
    assert_eq!(sender.sessions(), 1);
    sender.on_frame(Time(4), &cts(2, 250));
    sender.poll(Time(100 * MS), &mut bus).unwrap();
    let event = sender.event().map(seen);
    let reason = AbortReason::CTS_WHILE_SENDING;
    assert_eq!(event, Some(Seen::Failed { reason, by_peer: false }));
}

#[test]
fn a_receiver_gives_up_for_the_stated_reasons() {
    let rts = |len: u16, pgn: u8| {
        let [low, high] = len.to_le_bytes();
        [16, low, high, len.div_ceil(7) as u8, 255, pgn, 0xEF, 0]
    };
    let last = |rig: &mut Rig<Transport<2, 100>>| {
        let ours: Vec<_> = rig.controls().into_iter().filter(|(sa, _)| *sa == 0x90).collect();
        ours.iter().map(|(_, b)| [b[0], b[1]]).collect::<Vec<_>>()
    };
    // more than its memory
    let mut rig = Rig::plain();
    rig.say(60_416, 0x90, 0x33, rts(101, 0));
    rig.run_ms(5);
    assert_eq!(last(&mut rig), [[255, AbortReason::RESOURCES.0]]);
    // a second session of the same source
    rig.say(60_416, 0x90, 0x33, rts(50, 0));
    rig.run_ms(5);
    rig.say(60_416, 0x90, 0x33, rts(50, 1));
    rig.run_ms(5);
    assert_eq!(last(&mut rig), [[17, 8], [255, AbortReason::BUSY.0]]);
    // nothing comes: asked again twice, then given up
    rig.run_ms(4_000);
    assert_eq!(last(&mut rig), [[17, 8], [17, 8], [255, AbortReason::TIMEOUT.0]]);
    // the same packet is missing every time
    rig.say(60_416, 0x90, 0x33, rts(14, 0));
    for _ in 0..4 {
        rig.run_ms(5);
        rig.say(60_160, 0x90, 0x33, [2; 8]);
    }
    rig.run_ms(5);
    let limit = AbortReason::RETRANSMIT_LIMIT.0;
    assert_eq!(last(&mut rig), [[17, 2], [17, 2], [17, 2], [255, limit]]);
}

#[test]
fn what_belongs_to_no_session_is_ignored() {
    let mut rig = Rig::<Node>::plain();
    // a real engine, every five seconds
    rig.say(60_416, 0x80, 0x00, [17, 1, 6, 255, 255, 0xE3, 0xFE, 0]);
    rig.say(60_416, 0x80, 0x00, [19, 100, 0, 15, 255, 0xE3, 0xFE, 0]);
    rig.say(60_416, 0x80, 0x00, [255, 3, 255, 255, 255, 0xE3, 0xFE, 0]);
    rig.say(60_160, 0x80, 0x00, [1; 8]);
    rig.say(60_160, 0xFF, 0x00, [1; 8]);
    // broadcasts to an address, requests to send to everybody, and lengths that cannot be
    rig.say(60_416, 0x80, 0x00, [32, 14, 0, 2, 255, 0xCA, 0xFE, 0]);
    rig.say(60_416, 0xFF, 0x00, [16, 14, 0, 2, 255, 0xCA, 0xFE, 0]);
    rig.say(60_416, 0xFF, 0x00, [32, 14, 0, 3, 255, 0xCA, 0xFE, 0]);
    rig.run_ms(2_000);
    assert_eq!(rig.seen, [vec![], vec![]]);
    assert!(rig.controls().is_empty(), "nobody answers");
    assert_eq!(rig.nodes[0].0.counts().malformed, 3);
    assert_eq!(rig.nodes[0].0.sessions(), 0);
}

fn on(transport: &mut Transport<4, 100>, pgn: u32, da: u8, sa: u8, data: [u8; 8]) {
    transport.on_frame(Time(0), &Frame::of(Id::new(7, pgn, da, sa).unwrap(), data));
}

#[test]
fn a_flood_of_sources_without_a_claim_displaces_nobody_who_has_one() {
    let bam = [32, 14, 0, 2, 255, 0xCA, 0xFE, 0];
    let packet = |n: u8| [n, 1, 2, 3, 4, 5, 6, 7];
    let mut node = Transport::<4, 100>::new(16);
    node.set_address(Some(0x80));
    on(&mut node, ADDRESS_CLAIMED_PGN, 0xFF, 0x00, [7; 8]);
    on(&mut node, ADDRESS_CLAIMED_PGN, 0xFF, 0x05, [0; 8]);
    for sa in 150..250 {
        on(&mut node, 60_416, 0xFF, sa, bam);
    }
    assert_eq!((node.sessions(), node.counts().refused), (4, 96));
    // a NAME of zero is no claim
    on(&mut node, 60_416, 0xFF, 0x05, bam);
    assert_eq!(node.counts().refused, 97);
    // the engine has one: it takes the place of a flooding source, and keeps it
    on(&mut node, 60_416, 0xFF, 0x00, bam);
    on(&mut node, 60_160, 0xFF, 0x00, packet(1));
    for sa in 150..250 {
        on(&mut node, 60_416, 0xFF, sa, bam);
    }
    on(&mut node, 60_160, 0xFF, 0x00, packet(2));
    let event = node.event().map(seen);
    let bytes = [1, 2, 3, 4, 5, 6, 7].repeat(2);
    assert_eq!(event, Some(Seen::Received { pgn: DM1, sa: 0x00, bytes }));
    // and our own messages find room
    node.send(Time(0), 6, PDU1, 0x00, &text(20)).unwrap();
}

#[test]
fn a_lost_address_ends_the_sessions_of_this_node() {
    let mut rig = Rig::<Node>::plain();
    rig.send(0, PDU1, 0x90, &text(1785)).unwrap();
    rig.run_ms(100);
    rig.nodes[1].0.set_address(None);
    rig.run_ms(1_500);
    let other = Seen::Failed { reason: AbortReason::OTHER, by_peer: false };
    assert_eq!(rig.seen[1], [other]);
    assert_eq!(rig.seen[0], [Seen::Failed { reason: AbortReason::TIMEOUT, by_peer: false }]);
}

#[test]
fn a_bus_that_takes_nothing_ends_the_session() {
    let wire = Loopback::new(BitRate::Kbit250, 0);
    let mut bus = wire.node(0);
    let mut node = Node::new(16);
    node.set_address(Some(0x80));
    node.send(Time(0), 6, PDU1, 0x90, &text(20)).unwrap();
    node.poll(Time(T3 - 1), &mut bus).unwrap();
    assert_eq!(node.event(), None);
    node.poll(Time(T3), &mut bus).unwrap();
    assert!(matches!(node.event(), Some(TpEvent::Failed { reason: AbortReason::TIMEOUT, .. })));
}

/// Frames of the transport between few addresses, so that they meet.
fn any_frame() -> impl Strategy<Value = Frame> {
    let pgns = prop::sample::select(vec![60_416, 60_160, 51_200, 50_944, ADDRESS_CLAIMED_PGN, DM1]);
    let addresses = || prop::sample::select(vec![0_u8, 1, 0x80, 0x90, 0xFE, 0xFF]);
    let command = prop::sample::select(vec![16_u8, 17, 19, 20, 21, 22, 23, 32, 255, 1, 2, 3]);
    let small = prop::sample::select(vec![0_u8, 1, 2, 3, 14, 254, 255]);
    let data = (command, prop::array::uniform4(small), 0_u8..3);
    (pgns, addresses(), addresses(), data, 0_usize..=8).prop_map(|(pgn, da, sa, (c, b, g), len)| {
        let raw = 7 << 26 | (pgn | u32::from(da)) << 8 | u32::from(sa);
        let data = [c, b[0], b[1], b[2], b[3], g, 0xEF, 0];
        Frame::new(Id::from_raw(raw), &data[..if len > 1 { 8 } else { len }]).unwrap()
    })
}

proptest! {
    #[test]
    fn any_frames_leave_a_transport_whole(
        steps in prop::collection::vec((any_frame(), -2_000_i64..2_000, any::<bool>()), 0..300),
        listens in any::<bool>(),
    ) {
        let wire = Loopback::new(BitRate::Kbit500, 2);
        let (mut bus, mut other) = (wire.node(0), wire.node(1));
        let mut node = if listens { Transport::<3, 4_000>::listener() } else { Transport::new(255) };
        node.set_address(Some(0x80));
        let mut now = Time(0);
        for (frame, ms, sends) in steps {
            now = now.plus_nanos(ms * MS);
            node.on_frame(now, &frame);
            if sends {
                let _ = node.send(now, 6, PDU1, frame.id().sa(), &text(200));
            }
            node.poll(now, &mut bus).unwrap();
            while let Some(event) = node.event() {
                if let TpEvent::Received(message) = event {
                    prop_assert!(!message.bytes.is_empty() && message.bytes.len() <= 4_000);
                }
            }
            while other.receive(now).unwrap().is_some() {}
        }
        // whatever was under way ends
        for _ in 0..400 {
            now = now.plus_nanos(1_000 * MS);
            node.poll(now, &mut bus).unwrap();
            while node.event().is_some() {}
            while other.receive(now).unwrap().is_some() {}
        }
        prop_assert_eq!(node.sessions(), 0);
    }
}
