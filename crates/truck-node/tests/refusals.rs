//! Bad input gets one clear line on stderr and exit code 2, and nothing is actuated.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, clippy::panic, clippy::disallowed_methods, reason = "a test waits")]

mod support;

use std::process::{Command, Output};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use j1939::bus::Bus;
use j1939::{AddressClaim, Frame, Id, Name};
use road::{GeoReference, Road};
use support::{Files, Wire, node, refusal, sim_server};

/// Nobody listens there: what is wrong has to be noticed before.
const NO_BUS: &str = "socketcand:127.0.0.1:1/can0";

fn run(files: &Files, words: &[&str]) -> Output {
    run_as(node(), files, words)
}

fn run_as(mut node: Command, files: &Files, words: &[&str]) -> Output {
    let (map, sheet) = (files.path("road.xodr"), files.path("sheet.toml"));
    let mut all = vec!["--can", NO_BUS, "--map", &map, "--truck", &sheet];
    for pair in words.chunks(2) {
        match all.iter().position(|word| *word == pair[0]) {
            Some(at) => all[at + 1] = pair[1],
            None => all.extend(pair),
        }
    }
    node.args(all).output().unwrap()
}

#[test]
fn a_bus_that_is_not_there_is_named() {
    let files = Files::new(3.0);
    for (bus, says) in [
        ("nosuch0", "nosuch0: "),
        ("can:nosuch0", "nosuch0: "),
        (NO_BUS, "127.0.0.1:1/can0: "),
        ("socketcand:127.0.0.1", "a bus is can:IFACE or socketcand:HOST:PORT/IFACE"),
    ] {
        let line = refusal(&run(&files, &["--can", bus]));
        assert!(line.contains("--can") && line.contains(says), "{bus}: {line}");
    }
}

#[test]
fn a_truck_file_is_refused_with_what_makes_a_sheet_of_it() {
    let files = Files::new(3.0);
    let truck = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/truck.toml");
    let line = refusal(&run(&files, &["--truck", truck]));
    assert!(line.contains("truck.toml") && line.contains("sim-server truck sheet"), "{line}");
    assert!(refusal(&run(&files, &["--truck", "no-sheet.toml"])).contains("no-sheet.toml"));
}

/// The sheet with the first `x = [...]` of a map replaced.
fn with_axis(files: &Files, table: &str, axis: &str) -> String {
    let text = std::fs::read_to_string(files.path("sheet.toml")).unwrap();
    let at = text.find(&format!("[{table}]")).unwrap_or_else(|| panic!("no {table} in {text}"));
    let x = at + text[at..].find("x = [").unwrap();
    let end = x + text[x..].find(']').unwrap() + 1;
    let wrong = files.path("wrong.toml");
    std::fs::write(&wrong, format!("{}x = {axis}{}", &text[..x], &text[end..])).unwrap();
    wrong
}

#[test]
fn a_sheet_with_a_wrong_curve_is_refused_with_its_key() {
    let files = Files::new(3.0);
    for axis in ["[]", "[200.0, 100.0]"] {
        let wrong = with_axis(&files, "powertrain.full_load_nm", axis);
        let line = refusal(&run(&files, &["--truck", &wrong]));
        assert!(line.contains("wrong.toml") && line.contains("full_load_nm"), "{line}");
    }
}

#[test]
fn tables_of_the_bus_and_the_pose_are_checked() {
    for (text, says) in [
        ("[bus]\nadress = 3\n", "adress"),
        ("[bus]\nengine = 255\n", "engine"),
        ("[bus]\nbrakes = 0x27\n", "our own address"),
        ("[bus]\nname = 0\n", "name"),
        ("[bus]\nxbr = { pgn = 0x50000 }\n", "pgn"),
        ("[bus]\nsteering = { frame = \"maker\", address = 19, key = 1 }\n", "maker"),
        ("[pose]\nfix_sd_m = -1.0\n", "fix_sd_m"),
        ("[pose]\nantena_ahead_m = 1.0\n", "antena_ahead_m"),
    ] {
        let files = Files::new(3.0);
        let sheet = files.path("sheet.toml");
        let whole = std::fs::read_to_string(&sheet).unwrap();
        let limits = whole.split("[bus.steering]").next().unwrap();
        std::fs::write(&sheet, format!("{limits}{text}")).unwrap();
        let line = refusal(&run(&files, &[]));
        assert!(line.contains("sheet.toml: [") && line.contains(says), "{text}: {line}");
    }
    let files = Files::new(3.0);
    assert!(refusal(&run(&files, &["--address", "0x0B"])).contains("our own address 0x0B"));
}

