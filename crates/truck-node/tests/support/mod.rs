//! A virtual truck on a bus, and the program that drives it: two processes.
#![allow(unreachable_pub, dead_code, reason = "each test uses a part")]

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use j1939::BitRate;
use j1939::bus::loopback::{Loopback, LoopbackNode};
use j1939::bus::socketcand::Server;
use road::GeoReference;
use tractrix_core::Time;

/// Nothing takes longer than this, however busy the machine is.
pub const PATIENCE: Duration = Duration::from_secs(60);

const GEO: &str = "+proj=utm +zone=32 +ellps=WGS84 +units=m +no_defs";

/// Our program; `TRUCK_NODE` names a command in its place: `tools/arm64.sh` an emulator with the
/// program of another processor.
pub fn node() -> Command {
    let given = std::env::var("TRUCK_NODE").unwrap_or_default();
    let mut words = given.split_whitespace();
    let mut node = Command::new(words.next().unwrap_or(env!("CARGO_BIN_EXE_truck-node")));
    node.args(words);
    node
}

/// The program beside ours.
pub fn sim_server() -> Command {
    let path = Path::new(env!("CARGO_BIN_EXE_truck-node")).with_file_name("sim-server");
    assert!(path.exists(), "{} is missing: cargo build --release -p sim-server", path.display());
    Command::new(path)
}

/// Files of a drive: a straight road on the earth, a truck that stands on it, its sheet.
pub struct Files {
    pub folder: tempfile::TempDir,
}

impl Files {
    /// A vehicle ahead drives `lead_m_s`, its rear 60 m from the start.
    pub fn new(lead_m_s: f64) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let geo = GeoReference {
            projection: GEO.into(),
            offset_m: [689_000.0, 5_330_000.0, 0.0],
            offset_heading_rad: 0.0,
        };
        let road = road::builtin::flat(3_000.0).with_geo_reference(&geo);
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("road.xodr"), road.write_opendrive()).unwrap();
        let mut lead = String::from("id,t_s,x_m,y_m,length_m,width_m\n");
        for i in 0..1200 {
            let t_s = 0.1 * f64::from(i);
            lead.push_str(&format!("1,{t_s:.1},{:.3},-1.875,4.8,1.9\n", 65.0 + lead_m_s * t_s));
        }
        std::fs::write(path("lead.csv"), lead).unwrap();
        let scenario = "schema = 1\nname = \"yard\"\ndescription = \"A truck that stands.\"\n\
             road = \"road.xodr\"\n[truck]\nfile = \"longhaul\"\npayload_kg = 10000.0\n\
             [ego]\ns_m = 30.0\nspeed_m_s = 0.0\n\
             [traffic]\nsource = \"replay\"\n[traffic.replay]\nfile = \"lead.csv\"\n";
        std::fs::write(path("yard.toml"), scenario).unwrap();
        let sheet = path("sheet.toml");
        let words = ["truck", "sheet", "longhaul", "--payload-kg", "10000", "--out"];
        let made = sim_server().args(words).arg(&sheet).output().unwrap();
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        let files = Self { folder };
        files.extend_sheet("[bus.steering]\nframe = \"example\"\naddress = 0x13\nkey = 0x5A\n");
        files
    }

    pub fn path(&self, name: &str) -> String {
        self.folder.path().join(name).to_str().unwrap().to_owned()
    }

    /// Puts more into the sheet.
    pub fn extend_sheet(&self, text: &str) {
        let sheet = self.path("sheet.toml");
        let before = std::fs::read_to_string(&sheet).unwrap();
        std::fs::write(sheet, format!("{before}\n{text}")).unwrap();
    }

    /// The virtual truck on a bus, for a bounded time.
    pub fn truck(&self, bus: &str) -> Process {
        let mut command = sim_server();
        command.args(["ecu", &self.path("yard.toml"), "--bus", bus, "--duration", "120"]);
        Process::start(command)
    }

    /// Our program on a bus.
    pub fn node(&self, bus: &str, words: &[&str]) -> Process {
        self.node_with(bus, words, &[])
    }

    /// Our program on a bus, with more in its environment.
    pub fn node_with(&self, bus: &str, words: &[&str], environment: &[(&str, &str)]) -> Process {
        let mut command = node();
        command.envs(environment.iter().copied());
        command.args(["--can", bus, "--map", &self.path("road.xodr")]);
        command.args(["--truck", &self.path("sheet.toml")]).args(words);
        Process::start(command)
    }
}

