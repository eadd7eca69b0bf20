//! Clock offset, drift and jumps between two channels that measure the same quantity.
//!
//! | symbol | meaning |
//! |---|---|
//! | x, y | rates of change of the two channels over one second |
//! | tau(t) | lag of x behind y, s: `x(t) = g y(t - tau(t)) + b + e(t)` |
//! | e | autoregressive noise |
//!
//! Three stages: the cross-correlation of x and y says where the lag is, over the whole drive and
//! then in windows of two minutes; the windows are divided into stretches of linear lag by optimal
//! partitioning (Jackson et al., IEEE SPL 12(2), 2005), each jump placed where the likelihood
//! changes; in every stretch the lag at its middle and its drift maximise the likelihood of the
//! whitened residual (Ljung, System Identification, ch. 7). The uncertainty is the larger of the
//! one from the information matrix and the one from the scatter of the windows.
//!
//! A channel that is sampled and held at a slower rate is late by half its hold time on average:
//! [`ClockTrack`] is what is left after that. Left out: clocks that jump more than once in two
//! minutes, and which of the two channels is the late one.

mod check;
mod lag;
mod likelihood;
mod partition;

pub(crate) use check::check;

use likelihood::Fit;
use partition::Bounds;

/// Shortest stretch, s.
const SHORTEST_S: f64 = 90.0;
/// Ends of a stretch that its fit leaves out, s.
const MARGIN_S: f64 = 20.0;
/// Smallest jump that is told, s: less than one sample of a 1 Hz receiver may be its own filter.
const SMALLEST_JUMP_S: f64 = 0.75;
/// Correlation of the rates below which two channels are not taken to move together.
const TOGETHER: f64 = 0.6;
/// Standard deviations that make a lag, drift or jump certain.
const CERTAIN: f64 = 4.0;

/// Rates of change of two channels on a common grid.
///
/// x is compared every [`Rates::STEP_S`]. y is kept on a grid five times finer: interpolation
/// between coarse points would lower its noise half-way between them, and draw the lag there.
#[derive(Debug, Clone, PartialEq)]
pub struct Rates {
    x: Vec<f64>,
    y: Vec<f64>,
    fine_y: Vec<f64>,
}

/// Lag of one channel's clock behind another's over one stretch of a drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClockStretch {
    /// Begin, s after the drive's start.
    pub from_s: f64,
    /// End, s after the drive's start.
    pub to_s: f64,
    /// Lag in the middle of the stretch, s.
    pub lag_s: f64,
    /// Standard deviation of that lag, s.
    pub lag_sigma_s: f64,
    /// Growth of the lag, s per s.
    pub drift_s_s: f64,
    /// Standard deviation of the drift, s per s.
    pub drift_sigma_s_s: f64,
    /// Correlation of the rates of change once aligned.
    pub correlation: f64,
}

/// Lag over a drive: the stretches between jumps, in order of time.
#[derive(Debug, Clone, PartialEq)]
pub struct ClockTrack {
    /// Stretches; at least one.
    pub stretches: Vec<ClockStretch>,
    /// Correlation of the rates of change over the whole drive as recorded.
    pub correlation_as_recorded: f64,
}

/// What a channel measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The quantity whose rate of change is compared (speed, heading).
    Value,
    /// The rate of change itself (acceleration, yaw rate).
    Rate,
}

/// One channel on a uniform grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Signal<'a> {
    /// Samples.
    pub samples: &'a [f64],
    /// What they measure.
    pub kind: Kind,
}

impl Rates {
    /// Grid step, s.
    pub const STEP_S: f64 = 0.25;
    /// Fine points to a grid step.
    const FINE: usize = 5;
    /// Step of the fine grid, s.
    const FINE_S: f64 = Self::STEP_S / Self::FINE as f64;
    /// Fine points of half the smoothing.
    const HALF_SMOOTHING: usize = 1;

