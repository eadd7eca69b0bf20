//! Demand from detectors: counts, lane by lane, as a table with a header.
//!
//! | column | meaning |
//! |---|---|
//! | `time_s` | start of the interval, s |
//! | `lane` | lane track at the start of the road; missing: all lanes alike |
//! | `flow_veh_h` or `count` | vehicles per hour, or vehicles within the interval |
//! | `speed_m_s` | mean speed at which they pass; may be missing or empty |
//! | `truck_share_frac` | share of trucks; may be missing or empty |
//!
//! An interval ends where the next one of its lane begins; the last is as long as the one before.

use std::path::Path;

use super::DemandStep;
use crate::TrafficError;

/// Most rows of a table.
const ROWS: usize = 1_000_000;
/// Length of the interval of a single row, s (one minute).
const SINGLE_S: f64 = 60.0;

/// Reads a table of counts.
///
/// # Errors
/// [`TrafficError::Config`] names the file, the line and what is wrong there.
pub fn load(path: &Path) -> Result<Vec<DemandStep>, TrafficError> {
    let named = |why: String| TrafficError::Config { why: format!("{}: {why}", path.display()) };
    let text = std::fs::read_to_string(path).map_err(|e| named(e.to_string()))?;
    parse(&text).map_err(named)
}

/// One row.
struct Row {
    line: usize,
    time_s: f64,
    lane: Option<u16>,
    count: Option<f64>,
    flow_veh_h: Option<f64>,
    speed_m_s: Option<f64>,
    truck_share_frac: Option<f64>,
}

/// Demand of a table's text, in order of its times.
///
/// # Errors
/// Says the line and what is wrong there.
pub fn parse(text: &str) -> Result<Vec<DemandStep>, String> {
    let mut rows = rows(text)?;
    rows.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    let mut steps = Vec::with_capacity(rows.len());
    for (k, row) in rows.iter().enumerate() {
        let same = |other: &&Row| other.lane == row.lane;
        let before = rows.iter().take(k).rev().find(same).map(|other| row.time_s - other.time_s);
        let after = rows.iter().skip(k + 1).find(same).map(|other| other.time_s - row.time_s);
        let interval_s = after.or(before).unwrap_or(SINGLE_S);
        if interval_s <= 0.0 {
            return Err(format!("line {}: two rows of one lane at {} s", row.line, row.time_s));
        }
        let flow = row.flow_veh_h.or(row.count.map(|count| 3600.0 * count / interval_s));
        steps.push(DemandStep {
            from_s: row.time_s,
            lane: row.lane,
            flow_veh_h_lane: flow,
            truck_share_frac: row.truck_share_frac,
            inflow_speed_m_s: row.speed_m_s,
            ..DemandStep::default()
        });
    }
    Ok(steps)
}

fn rows(text: &str) -> Result<Vec<Row>, String> {
    let lines = text.lines().enumerate().map(|(k, line)| (k + 1, line.trim()));
    let mut lines = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let (_, head) = lines.next().ok_or("an empty table")?;
    let head: Vec<&str> = head.split(',').map(str::trim).collect();
    let known = ["time_s", "lane", "flow_veh_h", "count", "speed_m_s", "truck_share_frac"];
    if let Some(other) = head.iter().find(|name| !known.contains(name)) {
        return Err(format!("unknown column `{other}`; known: {}", known.join(", ")));
    }
    let column = |name: &str| head.iter().position(|found| *found == name);
    let time = column("time_s").ok_or("no column `time_s`")?;
    if column("flow_veh_h").is_some() == column("count").is_some() {
        return Err("one of the columns `flow_veh_h` and `count` is needed".to_owned());
    }
    let mut rows = Vec::new();
    for (line, text) in lines {
        let cells: Vec<&str> = text.split(',').map(str::trim).collect();
        if cells.len() != head.len() {
            return Err(format!("line {line}: {} cells under {} names", cells.len(), head.len()));
        }
        if rows.len() >= ROWS {
            return Err(format!("line {line}: more than {ROWS} rows"));
        }
        let number = |index: Option<usize>, high: f64| -> Result<Option<f64>, String> {
            let Some(cell) = index.and_then(|k| cells.get(k)).filter(|cell| !cell.is_empty())
            else {
                return Ok(None);
            };
            match cell.parse::<f64>() {
                Ok(x) if (0.0..=high).contains(&x) => Ok(Some(x)),
                _ => Err(format!("line {line}: `{cell}` is no number from 0 to {high}")),
            }
        };
        let lane = number(column("lane"), f64::from(u16::MAX - 1))?;
        if lane.is_some_and(|lane| lane % 1.0 != 0.0) {
            return Err(format!("line {line}: lanes are whole numbers"));
        }
        let time_s = number(Some(time), 1e7)?.ok_or(format!("line {line}: no time"))?;
        rows.push(Row {
            line,
            time_s,
            lane: lane.map(|lane| lane as u16),
            count: number(column("count"), 1e5)?,
            flow_veh_h: number(column("flow_veh_h"), 20_000.0)?,
            speed_m_s: number(column("speed_m_s"), 70.0)?,
            truck_share_frac: number(column("truck_share_frac"), 1.0)?,
        });
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_become_flows_by_the_interval_of_their_lane() {
        let text =
            "# A5, km 12\ntime_s,lane,count,speed_m_s\n0,0,10,22\n0,1,20,\n60,0,5,20\n300,1,4,30\n";
        let steps = parse(text).unwrap();
        let flows: Vec<_> = steps.iter().map(|s| (s.from_s, s.lane, s.flow_veh_h_lane)).collect();
        let want = [
            (0.0, Some(0), Some(600.0)),
            (0.0, Some(1), Some(240.0)),
            (60.0, Some(0), Some(300.0)),
            (300.0, Some(1), Some(48.0)),
        ];
        assert_eq!(flows, want);
        assert_eq!((steps[0].inflow_speed_m_s, steps[1].inflow_speed_m_s), (Some(22.0), None));
    }

    #[test]
    fn a_bad_table_is_refused_with_its_line() {
        for (text, words) in [
            ("", "empty table"),
            ("time_s,lane\n0,1", "flow_veh_h"),
            ("time_s,flow_veh_h,count\n", "one of the columns"),
            ("time_s,flow\n", "unknown column `flow`"),
            ("time_s,count\n0", "line 2: 1 cells under 2"),
            ("time_s,count\n0,-1", "line 2: `-1`"),
            ("time_s,count\nx,1", "line 2: `x`"),
            ("time_s,lane,count\n0,0.5,1", "whole numbers"),
            ("time_s,count\n0,1\n0,2", "two rows of one lane at 0 s"),
        ] {
            let e = parse(text).unwrap_err();
            assert!(e.contains(words), "{text:?}: {e}");
        }
    }
}
