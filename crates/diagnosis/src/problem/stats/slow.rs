//! Noise that remembers longer than an autoregressive filter reaches.
//!
//! Maps, gusts and the torque that an engine reports err slowly. An AR filter of a few rows takes the
//! noise between neighbours and leaves a sum over minutes to scatter many times as far as it says. What
//! it leaves is modelled as white noise of variance one and a sum of Ornstein-Uhlenbeck processes from
//! block to block of rows, with memories of [`MEMORY`] blocks (a sum of a few stands for any slow
//! spectrum: Keshner, Proc. IEEE 70, 1982). A Kalman filter over the means of blocks whitens it exactly:
//!
//! ```text
//! z = y - mean(y) + sqrt((1/n) / S) e,   e = mean(y) - predicted,   S = 1/n + variance of that
//! ```
//!
//! so that `z'z` is the sum of squares within blocks and of the innovations in their deviations. Rows have
//! weights: what drifts may be a factor on a signal, as an engine's torque report is on the torque. With
//! weights `w` a block has `n = w'w`, its mean is `w'y / n`, and `w` times the bracket is added. The gains
//! depend on mask and weights alone: the filter is linear and goes for residuals and sensitivities alike.

use crate::problem::inner;

/// Blocks over which the processes forget.
const MEMORY: [f64; 3] = [4.0, 16.0, 64.0];
const PROCESSES: usize = MEMORY.len();

/// Slow noise of one kind of rows.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Slow {
    /// Rows of a block.
    pub(crate) block: usize,
    /// Variance of the processes, in that of the white noise.
    power: [f64; PROCESSES],
}

/// The filter at one block.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Gain {
    /// Sum of the squares of the weights.
    weight: f64,
    /// What an innovation adds to the processes.
    kalman: [f64; PROCESSES],
    /// Deviation of the mean of white noise over that of the innovation.
    shrink: f64,
    /// What the processes keep until the next block.
    keep: [f64; PROCESSES],
}

/// State of the filter: the processes as the blocks before predict them.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct State([f64; PROCESSES]);

impl State {
    /// Innovation of a block with this `mean`, and on to the next block.
    pub(crate) fn innovation(&mut self, gain: &Gain, mean: f64) -> f64 {
        let e = if gain.weight > 0.0 { mean - self.0.iter().sum::<f64>() } else { 0.0 };
        for ((s, k), keep) in self.0.iter_mut().zip(&gain.kalman).zip(&gain.keep) {
            *s = (*s + k * e) * keep;
        }
        e
    }
}

impl Gain {
    /// What is added to the product of two whitened records by block sums `a` and `b` with innovations
    /// `ea` and `eb`.
    pub(crate) fn product(&self, (a, ea): (f64, f64), (b, eb): (f64, f64)) -> f64 {
        if self.weight > 0.0 {
            self.weight * self.shrink * self.shrink * ea * eb - a * b / self.weight
        } else {
            0.0
        }
    }

    /// Mean of a block from its sum.
    pub(crate) fn mean(&self, sum: f64) -> f64 {
        if self.weight > 0.0 { sum / self.weight } else { 0.0 }
    }
}

impl Slow {
    #[cfg(test)]
    pub(crate) fn of(block: usize, power: [f64; PROCESSES]) -> Self {
        Self { block, power }
    }

    /// The most probable one of records that an AR filter has whitened, zero where masked, with the
    /// weights of their rows; `None` where slow noise makes them no more probable.
    pub(crate) fn fit(records: &[(Vec<f64>, Vec<f64>)], block: usize) -> Option<Self> {
        let mut means: Vec<Vec<(f64, f64)>> = Vec::with_capacity(records.len());
        let (mut within, mut rows) = (0.0, 0.0);
        for (y, weights) in records {
            let blocks = y.chunks(block).zip(weights.chunks(block)).map(|(y, w)| {
                let count = inner(w, w);
                let mean = if count > 0.0 { inner(w, y) / count } else { 0.0 };
                if count > 0.0 {
                    within += inner(y, y) - count * mean * mean;
                    rows += w.iter().filter(|w| **w != 0.0).count() as f64 - 1.0;
                }
                (count, mean)
            });
            means.push(blocks.collect());
        }
        if rows < 8.0 || within <= 0.0 {
            return None;
        }
        // The white noise may be held larger than it is.
        let white = within / rows;
        let cost = |power: &[f64; PROCESSES]| -> f64 {
            let scaled = Self { block, power: power.map(|p| p / white) };
            means.iter().map(|m| scaled.surprise(m, white)).sum()
        };
        let mut power = [1e-6; PROCESSES];
        let mut best = cost(&power);
        let nothing = best;
        let mut step = 64.0_f64;
        while step > 1.1 {
            let before = best;
            for j in 0..PROCESSES {
                for factor in [step, step.recip()] {
                    let mut trial = power;
                    trial[j] = (trial[j] * factor).clamp(1e-8, 1e6);
                    let c = cost(&trial);
                    if c < best {
                        (power, best) = (trial, c);
                    }
                }
            }
            if best >= before {
                step = step.sqrt();
            }
        }
        (best < nothing - 1.0).then_some(Self { block, power })
    }