    /// Rates of two channels that share a grid of `step_s`.
    #[must_use]
    pub fn new(x: Signal<'_>, y: Signal<'_>, step_s: f64) -> Self {
        let coarse = |z: &[f64]| z.iter().step_by(Self::FINE).copied().collect();
        let (fine_x, fine_y) = (rates(x, step_s), rates(y, step_s));
        Self { x: coarse(&fine_x), y: coarse(&fine_y), fine_y }
    }

    fn duration_s(&self) -> f64 {
        self.x.len().min(self.y.len()) as f64 * Self::STEP_S
    }
}

/// Sum of all samples before each one.
fn sums(z: &[f64]) -> Vec<f64> {
    let mut sum = Vec::with_capacity(z.len() + 1);
    sum.push(0.0);
    let mut total = 0.0;
    for v in z {
        total += v;
        sum.push(total);
    }
    sum
}

/// Rate of change over one second, centred and smoothed, on the fine grid.
fn rates(signal: Signal<'_>, step_s: f64) -> Vec<f64> {
    let z = signal.samples;
    if z.is_empty() {
        return Vec::new();
    }
    let sum = sums(z);
    // Linear between samples, held beyond the ends.
    let at = |table: &[f64], index: f64| {
        let last = table.len() - 1;
        let i = (index.max(0.0) as usize).min(last);
        let part = (index - i as f64).clamp(0.0, 1.0);
        table[i] + part * (table[(i + 1).min(last)] - table[i])
    };
    let half = 0.5 / step_s;
    let n = ((z.len() - 1) as f64 * step_s / Rates::FINE_S) as usize + 1;
    let rate: Vec<f64> = (0..n)
        .map(|k| {
            let middle = k as f64 * Rates::FINE_S / step_s;
            match signal.kind {
                Kind::Value => at(z, middle + half) - at(z, middle - half),
                // Sample i covers half a sample on both sides of it.
                Kind::Rate => {
                    let a = (middle - half + 0.5).clamp(0.0, z.len() as f64);
                    let b = (middle + half + 0.5).clamp(0.0, z.len() as f64);
                    (at(&sum, b) - at(&sum, a)) / (b - a).max(0.5)
                }
            }
        })
        .collect();
    let sum = sums(&rate);
    (0..n)
        .map(|k| {
            let h = Rates::HALF_SMOOTHING.min(k).min(n - 1 - k);
            (sum[k + h + 1] - sum[k - h]) / (2 * h + 1) as f64
        })
        .collect()
}

/// Delay of a sampled-and-held channel, s: half its typical hold time beyond one grid step.
#[must_use]
pub fn hold_delay_s(samples: &[f64], step_s: f64) -> f64 {
    let mut runs = Vec::new();
    let mut from = 0;
    for i in 1..samples.len() {
        if samples[i] != samples[i - 1] {
            runs.push(i - from);
            from = i;
        }
    }
    if runs.is_empty() {
        return 0.0;
    }
    let middle = runs.len() / 2;
    let (_, hold, _) = runs.select_nth_unstable(middle);
    0.5 * (*hold as f64 - 1.0) * step_s
}

/// Lag of x behind y along a drive; `None` if they do not move together anywhere, or the drive is
/// shorter than four minutes.
#[must_use]
pub fn track(rates: &Rates) -> Option<ClockTrack> {
    if rates.duration_s() < 240.0 {
        return None;
    }
    let coarse = lag::coarse(rates)?;
    let windows = lag::windows(rates, coarse);
    let pieces = partition::pieces(&windows)?;
    let together = lag::together(rates, &windows);
    let stretches = stretches(rates, partition::boundaries(rates, &pieces), &together);
    let all = 0..rates.x.len().min(rates.y.len());
    stretches.iter().any(|s| s.correlation > TOGETHER).then(|| ClockTrack {
        correlation_as_recorded: likelihood::correlation(rates, all, |_| 0.0),
        stretches: stretches.clone(),
    })
}

