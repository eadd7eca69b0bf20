//! The SUMO process: found, started, watched, ended.
//!
//! Always the native program is started, never the Python wrapper that `pip` puts into `bin/`: the
//! wrapper forks, so that a kill would hit Python and leave SUMO running.
//!
//! A SUMO whose client is gone ends by itself ("peer shutdown"); before a client has connected it
//! would wait for ever, which is why a [`Process`] kills its child when it is dropped.

use std::collections::VecDeque;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError};

use super::error::SumoError;

/// Error output that is kept, bytes.
const STDERR_BYTES: usize = 64 << 10;
/// A program is asked for its version this long, s.
const WORDS_S: u64 = 10;
/// Of the answer so much is read, bytes, and so much shown, characters.
const WORDS_BYTES: u64 = 4 << 10;
const WORDS_SHOWN: usize = 200;

/// Where SUMO's programs are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Programs {
    /// The native `sumo`.
    pub sumo: PathBuf,
    /// `netconvert` beside it.
    pub netconvert: PathBuf,
    /// SUMO_HOME: type maps and schemas.
    pub home: PathBuf,
    /// What it calls itself and its version: `SUMO 1.28.0`.
    pub version: String,
}

impl Programs {
    /// Finds SUMO: the given path or that in `SUMO_BINARY`; if there is neither,
    /// `SUMO_HOME/bin/sumo`, the Python package `eclipse-sumo`, the PATH. A program counts if it
    /// gives SUMO's version and netconvert lies beside it.
    ///
    /// # Errors
    /// [`SumoError::NotFound`] says where it was looked for, what other programs printed there, and
    /// how to get it.
    pub fn find(given: Option<&Path>) -> Result<Self, SumoError> {
        let mut tried = Vec::new();
        let mut candidates: Vec<PathBuf> = Vec::new();
        // Who names a program gets this one or an error, not another version.
        if let Some(path) = given.map(Path::to_owned).or(environment("SUMO_BINARY").map(Into::into))
        {
            candidates.push(path);
        } else {
            candidates.extend(environment("SUMO_HOME").map(|h| Path::new(&h).join("bin/sumo")));
            candidates.extend(python_home(Path::new("python3")).map(|h| h.join("bin/sumo")));
            let path = environment("PATH").unwrap_or_default();
            candidates.extend(std::env::split_paths(&path).map(|dir| dir.join("sumo")));
        }
        for candidate in candidates {
            if !candidate.is_file() {
                tried.push(candidate.display().to_string());
                continue;
            }
            match native(&candidate).and_then(Self::beside) {
                Ok(programs) => return Ok(programs),
                Err(why) => tried.push(format!("{}: {why}", candidate.display())),
            }
        }
        Err(SumoError::NotFound { tried: tried.join(", ") })
    }

    fn beside(sumo: PathBuf) -> Result<Self, String> {
        let bin = sumo.parent().unwrap_or(Path::new("")).to_owned();
        let home = bin.parent().unwrap_or(Path::new("")).to_owned();
        let home = if home.join("data").is_dir() { home } else { PathBuf::from("/usr/share/sumo") };
        let version = String::new();
        let mut programs = Self { netconvert: bin.join("netconvert"), sumo, home, version };
        let mut question = programs.command(&programs.sumo);
        let said = first_words(question.arg("--version"))?;
        // `Eclipse SUMO sumo Version 1.28.0`, `Eclipse SUMO sumo v1_28_0`.
        let line = said.lines().next().unwrap_or_default();
        let number = line.split_whitespace().last().unwrap_or_default().trim_start_matches('v');
        if !line.contains("SUMO") || !number.starts_with(|c: char| c.is_ascii_digit()) {
            return Err(format!("not SUMO, printed {}", quoted(&said)));
        }
        if !programs.netconvert.is_file() {
            return Err(format!("no {} beside it", programs.netconvert.display()));
        }
        programs.version = format!("SUMO {number}");
        Ok(programs)
    }

    /// A command with the environment that SUMO's programs need.
    pub(crate) fn command(&self, program: &Path) -> Command {
        let mut command = Command::new(program);
        command.env("SUMO_HOME", &self.home).env("PROJ_LIB", self.home.join("data/proj"));
        command.stdin(Stdio::null());
        command
    }
}

/// What a program prints first, whether to its output or its error output. Whoever neither ends nor
/// closes both within [`WORDS_S`] is ended.
#[expect(clippy::disallowed_methods, reason = "the program is waited for, and read by threads")]
fn first_words(command: &mut Command) -> Result<String, String> {
    let mut child = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|e| format!("not started: {e}"))?;
    let (send, words) = std::sync::mpsc::channel();
    let pipes: [Option<Box<dyn Read + Send>>; 2] = [
        child.stdout.take().map(|pipe| Box::new(pipe) as _),
        child.stderr.take().map(|pipe| Box::new(pipe) as _),
    ];
    for pipe in pipes.into_iter().flatten() {
        let send = send.clone();
        std::thread::spawn(move || {
            let mut text = Vec::new();
            let _ = pipe.take(WORDS_BYTES).read_to_end(&mut text);
            let _ = send.send(String::from_utf8_lossy(&text).trim().to_owned());
        });
    }
    drop(send);
    let mut said = Vec::new();
    for _ in 0..2 {
        match words.recv_timeout(std::time::Duration::from_secs(WORDS_S)) {
            Ok(text) => said.push(text),
            Err(_) => break,
        }
    }
    let _ = child.kill();
    let _ = child.wait();
    Ok(said.into_iter().find(|text| !text.is_empty()).unwrap_or_default())
}

