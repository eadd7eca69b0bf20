//! Records of one module in one drive, and what whitening makes of them.
//!
//! A hat over time is zero in nearly all of a drive, and so is what the autoregressive filter makes of
//! it. Slow noise reaches over all that comes after: there the whitened rows are their weights times one
//! number a block, and products with them need no more than sums over blocks.

use super::inner;
use super::stats::slow::{SlowFilter, State};
use super::stats::whiten::Whitener;

/// Rows of a record that is zero before and after them.
#[derive(Debug, Clone, Default)]
pub(super) struct Part {
    from: usize,
    pub(super) rows: Vec<f64>,
}

impl Part {
    /// All rows of a record.
    pub(super) fn whole(rows: Vec<f64>) -> Self {
        Self { from: 0, rows }
    }

    /// Those of a record that are not zero.
    pub(super) fn acting(rows: &[f64]) -> Self {
        let acts = |x: &f64| *x != 0.0;
        let from = rows.iter().position(acts).unwrap_or(0);
        let to = rows.iter().rposition(acts).map_or(0, |last| last + 1);
        Self { from, rows: rows[from..to].to_vec() }
    }

    /// The sum of two whole records.
    pub(super) fn plus(&self, other: &Self) -> Self {
        Self {
            from: self.from,
            rows: self.rows.iter().zip(&other.rows).map(|(a, b)| a + b).collect(),
        }
    }

    /// What it changes by to `other` per `scale`.
    pub(super) fn change_to(&self, other: &Self, scale: f64) -> Self {
        let end = |x: &Self| x.from + x.rows.len();
        let at = |x: &Self, k: usize| {
            k.checked_sub(x.from).and_then(|k| x.rows.get(k)).copied().unwrap_or(0.0)
        };
        let (from, to) = (self.from.min(other.from), end(self).max(end(other)));
        let rows = (from..to).map(|k| (at(other, k) - at(self, k)) / scale).collect();
        Self { from, rows }
    }
}

/// A whitened record.
#[derive(Debug, Default)]
pub(super) struct Whitened {
    /// Rows that are written out, from the first of a block, up to the last of one.
    from: usize,
    rows: Vec<f64>,
    /// What the weights of the rows are times in each block after these.
    after: Vec<f64>,
    /// Sums of the rows by their weights in every block from that of `from`.
    sums: Vec<f64>,
}

impl Whitened {
    /// A record whitened, rows beyond `clip` cut there.
    pub(super) fn of(
        part: &Part,
        whitener: &Whitener,
        ok: &[bool],
        slow: Option<&SlowFilter>,
        clip: Option<f64>,
    ) -> Self {
        if part.rows.is_empty() || part.from >= ok.len() {
            return Self::default();
        }
        let block = slow.map_or(1, |s| s.block);
        let reach = part.from + part.rows.len() + whitener.coefficients.len();
        let (from, to) = (part.from / block * block, reach.next_multiple_of(block).min(ok.len()));
        let mut raw = vec![0.0; to - from];
        raw[part.from - from..].iter_mut().zip(&part.rows).for_each(|(x, r)| *x = *r);
        let mut rows = whitener.apply(&raw, &ok[from..to]);
        let mut state = State::default();
        if let Some(slow) = slow {
            slow.apply(&mut rows, from / block, &mut state);
        }
        if let Some(clip) = clip {
            for x in &mut rows {
                *x = if x.is_finite() { x.clamp(-clip, clip) } else { clip };
            }
        }
        let (mut after, mut sums) = (Vec::new(), Vec::new());
        if let Some(slow) = slow {
            sums = slow.sums(&rows, from / block);
            after = slow.shifts_after(to.div_ceil(block), &mut state);
            sums.extend(slow.sums_of_shifts(to.div_ceil(block), &after));
        }
        Self { from, rows, after, sums }
    }

    /// Inner product with another one of the same module.
    pub(super) fn dot(&self, other: &Self, slow: Option<&SlowFilter>) -> f64 {
        let end = |x: &Self| x.from + x.rows.len();
        let (from, to) = (self.from.max(other.from), end(self).min(end(other)));
        let mut out = 0.0;
        if from < to {
            let rows = |x: &Self| from - x.from..to - x.from;
            out += inner(&self.rows[rows(self)], &other.rows[rows(other)]);
        }
        if let Some(slow) = slow {
            let block = |row: usize| row / slow.block;
            let [(first, ends), (other_first, other_ends)] =
                [self, other].map(|x| (block(x.from), end(x).div_ceil(slow.block)));
            // where this one is a number a block, and where the other one alone is
            let tail = ends.max(other_first);
            out += along(&self.after, ends, &other.sums, other_first, tail..usize::MAX);
            let tail = other_ends.max(first);
            out += along(&other.after, other_ends, &self.sums, first, tail..ends);
        }
        out
    }