#[test]
fn options_that_cannot_be_used_are_named() {
    let files = Files::new(3.0);
    let (out, nowhere) = (files.path("out"), files.path("nowhere.xodr"));
    let road = Road::load(&files.path("road.xodr")).unwrap();
    let road = road.with_geo_reference(&GeoReference::default());
    std::fs::write(&nowhere, road.write_opendrive()).unwrap();
    std::fs::create_dir(&out).unwrap();
    std::fs::write(files.path("out/run.mcap"), "mine").unwrap();
    for (words, says) in [
        (["--map", &nowhere], "projection of the map: the map has none"),
        (["--map", "no.xodr"], "no.xodr"),
        (["--set-speed-m-s", "NaN"], "set_speed_m_s"),
        (["--pose", "nmea:/no/such/device"], "/no/such/device"),
        (["--watchdog", "/no/such/watchdog"], "/no/such/watchdog"),
        (["--out", &out], "--overwrite"),
    ] {
        let line = refusal(&run(&files, &words));
        assert!(line.contains(says), "{words:?}: {line}");
    }
    assert_eq!(std::fs::read_to_string(files.path("out/run.mcap")).unwrap(), "mine");
    for words in [["--health", "0.0.0.0:80"], ["--address", "254"], ["--pose", "gps"]] {
        let output = run(&files, &words);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && error.contains(words[0]), "{error}");
    }
}

/// A service manager or a container may keep CAN sockets from a program.
#[test]
fn an_interface_without_permission_is_named() {
    let files = Files::new(3.0);
    let mut denied = Command::new("python3");
    let support = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/support/no_can.py");
    denied.arg(support).arg(node().get_program()).args(node().get_args());
    let line = refusal(&run_as(denied, &files, &["--can", "lo"]));
    assert!(line.contains("--can lo: no permission to open a CAN socket"), "{line}");
}

/// Somebody has the address: he keeps it, and only one question was asked.
#[test]
fn an_address_that_is_taken_is_left_to_who_has_it() {
    let files = Files::new(3.0);
    let claims = Arc::new(AtomicU64::new(0));
    let counted = Arc::clone(&claims);
    let mut holder = AddressClaim::new(Name(0x9999), 0x27, 0);
    let wire = Wire::with(move |now, bus| {
        while let Some(heard) = bus.receive(now).unwrap() {
            holder.on_frame(heard.time, &heard.value);
            counted
                .fetch_add(u64::from(Name::claimed_in(&heard.value).is_some()), Ordering::Relaxed);
        }
        holder.poll(now, bus).unwrap();
    });
    let line = refusal(&run(&files, &["--can", &wire.name]));
    assert!(line.contains("0x27 is taken (NAME 0000000000009999)"), "{line}");
    assert_eq!(claims.load(Ordering::Relaxed), 0, "we have claimed it");
}

/// Somebody sends from it without having claimed it.
#[test]
fn an_address_that_somebody_uses_is_taken() {
    let files = Files::new(3.0);
    let wire = Wire::with(|now, bus| {
        let _ = bus.send(now, &Frame::of(Id::from_raw(0x18F0_0427), [0xFF; 8]));
    });
    assert!(refusal(&run(&files, &["--can", &wire.name])).contains("0x27 is taken"));
}