    /// Minus the log-likelihood of the means of blocks (weight, mean) with this white variance.
    fn surprise(&self, means: &[(f64, f64)], white: f64) -> f64 {
        let (mut filter, mut state) = (self.start(), State::default());
        let mut out = 0.0;
        for (count, mean) in means {
            let (gain, variance) = filter.next(*count);
            let e = state.innovation(&gain, *mean);
            if *count > 0.0 {
                out += 0.5 * ((white * variance).ln() + e * e / (white * variance));
            }
        }
        out
    }

    fn start(&self) -> Filter {
        let mut covariance = [[0.0; PROCESSES]; PROCESSES];
        for (j, p) in self.power.iter().enumerate() {
            covariance[j][j] = *p;
        }
        Filter { power: self.power, keep: MEMORY.map(|m| (-1.0 / m).exp()), covariance }
    }

    /// The filter over a record with these weights.
    pub(crate) fn over(&self, weights: Vec<f64>) -> SlowFilter {
        let mut filter = self.start();
        let gains = weights.chunks(self.block).map(|w| filter.next(inner(w, w)).0).collect();
        SlowFilter { block: self.block, weights, gains }
    }
}

/// The filter over the rows of a record.
#[derive(Debug)]
pub(crate) struct SlowFilter {
    /// Rows of a block.
    pub(crate) block: usize,
    /// How much slow noise of one shows in every row.
    pub(crate) weights: Vec<f64>,
    /// The filter at every block.
    pub(crate) gains: Vec<Gain>,
}

impl SlowFilter {
    /// Blocks from one on: their weights and the filter there.
    fn blocks(&self, from: usize) -> impl Iterator<Item = (&[f64], &Gain)> {
        self.weights.chunks(self.block).zip(&self.gains).skip(from)
    }

    /// Whitens rows `y` from the block `from`, before which all are zero.
    pub(crate) fn apply(&self, y: &mut [f64], from: usize, state: &mut State) {
        for (y, (w, gain)) in y.chunks_mut(self.block).zip(self.blocks(from)) {
            let mean = gain.mean(inner(w, y));
            let shift = gain.shrink * state.innovation(gain, mean) - mean;
            y.iter_mut().zip(w).for_each(|(y, w)| *y += w * shift);
        }
    }

    /// What the weights are times in every block from `from` on, where all rows are zero before they are
    /// whitened.
    pub(crate) fn shifts_after(&self, from: usize, state: &mut State) -> Vec<f64> {
        let gains = self.gains.iter().skip(from);
        gains.map(|gain| gain.shrink * state.innovation(gain, 0.0)).collect()
    }

    /// Sums of rows `y` from the block `from` on by their weights, per block.
    pub(crate) fn sums(&self, y: &[f64], from: usize) -> Vec<f64> {
        y.chunks(self.block).zip(self.blocks(from)).map(|(y, (w, _))| inner(w, y)).collect()
    }

    /// The same of the weights times a number in every block.
    pub(crate) fn sums_of_shifts<'a>(
        &'a self,
        from: usize,
        shifts: &'a [f64],
    ) -> impl Iterator<Item = f64> + 'a {
        shifts.iter().zip(self.gains.iter().skip(from)).map(|(s, gain)| s * gain.weight)
    }

    /// Adds `factor` times the weights times a number in every block from `from` on.
    pub(crate) fn add_shifts(&self, to: &mut [f64], from: usize, shifts: &[f64], factor: f64) {
        let to = to.chunks_mut(self.block).skip(from).zip(self.blocks(from));
        for ((to, (w, _)), shift) in to.zip(shifts) {
            to.iter_mut().zip(w).for_each(|(x, w)| *x += factor * shift * w);
        }
    }

    /// `x`, zero where masked, through the adjoint of the filter.
    pub(crate) fn adjoint(&self, x: &mut [f64]) {
        let mut after = [0.0; PROCESSES];
        let blocks = x.chunks_mut(self.block).zip(self.weights.chunks(self.block));
        for ((x, w), gain) in blocks.zip(&self.gains).rev() {
            after.iter_mut().zip(&gain.keep).for_each(|(a, keep)| *a *= keep);
            if gain.weight == 0.0 {
                continue;
            }
            let sum = inner(w, x);
            let fed: f64 = after.iter().zip(&gain.kalman).map(|(a, k)| a * k).sum();
            let e = gain.shrink * sum + fed;
            after.iter_mut().for_each(|a| *a -= e);
            let shift = (e - sum) / gain.weight;
            x.iter_mut().zip(w).for_each(|(x, w)| *x += w * shift);
        }
    }
}

