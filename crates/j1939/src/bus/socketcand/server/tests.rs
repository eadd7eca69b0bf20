#![allow(clippy::disallowed_methods, reason = "the other end of a socket")]

use std::io::{Read, Write};
use std::net::TcpStream;

use super::*;
use crate::bus::loopback::{Loopback, LoopbackNode};
use crate::bus::socketcand::Client;
use crate::{BitRate, Id};

const MS: i64 = 1_000_000;

fn server() -> (Loopback, Server<LoopbackNode>, String) {
    let bus = Loopback::new(BitRate::Kbit500, 2);
    let server = Server::bind("127.0.0.1:0", "can0", bus.node(0)).unwrap();
    let address = server.address().unwrap().to_string();
    (bus, server, address)
}

/// Connects while the server is polled.
fn connect(
    server: &mut Server<LoopbackNode>,
    address: &str,
    interface: &str,
) -> Result<Client, BusError> {
    std::thread::scope(|scope| {
        let client = scope.spawn(|| Client::connect(address, interface));
        while !client.is_finished() {
            server.poll(Time(0)).unwrap();
            std::thread::yield_now();
        }
        client.join().unwrap()
    })
}

/// Polls until `done`, with a bound.
fn until(
    server: &mut Server<LoopbackNode>,
    now: &mut i64,
    mut done: impl FnMut(&mut Server<LoopbackNode>, Time) -> bool,
) {
    for _ in 0..100_000 {
        *now += MS / 10;
        server.poll(Time(*now)).unwrap();
        if done(server, Time(*now)) {
            return;
        }
        std::thread::yield_now();
    }
    panic!("nothing came");
}

fn frame(n: u8) -> Frame {
    Frame::new(Id::from_raw(0x18EF_2700 | u32::from(n)), &[n; 5]).unwrap()
}

#[test]
fn programs_hear_each_other_and_the_bus() {
    let (bus, mut server, address) = server();
    let mut a = connect(&mut server, &address, "can0").unwrap();
    let mut b = connect(&mut server, &address, "can0").unwrap();
    let mut node = bus.node(1);
    let mut now = 0;
    a.send(Time(0), &frame(1)).unwrap();
    until(&mut server, &mut now, |_, t| b.receive(t).unwrap().is_some_and(|h| h.value == frame(1)));
    until(&mut server, &mut now, |_, t| {
        node.receive(t).unwrap().is_some_and(|h| h.value == frame(1))
    });
    assert_eq!(a.receive(Time(now)), Ok(None), "own frames are not heard");
    node.send(Time(now), &frame(2)).unwrap();
    until(&mut server, &mut now, |_, t| a.receive(t).unwrap().is_some_and(|h| h.value == frame(2)));
    until(&mut server, &mut now, |_, t| b.receive(t).unwrap().is_some_and(|h| h.value == frame(2)));
    drop(a);
    until(&mut server, &mut now, |s, _| s.clients() == 1);
    drop(server);
    let closed = (0..100_000).find_map(|_| b.receive(Time(0)).err()).unwrap().to_string();
    assert!(closed.contains("/can0: "), "{closed}");
}

#[test]
fn what_a_program_says_before_it_goes_is_sent() {
    let (bus, mut server, address) = server();
    let mut stream = TcpStream::connect(&address).unwrap();
    stream.write_all(b"< open can0 >< rawmode >< send 18EAFFFE 3 0 ee 0 >").unwrap();
    drop(stream);
    let mut node = bus.node(1);
    until(&mut server, &mut 0, |_, t| node.receive(t).unwrap().is_some());
}

#[test]
fn what_is_not_there_is_named() {
    let (_bus, mut server, address) = server();
    let error = connect(&mut server, &address, "can7").unwrap_err().to_string();
    assert!(error.contains("/can7: ") && error.contains("no interface"), "{error}");
    let error = Client::connect(&address, "can0; rm").unwrap_err().to_string();
    assert!(error.contains("letters and digits"), "{error}");
    drop(server);
    let error = Client::connect(&address, "can0").unwrap_err().to_string();
    assert!(error.starts_with(&address), "{error}");
}

#[test]
fn programs_that_misbehave_are_disconnected_and_their_number_is_bounded() {
    let (_bus, mut server, address) = server();
    let mut now = 0;
    for words in [
        "< send 18EAFFFE 3 0 ee 0 >".to_owned(),
        "< rawmode >< format disk >".to_owned(),
        "< rawmode >< send xyz 1 0 >".to_owned(),
        "x".repeat(1_000),
        "\u{7}< rawmode >".to_owned(),
    ] {
        let mut stream = TcpStream::connect(&address).unwrap();
        until(&mut server, &mut now, |s, _| s.clients() == 1);
        stream.write_all(words.as_bytes()).unwrap();
        until(&mut server, &mut now, |s, _| s.clients() == 0);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        assert!(String::from_utf8_lossy(&answer).starts_with("< hi >"));
    }
    let streams: Vec<_> = (0..CLIENTS + 2).map(|_| TcpStream::connect(&address).unwrap()).collect();
    until(&mut server, &mut now, |s, _| s.turned_away() == 2);
    assert_eq!((server.clients(), streams.len()), (CLIENTS, CLIENTS + 2));
}

#[test]
fn a_program_that_does_not_read_is_disconnected() {
    let (bus, mut server, address) = server();
    let mut now = 0;
    let mut stream = TcpStream::connect(&address).unwrap();
    stream.write_all(b"< open can0 >< rawmode >").unwrap();
    until(&mut server, &mut now, |s, _| s.clients.first().is_some_and(|c| c.raw));
    let mut node = bus.node(1);
    for _ in 0..1_000_000 {
        now += 300_000;
        node.send(Time(now), &frame(1)).unwrap();
        server.poll(Time(now)).unwrap();
        if server.clients() == 0 {
            return;
        }
    }
    panic!("it was kept for ever");
}