#[test]
fn a_bus_without_a_truck_is_not_waited_for_forever() {
    let files = Files::new(3.0);
    let wire = Wire::new();
    let output = run(&files, &["--can", &wire.name, "--ready-within", "1"]);
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(3), "{error}");
    assert!(error.contains("error: not ready after 1 s: bus: 0 frames"), "{error}");
    let report = String::from_utf8_lossy(&output.stdout).into_owned();
    for line in
        ["missing bus", "missing engine ", "missing pose", "missing radar", "ok      address"]
    {
        assert!(report.contains(line), "{line}: {report}");
    }
}

/// The truck on the bus is another one, or somewhere else.
#[test]
fn another_truck_and_another_road_are_refused() {
    let files = Files::new(3.0);
    let wire = Wire::new();
    let mut truck = files.truck(&wire.name);
    truck.until("is held until it is driven");
    let sheet = std::fs::read_to_string(files.path("sheet.toml")).unwrap();
    let other = |text: String| {
        std::fs::write(files.path("other.toml"), text).unwrap();
        refusal(&run(&files, &["--can", &wire.name, "--truck", &files.path("other.toml")]))
    };
    let line = other(format!("{sheet}\n[bus]\nvin = \"WDB96340310000001\"\n"));
    assert!(line.contains("of another truck: VIN WDB**************"), "{line}");
    assert!(line.contains("TRA************** on the bus"), "{line}");
    let output = sim_server()
        .args(["truck", "sheet", "longhaul", "--payload-kg", "30000", "--out"])
        .arg(files.path("laden.toml"))
        .output()
        .unwrap();
    assert!(output.status.success());
    let line = other(std::fs::read_to_string(files.path("laden.toml")).unwrap());
    assert!(line.contains("of another truck or load") && line.contains("(CVW)"), "{line}");
    let road = std::fs::read_to_string(files.path("road.xodr")).unwrap();
    let moved = road.replace("689000", "691000");
    assert_ne!(road, moved);
    std::fs::write(files.path("moved.xodr"), moved).unwrap();
    let line = refusal(&run(&files, &["--can", &wire.name, "--map", &files.path("moved.xodr")]));
    assert!(line.contains("--map: the road does not contain"), "{line}");
    truck.terminate();
    let (_, said) = truck.end();
    assert!(said.contains("not driven"), "{said}");
}

/// A bus of the kernel on which a tool sends a frame again and again.
fn beside(frame: [&str; 2], run: impl FnOnce() -> Output) -> Output {
    let words = frame.map(str::to_owned);
    let over = Arc::new(AtomicBool::new(false));
    let ends = Arc::clone(&over);
    let thread = std::thread::spawn(move || {
        while !ends.load(Ordering::Relaxed) {
            assert!(Command::new("cansend").args(&words).status().unwrap().success());
        }
    });
    let output = run();
    over.store(true, Ordering::Relaxed);
    thread.join().unwrap();
    output
}

#[test]
#[ignore = "needs CAN sockets: tests/can/uml.sh"]
fn a_bus_of_the_kernel_that_cannot_be_used_is_named() {
    let files = Files::new(3.0);
    let line = refusal(&run(&files, &["--can", "vcan2"]));
    assert!(line.contains("vcan2: the interface is down; `ip link set vcan2 up"), "{line}");
    let line = refusal(&run(&files, &["--can", "vcan9"]));
    assert!(line.contains("vcan9: no such CAN interface"), "{line}");
    let fd = ["vcan1", "18F00E00##1000102030405060708090A0B"];
    let line = refusal(&beside(fd, || run(&files, &["--can", "vcan1"])));
    assert!(line.contains("vcan1: CAN FD frames on this bus"), "{line}");
    // a protocol violation, as a controller of another bit rate reports it (linux/can/error.h)
    let error = ["vcan0", "20000008#0000020000000000"];
    let line = refusal(&beside(error, || run(&files, &["--can", "vcan0"])));
    assert!(line.contains("error frames and no other: wrong bit rate"), "{line}");
    // what a controller says that nobody acknowledges until it gives up
    let off = ["vcan0", "20000040#0000000000000000"];
    let line = refusal(&beside(off, || run(&files, &["--can", "vcan0"])));
    assert!(line.contains("vcan0: the controller is off the bus"), "{line}");
}