/// Fits every stretch; joins neighbours between which no jump is certain.
fn stretches(rates: &Rates, mut bounds: Vec<Bounds>, together: &[bool]) -> Vec<ClockStretch> {
    loop {
        let of = |b: &Bounds| stretch(rates, b, together);
        let fits: Vec<Option<ClockStretch>> = bounds.iter().map(of).collect();
        let join = fits.windows(2).position(|pair| match pair {
            [Some(a), Some(b)] => !ClockStretch::jumps(a, b),
            _ => true,
        });
        let Some(at) = join else { return fits.into_iter().flatten().collect() };
        let next = bounds.remove(at + 1);
        bounds[at] = bounds[at].joined(&next);
    }
}

fn stretch(rates: &Rates, bounds: &Bounds, together: &[bool]) -> Option<ClockStretch> {
    let (from_s, to_s) =
        (bounds.samples.start as f64 * Rates::STEP_S, bounds.samples.end as f64 * Rates::STEP_S);
    if to_s - from_s < SHORTEST_S {
        return None;
    }
    // A jump is placed to within seconds.
    let margin = (MARGIN_S / Rates::STEP_S) as usize;
    let inner = bounds.samples.start + margin..bounds.samples.end - margin;
    let fit = Fit::stretch(rates, inner, bounds.line, together)?;
    // A uniform spread of independent windows along the stretch.
    let drift_scatter = bounds.scatter_s * 12.0_f64.sqrt() / (to_s - from_s);
    Some(ClockStretch {
        from_s,
        to_s,
        lag_s: fit.lag_s,
        lag_sigma_s: fit.lag_sigma_s.max(bounds.scatter_s),
        drift_s_s: fit.drift_s_s,
        drift_sigma_s_s: fit.drift_sigma_s_s.max(drift_scatter),
        correlation: fit.correlation,
    })
}

impl ClockStretch {
    /// Lag and its standard deviation, s, `after_s` behind the middle.
    fn at(&self, after_s: f64) -> (f64, f64) {
        (
            self.lag_s + self.drift_s_s * after_s,
            self.lag_sigma_s.hypot(self.drift_sigma_s_s * after_s),
        )
    }

    /// Lag at the end of `a`, at the begin of `b`, and the standard deviation of the jump, s.
    fn jump(a: &Self, b: &Self) -> (f64, f64, f64) {
        let (before, sa) = a.at(0.5 * (a.to_s - a.from_s));
        let (after, sb) = b.at(-0.5 * (b.to_s - b.from_s));
        (before, after, sa.hypot(sb))
    }

    fn jumps(a: &Self, b: &Self) -> bool {
        let (before, after, sigma) = Self::jump(a, b);
        (after - before).abs() > SMALLEST_JUMP_S.max(CERTAIN * sigma)
    }
}

impl ClockTrack {
    /// Lag at a time after the drive's start, s.
    #[must_use]
    pub fn lag_at_s(&self, time_s: f64) -> f64 {
        let s = self.stretches.iter().rfind(|s| s.from_s <= time_s).or(self.stretches.first());
        s.map_or(0.0, |s| s.lag_s + s.drift_s_s * (time_s - 0.5 * (s.from_s + s.to_s)))
    }

    /// The channel that lags, moved to the other's clock: value at every grid time.
    #[must_use]
    pub fn aligned(&self, samples: &[f64], step_s: f64) -> Vec<f64> {
        (0..samples.len())
            .map(|i| {
                let t = i as f64 * step_s;
                let at = ((t + self.lag_at_s(t)) / step_s).clamp(0.0, (samples.len() - 1) as f64);
                let k = at as usize;
                let next = (k + 1).min(samples.len() - 1);
                samples[k] + (at - k as f64) * (samples[next] - samples[k])
            })
            .collect()
    }
}

#[cfg(test)]
mod tests;
