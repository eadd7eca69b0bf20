//! Work that takes longer than an answer may: commands of this program, each in a process of its own.
//!
//! A process can be ended at any time, has its own memory, and writes what the command writes, into
//! a folder that goes with the job.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::Stdio;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::Duration;

use serde::Serialize;
use tempfile::TempDir;
use tokio::io::{AsyncBufReadExt, AsyncReadExt, BufReader};
use tokio::process::{Child, Command};
use tokio::sync::{Notify, Semaphore};

use crate::failure::Failure;

/// Jobs that are kept, at most; the oldest that has ended makes room.
const MOST: usize = 32;
/// Jobs that run at once, at most.
const AT_ONCE: usize = 1;
/// A job that takes longer is ended.
const LONGEST: Duration = Duration::from_secs(1800);
/// Jobs that are ended with the server have this time to go,
const LONGEST_END: Duration = Duration::from_secs(5);
/// and are looked for this often.
const LOOK: Duration = Duration::from_millis(10);
/// Longest line of a command that is kept, bytes.
const MAX_LINE_BYTES: u64 = 4_096;

/// How far a job is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "status", rename_all = "snake_case")]
pub(crate) enum Progress {
    /// Others are before it.
    Queued,
    Running {
        /// The last line that the command said.
        said: String,
    },
    Done,
    /// The command's exit code, and its line.
    Failed {
        exit_code: Option<i32>,
        why: String,
    },
    Cancelled,
    TimedOut,
}

impl Progress {
    const fn is_over(&self) -> bool {
        !matches!(self, Self::Queued | Self::Running { .. })
    }
}

/// A command under way, or what it left.
pub(crate) struct Job {
    pub(crate) id: String,
    /// The command: `plan`, `diagnose`.
    pub(crate) kind: &'static str,
    /// What was asked for.
    pub(crate) asked: serde_json::Value,
    folder: TempDir,
    progress: Mutex<Progress>,
    cancel: Notify,
}

impl Job {
    /// How far it is.
    pub(crate) fn progress(&self) -> Progress {
        self.lock().clone()
    }

    /// The files that it left, when it is done.
    pub(crate) fn files(&self) -> Vec<String> {
        if self.progress() != Progress::Done {
            return Vec::new();
        }
        let entries = std::fs::read_dir(self.out()).into_iter().flatten().flatten();
        let files = entries.filter(|e| e.file_type().is_ok_and(|kind| kind.is_file()));
        let mut names: Vec<_> = files.filter_map(|e| e.file_name().into_string().ok()).collect();
        names.sort();
        names
    }

    /// One of its files.
    pub(crate) fn file(&self, name: &str) -> Option<PathBuf> {
        self.files().iter().any(|file| file == name).then(|| self.out().join(name))
    }

    fn out(&self) -> PathBuf {
        self.folder.path().join("out")
    }

    fn note(&self, progress: Progress) {
        *self.lock() = progress;
    }

    fn lock(&self) -> MutexGuard<'_, Progress> {
        self.progress.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// All jobs of a server.
pub(crate) struct Jobs {
    all: Mutex<Kept>,
    places: Arc<Semaphore>,
}

#[derive(Default)]
struct Kept {
    jobs: BTreeMap<u64, Arc<Job>>,
    begun: u64,
}

impl Jobs {
    /// None yet.
    pub(crate) fn new() -> Self {
        Self { all: Mutex::default(), places: Arc::new(Semaphore::new(AT_ONCE)) }
    }

    /// Starts a command of this program with these arguments; `--out` is added. None: too many are
    /// under way.
    ///
    /// # Errors
    /// [`Failure::Work`]: there is no folder for it.
    pub(crate) fn start(
        &self,
        kind: &'static str,
        arguments: Vec<OsString>,
        asked: serde_json::Value,
    ) -> Result<Option<Arc<Job>>, Failure> {
        let folder = tempfile::Builder::new().prefix("tractrix-job-").tempdir();
        let folder = folder.map_err(|e| Failure::Work(format!("a folder for the job: {e}")))?;
        let mut all = self.lock();
        if all.jobs.len() >= MOST {
            let Some(oldest) = all.jobs.iter().find(|(_, job)| job.progress().is_over()) else {
                return Ok(None);
            };
            let oldest = *oldest.0;
            all.jobs.remove(&oldest);
        }
        all.begun += 1;
        let number = all.begun;
        let (progress, cancel) = (Mutex::new(Progress::Queued), Notify::new());
        let id = format!("j{number}");
        let job = Arc::new(Job { id, kind, asked, folder, progress, cancel });
        all.jobs.insert(number, Arc::clone(&job));
        tokio::spawn(carry_out(Arc::clone(&job), arguments, Arc::clone(&self.places)));
        Ok(Some(job))
    }

