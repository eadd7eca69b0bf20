//! A table of a folder of measured drives, written as the contract has it.

/// A table of a folder of drives: one drive, or its map.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Table {
    /// Name of the drive.
    pub name: String,
    /// Mass on the load sheet, kg; none: the truck file's.
    pub reported_mass_kg: Option<f64>,
    /// Whether the tyres were warm at the start; none: not known.
    pub tyres_warm_at_start: Option<bool>,
    /// The map table beside it.
    pub map: Option<String>,
    /// Columns by name, of equal length; the first is `time_s`.
    pub columns: Vec<(&'static str, Vec<f64>)>,
}

impl Table {
    /// A table with these columns and no rows.
    #[must_use]
    pub fn new(name: String, columns: &[&'static str]) -> Self {
        let columns = columns.iter().map(|c| (*c, Vec::new())).collect();
        Self { name, columns, tyres_warm_at_start: Some(false), ..Self::default() }
    }

    /// Appends a row.
    pub fn push(&mut self, row: &[f64]) {
        for ((_, column), value) in self.columns.iter_mut().zip(row) {
            column.push(*value);
        }
    }

    /// The table as text.
    #[must_use]
    pub fn csv(&self) -> String {
        let rows = self.columns.first().map_or(0, |c| c.1.len());
        let mut text = self.columns.iter().map(|c| c.0).collect::<Vec<_>>().join(",");
        for i in 0..rows {
            text.push('\n');
            for (k, (_, column)) in self.columns.iter().enumerate() {
                if k > 0 {
                    text.push(',');
                }
                // a millionth is below the resolution of every channel
                let value = (column.get(i).copied().unwrap_or(f64::NAN) * 1e6).round() / 1e6;
                text.push_str(&value.to_string());
            }
        }
        text.push('\n');
        text
    }
}