/// A process whose output is read as it comes; it ends with the test at the latest.
pub struct Process {
    child: Child,
    lines: Receiver<String>,
    pub heard: Vec<String>,
}

impl Process {
    fn start(mut command: Command) -> Self {
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let (sender, lines) = channel();
        let (out, err) = (child.stdout.take().unwrap(), child.stderr.take().unwrap());
        let errors = sender.clone();
        std::thread::spawn(move || {
            BufReader::new(out).lines().map_while(Result::ok).try_for_each(|line| sender.send(line))
        });
        std::thread::spawn(move || {
            BufReader::new(err).lines().map_while(Result::ok).try_for_each(|line| errors.send(line))
        });
        Self { child, lines, heard: Vec::new() }
    }

    /// Waits for a line with these words, on stdout or stderr.
    pub fn until(&mut self, words: &str) -> String {
        let start = Instant::now();
        while start.elapsed() < PATIENCE {
            let Ok(line) = self.lines.recv_timeout(PATIENCE) else { break };
            self.heard.push(line.clone());
            if line.contains(words) {
                return line;
            }
        }
        panic!("waited in vain for {words:?}: {:#?}", self.heard)
    }

    /// All that it has said so far.
    pub fn said(&mut self) -> String {
        self.heard.extend(self.lines.try_iter());
        self.heard.join("\n")
    }

    /// Sends SIGTERM.
    pub fn terminate(&self) {
        let id = self.child.id().to_string();
        assert!(Command::new("kill").args(["-TERM", &id]).status().unwrap().success());
    }

    /// Waits for its end; everything that it said.
    pub fn end(mut self) -> (ExitStatus, String) {
        let start = Instant::now();
        loop {
            while let Ok(line) = self.lines.try_recv() {
                self.heard.push(line);
            }
            if let Some(status) = self.child.try_wait().unwrap() {
                self.heard.extend(self.lines.iter());
                return (status, self.heard.join("\n"));
            }
            assert!(start.elapsed() < PATIENCE, "it does not end: {:#?}", self.heard);
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A bus behind a server in a thread; what else happens on it is `act`'s.
pub struct Wire {
    pub name: String,
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Wire {
    pub fn new() -> Self {
        Self::with(|_, _| {})
    }

    /// `act` has another node of the bus and is called again and again.
    pub fn with(mut act: impl FnMut(Time, &mut LoopbackNode) + Send + 'static) -> Self {
        let wire = Loopback::new(BitRate::Kbit250, 2);
        let (node, mut other) = (wire.node(0), wire.node(1));
        let mut server = Server::bind("127.0.0.1:0", "can0", node).unwrap();
        let name = format!("socketcand:{}/can0", server.address().unwrap());
        let over = Arc::new(AtomicBool::new(false));
        let ends = Arc::clone(&over);
        let thread = std::thread::spawn(move || {
            let start = Instant::now();
            while !ends.load(Ordering::Relaxed) {
                let now = Time(start.elapsed().as_nanos() as i64);
                server.poll(now).unwrap();
                act(now, &mut other);
                std::thread::sleep(Duration::from_micros(500));
            }
        });
        Self { name, over, thread: Some(thread) }
    }
}

impl Drop for Wire {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// The one line and exit code 2 of a refusal.
pub fn refusal(output: &Output) -> String {
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{error}");
    let lines: Vec<_> = error.lines().filter(|line| line.starts_with("error: ")).collect();
    assert_eq!(lines.len(), 1, "{error}");
    lines[0].to_owned()
}

/// A number after a word, as in `up to 3.4 m/s`.
pub fn number_after(text: &str, word: &str) -> f64 {
    let rest = text.split(word).nth(1).unwrap_or_else(|| panic!("no {word:?} in {text}"));
    let number = rest.trim_start().split([' ', ',']).next().unwrap();
    number.parse().unwrap_or_else(|_| panic!("{number:?} after {word:?} in {text}"))
}
