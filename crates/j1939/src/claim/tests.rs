use super::*;
use crate::bus::loopback::{Loopback, LoopbackNode};
use crate::{BitRate, REQUEST_PGN};
use proptest::prelude::*;

const MS: i64 = 1_000_000;
const CAN_CHOOSE: u64 = 1 << 63;

/// Nodes on one bus and a listener that asks.
struct Rig {
    now: i64,
    nodes: Vec<(AddressClaim, LoopbackNode)>,
    listener: LoopbackNode,
    heard: Vec<(i64, Frame)>,
}

impl Rig {
    fn new(claims: Vec<AddressClaim>) -> Self {
        let bus = Loopback::new(BitRate::Kbit250, claims.len() + 1);
        let listener = bus.node(claims.len());
        let nodes = claims.into_iter().enumerate().map(|(i, c)| (c, bus.node(i))).collect();
        Self { now: 0, nodes, listener, heard: Vec::new() }
    }

    fn run_ms(&mut self, ms: i64) {
        for _ in 0..ms {
            self.now += MS;
            let now = Time(self.now);
            for (claim, node) in &mut self.nodes {
                while let Some(heard) = node.receive(now).unwrap() {
                    claim.on_frame(heard.time, &heard.value);
                }
                claim.poll(now, node).unwrap();
            }
            while let Some(heard) = self.listener.receive(now).unwrap() {
                self.heard.push((self.now / MS, heard.value));
            }
        }
    }

    fn say(&mut self, frame: Frame) {
        self.listener.send(Time(self.now), &frame).unwrap();
    }

    fn addresses(&self) -> Vec<Option<u8>> {
        self.nodes.iter().map(|(claim, _)| claim.address()).collect()
    }

    /// Claims heard since the last call: time in ms, address, NAME.
    fn claims(&mut self) -> Vec<(i64, u8, u64)> {
        let heard = std::mem::take(&mut self.heard);
        heard.iter().filter_map(|(t, f)| Some((*t, f.id().sa(), Name::claimed_in(f)?.0))).collect()
    }
}

fn claim(name: u64, address: u8) -> AddressClaim {
    AddressClaim::new(Name(name), address, 100)
}

#[test]
fn an_address_may_be_used_250_ms_after_the_claim() {
    let mut rig = Rig::new(vec![claim(7, 0x27)]);
    rig.run_ms(250);
    assert_eq!(rig.addresses(), [None]);
    rig.run_ms(1);
    assert_eq!(rig.addresses(), [Some(0x27)]);
    assert_eq!(rig.claims(), [(2, 0x27, 7)]);
}

#[test]
fn the_smaller_name_keeps_the_address_and_the_other_says_that_it_cannot() {
    let mut rig = Rig::new(vec![claim(9, 0x27), claim(7, 0x27)]);
    rig.run_ms(400);
    assert_eq!(rig.addresses(), [None, Some(0x27)]);
    let lost: Vec<_> = rig.claims().into_iter().filter(|(_, sa, _)| *sa == NULL_ADDRESS).collect();
    // 100 steps of 0.6 ms after the claim that beat it
    let [(at, _, 9)] = lost[..] else { panic!("{lost:?}") };
    assert!((60..=64).contains(&at), "{at}");
    assert_eq!(rig.nodes[0].0.state(), ClaimState::Lost);
}

#[test]
fn who_can_choose_takes_the_next_free_address() {
    let taken = [128, 129].map(|a| claim(u64::from(a), a));
    let chooser = claim(CAN_CHOOSE | 9, 129);
    let mut rig = Rig::new(taken.into_iter().chain([chooser]).collect());
    rig.run_ms(600);
    assert_eq!(rig.addresses(), [Some(128), Some(129), Some(130)]);
}

#[test]
fn a_late_claim_is_defended_against_or_lost_to() {
    let mut rig = Rig::new(vec![claim(7, 0x27)]);
    rig.run_ms(300);
    rig.claims();
    rig.say(Name(9).claim(0x27));
    rig.run_ms(5);
    assert_eq!(rig.claims().len(), 1, "the claim is repeated");
    assert_eq!(rig.addresses(), [Some(0x27)]);
    rig.say(Name(3).claim(0x27));
    rig.run_ms(5);
    assert_eq!(rig.addresses(), [None]);
    rig.run_ms(100);
    assert_eq!(rig.claims().iter().map(|c| c.1).collect::<Vec<_>>(), [NULL_ADDRESS]);
}

