//! Where a log has drives: from a start to a long standstill.

use serde::Serialize;

use super::collect::Series;

/// Below this a truck stands, m/s.
const STANDS_M_S: f64 = 0.5;
/// Kept before the start and after the stop, s.
const MARGIN_S: f64 = 5.0;

/// A part of a log, s since its start.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Span {
    /// Start, s.
    pub from_s: f64,
    /// End, s.
    pub to_s: f64,
}

impl Span {
    /// How long it is, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.to_s - self.from_s
    }
}

/// Spans in which the truck drives: a standstill of `standstill_s` or a pause of the speed signal
/// longer than it holds ends one.
pub(super) fn trips(speed: &Series, standstill_s: f64) -> Vec<Span> {
    let mut found: Vec<Span> = Vec::new();
    let mut last_s = f64::NEG_INFINITY;
    let mut starts_anew = true;
    let (mut first_known_s, mut last_known_s) = (Vec::new(), Vec::new());
    for &(time_s, v_m_s) in &speed.samples {
        if time_s - last_s > speed.holds_s.max(2.0) {
            starts_anew = true;
            first_known_s.push(time_s);
            last_known_s.push(time_s);
        }
        last_s = time_s;
        if let Some(known) = last_known_s.last_mut() {
            *known = time_s;
        }
        if v_m_s.abs() < STANDS_M_S {
            continue;
        }
        match found.last_mut() {
            Some(trip) if !starts_anew && time_s - trip.to_s < standstill_s => trip.to_s = time_s,
            _ => found.push(Span { from_s: time_s, to_s: time_s }),
        }
        starts_anew = false;
    }
    // margins, within what is known and halfway to the neighbour at most
    for trip in &mut found {
        let known = first_known_s.iter().zip(&last_known_s);
        let mut known = known.filter(|(a, b)| **a <= trip.from_s && trip.to_s <= **b);
        if let Some((a, b)) = known.next() {
            trip.from_s = (trip.from_s - MARGIN_S).max(*a);
            trip.to_s = (trip.to_s + MARGIN_S).min(*b);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(parts: &[(f64, f64, f64)]) -> Series {
        let mut samples = Vec::new();
        for &(from_s, to_s, v_m_s) in parts {
            let n = ((to_s - from_s) * 10.0) as usize;
            samples.extend((0..n).map(|k| (from_s + 0.1 * k as f64, v_m_s)));
        }
        Series { samples, holds_s: 0.3, period_s: 0.1, no_number: 0 }
    }

    #[test]
    fn a_long_standstill_parts_two_drives_and_a_short_one_does_not() {
        let speed = series(&[
            (0.0, 100.0, 0.0),
            (100.0, 200.0, 10.0),
            (200.0, 230.0, 0.0),
            (230.0, 300.0, 10.0),
            (300.0, 500.0, 0.0),
            (500.0, 600.0, 10.0),
        ]);
        let found = trips(&speed, 120.0);
        assert_eq!(found.len(), 2);
        assert!((found[0].from_s - 95.0).abs() < 0.2 && (found[0].to_s - 305.0).abs() < 0.2);
        assert!((found[1].from_s - 495.0).abs() < 0.2 && (found[1].to_s - 599.9).abs() < 0.2);
    }

    #[test]
    fn a_pause_of_the_log_parts_two_drives_without_a_margin_across_it() {
        let found = trips(&series(&[(0.0, 100.0, 10.0), (103.0, 200.0, 10.0)]), 120.0);
        assert_eq!(found.len(), 2);
        assert!(found[0].to_s < 100.0 && found[1].from_s >= 103.0);
        assert!(trips(&series(&[(0.0, 100.0, 0.0)]), 120.0).is_empty());
    }
}