/// The beginning of what a program printed, on one line.
fn quoted(said: &str) -> String {
    let line = said.lines().map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>();
    let shown: String = line.join(" | ").chars().take(WORDS_SHOWN).collect();
    if shown.is_empty() { "nothing".to_owned() } else { format!("`{shown}`") }
}

#[expect(clippy::disallowed_methods, reason = "the process shell looks up where SUMO is installed")]
fn environment(name: &str) -> Option<String> {
    std::env::var(name).ok().filter(|value| !value.is_empty())
}

/// The native program behind a path: itself, or what a Python wrapper stands for.
fn native(path: &Path) -> Result<PathBuf, String> {
    let mut file = std::fs::File::open(path).map_err(|e| e.to_string())?;
    let mut head = [0u8; 256];
    let n = file.read(&mut head).map_err(|e| e.to_string())?;
    let head = head.get(..n).unwrap_or_default();
    if !head.starts_with(b"#!") {
        return Ok(path.to_owned());
    }
    let line = head.split(|&b| b == b'\n').next().unwrap_or_default();
    let interpreter = String::from_utf8_lossy(line).trim_start_matches("#!").trim().to_owned();
    match python_home(Path::new(&interpreter)).map(|home| home.join("bin/sumo")) {
        Some(sumo) if sumo.is_file() => Ok(sumo),
        _ => {
            let said = first_words(Command::new(path).arg("--version").stdin(Stdio::null()))?;
            Err(format!("not the native program but a script, printed {}", quoted(&said)))
        }
    }
}

/// SUMO_HOME of the package `eclipse-sumo` of a Python interpreter.
fn python_home(python: &Path) -> Option<PathBuf> {
    let out = Command::new(python)
        .args(["-c", "import sumo; print(sumo.SUMO_HOME)"])
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .output()
        .ok()?;
    let home = String::from_utf8(out.stdout).ok()?;
    out.status.success().then(|| PathBuf::from(home.trim()))
}

/// A running SUMO.
#[derive(Debug)]
pub struct Process {
    child: Child,
    stderr: Arc<Mutex<VecDeque<u8>>>,
    /// Reads the error output until that ends.
    reader: Option<std::thread::JoinHandle<()>>,
}

impl Process {
    /// Starts SUMO with these options.
    ///
    /// # Errors
    /// [`SumoError::Startup`] if the system cannot start it.
    #[expect(clippy::disallowed_methods, reason = "the error output of SUMO is read by a thread")]
    pub fn start(programs: &Programs, options: &[String]) -> Result<Self, SumoError> {
        let mut child = programs
            .command(&programs.sumo)
            .args(options)
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|e| SumoError::Startup {
                exit: "not started".to_owned(),
                stderr: format!("{}: {e}", programs.sumo.display()),
            })?;
        let stderr = Arc::new(Mutex::new(VecDeque::new()));
        let reader = child.stderr.take().map(|mut pipe| {
            let ring = Arc::clone(&stderr);
            std::thread::spawn(move || {
                let mut chunk = [0u8; 4096];
                while let Ok(n) = pipe.read(&mut chunk) {
                    let Some(new) = chunk.get(..n).filter(|new| !new.is_empty()) else { break };
                    let mut ring = ring.lock().unwrap_or_else(PoisonError::into_inner);
                    ring.extend(new);
                    let over = ring.len().saturating_sub(STDERR_BYTES);
                    ring.drain(..over);
                }
            })
        });
        Ok(Self { child, stderr, reader })
    }

    /// Process id, for those who watch it.
    #[must_use]
    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Does it still run?
    pub fn is_alive(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(None))
    }

    /// How it ended, in words; waits up to a fifth of a second for a process that is just ending, and for
    /// what it has printed to be read: on a busy machine its last words were still in the pipe.
    #[expect(
        clippy::disallowed_methods,
        reason = "gives an ending process time to leave its status"
    )]
    pub fn ending(&mut self) -> String {
        let mut ended = None;
        for _ in 0..100 {
            match self.child.try_wait() {
                Ok(Some(status)) => ended = Some(status.to_string()),
                Ok(None) => {}
                Err(e) => return e.to_string(),
            }
            let read = self.reader.as_ref().is_none_or(std::thread::JoinHandle::is_finished);
            match ended.take_if(|_| read) {
                Some(ended) => return ended,
                None => std::thread::sleep(std::time::Duration::from_millis(2)),
            }
        }
        ended.unwrap_or_else(|| "still running".to_owned())
    }

    /// The last lines of its error output.
    #[must_use]
    pub fn last_words(&self) -> String {
        let ring = self.stderr.lock().unwrap_or_else(PoisonError::into_inner);
        let bytes: Vec<u8> = ring.iter().copied().collect();
        let text = String::from_utf8_lossy(&bytes);
        let useful = text.lines().filter(|line| !line.contains("proj.db"));
        let lines: Vec<&str> = useful.collect();
        lines.get(lines.len().saturating_sub(8)..).unwrap_or_default().join(" | ")
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
