//! `serve`: sessions that are asked for, side by side.

use std::process::Stdio;
use std::time::Duration;

use crate::support::serving::{Serving, refusal};
use crate::support::{client, program, refused};
use serde_json::{Value, json};

/// A server without a run, on a free port.
struct Server {
    serving: Serving,
    folder: tempfile::TempDir,
}

impl Server {
    fn start(options: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("tmp")).unwrap();
        let mut command = program();
        command.env("TMPDIR", folder.path().join("tmp"));
        command.args(["serve", "--port", "0", "--runs"]).arg(folder.path().join("runs"));
        Self { serving: Serving::start(command.args(options)), folder }
    }

    fn ask(&self, method: &str, path: &str, body: &Value) -> (u16, Value) {
        let body = if body.is_null() { String::new() } else { body.to_string() };
        client::ask(&self.serving.address, method, path, "", body.as_bytes())
    }

    fn get(&self, path: &str) -> (u16, Value) {
        self.ask("GET", path, &Value::Null)
    }

    /// Begins a session; its object.
    fn begin(&self, wanted: &Value) -> Value {
        let (status, session) = self.ask("POST", "/api/v1/sessions", wanted);
        assert_eq!(status, 201, "{wanted}: {session}");
        session
    }

    /// Asks until the answer is as wanted.
    fn wait_for(&self, path: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        for _ in 0..1200 {
            let (_, answer) = self.get(path);
            if wanted(&answer) {
                return answer;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        panic!("{path}: {:?}", self.get(path))
    }

    /// The folder of a run.
    fn run(&self, name: &str) -> std::path::PathBuf {
        self.folder.path().join("runs").join(name)
    }

    fn summary(&self, run: &str) -> Value {
        let file = self.run(run).join("summary.json");
        serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap()
    }

    /// Ends the server as a service manager does.
    fn end(&mut self) -> Option<i32> {
        let id = self.serving.id().to_string();
        assert!(std::process::Command::new("kill").arg(&id).status().unwrap().success());
        self.serving.wait()
    }
}

/// Eight worlds in one process, each in its own thread: none of them knows of the others.
#[test]
fn eight_sessions_have_each_the_bits_that_it_has_alone() {
    let mut server = Server::start(&[]);
    let scenarios = [
        "highway",
        "flat",
        "incident",
        "rush-hour",
        "dense-15",
        "medium-12.5",
        "sparse-15",
        "flat",
    ];
    let sessions: Vec<(&str, u64, Value)> = (1..)
        .zip(scenarios)
        .map(|(seed, scenario)| {
            let wanted = json!({
                "scenario": scenario, "seed": seed, "duration_s": 20, "state": "playing",
                "pace": "max",
            });
            (scenario, seed, server.begin(&wanted))
        })
        .collect();
    refusal(
        &server.ask("POST", "/api/v1/sessions", &json!({ "scenario": "flat" })),
        429,
        "too_many_sessions",
        "8",
    );
    let (_, all) = server.get("/api/v1/sessions");
    assert_eq!((all["sessions"].as_array().unwrap().len(), &all["most"]), (8, &8.into()));
    for (scenario, seed, session) in &sessions {
        let (id, run) = (session["id"].as_str().unwrap(), session["run"].as_str().unwrap());
        server.wait_for(&format!("/api/v1/sessions/{id}"), |session| session["recording"] == false);
        let alone = server.folder.path().join(format!("alone-{id}"));
        let seed = seed.to_string();
        let status = program()
            .args(["run", scenario, "--seed", &seed, "--duration", "20", "--headless", "--out"])
            .arg(&alone)
            .stderr(Stdio::null())
            .stdout(Stdio::null())
            .status();
        assert!(status.unwrap().success());
        let alone: Value =
            serde_json::from_slice(&std::fs::read(alone.join("summary.json")).unwrap()).unwrap();
        assert!(alone["state_hash"].is_string());
        assert_eq!(server.summary(run)["state_hash"], alone["state_hash"], "{scenario}");
    }
    assert_eq!(server.end(), Some(0));
}

#[test]
fn a_session_is_commanded_ended_and_its_place_is_free_again() {
    let mut server = Server::start(&["--sessions", "1"]);
    assert_eq!(server.get("/api/v1/ready").0, 200);
    refusal(&server.get("/api/v1/state"), 404, "no_session", "default");
    let toml = "schema = 1\nname = \"My Road!\"\nroad = \"builtin:flat\"\n[truck]\nfile = \"sinotruk\"\n\
                payload_kg = 1000.0\n";
    let session = server.begin(&json!({ "toml": toml }));
    assert_eq!((&session["state"], &session["run"]), (&"stopped".into(), &"my-road--1".into()));
    let path = format!("/api/v1/sessions/{}", session["id"].as_str().unwrap());
    let control = |command: Value| server.ask("POST", &format!("{path}/control"), &command);
    assert_eq!(control(json!({ "action": "pause" })).0, 200);
    let (status, acted) = control(json!({ "action": "step", "ticks": 100, "wait": true }));
    assert_eq!((status, &acted["tick"]), (200, &100.into()));
    assert_eq!(server.get(&format!("{path}/state")).0, 200);
    assert_eq!(control(json!({ "action": "reset", "seed": 5 })).0, 200);
    assert_eq!(server.get(&path).1["run"], "my-road--5");
    let (status, metrics) = (200, client::text(&server.serving.address, "/api/v1/metrics"));
    assert_eq!(status, 200);
    assert!(metrics.contains("tractrix_ticks_total{session=\"s1\"} 100"), "{metrics}");
    assert_eq!(client::status(&server.serving.address, "DELETE", &path), 204);
    refusal(&server.get(&path), 404, "no_session", "s1");
    assert!(!client::text(&server.serving.address, "/api/v1/metrics").contains("session=\"s1\""));
    assert_eq!(server.summary("my-road--1")["end_reason"], "interrupted");
    assert_eq!(server.summary("my-road--5")["seed"], 5);
    let again = server.begin(&json!({ "scenario": "flat", "state": "playing" }));
    assert_eq!(server.end(), Some(0));
    let run = again["run"].as_str().unwrap();
    assert_eq!(server.summary(run)["end_reason"], "interrupted", "a signal ends every session");
}

/// Whoever may only speak HTTP may neither read files of the machine nor start programs.
#[test]
fn what_a_scenario_from_outside_may_name_is_bounded() {
    let assets = tempfile::tempdir().unwrap();
    std::fs::write(assets.path().join("hill.csv"), "s_m,z_m\n0,0\n1000,10\n2000,10\n").unwrap();
    let server = Server::start(&["--assets", assets.path().to_str().unwrap()]);
    let begin = |wanted: Value| server.ask("POST", "/api/v1/sessions", &wanted);
    let road = |road: &str| json!({ "scenario": "flat", "road": road });
    for file in ["/etc/passwd", "../hill.csv", "nothing.csv"] {
        refusal(&begin(road(file)), 422, "outside", file);
    }
    refusal(&begin(json!({ "scenario": "nothing" })), 422, "unusable", "nothing");
    refusal(&begin(json!({ "toml": "schema = 1" })), 422, "unusable", "name");
    refusal(&begin(json!({ "scenario": "flat", "sede": 1 })), 400, "wrong_body", "sede");
    refusal(&begin(json!([])), 400, "wrong_body", "");
    let long = json!({ "scenario": "flat", "toml": "x".repeat(300_000) });
    refusal(&begin(long), 413, "body_not_read", "too long");
    std::fs::write(assets.path().join("bad.csv"), "s_m,z_m\n0,zero\n").unwrap();
    let (status, answer) = begin(road("bad.csv"));
    assert_eq!(status, 422);
    assert!(!answer.to_string().contains(assets.path().to_str().unwrap()), "{answer}");
    server.begin(&road("hill.csv"));
}

/// What sessions leave: listed, seen again, compared, downloaded, removed.
#[test]
fn runs_are_listed_played_compared_downloaded_and_removed() {
    let server = Server::start(&[]);
    let begin = |seed: u64, duration_s: u64| {
        let wanted = json!({
            "scenario": "incident", "seed": seed, "duration_s": duration_s, "state": "playing",
            "pace": "max",
        });
        server.begin(&wanted)["run"].as_str().unwrap().to_owned()
    };
    let runs = [begin(1, 30), begin(1, 30), begin(2, 20)];
    for run in &runs {
        server.wait_for(&format!("/api/v1/runs/{run}"), |run| run["recording"] == false);
    }
    let (_, all) = server.get("/api/v1/runs");
    assert_eq!(all["runs"].as_array().unwrap().len(), 3);
    let (_, one) = server.get(&format!("/api/v1/runs/{}", runs[0]));
    assert_eq!(one["summary"], server.summary(&runs[0]));
    let of = |what: &str| format!("/api/v1/runs/{}/{what}", runs[0]);

    let (_, strip) = server.get(&of("strip"));
    assert_eq!((&strip["ticks_different"], &strip["span_s"][0]), (&0.into(), &0.0.into()));
    assert!(strip["span_s"][1].as_f64().unwrap() > 29.5, "{}", strip["span_s"]);
    let (_, frames) = server.get(&of("frames?from_s=5&to_s=6"));
    let frames = frames["frames"].as_array().unwrap();
    assert_eq!((frames.len(), &frames[0]["time_s"]), (5, &5.0.into()), "four a second");
    assert!(frames[0]["ego"]["speed_m_s"].as_f64().unwrap() > 1.0);
    assert!(frames[0]["plan"]["path_xy_m"].as_array().unwrap().len() > 10);
    assert!(server.get(&of("road")).1["length_m"].as_f64().unwrap() > 1000.0);
    let report = client::text(&server.serving.address, &of("report"));
    assert!(report.contains("state hash") && !report.contains("<script src"), "one file");
    refusal(&server.get(&of("frames?from_s=1")), 400, "wrong_query", "to_s");

    let compare = |a: &str, b: &str| server.get(&format!("/api/v1/compare?a={a}&b={b}")).1;
    let same = compare(&runs[0], &runs[1]);
    assert_eq!((&same["ticks"], &same["ticks_different"]), (&3000.into(), &0.into()));
    assert!(same["first_difference"].is_null() && same["other_scene_s"].is_null(), "{same}");
    let other = compare(&runs[0], &runs[2]);
    assert_eq!(other["more_ticks"], json!({ "a": 1000, "b": 0 }));
    assert!(other["other_scene_s"].as_f64().unwrap() < 20.0, "other traffic: {other}");

    let whole = std::fs::read(server.run(&runs[0]).join("run.mcap")).unwrap();
    assert_eq!(client::bytes(&server.serving.address, &of("recording"), ""), (200, whole.clone()));
    let part = client::bytes(&server.serving.address, &of("recording"), "Range: bytes=8-107\r\n");
    assert_eq!(part, (206, whole[8..108].to_vec()));
    let beyond =
        client::bytes(&server.serving.address, &of("recording"), "Range: bytes=99999999-\r\n");
    assert_eq!(beyond.0, 416);

    for name in ["nothing", "..", "%2e%2e", "..%2Fruns", "a%00b", "Highway-1"] {
        refusal(&server.get(&format!("/api/v1/runs/{name}")), 404, "no_run", "");
    }
    assert_eq!(
        client::status(&server.serving.address, "DELETE", &format!("/api/v1/runs/{}", runs[2])),
        204
    );
    assert!(!server.run(&runs[2]).exists());
    refusal(&server.get(&format!("/api/v1/runs/{}", runs[2])), 404, "no_run", &runs[2]);
}

/// A run that is being recorded cannot be removed; what of it is finished is a whole file.
#[test]
fn the_finished_part_of_a_run_under_way_is_a_whole_recording() {
    let server = Server::start(&[]);
    let session = server.begin(&json!({ "scenario": "flat" }));
    let run = session["run"].as_str().unwrap();
    let control = format!("/api/v1/sessions/{}/control", session["id"].as_str().unwrap());
    server.ask("POST", &control, &json!({ "action": "pause" }));
    server.ask("POST", &control, &json!({ "action": "step", "ticks": 1000, "wait": true }));
    let path = format!("/api/v1/runs/{run}");
    refusal(&server.ask("DELETE", &path, &Value::Null), 409, "run_is_recording", run);
    refusal(&server.get(&format!("{path}/strip")), 409, "run_is_recording", run);
    let (status, part) = client::bytes(&server.serving.address, &format!("{path}/recording"), "");
    assert_eq!(status, 200);
    let file = server.folder.path().join("part.mcap");
    std::fs::write(&file, part).unwrap();
    let output = program().arg("process-replay").arg(&file).arg("--json").output().unwrap();
    let compared: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(compared["ticks_different"], 0);
    assert!(compared["ticks_compared"].as_u64().unwrap() >= 800, "{compared}");
}

/// `plan` over HTTP is `plan`: the same file. Its folder goes with the server, a job under way too.
#[test]
fn a_job_leaves_what_the_command_would() {
    let mut server = Server::start(&[]);
    let trip = json!({
        "truck": "sinotruk", "road": "builtin:flat", "mass_kg": 20000, "set_speed_m_s": 22,
        "speed_min_m_s": 20, "speed_max_m_s": 24,
    });
    let (status, job) = server.ask("POST", "/api/v1/plan", &trip);
    assert_eq!(status, 202);
    let path = format!("/api/v1/jobs/{}", job["id"].as_str().unwrap());
    let done = server.wait_for(&path, |job| job["status"] == "done");
    assert_eq!(done["files"], json!(["plan.csv", "plan.html", "plan.json"]));
    let out = server.folder.path().join("plan");
    let words = "plan --truck sinotruk --road builtin:flat --mass-kg 20000 --set-speed-m-s 22 \
                 --speed-min-m-s 20 --speed-max-m-s 24 --out";
    let status = program().args(words.split_whitespace()).arg(&out).output().unwrap().status;
    assert!(status.success());
    let csv = client::text(&server.serving.address, &format!("{path}/files/plan.csv"));
    assert_eq!(csv, std::fs::read_to_string(out.join("plan.csv")).unwrap());
    for file in ["nothing.csv", "..", "..%2Fplan.csv"] {
        refusal(&server.get(&format!("{path}/files/{file}")), 404, "not_found", "");
    }
    let mut slow = trip.clone();
    slow["mass_kg"] = (-1.0).into();
    let (_, job) = server.ask("POST", "/api/v1/plan", &slow);
    let path = format!("/api/v1/jobs/{}", job["id"].as_str().unwrap());
    let failed = server.wait_for(&path, |job| job["status"] == "failed");
    assert_eq!(failed["exit_code"], 2);
    assert!(failed["why"].as_str().unwrap().contains("--mass-kg"), "{failed}");
    assert_eq!(client::status(&server.serving.address, "DELETE", &path), 204);
    refusal(&server.get(&path), 404, "no_job", "");
    let diagnose = |body: Value| server.ask("POST", "/api/v1/diagnose", &body);
    refusal(&diagnose(json!({ "truck": "sinotruk" })), 400, "wrong_body", "drives or run");
    refusal(&diagnose(json!({ "truck": "sinotruk", "run": "x" })), 404, "no_run", "x");
    refusal(&diagnose(json!({ "truck": "/etc/passwd", "drives": "d" })), 422, "outside", "truck");
    refusal(&diagnose(json!({ "truck": "sinotruk", "drives": "/etc" })), 422, "outside", "drives");
    server.ask("POST", "/api/v1/plan", &trip);
    let folders = || std::fs::read_dir(server.folder.path().join("tmp")).unwrap().count();
    assert!(folders() >= 2);
    assert_eq!(server.end(), Some(0));
    assert_eq!(std::fs::read_dir(server.folder.path().join("tmp")).unwrap().count(), 0);
}

#[test]
fn what_is_built_in_is_told() {
    let server = Server::start(&[]);
    let (_, all) = server.get("/api/v1/scenarios");
    let named = |s: &Value| s["name"] == "highway" && s["description"].is_string();
    assert!(all["scenarios"].as_array().unwrap().iter().any(named));
    let (_, highway) = server.get("/api/v1/scenarios/highway");
    server.begin(&json!({ "toml": highway["toml"] }));
    assert_eq!(server.get("/api/v1/scenarios/nothing").0, 404);
    assert!(
        server.get("/api/v1/trucks").1["trucks"].as_array().unwrap().contains(&"sinotruk".into())
    );
}

/// Who has no token gets nothing, not even which sessions there are; a browser keeps it in a cookie
/// that scripts and other sites cannot use.
#[test]
fn a_token_opens_every_door_and_nothing_else_does() {
    const TOKEN: &str = "a-token-of-some-length";
    let there = tempfile::tempdir().unwrap();
    let file = there.path().join("token");
    std::fs::write(&file, TOKEN).unwrap();
    let server = Server::start(&["--token-file", file.to_str().unwrap()]);
    for path in ["/", "/runs", "/ws", "/api/v1/health", "/api/v1/sessions", "/api/openapi.json"] {
        for header in
            ["", "Authorization: Bearer a-token-of-some-lengt\r\n", "Cookie: tractrix_token=\r\n"]
        {
            let refused = client::ask(&server.serving.address, "GET", path, header, b"");
            refusal(&refused, 401, "unauthorized", "token");
        }
    }
    let bearer = format!("Authorization: Bearer {TOKEN}\r\n");
    assert_eq!(
        client::ask(&server.serving.address, "GET", "/api/v1/sessions", &bearer, b"").0,
        200
    );
    let cookie = format!("Cookie: tractrix_token={TOKEN}\r\n");
    assert_eq!(client::bytes(&server.serving.address, "/runs", &cookie).0, 200);
    assert_eq!(client::bytes(&server.serving.address, &format!("/runs?token={TOKEN}"), "").0, 303);
    let api = format!("/api/v1/sessions?token={TOKEN}");
    assert_eq!(
        client::bytes(&server.serving.address, &api, "").0,
        401,
        "an address is no place for it"
    );
}

#[test]
fn wrong_options_are_named() {
    assert!(refused(&["serve", "--bind", "0.0.0.0"]).contains("--token-file"));
    assert!(refused(&["run", "--bind", "localhost"]).contains("--bind"));
    assert!(refused(&["serve", "--token-file", "/nothing/here"]).contains("/nothing/here"));
    assert!(refused(&["serve", "--sessions", "65"]).contains("--sessions"));
    assert!(refused(&["serve", "--assets", "/nothing/here"]).contains("--assets /nothing/here"));
}

/// A session that was forgotten played on, and held its place, as long as the server ran.
#[test]
fn a_session_that_nobody_wants_any_more_is_ended_with_its_summary() {
    let mut server = Server::start(&["--session-idle-s", "3"]);
    let wanted = json!({ "scenario": "flat", "state": "playing", "pace": "realtime" });
    let [forgotten, wanted] = [server.begin(&wanted), server.begin(&wanted)];
    let path = |session: &Value| format!("/api/v1/sessions/{}", session["id"].as_str().unwrap());
    // Asked for until the other one is gone; a list asks for nobody
    let list = server.wait_for("/api/v1/sessions", |list| {
        assert_eq!(server.get(&path(&wanted)).0, 200);
        list["sessions"].as_array().unwrap().len() == 1
    });
    assert_eq!(list["sessions"][0]["id"], wanted["id"]);
    refusal(&server.get(&path(&forgotten)), 404, "no_session", "");
    let summary = server.summary(forgotten["run"].as_str().unwrap());
    assert_eq!(summary["end_reason"], "interrupted");
    assert!(summary["duration_s"].as_f64().unwrap() > 1.0);
    server.end();
}
