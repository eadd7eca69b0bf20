//! The folder that a command writes into: what lies in it is not overwritten, and a command that
//! fails leaves nothing behind.
//!
//! Everything that a command writes goes through [`OutFolder::begin`]. Results of an earlier run
//! that are to be overwritten are put aside first and come back if the command fails; what the
//! command began, and the folders that it made, are removed then. [`OutFolder::keep`] ends that.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use clap::Args;

use crate::failure::Failure;
use crate::signals;

/// What a folder that holds a run is told by.
const RUN: &str = "run.mcap";
/// Where replaced results lie until the command has succeeded.
const ASIDE: &str = ".replaced";

/// Where the results go, on the command line.
#[derive(Debug, Args)]
pub(crate) struct Out {
    /// Folder of the results.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Replaces results that are in that folder.
    #[arg(long)]
    overwrite: bool,
}

impl Out {
    /// The folder, refused if it holds a run or one of `results`. Ctrl-C, SIGTERM and SIGHUP
    /// undo what was begun in it and end the program.
    ///
    /// # Errors
    /// As [`OutFolder::new`].
    pub(crate) fn folder(&self, results: &'static [&'static str]) -> Result<OutFolder, Failure> {
        let folder = OutFolder::new(self.out.clone(), self.overwrite, results)?;
        let state = Arc::clone(&folder.0);
        signals::on_stop(move |signal| {
            let mut state = lock(&state);
            if state.stop.as_ref().is_some_and(|stop| !stop.swap(true, Ordering::Relaxed)) {
                return;
            }
            state.undo();
            std::process::exit(signal.exit_code());
        })?;
        Ok(folder)
    }
}

/// A folder of results under way. Dropped without [`Self::keep`] it is as it was before.
#[derive(Debug)]
pub(crate) struct OutFolder(Arc<Mutex<State>>);

#[derive(Debug)]
struct State {
    folder: PathBuf,
    overwrite: bool,
    /// File names that the command writes; `*` stands for any start of the name.
    results: &'static [&'static str],
    /// Folders that did not exist, outermost first.
    made: Vec<PathBuf>,
    /// Names that were begun.
    begun: Vec<String>,
    /// Names that lie aside.
    aside: Vec<String>,
    open: bool,
    /// From now on nothing is undone.
    kept: bool,
    /// What the first signal raises instead of ending the program.
    stop: Option<Arc<AtomicBool>>,
}

impl OutFolder {
    /// Claims a folder; nothing is written yet.
    ///
    /// # Errors
    /// [`Failure::Input`] names the result that is in it already, without `overwrite`.
    pub(crate) fn new(
        folder: PathBuf,
        overwrite: bool,
        results: &'static [&'static str],
    ) -> Result<Self, Failure> {
        let state = State {
            folder,
            overwrite,
            results,
            made: Vec::new(),
            begun: Vec::new(),
            aside: Vec::new(),
            open: false,
            kept: false,
            stop: None,
        };
        if !overwrite && let Some(name) = state.there().first() {
            return Err(state.taken(name));
        }
        Ok(Self(Arc::new(Mutex::new(state))))
    }

    /// Makes a folder that was not there: the first of these names that is free.
    ///
    /// # Errors
    /// [`Failure`] names the folder that cannot be made.
    pub(crate) fn fresh(
        parent: &Path,
        names: impl Iterator<Item = String>,
        results: &'static [&'static str],
    ) -> Result<Self, Failure> {
        for name in names {
            let folder = parent.join(name);
            if folder.symlink_metadata().is_ok() {
                continue;
            }
            let out = Self::new(folder.clone(), false, results)?;
            let mut state = lock(&out.0);
            state.remember_missing();
            std::fs::create_dir_all(parent).map_err(|e| Failure::writing(parent, &e))?;
            match std::fs::create_dir(&folder) {
                Ok(()) => {
                    state.open = true;
                    drop(state);
                    return Ok(out);
                }
                // Another run was quicker: its folder is not ours to remove
                Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => state.made.clear(),
                Err(e) => return Err(Failure::writing(&folder, &e)),
            }
        }
        Err(Failure::Work(format!("{}: too many runs", parent.display())))
    }

    /// The folder.
    pub(crate) fn path(&self) -> PathBuf {
        lock(&self.0).folder.clone()
    }

    /// Where a file or folder of the results goes. Makes the folder and puts earlier results aside.
    ///
    /// # Errors
    /// [`Failure`] names the folder that cannot be made, or what is in it already.
    pub(crate) fn begin(&self, name: &str) -> Result<PathBuf, Failure> {
        lock(&self.0).begin(name)
    }

    /// Writes a file of the results.
    ///
    /// # Errors
    /// [`Failure`] names the file; nothing of it is left.
    pub(crate) fn write(&self, name: &str, content: impl AsRef<[u8]>) -> Result<(), Failure> {
        let path = self.begin(name)?;
        write_whole(&path, content.as_ref())
    }

    /// From now on the first signal only raises this flag: the command ends in good order.
    pub(crate) fn stop_in_good_order(&self) -> Arc<AtomicBool> {
        Arc::clone(lock(&self.0).stop.get_or_insert_default())
    }

    /// The command has succeeded, or what it wrote is worth keeping: earlier results go.
    pub(crate) fn keep(&self) {
        let mut state = lock(&self.0);
        if !state.aside.is_empty() {
            let _ = std::fs::remove_dir_all(state.folder.join(ASIDE));
        }
        state.kept = true;
    }
}

