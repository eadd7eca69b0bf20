//! `L D Lᵀ` of a symmetric pentadiagonal matrix, in place and without allocation.

/// Three diagonals; after [`Band::factor`] the inverse of `D` and the two columns of `L`.
#[derive(Debug, Clone, Default)]
pub(super) struct Band {
    /// Diagonal, then `1/D`.
    pub(super) m0: alloc::vec::Vec<f64>,
    /// First off-diagonal (`i`, `i+1`), then `L`.
    pub(super) m1: alloc::vec::Vec<f64>,
    /// Second off-diagonal (`i`, `i+2`), then `L`.
    pub(super) m2: alloc::vec::Vec<f64>,
}

/// Smallest pivot that counts as positive.
const LEAST_PIVOT: f64 = 1e-14;

impl Band {
    pub(super) fn resize(&mut self, n: usize) {
        for v in [&mut self.m0, &mut self.m1, &mut self.m2] {
            v.clear();
            v.resize(n, 0.0);
        }
    }

    /// Row and column `i` become those of the identity.
    pub(super) fn pin_last(&mut self) {
        let n = self.m0.len();
        self.m0[n - 1] = 1.0;
        if n > 1 {
            self.m1[n - 2] = 0.0;
        }
        if n > 2 {
            self.m2[n - 3] = 0.0;
        }
    }

    /// Factors; false if a pivot is not positive.
    pub(super) fn factor(&mut self) -> bool {
        let n = self.m0.len();
        let (m0, m1, m2) = (&mut self.m0[..n], &mut self.m1[..n], &mut self.m2[..n]);
        // What the two columns before take from this one's diagonal and off-diagonal.
        let (mut take0, mut take1, mut take0_next) = (0.0, 0.0, 0.0);
        let mut good = true;
        for i in 0..n {
            let pivot = m0[i] - take0;
            let off = m1[i] - take1;
            good &= pivot > LEAST_PIVOT;
            let inverse = 1.0 / pivot;
            let (l1, l2) = (off * inverse, m2[i] * inverse);
            take0 = take0_next + l1 * off;
            take1 = l1 * m2[i];
            take0_next = l2 * m2[i];
            m0[i] = inverse;
            m1[i] = l1;
            m2[i] = l2;
        }
        good
    }

    /// Solves for `r` in place.
    pub(super) fn solve(&self, r: &mut [f64]) {
        let n = self.m0.len();
        let (m0, m1, m2, r) = (&self.m0[..n], &self.m1[..n], &self.m2[..n], &mut r[..n]);
        let (mut take, mut take_next) = (0.0, 0.0);
        for i in 0..n {
            let x = r[i] - take;
            take = take_next + m1[i] * x;
            take_next = m2[i] * x;
            r[i] = x * m0[i];
        }
        let (mut one, mut two) = (0.0, 0.0);
        for i in (0..n).rev() {
            let x = r[i] - m1[i] * one - m2[i] * two;
            two = one;
            one = x;
            r[i] = x;
        }
    }

    /// Solves for two right-hand sides at once: their chains of dependent operations overlap.
    pub(super) fn solve_two(&self, r: &mut [f64], q: &mut [f64]) {
        let n = self.m0.len();
        let (m0, m1, m2) = (&self.m0[..n], &self.m1[..n], &self.m2[..n]);
        let (r, q) = (&mut r[..n], &mut q[..n]);
        let (mut take, mut next) = ([0.0; 2], [0.0; 2]);
        for i in 0..n {
            let x = [r[i] - take[0], q[i] - take[1]];
            take = [next[0] + m1[i] * x[0], next[1] + m1[i] * x[1]];
            next = [m2[i] * x[0], m2[i] * x[1]];
            r[i] = x[0] * m0[i];
            q[i] = x[1] * m0[i];
        }
        let (mut one, mut two) = ([0.0; 2], [0.0; 2]);
        for i in (0..n).rev() {
            let x =
                [r[i] - m1[i] * one[0] - m2[i] * two[0], q[i] - m1[i] * one[1] - m2[i] * two[1]];
            two = one;
            one = x;
            r[i] = x[0];
            q[i] = x[1];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;

    #[test]
    fn a_solution_put_back_gives_the_right_hand_side() {
        let n = 9;
        let mut band = Band::default();
        band.resize(n);
        for i in 0..n {
            band.m0[i] = 5.0 + i as f64;
            band.m1[i] = -1.0 - 0.1 * i as f64;
            band.m2[i] = 0.7;
        }
        let raw = band.clone();
        assert!(band.factor());
        let b: vec::Vec<f64> = (0..n).map(|i| libm::sin(i as f64)).collect();
        let (mut x, mut y, mut z) = (b.clone(), b.clone(), vec![1.0; n]);
        band.solve(&mut x);
        band.solve_two(&mut y, &mut z);
        assert_eq!(x, y);
        for i in 0..n {
            let mut sum = raw.m0[i] * x[i];
            for (j, off) in [(1, &raw.m1), (2, &raw.m2)] {
                if i >= j {
                    sum += off[i - j] * x[i - j];
                }
                if i + j < n {
                    sum += off[i] * x[i + j];
                }
            }
            assert!((sum - b[i]).abs() < 1e-13);
        }
    }

    #[test]
    fn an_indefinite_matrix_is_refused() {
        let mut band = Band { m0: vec![1.0, 1.0], m1: vec![2.0, 0.0], m2: vec![0.0; 2] };
        assert!(!band.factor());
    }
}
