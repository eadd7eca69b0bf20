//! Random numbers that depend on *what* is drawn, never on the order of the calls.
//!
//! Philox4x32-10, a counter-based generator: Salmon, Moraes, Dror, Shaw, "Parallel random numbers:
//! as easy as 1, 2, 3", SC 2011. The key is the seed, the counter names the draw (stream, index,
//! number). Integer arithmetic only, so the same on every machine. Statistical draws (uniform,
//! bell-shaped) use `+ - *` only.

/// Names the purpose of a draw, so that two purposes never share numbers.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Stream {
    /// Parameters of a driver; index = vehicle number.
    Driver = 1,
    /// Arrival at an entry; index = tick, number = lane track.
    Arrival = 2,
    /// Spacing of the initial fill; index = position in the lane, number = lane track.
    Fill = 3,
    /// Sensor noise; index = frame, the vehicle is in the key.
    Perception = 4,
    /// Speed beyond the end of the road; index = period, number = lane track.
    Outflow = 5,
    /// Search for parameters; index = trial, number = which draw of it.
    Search = 6,
    /// Speed before the start of the road; index = period, number = lane track.
    Inflow = 7,
    /// Errors of judgement; index = vehicle number, number = tick.
    Judgement = 8,
}

const M0: u64 = 0xD251_1F53;
const M1: u64 = 0xCD9E_8D57;
const W0: u32 = 0x9E37_79B9;
const W1: u32 = 0xBB67_AE85;

/// The Philox4x32 bijection with ten rounds.
fn philox4x32_10(mut c: [u32; 4], mut k: [u32; 2]) -> [u32; 4] {
    for _ in 0..10 {
        let (p0, p1) = (M0 * u64::from(c[0]), M1 * u64::from(c[2]));
        c = [
            (p1 >> 32) as u32 ^ c[1] ^ k[0],
            p1 as u32,
            (p0 >> 32) as u32 ^ c[3] ^ k[1],
            p0 as u32,
        ];
        k = [k[0].wrapping_add(W0), k[1].wrapping_add(W1)];
    }
    c
}

/// Draws for one index of one stream.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Draws {
    key: [u32; 2],
    stream: Stream,
    index: u64,
}

impl Draws {
    pub(crate) fn new(seed: u64, stream: Stream, index: u64) -> Self {
        Self { key: [seed as u32, (seed >> 32) as u32], stream, index }
    }

    /// Uniform in [0, 1), 53 bits.
    pub(crate) fn uniform(&self, number: u32) -> f64 {
        self.two(number)[0]
    }

    /// Two independent ones; the first is that of [`Draws::uniform`].
    pub(crate) fn two(&self, number: u32) -> [f64; 2] {
        let (i0, i1) = (self.index as u32, (self.index >> 32) as u32);
        let [a, b, c, d] = philox4x32_10([i0, i1, self.stream as u32, number], self.key);
        [(a, b), (c, d)].map(|(high, low)| {
            let bits = (u64::from(high) << 32 | u64::from(low)) >> 11;
            bits as f64 * (1.0 / 9_007_199_254_740_992.0)
        })
    }

    /// Bell-shaped with mean 0, variance 1, bounded by ±3.464: a sum of four uniforms
    /// (Irwin–Hall, n = 4), scaled. Bounded on purpose: a driver parameter has no tail.
    pub(crate) fn bell(&self, number: u32) -> f64 {
        let base = 0x8000_0000 | (number << 2);
        let sum = self.uniform(base)
            + self.uniform(base + 1)
            + self.uniform(base + 2)
            + self.uniform(base + 3);
        // The variance of the sum is 4/12; sqrt(3) makes it one.
        (sum - 2.0) * 1.732_050_807_568_877_2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Known answers published with the Random123 library (`kat_vectors`, philox4x32 10).
    #[test]
    fn the_generator_gives_the_published_known_answers() {
        assert_eq!(
            philox4x32_10([0; 4], [0; 2]),
            [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]
        );
        assert_eq!(
            philox4x32_10([u32::MAX; 4], [u32::MAX; 2]),
            [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]
        );
        assert_eq!(
            philox4x32_10(
                [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344],
                [0xa409_3822, 0x299f_31d0]
            ),
            [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1]
        );
    }

    #[test]
    fn uniform_and_bell_have_their_means_and_variances() {
        let n = 20_000;
        let (mut u, mut b, mut b2) = (0.0, 0.0, 0.0);
        for i in 0..n {
            let d = Draws::new(7, Stream::Driver, i);
            u += d.uniform(0);
            let x = d.bell(1);
            b += x;
            b2 += x * x;
        }
        let n = n as f64;
        assert!((u / n - 0.5).abs() < 0.01);
        assert!((b / n).abs() < 0.03);
        assert!((b2 / n - 1.0).abs() < 0.03);
    }
}