impl Drop for OutFolder {
    fn drop(&mut self) {
        lock(&self.0).undo();
    }
}

fn lock(state: &Mutex<State>) -> MutexGuard<'_, State> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

impl State {
    /// Results in the folder: those of this command, and a run.
    fn there(&self) -> Vec<String> {
        let entries = std::fs::read_dir(&self.folder).into_iter().flatten().flatten();
        let names = entries.filter_map(|e| e.file_name().to_str().map(str::to_owned));
        let is_result = |name: &String| {
            name == RUN
                || self.results.iter().any(|result| match result.strip_prefix('*') {
                    Some(end) => name.ends_with(end),
                    None => name == result,
                })
        };
        let mut names: Vec<String> = names.filter(is_result).collect();
        names.sort();
        names
    }

    fn taken(&self, name: &str) -> Failure {
        Failure::Input(format!(
            "--out {}: {name} is in it already; choose another folder, or --overwrite",
            self.folder.display()
        ))
    }

    fn begin(&mut self, name: &str) -> Result<PathBuf, Failure> {
        if !self.open {
            self.make_folder()?;
            self.open = true;
            // A run stays where only other results are replaced.
            for name in self.there().iter().filter(|n| *n != RUN || self.results.contains(&RUN)) {
                self.put_aside(name)?;
            }
        }
        let path = self.folder.join(name);
        if !self.begun.iter().any(|b| b == name) {
            if path.symlink_metadata().is_ok() {
                if !self.overwrite {
                    return Err(self.taken(name));
                }
                self.put_aside(name)?;
            }
            self.begun.push(name.to_owned());
        }
        Ok(path)
    }

    /// Makes the folder, and remembers which of its parents were not there.
    fn make_folder(&mut self) -> Result<(), Failure> {
        self.remember_missing();
        std::fs::create_dir_all(&self.folder).map_err(|e| Failure::writing(&self.folder, &e))
    }

    fn remember_missing(&mut self) {
        let missing = self
            .folder
            .ancestors()
            .take_while(|a| *a != Path::new("") && a.symlink_metadata().is_err());
        let mut missing: Vec<PathBuf> = missing.map(Path::to_owned).collect();
        missing.reverse();
        self.made = missing;
    }

    fn put_aside(&mut self, name: &str) -> Result<(), Failure> {
        let aside = self.folder.join(ASIDE);
        let moved = std::fs::create_dir_all(&aside)
            .and_then(|()| std::fs::rename(self.folder.join(name), aside.join(name)));
        moved.map_err(|e| Failure::writing(&self.folder.join(name), &e))?;
        self.aside.push(name.to_owned());
        Ok(())
    }

