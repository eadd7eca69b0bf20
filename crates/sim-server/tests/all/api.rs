//! The HTTP API as a client meets it: answers and refusals are JSON, in the API's own words.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use crate::support::run::Run;
use crate::support::serving::refusal;
use crate::support::{client, program};
use serde_json::Value;

#[test]
fn refusals_are_json_with_a_code_and_words_of_the_api() {
    let run = Run::start(&[]);
    refusal(&run.control("nonsense"), 400, "not_an_object", "JSON object");
    refusal(&run.control(r#"{"action": "fly"}"#), 400, "unknown_action", "fly");
    refusal(&run.control(r#"{"action": "step"}"#), 400, "missing_key", "ticks");
    refusal(&run.control(r#"{"action": "pace", "pace": -1}"#), 400, "wrong_value", "pace = -1");
    refusal(&run.ask("POST", "/api/v1/control", "", b"\xff\xfe"), 400, "not_an_object", "JSON");
    refusal(&run.ask("GET", "/api/v1/nothing", "", b""), 404, "not_found", "/api/v1/nothing");
    refusal(&run.ask("GET", "/api/v1/control", "", b""), 405, "method_not_allowed", "GET");
    let evil = "Host: evil.example\r\n";
    refusal(&run.ask("GET", "/api/v1/state", evil, b""), 403, "foreign_page", "this server");
    let long = "Content-Length: 9000000\r\n";
    refusal(&run.ask("POST", "/api/v1/control", long, b""), 413, "body_not_read", "too long");
    for kind in ["text/plain", "application/x-www-form-urlencoded", "application/jsonx"] {
        let kind = format!("Content-Type: {kind}\r\n");
        let form = run.ask("POST", "/api/v1/control", &kind, br#"{"action": "pause"}"#);
        refusal(&form, 415, "not_json", "application/json");
    }
    for headers in ["Origin: null\r\n", "Sec-Fetch-Site: cross-site\r\n"] {
        let elsewhere = run.ask("POST", "/api/v1/control", headers, br#"{"action": "pause"}"#);
        refusal(&elsewhere, 403, "foreign_page", "this server");
    }
}

/// A connection on which a head is sent as it is.
fn sent(run: &Run, head: &str) -> TcpStream {
    let mut stream = TcpStream::connect(&run.serving.address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    stream.write_all(head.as_bytes()).unwrap();
    stream
}

/// The first line of an answer; empty where the server has closed the connection.
fn first_line(stream: &mut TcpStream) -> String {
    let mut line = String::new();
    // A connection that is turned away may be reset behind its answer
    let _ = BufReader::new(stream).read_line(&mut line);
    line
}

/// 500 sockets that said nothing were kept for ever.
#[test]
fn silent_clients_cannot_keep_others_out() {
    let run = Run::start(&[]);
    let mut idle: Vec<_> = (0..64).map(|_| sent(&run, "")).collect();
    let slow = "POST /api/v1/control HTTP/1.1\r\nHost: localhost\r\nContent-Length: 9\r\n";
    idle[0].write_all(slow.as_bytes()).unwrap();
    let turned_away = (0..100).any(|_| first_line(&mut sent(&run, "")).contains(" 503 "));
    assert!(turned_away, "the 65th");
    for stream in &mut idle {
        assert_eq!(first_line(stream), "", "none of them said what it wants");
    }
    let body = format!("{slow}Content-Type: application/json\r\n\r\n{{");
    let mut late = sent(&run, &body);
    assert_eq!(run.state()["schema"], 1);
    assert!(first_line(&mut late).contains(" 408 "), "a body that does not come");
}

/// The paths of a session are those without one, as long as there is one session.
#[test]
fn the_one_session_is_listed_and_others_are_not_there() {
    let run = Run::start(&["--seed", "11", "--pace", "max"]);
    run.act(r#"{"action": "pause"}"#);
    let (_, all) = run.ask("GET", "/api/v1/sessions", "", b"");
    let (status, one) = run.ask("GET", "/api/v1/sessions/default", "", b"");
    assert_eq!((status, &all["sessions"]), (200, &serde_json::json!([one])));
    assert_eq!((&one["seed"], &one["state"]), (&11.into(), &"paused".into()));
    assert_eq!(one["scenario"], "flat");
    let path = |what: &str| format!("/api/v1/sessions/default/{what}");
    assert_eq!(run.ask("GET", &path("state"), "", b"").1["run_id"], run.state()["run_id"]);
    let step = br#"{"action": "step", "ticks": 5, "wait": true}"#;
    assert_eq!(run.ask("POST", &path("control"), "", step).0, 200);
    for missing in ["", "/state", "/control", "/road"] {
        let other = format!("/api/v1/sessions/other{missing}");
        let method = if missing == "/control" { "POST" } else { "GET" };
        refusal(&run.ask(method, &other, "", b"{}"), 404, "no_session", "\"other\"");
    }
    refusal(&run.ask("GET", &path("nothing"), "", b""), 404, "not_found", "nothing");
}

/// The body of an answer of any kind.
fn text(run: &Run, path: &str) -> String {
    client::text(&run.serving.address, path)
}

#[test]
fn a_monitor_can_ask_how_the_run_goes() {
    let run = Run::start(&["--pace", "max"]);
    run.act(r#"{"action": "pause"}"#);
    run.act(r#"{"action": "reset"}"#);
    let stands = (0..300).any(|_| {
        std::thread::sleep(Duration::from_millis(20));
        run.state()["time_s"] == 0.0
    });
    assert!(stands, "a run that stands at its start is seen");
    let before = counted(&run, "tractrix_ticks_total");
    run.act(r#"{"action": "step", "ticks": 150, "wait": true}"#);
    assert_eq!(counted(&run, "tractrix_ticks_total"), before + 150.0);
    assert_eq!(counted(&run, "tractrix_tick_time_seconds_count"), before + 150.0);
    let seconds = counted(&run, "tractrix_tick_time_seconds_sum");
    assert!(seconds > 0.0 && seconds < 60.0, "{seconds}");
    assert_eq!(counted(&run, "tractrix_viewers"), 0.0);
    assert!(run.state()["time_s"].is_number());
    assert_eq!(run.ask("GET", "/api/v1/ready", "", b"").0, 200);
    assert!(text(&run, "/api/v1/metrics").trim_end().ends_with("# EOF"));
}

/// The value of a metric.
fn counted(run: &Run, name: &str) -> f64 {
    let answer = text(run, "/api/v1/metrics");
    let line = answer
        .lines()
        .find_map(|line| line.strip_prefix(name)?.strip_prefix("{session=\"default\"} "));
    line.unwrap_or_else(|| panic!("{name}: {answer}")).parse().unwrap()
}

/// 300 viewers that took nothing were kept for ever.
#[test]
fn viewers_have_sixteen_places_and_listen() {
    let run = Run::start(&[]);
    let handshake = format!(
        "GET /ws HTTP/1.1\r\nHost: {}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
         Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n",
        run.serving.address
    );
    let mut viewers: Vec<_> = (0..16).map(|_| sent(&run, &handshake)).collect();
    for viewer in &mut viewers {
        assert!(first_line(viewer).contains(" 101 "));
    }
    assert!(first_line(&mut sent(&run, &handshake)).contains(" 429 "), "the 17th");
    // A masked text frame of 5,000 bytes
    let head = [0x81, 0x80 | 126, 0x13, 0x88, 0, 0, 0, 0];
    viewers[0].write_all(&[&head[..], &[b'x'; 5_000]].concat()).unwrap();
    let again = (0..600).any(|_| {
        std::thread::sleep(Duration::from_millis(50));
        first_line(&mut sent(&run, &handshake)).contains(" 101 ")
    });
    assert!(again, "who talks too much leaves a place");
}

#[test]
fn browsers_are_told_what_an_answer_may_do() {
    let run = Run::start(&[]);
    for path in ["/", "/api/v1/health", "/assets/app.js", "/nothing"] {
        let request =
            format!("GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
        let mut answer = String::new();
        sent(&run, &request).read_to_string(&mut answer).unwrap();
        let head = answer.split("\r\n\r\n").next().unwrap().to_ascii_lowercase();
        for wanted in [
            "content-security-policy: default-src 'none'; script-src 'self'",
            "frame-ancestors 'none'",
            "x-content-type-options: nosniff",
            "referrer-policy: no-referrer",
            "cross-origin-resource-policy: same-origin",
        ] {
            assert!(head.contains(wanted), "{path}: {head}");
        }
    }
}

/// A pace of 5 was refused, only "5" was taken.
#[test]
fn a_pace_is_a_number_or_a_word() {
    let run = Run::start(&[]);
    for (pace, shown) in [("5", "5"), ("\"7\"", "7"), ("\"realtime\"", "realtime")] {
        let answer = run.control(&format!("{{\"action\": \"pace\", \"pace\": {pace}}}"));
        assert_eq!(answer.0, 200, "{}", answer.1);
        let taken = (0..300).any(|_| {
            std::thread::sleep(Duration::from_millis(50));
            run.state()["run"]["pace"] == shown
        });
        assert!(taken, "{pace}");
    }
}

/// A wish for a lane change was answered and dropped where nobody takes wishes.
#[test]
fn a_lane_change_is_taken_only_where_the_decider_is_external() {
    let wish = r#"{"action": "lane_change", "to": "left"}"#;
    refusal(&Run::start(&[]).control(wish), 409, "no_external_decider", "set_decider");
    assert_eq!(Run::start(&["--decider", "external"]).control(wish).0, 200);
}

/// A page that stays open must see that another run has taken the port.
#[test]
fn each_run_has_an_id_of_its_own() {
    let (a, b) = (Run::start(&[]), Run::start(&[]));
    let id = |run: &Run| run.state()["run_id"].as_str().unwrap().to_owned();
    let (first, other) = (id(&a), id(&b));
    assert!(!first.is_empty() && first != other);
    assert_eq!(id(&a), first);
    a.control(r#"{"action": "pace", "pace": "max"}"#);
    let (_, summary) = a.ask("GET", "/api/v1/summary", "", b"");
    assert_eq!(summary["schema"], 1);
}

/// A client drives a run tick by tick, changes the set speed on the way, and gets the bits of the
/// same run without a server; each reset has a recording of its own.
#[test]
fn a_run_in_lockstep_has_the_bits_of_the_same_run_alone() {
    let run = Run::start(&["--pace", "max"]);
    let first = run.state()["run_id"].clone();
    run.act(r#"{"action": "pause"}"#);
    let began = run.act(r#"{"action": "reset", "seed": 7}"#);
    assert_eq!((&began["tick"], &began["state"]), (&0.into(), &"paused".into()), "{began}");
    let stepped = run.act(r#"{"action": "step", "ticks": 300, "wait": true}"#);
    assert_eq!((&stepped["tick"], &stepped["state"]), (&300.into(), &"paused".into()));
    run.act(r#"{"action": "set_speed", "speed_m_s": 15.5}"#);
    let stepped = run.act(r#"{"action": "step_until", "time_s": 20.0, "wait": true}"#);
    assert_eq!((&stepped["tick"], &stepped["time_s"]), (&2000.into(), &20.0.into()));
    assert_eq!(run.act(r#"{"action": "step_until", "time_s": 3, "wait": true}"#)["tick"], 2000);
    assert_ne!(run.state()["run_id"], first, "a page sees that another run has begun");
    let summary = {
        assert_eq!(run.act(r#"{"action": "quit"}"#)["state"], "quitting");
        let one = run.folder.path().join("out");
        assert!(one.join("summary.json").exists() && one.join("run.mcap").exists());
        run.end("run-2/summary.json")
    };
    let scenario = sim::Scenario::builtin("flat").unwrap();
    let mut alone = sim::World::new(&scenario, 7).unwrap();
    for tick in 0..2000 {
        if tick == 300 {
            alone.stack_mut().set_speed(15.5);
        }
        alone.tick(&mut ()).unwrap();
    }
    assert_eq!(summary["state_hash"], alone.summary().state_hash.as_str());
}

/// What-if: the same moment goes on twice, and once otherwise; each has a recording of its own.
#[test]
fn a_world_that_was_kept_goes_on_with_the_bits_that_it_would_have_had() {
    let run = Run::start(&["--pace", "max", "--seed", "5"]);
    run.act(r#"{"action": "pause"}"#);
    run.act(r#"{"action": "reset"}"#);
    let step =
        |ticks: u32| run.act(&format!(r#"{{"action": "step", "ticks": {ticks}, "wait": true}}"#));
    step(500);
    run.act(r#"{"action": "snapshot", "name": "here"}"#);
    step(400);
    let back = run.act(r#"{"action": "restore", "name": "here"}"#);
    assert_eq!((&back["time_s"], &back["state"]), (&5.0.into(), &"paused".into()), "{back}");
    assert_eq!(step(400)["time_s"], 9.0);
    run.act(r#"{"action": "restore", "name": "here"}"#);
    run.act(r#"{"action": "set_speed", "speed_m_s": 12}"#);
    step(400);
    let unknown = run.control(r#"{"action": "restore", "name": "there"}"#);
    refusal(&unknown, 409, "nothing_kept", "\"there\"");
    for number in 1..8 {
        run.act(&format!(r#"{{"action": "snapshot", "name": "more-{number}"}}"#));
    }
    let more = run.control(r#"{"action": "snapshot", "name": "more-8"}"#);
    refusal(&more, 409, "too_many_kept", "8 worlds");
    run.act(r#"{"action": "snapshot", "name": "here"}"#);
    run.act(r#"{"action": "quit"}"#);
    let out = run.folder.path().join("out");
    let replayed = program().arg("process-replay").arg(out.join("run-3/run.mcap")).output();
    let line = String::from_utf8(replayed.unwrap().stderr).unwrap();
    assert!(line.contains("goes on from a snapshot at 5 s"), "{line}");
    let summary = |name: &str| -> Value {
        serde_json::from_slice(&std::fs::read(out.join(name).join("summary.json")).unwrap())
            .unwrap()
    };
    let (whole, again) = (summary("run-2"), summary("run-3"));
    assert_eq!(whole["state_hash"], again["state_hash"]);
    assert_eq!(whole["fuel_g"], again["fuel_g"]);
    assert_eq!(whole["ghost"], again["ghost"], "its ghost goes on as well");
    assert_ne!(run.end("run-4/summary.json")["state_hash"], whole["state_hash"]);
}

#[test]
fn a_run_stands_still_where_it_was_told_to() {
    let run = Run::start(&["--pace", "max"]);
    run.act(r#"{"action": "pause"}"#);
    run.act(r#"{"action": "reset"}"#);
    run.act(r#"{"action": "pause_at", "time_s": 4.5}"#);
    run.act(r#"{"action": "play"}"#);
    let stands = (0..600).any(|_| {
        std::thread::sleep(Duration::from_millis(20));
        run.ask("GET", "/api/v1/sessions/default", "", b"").1["state"] == "paused"
    });
    assert!(stands);
    assert_eq!(run.act(r#"{"action": "pause"}"#)["tick"], 450);
    run.act(r#"{"action": "play"}"#);
    std::thread::sleep(Duration::from_millis(200));
    assert!(run.act(r#"{"action": "pause"}"#)["tick"].as_u64().unwrap() > 450, "once");
}

#[test]
fn commands_in_a_wrong_state_are_refused_with_what_they_need() {
    let run = Run::start(&["--duration", "3", "--pace", "max"]);
    let step = r#"{"action": "step", "ticks": 10, "wait": true}"#;
    let ended = (0..600).any(|_| {
        std::thread::sleep(Duration::from_millis(50));
        run.state()["run"]["state"] == "finished"
    });
    assert!(ended);
    refusal(&run.control(step), 409, "run_ended", "has ended");
    let stopped = run.act(r#"{"action": "stop"}"#);
    assert_eq!((&stopped["state"], &stopped["tick"]), (&"stopped".into(), &0.into()));
    refusal(&run.control(step), 409, "wrong_state", "pause it first");
    assert_eq!(run.act(r#"{"action": "pause"}"#)["state"], "paused");
    assert_eq!(run.act(step)["tick"], 10);
    let far = r#"{"action": "step_until", "time_s": 1e9, "wait": true}"#;
    refusal(&run.control(far), 422, "too_far", "at most 1000000");
    run.act(r#"{"action": "pace", "pace": 0.01}"#);
    std::thread::scope(|scope| {
        let waiting =
            scope.spawn(|| run.control(r#"{"action": "step", "ticks": 90, "wait": true}"#));
        let steps = (0..600).any(|_| {
            std::thread::sleep(Duration::from_millis(20));
            (0.105..1.0).contains(&run.state()["time_s"].as_f64().unwrap())
        });
        assert!(steps);
        let second = r#"{"action": "step", "ticks": 1}"#;
        refusal(&run.control(second), 409, "wrong_state", "let a step end");
        run.act(r#"{"action": "play"}"#);
        refusal(&waiting.join().unwrap(), 409, "cut_short", "were not driven");
    });
}
