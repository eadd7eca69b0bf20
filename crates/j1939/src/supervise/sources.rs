//! One signal from several sources.
//!
//! CCVS1 comes from the engine, the cab, the body controller and the brakes, and all but one say
//! that they have no speed. Who is believed is a matter of order and freshness, never of who spoke
//! last.

use tractrix_core::{Stamped, Time};

/// The value of a signal that up to `N` sources send.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sources<T, const N: usize> {
    rows: [(u8, Option<Stamped<T>>); N],
    fresh_nanos: i64,
}

impl<T: Copy, const N: usize> Sources<T, N> {
    /// A signal of these source addresses, the most trusted first. A value is used for
    /// `fresh_nanos` after it came.
    #[must_use]
    pub fn new(order: [u8; N], fresh_nanos: i64) -> Self {
        Self { rows: order.map(|sa| (sa, None)), fresh_nanos }
    }

    /// Takes what a source says; none when it has no value (not available, error). Sources that are
    /// not in the order are not listened to.
    pub fn offer(&mut self, now: Time, sa: u8, value: Option<T>) {
        if let Some((_, row)) = self.rows.iter_mut().find(|(known, _)| *known == sa) {
            *row = value.map(|value| Stamped { time: now, value });
        }
    }

    /// The fresh value of the most trusted source that has one, and its address.
    #[must_use]
    pub fn best(&self, now: Time) -> Option<(u8, Stamped<T>)> {
        let fresh = |of: &Stamped<T>| now.0.saturating_sub(of.time.0) <= self.fresh_nanos;
        self.rows.iter().find_map(|(sa, row)| Some((*sa, row.filter(fresh)?)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_source_that_has_a_fresh_value_is_believed() {
        let mut speed = Sources::new([0x00, 0x0B, 0x31], 250);
        assert_eq!(speed.best(Time(0)), None);
        speed.offer(Time(0), 0x31, Some(20.0));
        speed.offer(Time(0), 0x00, None);
        speed.offer(Time(0), 0x55, Some(99.0));
        let of = |speed: &Sources<f64, 3>, now| speed.best(Time(now)).map(|(sa, s)| (sa, s.value));
        assert_eq!(of(&speed, 10), Some((0x31, 20.0)));
        speed.offer(Time(10), 0x0B, Some(21.0));
        assert_eq!(of(&speed, 10), Some((0x0B, 21.0)), "in the order, whoever spoke last");
        speed.offer(Time(200), 0x31, Some(22.0));
        assert_eq!(of(&speed, 261), Some((0x31, 22.0)), "stale values give way");
        speed.offer(Time(270), 0x31, None);
        assert_eq!(of(&speed, 270), None, "not available is not the last value");
    }
}
