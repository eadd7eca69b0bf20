//! A fake TraCI server that misbehaves: every fault gives a typed error in bounded time, and the
//! link refuses to go on with the first cause.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::time::Duration;

use traffic_client::sumo::codec::{Value, Writer};
use traffic_client::sumo::session::{Answer, id, var};
use traffic_client::sumo::tcp::PortClaim;
use traffic_client::sumo::{Link, Programs, SumoError, Timeouts};

const QUICK: Timeouts = Timeouts { startup_s: 5.0, answer_s: 0.3 };

/// Starts a server that handles one connection with `serve`.
fn server(serve: impl FnOnce(TcpStream) + Send + 'static) -> u16 {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    std::thread::spawn(move || serve(listener.accept().unwrap().0));
    port
}

fn request(stream: &mut TcpStream) -> Option<Vec<u8>> {
    let mut head = [0; 4];
    stream.read_exact(&mut head).ok()?;
    let mut body = vec![0; u32::from_be_bytes(head) as usize - 4];
    stream.read_exact(&mut body).ok()?;
    Some(body)
}

fn status(w: &mut Writer, command: u8, result: u8, text: &str) {
    w.begin(command).u8(result).str(text).end();
}

fn version(api: i32) -> Vec<u8> {
    let mut w = Writer::default();
    w.clear();
    status(&mut w, id::VERSION, 0, "");
    w.begin(id::VERSION).i32(api).str("SUMO fake").end();
    w.message().to_vec()
}

/// The answer to a step, with one vehicle seen by the ego.
fn step() -> Vec<u8> {
    let mut w = Writer::default();
    w.clear();
    status(&mut w, id::STEP, 0, "");
    let mut sub = Writer::default();
    sub.clear();
    sub.begin(0x94).str("ego").u8(0xa4).u8(5).i32(1).str("car.7");
    sub.u8(var::POSITION).u8(0).u8(0x01).f64(12.0).f64(-3.0);
    for (variable, x) in [
        (var::SPEED, 20.0),
        (var::ANGLE, 90.0),
        (var::ACCELERATION, -1.0),
        (var::LATERAL_SPEED, 0.25),
    ] {
        sub.u8(variable).u8(0).u8(0x0b).f64(x);
    }
    sub.end();
    let mut message = w.message().to_vec();
    message.extend_from_slice(&1i32.to_be_bytes());
    message.extend_from_slice(&sub.message()[4..]);
    let n = message.len() as u32;
    message[..4].copy_from_slice(&n.to_be_bytes());
    message
}

/// Greets well, then answers the next request with these bytes and closes.
fn link_then(answer: Vec<u8>) -> Link {
    let port = server(move |mut s| {
        request(&mut s).unwrap();
        s.write_all(&version(22)).unwrap();
        request(&mut s);
        s.write_all(&answer).unwrap();
    });
    Link::attach(port, QUICK).unwrap()
}

fn step_error(answer: Vec<u8>) -> SumoError {
    let mut link = link_then(answer);
    link.session.request().step();
    let e = link.exchange("step").unwrap_err();
    link.session.request().step();
    assert!(
        matches!(link.exchange("step"), Err(SumoError::Poisoned { .. })),
        "not poisoned by {e}"
    );
    e
}

#[test]
fn a_good_answer_in_single_bytes_is_understood() {
    let port = server(|mut s| {
        request(&mut s).unwrap();
        for b in version(20) {
            s.write_all(&[b]).unwrap();
            s.flush().unwrap();
        }
        request(&mut s).unwrap();
        for chunk in step().chunks(7) {
            s.write_all(chunk).unwrap();
            std::thread::sleep(Duration::from_millis(1));
        }
        request(&mut s);
    });
    let mut link = Link::attach(port, QUICK).unwrap();
    assert_eq!((link.api, link.name.as_str()), (20, "SUMO fake"));
    link.session.request().step();
    link.exchange("step").unwrap();
    let seen = link.session.seen[0];
    assert_eq!(link.session.name(seen.handle), "car.7");
    assert_eq!((seen.x_m, seen.y_m, seen.speed_m_s, seen.angle_deg), (12.0, -3.0, 20.0, 90.0));
    assert_eq!((seen.accel_m_s2, seen.lateral_speed_m_s), (-1.0, 0.25));
}

#[test]
fn an_unknown_version_is_refused_by_name() {
    let port = server(|mut s| {
        request(&mut s).unwrap();
        s.write_all(&version(35)).unwrap();
        request(&mut s);
    });
    let e = Link::attach(port, QUICK).unwrap_err();
    assert!(
        matches!(&e, SumoError::Version { api: 35, .. }) && e.to_string().contains("SUMO fake")
    );
}

#[test]
fn an_end_in_the_middle_of_a_message_is_a_disconnection() {
    let mut half = step();
    half.truncate(20);
    assert!(matches!(step_error(half), SumoError::Disconnected { .. }));
    assert!(matches!(step_error(Vec::new()), SumoError::Disconnected { .. }));
}