/// What the filter knows before a block.
struct Filter {
    power: [f64; PROCESSES],
    keep: [f64; PROCESSES],
    covariance: [[f64; PROCESSES]; PROCESSES],
}

impl Filter {
    /// Takes a block of this weight and goes on to the next; with the variance of its innovation.
    fn next(&mut self, weight: f64) -> (Gain, f64) {
        let (p, keep) = (&mut self.covariance, self.keep);
        let mut gain = Gain { weight, kalman: [0.0; PROCESSES], shrink: 0.0, keep };
        let sums = p.map(|row| row.iter().sum::<f64>());
        let mut variance = sums.iter().sum::<f64>();
        if weight > 0.0 {
            variance += weight.recip();
            gain.kalman = sums.map(|s| s / variance);
            gain.shrink = (weight * variance).sqrt().recip();
            for (row, k) in p.iter_mut().zip(&gain.kalman) {
                row.iter_mut().zip(&sums).for_each(|(x, s)| *x -= k * s);
            }
        }
        for (a, row) in p.iter_mut().enumerate() {
            for (b, x) in row.iter_mut().enumerate() {
                *x *= keep[a] * keep[b];
            }
            row[a] += (1.0 - keep[a] * keep[a]) * self.power[a];
        }
        (gain, variance)
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn normal(rng: &mut ChaCha8Rng) -> f64 {
        (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
    }

    /// White noise with a slow one of deviation 0.3 and a memory of 500 rows as a factor on weights that
    /// come and go.
    fn record(seed: u64) -> (Vec<f64>, Vec<f64>) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let keep = (-1.0_f64 / 500.0).exp();
        let mut slow = 0.3 * normal(&mut rng);
        let weight =
            |i: i32| if i % 900 > 250 { 0.7 + 0.5 * (0.01 * f64::from(i)).sin() } else { 0.0 };
        let weights: Vec<f64> = (0..15_000).map(weight).collect();
        let mut of = |w: &f64| {
            slow = keep * slow + 0.3 * (1.0 - keep * keep).sqrt() * normal(&mut rng);
            let white = normal(&mut rng);
            if *w > 0.0 { w * slow + white } else { 0.0 }
        };
        (weights.iter().map(&mut of).collect(), weights)
    }

    fn fitted() -> Slow {
        Slow::fit(&(0..8).map(record).collect::<Vec<_>>(), 64).unwrap()
    }

    #[test]
    fn sums_over_minutes_scatter_as_the_filter_says() {
        let slow = fitted();
        let (mut raw, mut left, mut count) = (0.0, 0.0, 0.0);
        for seed in 100..130 {
            let (mut y, weights) = record(seed);
            for of in [&mut raw, &mut left] {
                for (y, w) in y.chunks(2000).zip(weights.chunks(2000)) {
                    *of += inner(w, y).powi(2) / inner(w, w);
                }
                slow.over(weights.clone()).apply(&mut y, 0, &mut State::default());
            }
            count += 8.0;
        }
        assert!(raw / count > 30.0, "{}", raw / count);
        assert!((left / count - 1.0).abs() < 0.35, "{}", left / count);
    }

    #[test]
    fn the_adjoint_is_that_of_the_filter() {
        let (slow, (x, weights), (y, _)) = (fitted(), record(7), record(8));
        let (mut forth, mut back) = (x.clone(), y.clone());
        let slow = slow.over(weights);
        slow.apply(&mut forth, 0, &mut State::default());
        slow.adjoint(&mut back);
        let (one, other) = (inner(&forth, &y), inner(&x, &back));
        assert!((one - other).abs() < 1e-9 * one.abs().max(1.0), "{one} {other}");
    }

    #[test]
    fn products_come_from_the_sums_of_blocks() {
        let (slow, (x, weights)) = (fitted(), record(9));
        let mut white = x.clone();
        let over = slow.over(weights.clone());
        over.apply(&mut white, 0, &mut State::default());
        let (mut state, mut product) = (State::default(), inner(&x, &x));
        let blocks = x.chunks(slow.block).zip(weights.chunks(slow.block));
        for ((x, w), gain) in blocks.zip(&over.gains) {
            let sum = inner(w, x);
            let e = state.innovation(gain, gain.mean(sum));
            product += gain.product((sum, e), (sum, e));
        }
        let direct = inner(&white, &white);
        assert!((product - direct).abs() < 1e-9 * direct, "{product} {direct}");
    }

    #[test]
    fn white_noise_has_no_slow_part() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut record = |_| ((0..20_000).map(|_| normal(&mut rng)).collect(), vec![1.0; 20_000]);
        let records: Vec<_> = (0..4).map(&mut record).collect();
        let small = Slow::fit(&records, 64).is_none_or(|s| s.power.iter().sum::<f64>() < 1e-3);
        assert!(small);
    }
}
