//! Progress of what takes longer than a second: a bar on a terminal, a line every ten seconds
//! elsewhere.

use std::io::IsTerminal;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use sim::World;

use crate::output;

/// A line is written this often where stderr is no terminal.
const LINE_PERIOD: Duration = Duration::from_secs(10);

/// The progress of a run: distance along the road.
pub(crate) struct Progress(Shown);

impl Progress {
    /// Progress over the road's length, on stderr.
    pub(crate) fn of_run(world: &World) -> Self {
        let length_m = world.road().length_m().max(1.0) as u64;
        Self(Shown::new(Some(length_m), "{bar:32} {percent:>3} %  {msg}"))
    }

    /// Shown to nobody.
    pub(crate) const fn hidden() -> Self {
        Self(Shown::Nowhere)
    }

    /// Moves to where the ego is.
    pub(crate) fn show(&self, world: &World) {
        let ego = world.truck().state();
        self.0.show(
            ego.s_m.max(0.0) as u64,
            format!(
                "{:.2} km  {:.0} km/h  {:.0} s simulated",
                ego.s_m * 1e-3,
                ego.speed_m_s * 3.6,
                world.now().seconds()
            ),
        );
    }

    /// Ends it.
    pub(crate) fn finish(&self) {
        self.0.finish();
    }
}

/// Says what is being done.
pub(crate) struct Stages(Shown);

impl Stages {
    /// A spinner, on stderr.
    pub(crate) fn start() -> Self {
        Self(Shown::new(None, "{spinner} {elapsed:>4}  {msg}"))
    }

    /// What is being done now.
    pub(crate) fn show(&self, what: &str) {
        self.0.show(0, what.to_owned());
    }

    /// Ends it.
    pub(crate) fn finish(&self) {
        self.0.finish();
    }
}

/// Where progress is shown.
enum Shown {
    Nowhere,
    Terminal(ProgressBar),
    Lines(Lines),
}

impl Shown {
    fn new(length: Option<u64>, template: &str) -> Self {
        if !std::io::stderr().is_terminal() {
            return Self::Lines(Lines::start());
        }
        let bar = ProgressBar::with_draw_target(length, ProgressDrawTarget::stderr_with_hz(5));
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        if length.is_none() {
            bar.enable_steady_tick(Duration::from_millis(200));
        }
        Self::Terminal(bar)
    }

    fn show(&self, position: u64, what: String) {
        match self {
            Self::Nowhere => {}
            Self::Terminal(bar) => {
                bar.set_position(position);
                bar.set_message(what);
            }
            Self::Lines(lines) => {
                *lines.what.lock().unwrap_or_else(PoisonError::into_inner) = what;
            }
        }
    }

    fn finish(&self) {
        match self {
            Self::Nowhere => {}
            Self::Terminal(bar) => bar.finish_and_clear(),
            Self::Lines(lines) => {
                let _ = lines.end.send(());
            }
        }
    }
}

/// Writes a line now and then, until it is dropped or ended.
struct Lines {
    what: Arc<Mutex<String>>,
    end: Sender<()>,
}

impl Lines {
    #[expect(clippy::disallowed_methods, reason = "the shell owns clock and threads")]
    fn start() -> Self {
        let (end, ended) = channel();
        let what = Arc::new(Mutex::new(String::new()));
        let (shown, start) = (Arc::clone(&what), Instant::now());
        std::thread::spawn(move || {
            while ended.recv_timeout(LINE_PERIOD) == Err(RecvTimeoutError::Timeout) {
                let what = shown.lock().unwrap_or_else(PoisonError::into_inner).clone();
                output::note(&format!("{:>5.0} s  {what}", start.elapsed().as_secs_f64()));
            }
        });
        Self { what, end }
    }
}
