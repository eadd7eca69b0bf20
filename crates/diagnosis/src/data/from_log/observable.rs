//! What drives of a log can be asked: causes whose columns are there, and causes that nobody can see.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::causes::hypothesis::CATALOGUE;
use crate::{Channel, Table};

/// The catalogue of causes against the columns of the drives.
#[derive(Debug, Serialize)]
pub(super) struct Causes {
    /// Causes whose columns are there; whether the drives excite them `diagnose` says.
    columns_for: Vec<&'static str>,
    /// Causes that no drive can show, with the columns that they lack.
    not_observable: Vec<Unobservable>,
}

#[derive(Debug, Serialize)]
struct Unobservable {
    id: &'static str,
    missing_columns: Vec<&'static str>,
}

impl Causes {
    pub(super) fn of(tables: &[Table]) -> Self {
        let (mut yes, mut no): (Vec<&'static str>, Vec<Unobservable>) = (Vec::new(), Vec::new());
        for h in CATALOGUE {
            let missing = |table: &Table| -> Vec<&'static str> {
                h.channels.iter().filter(|c| lacks(table, **c)).map(|c| c.name()).collect()
            };
            let Some(least) = tables.iter().map(missing).min_by_key(Vec::len) else { continue };
            if least.is_empty() && !yes.contains(&h.id) {
                yes.push(h.id);
            } else if !least.is_empty() && !no.iter().any(|n| n.id == h.id) {
                no.push(Unobservable { id: h.id, missing_columns: least });
            }
        }
        // of several forms of a cause one is enough
        no.retain(|n| !yes.contains(&n.id));
        Self { columns_for: yes, not_observable: no }
    }

    /// The same for people.
    pub(super) fn sentences(&self) -> Vec<String> {
        let none = if self.columns_for.is_empty() { "no cause" } else { "" };
        let mut lines =
            vec![format!("Columns are there for: {none}{}", self.columns_for.join(", "))];
        let mut by_columns: BTreeMap<String, Vec<&str>> = BTreeMap::new();
        for n in &self.not_observable {
            by_columns.entry(n.missing_columns.join(", ")).or_default().push(n.id);
        }
        lines.extend(by_columns.into_iter().map(|(columns, ids)| {
            format!("Nothing can be said, for want of {columns}, of: {}", ids.join(", "))
        }));
        lines
    }
}

/// Whether a drive lacks a column that its map does not fill either.
fn lacks(table: &Table, channel: Channel) -> bool {
    let is_there = table.columns.iter().any(|column| column.0 == channel.name());
    let of_map = matches!(channel, Channel::GradeFrac | Channel::Curvature1M);
    !(is_there || of_map && table.map.is_some())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(columns: &[&'static str], map: bool) -> Table {
        Table { map: map.then(|| "map.csv".to_owned()), ..Table::new("d".to_owned(), columns) }
    }

    #[test]
    fn a_cause_is_listed_once_with_the_columns_of_the_drive_that_lacks_least() {
        let long = ["speed_m_s", "engine_torque_percent", "engine_speed_rpm", "gear"];
        let without = Causes::of(&[table(&long[..1], false), table(&long, false)]);
        let mass = without.not_observable.iter().find(|n| n.id == "mass").unwrap();
        assert_eq!(mass.missing_columns, ["grade_frac"]);
        let all = CATALOGUE.iter().map(|h| h.id).collect::<std::collections::BTreeSet<_>>();
        assert_eq!(without.columns_for.len() + without.not_observable.len(), all.len());
        let with = Causes::of(&[table(&long, true)]);
        assert!(with.columns_for.contains(&"mass"));
        assert!(with.not_observable.iter().all(|n| n.id != "mass"));
    }
}
