//! The driver's wish to hand over, or to drive himself, on a Unix socket: one word, one answer. The
//! socket is its owner's alone; a port would be open to every program on the computer, and through
//! browsers to more.

use std::io::{ErrorKind, Read, Write};
use std::os::unix::fs::{FileTypeExt, PermissionsExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::failure::Failure;

/// Who has connected has so long to say his word.
const PATIENCE: Duration = Duration::from_secs(1);
/// No word is longer, bytes.
const LONGEST: usize = 64;

/// What is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Asked {
    /// That the system drives.
    Engage,
    /// That it lets go of the truck.
    Disengage,
}

/// The socket, and who is at it.
pub(crate) struct Control {
    listener: UnixListener,
    path: PathBuf,
    client: Option<Client>,
}

struct Client {
    stream: UnixStream,
    since: Duration,
    word: Vec<u8>,
    /// He has said his word and waits for the answer.
    waits: bool,
}

impl Control {
    /// Makes the socket. One that is left of an earlier run is replaced.
    ///
    /// # Errors
    /// [`Failure::Input`] names a path that cannot be used, or that somebody listens on.
    pub(crate) fn bind(path: &Path) -> Result<Self, Failure> {
        let fail = |e: std::io::Error| Failure::input(format!("--control {}: {e}", path.display()));
        let is_socket = path.symlink_metadata().is_ok_and(|m| m.file_type().is_socket());
        if is_socket && UnixStream::connect(path).is_err() {
            std::fs::remove_file(path).map_err(fail)?;
        }
        let listener = UnixListener::bind(path).map_err(fail)?;
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o600)).map_err(fail)?;
        listener.set_nonblocking(true).map_err(fail)?;
        Ok(Self { listener, path: path.to_owned(), client: None })
    }

    /// What is asked for, if anything; [`Self::answer`] comes next. Nobody is waited for.
    pub(crate) fn asked(&mut self, elapsed: Duration) -> Option<Asked> {
        if self.client.is_none() {
            let (stream, _) = self.listener.accept().ok()?;
            stream.set_nonblocking(true).ok()?;
            self.client = Some(Client { stream, since: elapsed, word: Vec::new(), waits: false });
        }
        let client = self.client.as_mut()?;
        let mut bytes = [0; LONGEST];
        let is_over = match client.stream.read(&mut bytes) {
            Ok(read) => {
                client.word.extend_from_slice(bytes.get(..read).unwrap_or_default());
                read == 0 || client.word.len() >= LONGEST
            }
            Err(e) if e.kind() == ErrorKind::WouldBlock => {
                elapsed.saturating_sub(client.since) >= PATIENCE
            }
            Err(_) => true,
        };
        let line = client.word.iter().position(|byte| *byte == b'\n');
        let word = match line.and_then(|end| client.word.get(..end)) {
            Some(word) => word,
            None if is_over => &[],
            None => return None,
        };
        let asked = match word {
            b"engage" => Asked::Engage,
            b"disengage" => Asked::Disengage,
            _ => {
                self.answer("engage or disengage, and a new line");
                return None;
            }
        };
        client.waits = true;
        Some(asked)
    }

    /// Whether somebody waits for an answer.
    pub(crate) fn waits(&self) -> bool {
        self.client.as_ref().is_some_and(|client| client.waits)
    }

    /// Answers, and takes leave.
    pub(crate) fn answer(&mut self, line: &str) {
        if let Some(Client { mut stream, .. }) = self.client.take() {
            // It fits into the socket's buffer; who has gone does not hear it
            let _ = writeln!(stream, "{line}");
        }
    }
}

impl Drop for Control {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::*;

    fn connected(control: &Control, says: &str) -> UnixStream {
        let mut stream = UnixStream::connect(&control.path).unwrap();
        stream.write_all(says.as_bytes()).unwrap();
        stream
    }

    fn heard(mut stream: UnixStream) -> String {
        let mut text = String::new();
        stream.read_to_string(&mut text).unwrap();
        text
    }

    #[test]
    fn two_words_are_understood_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let mut control = Control::bind(&folder.path().join("control")).unwrap();
        assert_eq!(control.asked(Duration::ZERO), None);
        for (says, asked) in [("engage\n", Asked::Engage), ("disengage\n", Asked::Disengage)] {
            let stream = connected(&control, says);
            assert_eq!(control.asked(Duration::ZERO), Some(asked));
            assert!(control.waits());
            control.answer("done");
            assert_eq!(heard(stream), "done\n");
            assert!(!control.waits());
        }
        for says in ["Engage\n", "\n", "engage it at once, please\n", &"engage!!".repeat(8)] {
            let stream = connected(&control, says);
            assert_eq!(control.asked(Duration::ZERO), None, "{says}");
            assert!(heard(stream).starts_with("engage or disengage"), "{says}");
        }
    }

    #[test]
    fn who_says_nothing_does_not_keep_others_waiting() {
        let folder = tempfile::tempdir().unwrap();
        let mut control = Control::bind(&folder.path().join("control")).unwrap();
        let silent = connected(&control, "eng");
        assert_eq!(control.asked(Duration::ZERO), None);
        assert_eq!(control.asked(PATIENCE), None);
        assert!(heard(silent).starts_with("engage or disengage"));
        let _next = connected(&control, "engage\n");
        assert_eq!(control.asked(PATIENCE), Some(Asked::Engage));
    }

    #[test]
    fn the_socket_is_its_owner_s_and_not_taken_from_who_listens() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("control");
        std::fs::write(&path, "mine").unwrap();
        assert!(Control::bind(&path).is_err());
        std::fs::remove_file(&path).unwrap();
        let control = Control::bind(&path).unwrap();
        assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, 0o600);
        assert!(Control::bind(&path).is_err());
        drop(control);
        assert!(!path.exists());
        // what a program that was killed leaves behind
        drop(UnixListener::bind(&path).unwrap());
        assert!(path.exists());
        Control::bind(&path).unwrap();
    }
}
