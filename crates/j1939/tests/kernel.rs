//! Against the J1939 stack of the Linux kernel, and over its CAN sockets.
//!
//! They need `vcan0` and `vcan1` (CAN FD), the kernel's `can-j1939` and can-utils:
//! `tests/can/uml.sh` runs them in User-Mode Linux. Every wait is for an event, with a bound.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, clippy::panic, clippy::disallowed_methods, reason = "a test waits")]

mod wall;

use std::path::PathBuf;
use std::process::Command;
use std::time::{Duration, Instant};

use j1939::bus::{Bus, BusError, socketcan::SocketCan};
use j1939::{ADDRESS_CLAIMED_PGN, AddressClaim, Frame, Id, Name, REQUEST_PGN, Request};
use tractrix_core::Time;
use wall::{Node, PATIENCE, Seen, Tool};

/// A parameter group with a destination on the second data page, as in the kernel's own examples.
const PGN: u32 = 0x1_2300;
const OURS: u8 = 0x90;
const KERNELS: u8 = 0x80;

fn vcan0() -> SocketCan {
    SocketCan::open("vcan0", &[]).unwrap()
}

/// A node that need not claim.
fn with_address() -> Node<SocketCan> {
    Node::new(vcan0(), AddressClaim::bypass(Name(7), OURS))
}

fn receive(node: &mut Node<SocketCan>, expected: &[u8]) {
    node.until("a message of the kernel", |_, seen| match seen {
        Seen::Received { pgn, sa, bytes } => {
            assert_eq!((pgn, sa, bytes.len()), (PGN, KERNELS, expected.len()));
            assert!(bytes == expected, "the bytes differ");
            true
        }
        Seen::Failed(why) => panic!("{why}"),
        _ => false,
    });
}

fn text(len: usize) -> Vec<u8> {
    (0..len).map(|i| (i * 7 + i / 256) as u8).collect()
}

/// A file with those bytes; the folder of temporary files is in memory there.
fn file_of(bytes: &[u8]) -> PathBuf {
    let path = std::env::temp_dir().join(format!("bytes-{}", bytes.len()));
    std::fs::write(&path, bytes).unwrap();
    path
}

/// The kernel sends to us; its tool reports an error of its own afterwards, the bytes count.
fn kernel_sends(len: usize, broadcast: bool) {
    let mut node = with_address();
    let file = file_of(&text(len));
    let file = file.to_str().unwrap();
    let _tool = if broadcast {
        Tool::start(&["j1939cat", "-B", "-i", file, "vcan0:0x80", ":,0x12300"])
    } else {
        Tool::start(&["j1939cat", "-i", file, "vcan0:0x80", ":0x90,0x12300"])
    };
    receive(&mut node, &text(len));
}

/// We send to the kernel: again while its tool is not listening yet.
fn kernel_receives(len: usize, broadcast: bool) {
    let mut node = with_address();
    let tool = Tool::start(&["j1939cat", "-B", "-r", "vcan0:0x80"]);
    let da = if broadcast { 0xFF } else { KERNELS };
    let start = Instant::now();
    let mut got = Vec::new();
    while start.elapsed() < PATIENCE {
        node.transport.send(node.now(), 6, PGN, da, &text(len)).unwrap();
        let mut sent = false;
        node.until("the end of our message", |_, seen| match seen {
            Seen::Sent => {
                sent = true;
                true
            }
            Seen::Failed(_) => true,
            _ => false,
        });
        // what is acknowledged is with the tool in a moment; a broadcast may have found nobody
        let wait = if broadcast { Duration::from_secs(1) } else { PATIENCE };
        while sent && got.len() < len {
            match tool.output.recv_timeout(wait) {
                Ok(byte) => got.push(byte),
                Err(_) => break,
            }
        }
        if got.len() == len {
            assert!(got == text(len), "the bytes differ");
            return;
        }
        assert!(got.is_empty(), "{} of {len} bytes", got.len());
    }
    panic!("the kernel did not take {len} bytes");
}

#[test]
#[ignore = "needs CAN sockets: tests/can/uml.sh"]
fn frames_between_sockets_are_all_there_and_own_ones_are_not() {
    let mut a = vcan0();
    let mut b = SocketCan::open("vcan0", &[]).unwrap();
    let mut filtered = SocketCan::open("vcan0", &[REQUEST_PGN]).unwrap();
    let now = Time(1_000_000_000);
    let frame = |n: u32| Frame::of(Id::from_raw(0x18EF_0000), u64::from(n).to_le_bytes());
    let request = Request { pgn: ADDRESS_CLAIMED_PGN, da: 0xFF, sa: 0xFE }.frame().unwrap();
    let mut heard = Vec::new();
    for n in 0..20_000 {
        while let Err(error) = a.send(now, &frame(n)) {
            assert!(matches!(error, BusError::Full(_)), "{error}");
        }
        while let Some(h) = b.receive(now).unwrap() {
            assert!(h.time <= now && h.time.seconds_since(now) > -1.0);
            heard.push(h.value);
        }
    }
    a.send(now, &request).unwrap();
    let last = (0..1_000_000).find_map(|_| b.receive(now).unwrap());
    assert_eq!(heard.len(), 20_000);
    assert!(heard.iter().zip(0..).all(|(f, n)| *f == frame(n)));
    assert_eq!(last.map(|h| h.value), Some(request));
    assert_eq!(a.receive(now), Ok(None), "own frames are not heard");
    assert_eq!(filtered.receive(now).unwrap().map(|h| h.value), Some(request));
    assert_eq!(filtered.receive(now), Ok(None));
    assert_eq!((a.counts().dropped, b.counts().dropped), (0, 0));
}

