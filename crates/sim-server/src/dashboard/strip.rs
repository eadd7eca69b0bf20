//! Columns of the strip plots over distance.

use serde::Serialize;
use tractrix_core::Tick;

/// Distance between two rows, m, and time, s: a row is due when either has passed.
const SPACING_M: f64 = 10.0;
const SPACING_S: f64 = 5.0;

/// The columns since the start of the run.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub(crate) struct Strip {
    time_s: Vec<f64>,
    pub(super) s_m: Vec<f64>,
    pub(super) speed_m_s: Vec<f64>,
    pub(super) reference_speed_m_s: Vec<f64>,
    pub(super) engine_power_w: Vec<f64>,
    pub(super) gear: Vec<u8>,
    pub(super) fuel_used_g: Vec<f64>,
    pub(super) lateral_error_m: Vec<f64>,
}

impl Strip {
    /// Number of rows.
    pub(crate) fn len(&self) -> usize {
        self.s_m.len()
    }

    /// Adds a row.
    pub(crate) fn push(&mut self, tick: &Tick<'_>) {
        let p = &tick.ego.powertrain;
        self.time_s.push(round(tick.now.seconds(), 100.0));
        self.s_m.push(round(tick.ego.s_m, 10.0));
        self.speed_m_s.push(round(tick.ego.speed_m_s, 1e3));
        self.reference_speed_m_s.push(round(tick.plan.reference_speed_m_s, 1e3));
        self.engine_power_w.push(round(p.engine_power_w, 0.1));
        self.gear.push(p.gear);
        self.fuel_used_g.push(round(p.fuel_used_g, 10.0));
        self.lateral_error_m.push(round(tick.plan.lateral_error_m, 1e4));
    }

    /// The rows from `first` on.
    pub(crate) fn rows_from(&self, first: usize) -> Self {
        let tail = |column: &[f64]| column.get(first..).unwrap_or_default().to_vec();
        Self {
            time_s: tail(&self.time_s),
            s_m: tail(&self.s_m),
            speed_m_s: tail(&self.speed_m_s),
            reference_speed_m_s: tail(&self.reference_speed_m_s),
            engine_power_w: tail(&self.engine_power_w),
            gear: self.gear.get(first..).unwrap_or_default().to_vec(),
            fuel_used_g: tail(&self.fuel_used_g),
            lateral_error_m: tail(&self.lateral_error_m),
        }
    }
}

/// When rows are due, without a look at those that there are.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct RowsDue {
    /// Place and time of the last row, m and s.
    last: Option<(f64, f64)>,
}

impl RowsDue {
    /// Whether a row is due; it is taken to be added.
    pub(crate) fn take(&mut self, tick: &Tick<'_>) -> bool {
        let (s_m, time_s) = (tick.ego.s_m, tick.now.seconds());
        let is_due = self.last.is_none_or(|(last_m, last_s)| {
            s_m >= last_m + SPACING_M || time_s >= last_s + SPACING_S
        });
        if is_due {
            // As the row has them, so that rows stay where they are
            self.last = Some((round(s_m, 10.0), round(time_s, 100.0)));
        }
        is_due
    }
}

/// Rounds for the wire: `per_unit` steps per unit.
pub(super) fn round(value: f64, per_unit: f64) -> f64 {
    (value * per_unit).round() / per_unit
}