#[test]
fn an_end_before_the_version_is_a_failed_start() {
    let port = server(|mut s| {
        request(&mut s);
    });
    assert!(matches!(Link::attach(port, QUICK), Err(SumoError::Startup { .. })));
}

#[test]
fn a_server_that_stalls_is_given_up_after_the_timeout() {
    let port = server(|mut s| {
        request(&mut s).unwrap();
        s.write_all(&version(22)).unwrap();
        request(&mut s).unwrap();
        // Dribbles, so that single reads succeed, but never finishes the message.
        for b in step().iter().take(30) {
            let _ = s.write_all(&[*b]);
            std::thread::sleep(Duration::from_millis(50));
        }
    });
    let mut link = Link::attach(port, QUICK).unwrap();
    link.session.request().step();
    let e = link.exchange("step").unwrap_err();
    assert!(matches!(e, SumoError::Timeout { operation: "step", .. }), "{e}");
    assert!(e.is_retryable());
}

#[test]
fn answers_in_the_wrong_order_are_a_protocol_error() {
    let mut w = Writer::default();
    w.clear();
    status(&mut w, id::GET | id::VEHICLE, 0, "");
    assert!(matches!(step_error(w.message().to_vec()), SumoError::Protocol(_)));
}

#[test]
fn oversized_and_undersized_lengths_are_protocol_errors() {
    for length in [u32::MAX, 0x7fff_ffff, 0, 3] {
        let e = step_error(length.to_be_bytes().to_vec());
        assert!(matches!(e, SumoError::Protocol(_)), "{length}: {e}");
    }
    // A count that the message cannot hold.
    let mut bad = step();
    let at = bad.len() - step().len() + 4 + 12;
    bad[at..at + 4].copy_from_slice(&i32::MAX.to_be_bytes());
    assert!(matches!(step_error(bad), SumoError::Protocol(_)));
}

#[test]
fn more_answers_than_questions_are_a_protocol_error() {
    let mut long = step();
    long.extend_from_slice(&[7, id::STEP, 0, 0, 0, 0, 0]);
    let n = long.len() as u32;
    long[..4].copy_from_slice(&n.to_be_bytes());
    assert!(matches!(step_error(long), SumoError::Protocol(_)));
}

#[test]
fn a_refused_command_does_not_spoil_the_rest_of_the_batch_or_the_link() {
    let mut w = Writer::default();
    w.clear();
    status(&mut w, id::SET | id::VEHICLE, 0xff, "Vehicle 'x' is not known");
    status(&mut w, id::GET | id::SIMULATION, 0, "");
    w.begin(0xbb).u8(var::TIME).str("").value(&Value::Double(4.5)).end();
    let mut link = link_then(w.message().to_vec());
    link.session.request().move_to_xy("x", 0.0, 0.0, 0.0).get(id::SIMULATION, var::TIME, "");
    link.exchange("move").unwrap();
    assert_eq!(link.session.answers[1], Answer::Value(Value::Double(4.5)));
    let e = link.session.refusal("x").unwrap();
    assert!(!e.is_fatal() && e.to_string().contains("not known"), "{e}");
    assert!(!link.is_poisoned());
}

/// A program that is not SUMO was started, waited for and left unnamed.
#[test]
fn a_program_that_is_not_sumo_is_named_with_what_it_printed() {
    let folder = std::env::temp_dir().join(format!("tractrix-{}-not-sumo", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join("sumo");
    for (script, said) in [
        ("#!/bin/sh\nexec /bin/echo I am a calendar\n", "`I am a calendar`"),
        ("#!/bin/sh\necho no such library >&2; exit 127\n", "`no such library`"),
        ("#!/bin/sh\nexit 3\n", "printed nothing"),
    ] {
        std::fs::write(&file, script).unwrap();
        let runs = std::os::unix::fs::PermissionsExt::from_mode(0o755);
        std::fs::set_permissions(&file, runs).unwrap();
        let e = Programs::find(Some(&file)).unwrap_err().to_string();
        assert!(e.contains(&file.display().to_string()) && e.contains("eclipse-sumo"), "{e}");
        assert!(e.contains(said), "{e}");
    }
    for (program, said) in [("/bin/true", "GNU"), ("/bin/sh", "printed")] {
        let e = Programs::find(Some(std::path::Path::new(program))).unwrap_err().to_string();
        assert!(e.contains(program) && e.contains(said), "{e}");
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

/// Two worlds that began at the same time were given one port, one after the other, and each drove
/// in the other's SUMO: the second connected to the SUMO of the first, which then closed the port
/// for the SUMO of the second. Once in some hundred runs of all tests.
#[test]
fn a_port_is_nobody_elses_from_its_choice_until_sumo_listens_there() {
    let claim = PortClaim::new().unwrap();
    for _ in 0..100_000 {
        let other = TcpListener::bind("127.0.0.1:0").unwrap();
        assert_ne!(other.local_addr().unwrap().port(), claim.port);
    }
    let sumo = TcpListener::bind(("127.0.0.1", claim.port)).unwrap();
    assert!(TcpStream::connect(("127.0.0.1", claim.port)).is_ok());
    drop(sumo);
}