    /// All jobs, the newest first.
    pub(crate) fn all(&self) -> Vec<Arc<Job>> {
        self.lock().jobs.values().rev().cloned().collect()
    }

    /// A job by its id.
    pub(crate) fn get(&self, id: &str) -> Option<Arc<Job>> {
        self.lock().jobs.values().find(|job| job.id == id).cloned()
    }

    /// Ends a job, and forgets it with its files.
    pub(crate) fn remove(&self, id: &str) -> bool {
        let mut all = self.lock();
        let found = all.jobs.iter().find(|(_, job)| job.id == id).map(|(number, _)| *number);
        let Some(job) = found.and_then(|number| all.jobs.remove(&number)) else { return false };
        job.cancel.notify_one();
        true
    }

    /// Ends all jobs, and removes their files; those under way get a moment to go.
    pub(crate) async fn end(&self) {
        let jobs = std::mem::take(&mut self.lock().jobs);
        for job in jobs.values() {
            job.cancel.notify_one();
        }
        let all: Vec<Weak<Job>> = jobs.values().map(Arc::downgrade).collect();
        drop(jobs);
        let gone = async {
            while all.iter().any(|job| job.strong_count() > 0) {
                tokio::time::sleep(LOOK).await;
            }
        };
        // Who still looks at a file keeps it a little longer
        let _ = tokio::time::timeout(LONGEST_END, gone).await;
    }

    fn lock(&self) -> MutexGuard<'_, Kept> {
        self.all.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

async fn carry_out(job: Arc<Job>, arguments: Vec<OsString>, places: Arc<Semaphore>) {
    let ended = tokio::select! {
        biased;
        () = job.cancel.notified() => Progress::Cancelled,
        ended = in_turn(&job, arguments, &places) => ended,
    };
    job.note(ended);
}

async fn in_turn(job: &Job, arguments: Vec<OsString>, places: &Semaphore) -> Progress {
    let Ok(_place) = places.acquire().await else { return Progress::Cancelled };
    job.note(Progress::Running { said: String::new() });
    match tokio::time::timeout(LONGEST, command(job, arguments)).await {
        Ok(Ok(ended)) => ended,
        Ok(Err(e)) => Progress::Failed { exit_code: None, why: e.to_string() },
        Err(_) => Progress::TimedOut,
    }
}

/// Runs the command; it dies with this future.
async fn command(job: &Job, arguments: Vec<OsString>) -> std::io::Result<Progress> {
    let mut child = Command::new(std::env::current_exe()?)
        .arg(job.kind)
        .args(arguments)
        .arg("--out")
        .arg(job.out())
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .kill_on_drop(true)
        .spawn()?;
    let said = listen(&mut child, job).await;
    let status = child.wait().await?;
    if status.success() {
        return Ok(Progress::Done);
    }
    let why = said.strip_prefix("error: ").unwrap_or(&said);
    let place = format!("{}/", job.out().display());
    let why = why.replace(&place, "");
    Ok(Progress::Failed { exit_code: status.code(), why })
}

/// Keeps the last line that the command says, until it says no more.
async fn listen(child: &mut Child, job: &Job) -> String {
    let mut last = String::new();
    let Some(stderr) = child.stderr.take() else { return last };
    let mut reader = BufReader::new(stderr);
    loop {
        let mut line = Vec::new();
        match (&mut reader).take(MAX_LINE_BYTES).read_until(b'\n', &mut line).await {
            Ok(1..) => {
                last = String::from_utf8_lossy(&line).trim_end().to_owned();
                job.note(Progress::Running { said: last.clone() });
            }
            _ => return last,
        }
    }
}