    /// Adds `factor` times all rows to `to`.
    pub(super) fn add_to(&self, to: &mut [f64], factor: f64, slow: Option<&SlowFilter>) {
        let rows = to.iter_mut().skip(self.from).zip(&self.rows);
        rows.for_each(|(x, own)| *x += factor * own);
        if let Some(slow) = slow {
            let end = self.from + self.rows.len();
            slow.add_shifts(to, end.div_ceil(slow.block), &self.after, factor);
        }
    }

    /// All `count` rows; none where the module has none.
    pub(super) fn written_out(&self, count: usize, slow: Option<&SlowFilter>) -> Vec<f64> {
        if self.rows.len() == count {
            return self.rows.clone();
        }
        let mut out = vec![0.0; count];
        self.add_to(&mut out, 1.0, slow);
        out
    }

    /// Whether nothing of it is other than zero.
    pub(super) fn is_nothing(&self) -> bool {
        self.rows.is_empty()
    }
}

/// Inner product of two records of numbers a block, which begin at blocks of their own, in some blocks.
fn along(
    a: &[f64],
    from_a: usize,
    b: &[f64],
    from_b: usize,
    blocks: core::ops::Range<usize>,
) -> f64 {
    let to = blocks.end.min(from_a + a.len()).min(from_b + b.len());
    let from = blocks.start.max(from_a).max(from_b);
    if from < to {
        inner(&a[from - from_a..to - from_a], &b[from - from_b..to - from_b])
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::super::stats::slow::Slow;
    use super::super::stats::whiten::Rows;
    use super::*;

    const COUNT: usize = 1_000;

    /// Rows that are zero outside `acts`.
    fn record(acts: core::ops::Range<usize>, pace: f64) -> Vec<f64> {
        let value = |k: usize| if acts.contains(&k) { 1.0 + (pace * k as f64).sin() } else { 0.0 };
        (0..COUNT).map(value).collect()
    }

    /// A record that acts in a part of a drive is whitened there and is one number a block after it: its
    /// products and its rows are those of the whole record whitened.
    #[test]
    fn what_acts_in_a_part_of_a_drive_is_whitened_as_the_whole_is() {
        let ok: Vec<bool> = (0..COUNT).map(|k| k % 200 > 20).collect();
        let weights: Vec<f64> = (0..COUNT).map(|k| 0.3 + (0.02 * k as f64).cos()).collect();
        let coefficients = vec![0.6, -0.2, 0.1];
        let slow = Slow::of(32, [0.02, 0.01, 0.05]);
        let parts = [0..COUNT, 0..40, 300..340, 330..650, 650..651, 980..COUNT, 5..5];
        for slow in [None, Some(slow)] {
            let whitener = Whitener { coefficients: coefficients.clone(), sigma: 0.5, slow };
            let over = whitener.over(Rows { ok: &ok, carrier: Some(&weights) });
            let over = over.as_ref();
            let whole: Vec<Vec<f64>> = parts
                .iter()
                .map(|acts| whitener.whiten(&record(acts.clone(), 0.1), &ok, over))
                .collect();
            let whites: Vec<Whitened> = parts
                .iter()
                .map(|acts| {
                    let part = Part::acting(&record(acts.clone(), 0.1));
                    assert_eq!(part.rows.len(), acts.len());
                    Whitened::of(&part, &whitener, &ok, over, None)
                })
                .collect();
            assert!(whites[2].rows.len() < 100 && !whites[2].rows.is_empty());
            for (a, x) in whites.iter().zip(&whole) {
                let written = a.written_out(COUNT, over);
                let worst = written.iter().zip(x).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(worst < 1e-12, "{worst}");
                for (b, y) in whites.iter().zip(&whole) {
                    let (local, direct) = (a.dot(b, over), inner(x, y));
                    let size = (inner(x, x) * inner(y, y)).sqrt();
                    assert!((local - direct).abs() <= 1e-12 * size, "{local} {direct}");
                }
            }
        }
    }

    #[test]
    fn a_change_between_records_that_act_elsewhere_has_the_rows_of_both() {
        let (a, b) = (record(10..20, 0.1), record(15..40, 0.3));
        let change = Part::acting(&a).change_to(&Part::acting(&b), 0.5);
        let direct: Vec<f64> = a.iter().zip(&b).map(|(a, b)| (b - a) / 0.5).collect();
        assert_eq!((change.from, &change.rows[..]), (10, &direct[10..40]));
    }
}
