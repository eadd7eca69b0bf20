//! A folder of runs: which there are, what they say of themselves, and their end.

use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use serde::Serialize;
use serde_json::Value;

use crate::failure::Failure;
use crate::session::RESULTS;

/// Runs that are listed, at most: the newest.
const MOST: usize = 1_000;
/// Longest summary that is read, bytes.
const MAX_SUMMARY_BYTES: u64 = 4 << 20;

/// The folder.
#[derive(Debug, Clone)]
pub(crate) enum RunFolder {
    /// Each run has a folder of its own in it.
    Of(PathBuf),
    /// The first run lies in the folder itself, as `run-1`, later ones in `run-2`, ...
    Named(PathBuf),
}

/// A run in the folder.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct FoundRun {
    /// Its name: lower-case letters, digits and hyphens.
    pub(crate) name: String,
    /// When its recording was written to last, s since 1970.
    pub(crate) written_unix_s: f64,
    /// Length of its recording, bytes.
    pub(crate) recording_bytes: u64,
    /// Its summary; none before its end, and after a crash.
    pub(crate) summary: Option<Value>,
    #[serde(skip)]
    pub(crate) folder: PathBuf,
}

impl FoundRun {
    /// Its recording.
    pub(crate) fn recording(&self) -> PathBuf {
        self.folder.join(RESULTS[0])
    }

    /// Removes the run's files, and its folder when nothing else is in it.
    ///
    /// # Errors
    /// [`Failure::Work`] names the file that cannot be removed.
    pub(crate) fn remove(&self) -> Result<(), Failure> {
        for name in RESULTS.iter().chain(&[RECOVERED]) {
            let path = self.folder.join(name);
            let removed = match path.symlink_metadata() {
                Err(_) => continue,
                Ok(kind) if kind.is_dir() => std::fs::remove_dir_all(&path),
                Ok(_) => std::fs::remove_file(&path),
            };
            removed.map_err(|e| Failure::Work(format!("{name}: {e}")))?;
        }
        // Something else in it is not ours to remove
        let _ = std::fs::remove_dir(&self.folder);
        Ok(())
    }
}

/// What `recover` leaves beside a torn recording.
const RECOVERED: &str = "run.recovered.mcap";

impl RunFolder {
    /// The folder on the disk.
    pub(crate) fn path(&self) -> &Path {
        match self {
            Self::Of(path) | Self::Named(path) => path,
        }
    }

    /// The runs, the newest first.
    pub(crate) fn runs(&self) -> Vec<FoundRun> {
        let entries = std::fs::read_dir(self.path()).into_iter().flatten().flatten();
        let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
        let first = matches!(self, Self::Named(_)).then(|| FIRST.to_owned());
        let mut found: Vec<_> = names.chain(first).filter_map(|name| self.find(&name)).collect();
        found.sort_by(|a, b| {
            b.written_unix_s.total_cmp(&a.written_unix_s).then_with(|| a.name.cmp(&b.name))
        });
        found.truncate(MOST);
        found
    }

    /// A run by its name. No name leads out of the folder, nor does a symbolic link.
    pub(crate) fn find(&self, name: &str) -> Option<FoundRun> {
        let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        if name.is_empty() || name.len() > 200 || !name.chars().all(plain) {
            return None;
        }
        let folder = match self {
            Self::Named(path) if name == FIRST => path.clone(),
            Self::Named(path) | Self::Of(path) => {
                let folder = path.join(name);
                folder.symlink_metadata().ok().filter(std::fs::Metadata::is_dir)?;
                folder
            }
        };
        let recording = folder.join(RESULTS[0]).symlink_metadata().ok();
        let recording = recording.filter(std::fs::Metadata::is_file)?;
        let written = recording.modified().unwrap_or(SystemTime::UNIX_EPOCH);
        let written_unix_s = written.duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64();
        let summary = summary_of(&folder);
        let (name, recording_bytes) = (name.to_owned(), recording.len());
        Some(FoundRun { name, written_unix_s, recording_bytes, summary, folder })
    }
}

/// The run that lies in the folder itself.
const FIRST: &str = "run-1";

fn summary_of(folder: &Path) -> Option<Value> {
    let path = folder.join("summary.json");
    let small = |m: &std::fs::Metadata| m.is_file() && m.len() <= MAX_SUMMARY_BYTES;
    path.symlink_metadata().ok().filter(small)?;
    serde_json::from_slice(&std::fs::read(path).ok()?).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(folder: &Path, name: &str) {
        std::fs::create_dir_all(folder).unwrap();
        std::fs::write(folder.join(name), "{\"seed\": 1}").unwrap();
    }

    #[test]
    fn runs_are_found_by_plain_names_and_nothing_else_is() {
        let there = tempfile::tempdir().unwrap();
        let root = there.path().join("runs");
        write(&root.join("flat-1"), "run.mcap");
        write(&root.join("flat-1"), "summary.json");
        write(&root.join("Other"), "run.mcap");
        write(&root.join("empty"), "notes.txt");
        write(&there.path().join("secret"), "run.mcap");
        std::os::unix::fs::symlink("../secret", root.join("link")).unwrap();
        write(&root.join("linked"), "x");
        std::os::unix::fs::symlink("../../secret/run.mcap", root.join("linked/run.mcap")).unwrap();
        let folder = RunFolder::Of(root.clone());
        let names: Vec<String> = folder.runs().into_iter().map(|run| run.name).collect();
        assert_eq!(names, ["flat-1"]);
        for name in ["", ".", "..", "../secret", "link", "linked", "Other", "a/b", "a\0b", "ä"] {
            assert_eq!(folder.find(name), None, "{name:?}");
        }
        let run = folder.find("flat-1").unwrap();
        assert_eq!(run.summary.as_ref().unwrap()["seed"], 1);
        write(&run.folder, "notes.txt");
        run.remove().unwrap();
        assert_eq!(folder.find("flat-1"), None);
        assert!(root.join("flat-1/notes.txt").exists(), "what is not of the run stays");
    }

    #[test]
    fn the_runs_of_a_named_folder_are_numbered() {
        let there = tempfile::tempdir().unwrap();
        write(there.path(), "run.mcap");
        write(&there.path().join("run-2"), "run.mcap");
        let folder = RunFolder::Named(there.path().to_owned());
        let mut names: Vec<String> = folder.runs().into_iter().map(|run| run.name).collect();
        names.sort();
        assert_eq!(names, ["run-1", "run-2"]);
        assert_eq!(RunFolder::Of("/nothing/here".into()).runs(), []);
    }
}