#[test]
fn a_name_of_zero_is_not_yielded_to() {
    let mut rig = Rig::new(vec![claim(7, 0)]);
    rig.run_ms(300);
    rig.claims();
    // as in the recorded attack on an engine
    rig.say(Name(0).claim(0));
    rig.run_ms(5);
    assert_eq!(rig.addresses(), [Some(0)]);
    assert_eq!(rig.claims().len(), 1);
}

#[test]
fn requests_for_claims_are_answered_with_or_without_an_address() {
    let mut rig = Rig::new(vec![claim(9, 0x27), claim(7, 0x27), claim(8, 0x28)]);
    rig.run_ms(400);
    rig.claims();
    let request = |da| Request { pgn: ADDRESS_CLAIMED_PGN, da, sa: NULL_ADDRESS }.frame().unwrap();
    rig.say(request(GLOBAL_ADDRESS));
    rig.run_ms(100);
    let mut claims: Vec<_> = rig.claims().iter().map(|c| (c.1, c.2)).collect();
    claims.sort_unstable();
    assert_eq!(claims, [(0x27, 7), (0x28, 8), (NULL_ADDRESS, 9)]);
    rig.say(request(0x28));
    rig.run_ms(100);
    assert_eq!(rig.claims().iter().map(|c| c.1).collect::<Vec<_>>(), [0x28]);
}

#[test]
fn a_commanded_address_is_claimed_by_its_name_alone() {
    let mut rig = Rig::new(vec![claim(7, 0x27), claim(8, 0x28)]);
    rig.run_ms(300);
    let mut bytes = [0; 9];
    bytes[..8].copy_from_slice(&7_u64.to_le_bytes());
    bytes[8] = 0x30;
    let command =
        TpMessage { time: Time(0), pgn: COMMANDED_ADDRESS_PGN, da: 0xFF, sa: 1, bytes: &bytes };
    for (claim, _) in &mut rig.nodes {
        claim.on_message(&command);
    }
    assert_eq!(rig.addresses(), [None, Some(0x28)]);
    rig.run_ms(252);
    assert_eq!(rig.addresses(), [Some(0x30), Some(0x28)]);
    // an address that nobody can have is refused
    let nobody = [7, 0, 0, 0, 0, 0, 0, 0, NULL_ADDRESS];
    rig.nodes[0].0.on_message(&TpMessage { bytes: &nobody, ..command });
    assert_eq!(rig.addresses()[0], Some(0x30));
}

#[test]
fn a_bypassed_node_says_nothing() {
    let mut rig = Rig::new(vec![AddressClaim::bypass(Name(7), 0x27)]);
    assert_eq!(rig.addresses(), [Some(0x27)]);
    rig.say(Name(3).claim(0x27));
    rig.say(Request { pgn: ADDRESS_CLAIMED_PGN, da: 0xFF, sa: 1 }.frame().unwrap());
    rig.run_ms(300);
    assert_eq!((rig.addresses(), rig.claims()), (vec![Some(0x27)], vec![]));
}

#[test]
fn the_fields_of_a_name() {
    // can-j1939's example: maker 666, function 1, identity 1234567, arbitrary address
    let name = Name(1 << 63 | 1 << 40 | 666 << 21 | 1_234_567);
    assert!(name.can_choose());
    assert_eq!((name.function(), name.manufacturer(), name.identity()), (1, 666, 1_234_567));
}

proptest! {
    #[test]
    fn any_frames_leave_a_node_with_one_address_or_none(
        frames in proptest::collection::vec((any::<bool>(), any::<u32>(), any::<[u8; 8]>(), 0_usize..9), 0..200),
        name in any::<u64>(), address in any::<u8>(), step_ms in 0_i64..300,
    ) {
        let bus = Loopback::new(BitRate::Kbit250, 2);
        let (mut node, mut listener) = (bus.node(0), bus.node(1));
        let mut claim = AddressClaim::new(Name(name), address, 5);
        let mut now = Time(0);
        for (network, raw, data, len) in frames {
            now = now.plus_nanos(step_ms * MS);
            let pgn = if raw & 1 == 0 { ADDRESS_CLAIMED_PGN } else { REQUEST_PGN };
            let raw = if network { raw & 0x1C00_FFFF | pgn << 8 } else { raw };
            claim.on_frame(now, &Frame::new(Id::from_raw(raw), &data[..len]).unwrap());
            claim.on_message(&TpMessage { time: now, pgn: raw, da: 0xFF, sa: 0, bytes: &data[..len] });
            claim.poll(now, &mut node).unwrap();
            prop_assert!(claim.address().is_none_or(|a| a < NULL_ADDRESS));
            while let Some(heard) = listener.receive(now).unwrap() {
                prop_assert_eq!(Name::claimed_in(&heard.value), Some(Name(name)));
            }
        }
    }
}