#[test]
#[ignore = "needs CAN sockets: tests/can/uml.sh"]
fn what_the_kernel_drops_is_counted_and_other_frames_are_skipped() {
    let mut sender = SocketCan::open("vcan0", &[]).unwrap();
    let mut slow = SocketCan::open("vcan0", &[]).unwrap();
    let frame = Frame::of(Id::from_raw(0x18EF_0000), [1; 8]);
    let now = Time(0);
    for _ in 0..20_000 {
        while sender.send(now, &frame).is_err() {}
    }
    let mut heard = 0;
    while slow.receive(now).unwrap().is_some() {
        heard += 1;
    }
    // the counter comes with the next frame
    sender.send(now, &frame).unwrap();
    assert!(slow.receive(now).unwrap().is_some());
    assert!(heard < 20_000, "the socket had room for all of them");
    assert_eq!(heard + slow.counts().dropped, 20_000);
    for words in [["vcan0", "123#00"], ["vcan0", "18F00E00#R"]] {
        assert!(Command::new("cansend").args(words).status().unwrap().success());
    }
    assert_eq!(slow.receive(now), Ok(None));
    assert_eq!(slow.counts().skipped, 2);
}

#[test]
#[ignore = "needs CAN sockets: tests/can/uml.sh"]
fn a_bus_that_cannot_be_used_is_named() {
    let error = SocketCan::open("nosuch0", &[]).unwrap_err().to_string();
    assert!(error.starts_with("nosuch0: no such CAN interface"), "{error}");
    let error = SocketCan::open("vcan2", &[]).unwrap_err().to_string();
    assert!(error.starts_with("vcan2: the interface is down"), "{error}");
    let mut bus = SocketCan::open("vcan1", &[]).unwrap();
    let words = ["vcan1", "18F00E00##1000102030405060708090A0B"];
    assert!(Command::new("cansend").args(words).status().unwrap().success());
    let error = bus.receive(Time(0)).unwrap_err().to_string();
    assert!(error.starts_with("vcan1: CAN FD"), "{error}");
}

#[test]
#[ignore = "needs CAN sockets: tests/can/uml.sh"]
fn the_kernel_sends_1785_bytes_to_us() {
    kernel_sends(1785, false);
}

#[test]
#[ignore = "needs CAN sockets: tests/can/uml.sh"]
fn the_kernel_receives_1785_bytes_of_us() {
    kernel_receives(1785, false);
}

#[test]
#[ignore = "needs CAN sockets: tests/can/uml.sh"]
fn the_kernel_broadcasts_to_us() {
    kernel_sends(100, true);
}

#[test]
#[ignore = "needs CAN sockets: tests/can/uml.sh"]
fn the_kernel_hears_our_broadcast() {
    kernel_receives(100, true);
}

#[test]
#[ignore = "needs CAN sockets: tests/can/uml.sh"]
fn the_kernel_sends_20000_bytes_to_us_by_etp() {
    kernel_sends(20_000, false);
}

#[test]
#[ignore = "needs CAN sockets: tests/can/uml.sh"]
fn the_kernel_receives_20000_bytes_of_us_by_etp() {
    kernel_receives(20_000, false);
}

#[test]
#[ignore = "needs CAN sockets: tests/can/uml.sh"]
fn j1939acd_respects_a_smaller_name_and_takes_from_a_larger() {
    let acd = |range: &str| Tool::start(&["j1939acd", "-r", range, "1100", "vcan0"]);
    let claims = |of: &Seen| match of {
        Seen::Frame(frame) => Name::claimed_in(frame).map(|name| (name.0, frame.id().sa())),
        _ => None,
    };
    // ours is smaller and there first: the daemon takes the other address
    let mut node = Node::new(vcan0(), AddressClaim::new(Name(0x10), 128, 0));
    node.until("our own address", |node, _| node.claim.address() == Some(128));
    let tool = acd("128,129");
    node.until("a claim of another address", |_, seen| claims(&seen) == Some((0x1100, 129)));
    assert_eq!(node.claim.address(), Some(128));
    drop((tool, node));
    // ours is larger and can choose: the daemon takes it, and we take the next
    let mut node = Node::new(vcan0(), AddressClaim::new(Name(1 << 63 | 5), 128, 0));
    node.until("our own address", |node, _| node.claim.address() == Some(128));
    let _tool = acd("128");
    node.until("a claim of our address", |_, seen| claims(&seen) == Some((0x1100, 128)));
    node.until("another address", |node, _| node.claim.address() == Some(129));
}
