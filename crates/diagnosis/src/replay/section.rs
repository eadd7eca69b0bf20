//! Grade by the place on the road.

/// Grade over the position, on a uniform grid.
pub(crate) struct GradeBySection {
    start_m: f64,
    values: Vec<f64>,
}

/// Length of a cell, m.
const SECTION_M: f64 = 4.0;

impl GradeBySection {
    pub(super) fn new(s: &[f64], grade: &[f64]) -> Self {
        let (lo, hi) =
            s.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |a, x| (a.0.min(*x), a.1.max(*x)));
        let cells = (((hi - lo) / SECTION_M) as usize + 2).min(1_000_000);
        let (mut sum, mut count) = (vec![0.0; cells], vec![0.0; cells]);
        for (s, g) in s.iter().zip(grade) {
            let i = (((s - lo) / SECTION_M) as usize).min(cells - 1);
            sum[i] += g;
            count[i] += 1.0;
        }
        let mut last = grade.first().copied().unwrap_or(0.0);
        let values = sum
            .iter()
            .zip(&count)
            .map(|(s, c)| {
                if *c > 0.0 {
                    last = s / c;
                }
                last
            })
            .collect();
        Self { start_m: lo, values }
    }

    pub(crate) fn at(&self, s_m: f64) -> f64 {
        let x = ((s_m - self.start_m) / SECTION_M - 0.5).max(0.0);
        let i = (x as usize).min(self.values.len() - 1);
        let j = (i + 1).min(self.values.len() - 1);
        self.values[i] + (x - i as f64).min(1.0) * (self.values[j] - self.values[i])
    }
}
