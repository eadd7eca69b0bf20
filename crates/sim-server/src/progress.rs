//! Progress on a terminal: a bar while something takes longer than a second, silent elsewhere.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use sim::World;

/// The bar of a run: distance along the road.
pub(crate) struct Progress(ProgressBar);

impl Progress {
    /// A bar over the road's length; it draws on stderr if that is a terminal.
    pub(crate) fn of_run(world: &World) -> Self {
        let length_m = world.road().length_m().max(1.0) as u64;
        let bar =
            ProgressBar::with_draw_target(Some(length_m), ProgressDrawTarget::stderr_with_hz(5));
        if let Ok(style) = ProgressStyle::with_template("{bar:32} {percent:>3} %  {msg}") {
            bar.set_style(style);
        }
        Self(bar)
    }

    /// Moves the bar to where the ego is.
    pub(crate) fn show(&self, world: &World) {
        let ego = world.truck().state();
        self.0.set_position(ego.s_m.max(0.0) as u64);
        self.0.set_message(format!(
            "{:.2} km  {:.0} km/h  {:.0} s simulated",
            ego.s_m * 1e-3,
            ego.speed_m_s * 3.6,
            world.now().seconds()
        ));
    }

    /// Removes the bar.
    pub(crate) fn finish(&self) {
        self.0.finish_and_clear();
    }
}

/// A line that says what is being done, on a terminal.
pub(crate) struct Stages(ProgressBar);

impl Stages {
    /// A spinner on stderr, if that is a terminal.
    pub(crate) fn start() -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr_with_hz(5));
        if let Ok(style) = ProgressStyle::with_template("{spinner} {elapsed:>4}  {msg}") {
            bar.set_style(style);
        }
        bar.enable_steady_tick(std::time::Duration::from_millis(200));
        Self(bar)
    }

    /// What is being done now.
    pub(crate) fn show(&self, what: &str) {
        self.0.set_message(what.to_owned());
    }

    /// Removes the line.
    pub(crate) fn finish(&self) {
        self.0.finish_and_clear();
    }
}