    /// Makes the folder what it was.
    fn undo(&mut self) {
        if self.kept {
            return;
        }
        for name in self.begun.drain(..) {
            remove(&self.folder.join(name));
        }
        let aside = self.folder.join(ASIDE);
        for name in self.aside.drain(..) {
            let _ = std::fs::rename(aside.join(&name), self.folder.join(&name));
        }
        let _ = std::fs::remove_dir(aside);
        for folder in self.made.drain(..).rev() {
            let _ = std::fs::remove_dir(folder);
        }
        self.open = false;
    }
}

/// Removes a file or a folder with all that is in it.
fn remove(path: &Path) {
    let is_folder = path.symlink_metadata().is_ok_and(|m| m.is_dir());
    let _ = if is_folder { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) };
}

/// Writes a whole file, or nothing.
///
/// # Errors
/// [`Failure`] names the file.
pub(crate) fn write_whole(path: &Path, content: &[u8]) -> Result<(), Failure> {
    let written = std::fs::write(path, content);
    written.map_err(|e| {
        if path.file_name().is_some_and(|name| name != OsStr::new("")) {
            remove(path);
        }
        Failure::writing(path, &e)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const RESULTS: &[&str] = &["plan.json", "*.extended.toml"];

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|e| e.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    fn open(folder: &Path, overwrite: bool) -> Result<OutFolder, Failure> {
        OutFolder::new(folder.to_owned(), overwrite, RESULTS)
    }

    #[test]
    fn a_folder_with_results_or_a_run_is_refused_and_named() {
        let there = tempfile::tempdir().unwrap();
        std::fs::write(there.path().join("notes.txt"), "mine").unwrap();
        assert!(open(there.path(), false).is_ok(), "other files are in nobody's way");
        for name in ["plan.json", "iits.extended.toml", "run.mcap"] {
            let file = there.path().join(name);
            std::fs::write(&file, "old").unwrap();
            let line = open(there.path(), false).unwrap_err().line();
            assert!(line.contains(name) && line.contains("--overwrite"), "{line}");
            assert!(open(there.path(), true).is_ok());
            std::fs::remove_file(file).unwrap();
        }
    }

    #[test]
    fn what_failed_leaves_no_file_and_no_folder() {
        let there = tempfile::tempdir().unwrap();
        let out = open(&there.path().join("a/b"), false).unwrap();
        out.write("plan.json", "half").unwrap();
        std::fs::create_dir(out.begin("drives").unwrap()).unwrap();
        drop(out);
        assert!(names(there.path()).is_empty());
    }

    #[test]
    fn what_was_to_be_replaced_comes_back_after_a_failure_and_goes_after_a_success() {
        let there = tempfile::tempdir().unwrap();
        let (plan, old) = (there.path().join("plan.json"), there.path().join("x.extended.toml"));
        std::fs::write(&plan, "old").unwrap();
        std::fs::write(&old, "old").unwrap();
        let out = open(there.path(), true).unwrap();
        out.write("plan.json", "new").unwrap();
        drop(out);
        assert_eq!(std::fs::read_to_string(&plan).unwrap(), "old");
        assert_eq!(names(there.path()), ["plan.json", "x.extended.toml"]);

        let out = open(there.path(), true).unwrap();
        out.write("plan.json", "new").unwrap();
        out.keep();
        out.write("more.json", "new").unwrap();
        drop(out);
        assert_eq!(std::fs::read_to_string(&plan).unwrap(), "new");
        let left = names(there.path());
        assert_eq!(left, ["more.json", "plan.json"], "no result of the earlier command is left");
    }

    #[test]
    fn a_name_that_is_no_result_is_not_taken_from_the_user() {
        let there = tempfile::tempdir().unwrap();
        std::fs::create_dir(there.path().join("drives")).unwrap();
        let out = open(there.path(), false).unwrap();
        assert!(out.begin("drives").unwrap_err().line().contains("drives"));
        drop(out);
        assert_eq!(names(there.path()), ["drives"]);
    }
}
