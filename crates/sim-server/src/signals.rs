//! Ctrl-C, SIGTERM and SIGHUP: whoever asks a command to end.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use tokio::signal::unix::{SignalKind, signal};

use crate::failure::Failure;

/// A signal that ends a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum StopSignal {
    Hangup,
    Interrupt,
    Terminate,
}

impl StopSignal {
    /// 128 and the signal's number, as shells report it.
    pub(crate) const fn exit_code(self) -> i32 {
        128 + match self {
            Self::Hangup => HANGUP,
            Self::Interrupt => 2,
            Self::Terminate => 15,
        }
    }
}

/// Number of SIGHUP (POSIX).
const HANGUP: i32 = 1;

/// Raises a flag at every signal: a run ends between two ticks, or the waiting behind its end.
pub(crate) async fn raise(stop: Arc<AtomicBool>) {
    loop {
        stop_signal().await;
        stop.store(true, Ordering::Relaxed);
    }
}

/// Waits for a signal. A hangup does not count where whoever started the program had it ignored
/// (`nohup`).
pub(crate) async fn stop_signal() -> StopSignal {
    let (Ok(mut interrupt), Ok(mut terminate)) =
        (signal(SignalKind::interrupt()), signal(SignalKind::terminate()))
    else {
        return std::future::pending().await;
    };
    let hangup = async {
        if !is_ignored(HANGUP)
            && let Ok(mut hangup) = signal(SignalKind::hangup())
        {
            hangup.recv().await;
        } else {
            std::future::pending::<()>().await;
        }
    };
    tokio::select! {
        _ = interrupt.recv() => StopSignal::Interrupt,
        _ = terminate.recv() => StopSignal::Terminate,
        () = hangup => StopSignal::Hangup,
    }
}

/// Whether the process was started with a signal ignored (Linux; false elsewhere).
fn is_ignored(number: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|hex| u64::from_str_radix(hex.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (number - 1) & 1 == 1)
}

/// Calls `act` in a thread of its own at every signal.
///
/// # Errors
/// [`Failure::Work`] when no thread can wait for signals.
pub(crate) fn on_stop(act: impl Fn(StopSignal) + Send + 'static) -> Result<(), Failure> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(Failure::work)?;
    #[expect(clippy::disallowed_methods, reason = "the shell waits for signals in a thread")]
    std::thread::spawn(move || {
        loop {
            act(runtime.block_on(stop_signal()));
        }
    });
    Ok(())
}
