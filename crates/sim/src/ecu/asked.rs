//! What control units are asked to do, by whom, and until when.

use j1939::check::{Checker, Policy, Protection, Verdict};
use j1939::{Frame, J1939Error};
use tractrix_core::Time;

/// Sources that one control unit listens to; others are refused.
const SOURCES: usize = 4;

/// The demands of one kind, a source each. The most urgent one acts; of equally urgent ones that of
/// the source that was heard first.
#[derive(Debug, Clone)]
pub(super) struct Asked<T> {
    sources: [Option<Source<T>>; SOURCES],
    protection: Option<Protection>,
    /// A demand that is not repeated within this ends, ns.
    timeout_ns: i64,
}

#[derive(Debug, Clone, Copy)]
struct Source<T> {
    sa: u8,
    checker: Option<Checker>,
    demand: Option<Demand<T>>,
}

/// A demand that may act.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Demand<T> {
    /// Who asks.
    pub(super) sa: u8,
    /// 0 is the most urgent, 3 the least.
    pub(super) priority: u8,
    pub(super) value: T,
    heard: Time,
}

impl<T: Copy> Asked<T> {
    /// Demands with counter and checksum where `protection` says so.
    pub(super) const fn new(protection: Option<Protection>, timeout_ns: i64) -> Self {
        Self { sources: [None; SOURCES], protection, timeout_ns }
    }

    /// Takes a demand, or the end of one (`None`).
    ///
    /// # Errors
    /// [`J1939Error::Unprotected`] for a frame that must not act: what it asks for is not taken, and
    /// the demand before it goes on until it is too old.
    pub(super) fn hear(
        &mut self,
        now: Time,
        frame: &Frame,
        priority: u8,
        value: Option<T>,
    ) -> Result<(), J1939Error> {
        let (pgn, sa) = (frame.id().pgn(), frame.id().sa());
        let refused = |verdict| J1939Error::Unprotected { pgn, sa, verdict };
        let protection = self.protection;
        let known = self.sources.iter().position(|s| s.is_some_and(|s| s.sa == sa));
        let free = || self.sources.iter().position(Option::is_none);
        let Some(place) = known.or_else(free).and_then(|at| self.sources.get_mut(at)) else {
            return Err(refused(Verdict::Missing));
        };
        let checker = protection.map(|p| Checker::new(p, Policy::Required));
        let source = place.get_or_insert(Source { sa, checker, demand: None });
        if let Some(checker) = &mut source.checker {
            let verdict = checker.check(frame);
            if !verdict.passes() {
                return Err(refused(verdict));
            }
        }
        source.demand = value.map(|value| Demand { sa, priority, value, heard: now });
        Ok(())
    }

    /// Forgets all demands.
    pub(super) fn forget(&mut self) {
        for source in self.sources.iter_mut().flatten() {
            source.demand = None;
        }
    }

    /// The demand that acts at `now`.
    pub(super) fn acting(&self, now: Time) -> Option<Demand<T>> {
        let fresh = |d: &Demand<T>| now.0.saturating_sub(d.heard.0) <= self.timeout_ns;
        let demands = self.sources.iter().flatten().filter_map(|s| s.demand).filter(fresh);
        demands.min_by_key(|d| d.priority)
    }

    /// Ends demands that were not repeated in time; whether there was one.
    pub(super) fn expire(&mut self, now: Time) -> bool {
        let timeout_ns = self.timeout_ns;
        let mut expired = false;
        for source in self.sources.iter_mut().flatten() {
            if source.demand.is_some_and(|d| now.0.saturating_sub(d.heard.0) > timeout_ns) {
                source.demand = None;
                expired = true;
            }
        }
        expired
    }
}

#[cfg(test)]
mod tests {
    use j1939::check::{Carrier, Sealer};
    use j1939::truck::{Urgency, brake_demand};
    use tractrix_core::{BrakeMode, Command};

    use super::*;

    const MS: i64 = 1_000_000;

    fn verdict(error: J1939Error) -> Verdict {
        let J1939Error::Unprotected { verdict, .. } = error else { panic!("{error}") };
        verdict
    }

    fn frame(sealer: &mut Sealer, sa: u8) -> Frame {
        let brake =
            Command { xbr_decel_m_s2: 1.0, brake_mode: BrakeMode::Maximum, ..Command::default() };
        sealer.seal(brake_demand(&brake, Urgency::Normal), 0x0B, sa).unwrap()
    }

    fn asked() -> Asked<u8> {
        Asked::new(Some(Carrier::XBR.protection), 100 * MS)
    }

    #[test]
    fn the_most_urgent_demand_acts_and_old_ones_end() {
        let mut asked = asked();
        let [mut a, mut b] = [Sealer::new(Carrier::XBR); 2];
        asked.hear(Time(0), &frame(&mut a, 1), 2, Some(10)).unwrap();
        asked.hear(Time(MS), &frame(&mut b, 2), 0, Some(20)).unwrap();
        assert_eq!(asked.acting(Time(MS)).map(|d| (d.sa, d.value)), Some((2, 20)));
        asked.hear(Time(90 * MS), &frame(&mut a, 1), 2, Some(11)).unwrap();
        let late = Time(102 * MS);
        assert_eq!(asked.acting(late).map(|d| (d.sa, d.value)), Some((1, 11)));
        assert!(asked.expire(late) && !asked.expire(late));
        asked.hear(late, &frame(&mut a, 1), 2, None).unwrap();
        assert_eq!(asked.acting(late), None);
    }

    #[test]
    fn what_is_repeated_lost_or_changed_is_refused() {
        let mut asked = asked();
        let mut sealer = Sealer::new(Carrier::XBR);
        let frames: Vec<Frame> = (0..4).map(|_| frame(&mut sealer, 1)).collect();
        asked.hear(Time(0), &frames[0], 2, Some(1)).unwrap();
        let stuck = asked.hear(Time(1), &frames[0], 2, Some(2)).unwrap_err();
        assert!(matches!(verdict(stuck), Verdict::Stuck { .. }));
        let jump = asked.hear(Time(2), &frames[2], 2, Some(3)).unwrap_err();
        assert!(matches!(verdict(jump), Verdict::Jump { .. }));
        let mut wrong: [u8; 8] = frames[3].bytes().try_into().unwrap();
        wrong[0] ^= 1;
        let wrong = Frame::of(frames[3].id(), wrong);
        let checksum = asked.hear(Time(3), &wrong, 2, Some(4)).unwrap_err();
        assert!(matches!(verdict(checksum), Verdict::Checksum { .. }));
        assert_eq!(asked.acting(Time(3)).map(|d| d.value), Some(1));
        assert!(asked.hear(Time(4), &frames[3], 2, Some(5)).is_ok());
    }

    #[test]
    fn a_fifth_source_is_refused() {
        let mut asked = asked();
        for sa in 0..4 {
            asked.hear(Time(0), &frame(&mut Sealer::new(Carrier::XBR), sa), 2, Some(sa)).unwrap();
        }
        let fifth = frame(&mut Sealer::new(Carrier::XBR), 9);
        assert!(asked.hear(Time(0), &fifth, 0, Some(9)).is_err());
        assert_eq!(asked.acting(Time(0)).map(|d| d.value), Some(0));
    }
}
