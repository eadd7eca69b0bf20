//! Who drives: off, ready, engaged, overridden by the driver, minimal risk.

use tractrix_core::Time;

/// Who drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Engagement {
    /// The driver drives; something that driving over the bus needs is missing.
    #[default]
    Off,
    /// The driver drives; the system may be engaged.
    Ready,
    /// The system drives.
    Engaged,
    /// The driver has taken over and holds pedals or wheel.
    Override,
    /// The system brings the truck to a stop, because something is wrong.
    MinimalRisk,
}

impl Engagement {
    /// Whether demands are sent to the truck.
    #[must_use]
    pub const fn actuates(self) -> bool {
        matches!(self, Self::Engaged | Self::MinimalRisk)
    }
}

/// What decides about the engagement in a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Conditions {
    /// The address is ours.
    pub claimed: bool,
    /// Every signal is fresh, and the torque can be scaled.
    pub fresh: bool,
    /// Engine and brakes take demands.
    pub accepted: bool,
    /// The driver holds pedals or wheel.
    pub driver: bool,
    /// The bus is not in order: wrong counters, rates, flood.
    pub wrong: bool,
    /// Somebody pretends to be somebody else.
    pub intruder: bool,
}

impl Conditions {
    const fn in_order(self) -> bool {
        self.claimed && self.fresh && self.accepted && !self.wrong && !self.intruder
    }
}

/// The engagement with its memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Clutch {
    state: Engagement,
    since: Time,
    /// The driver's wish to engage, valid for the next tick.
    wished: bool,
    /// An intruder was there, or a stop is asked for: only a new engagement ends the minimal-risk
    /// manoeuvre.
    latched: bool,
}

impl Clutch {
    pub(super) const fn state(&self) -> Engagement {
        self.state
    }

    /// Since when it is so.
    pub(super) const fn since(&self) -> Time {
        self.since
    }

    pub(super) const fn wish(&mut self) {
        self.wished = true;
    }

    /// Brings the truck to a stop, if the system drives.
    pub(super) fn stop(&mut self, now: Time) {
        if self.state.actuates() {
            self.latched = true;
            self.set(now, Engagement::MinimalRisk);
        }
    }

    pub(super) fn release(&mut self, now: Time) {
        self.wished = false;
        self.set(now, Engagement::Off);
    }

    /// A transient fault ends with its cause: the guard then waits for its recovery time. An
    /// intruder does not go away by being silent for a moment.
    pub(super) fn update(&mut self, now: Time, conditions: Conditions) {
        let wished = core::mem::take(&mut self.wished);
        let free = conditions.in_order() && !conditions.driver;
        self.latched = self.state.actuates() && (self.latched || conditions.intruder);
        let next = match self.state {
            Engagement::Off | Engagement::Override if conditions.driver => {
                if self.state == Engagement::Override {
                    Engagement::Override
                } else {
                    Engagement::Off
                }
            }
            Engagement::Ready if free && wished => Engagement::Engaged,
            Engagement::Off | Engagement::Ready | Engagement::Override => {
                if free {
                    Engagement::Ready
                } else {
                    Engagement::Off
                }
            }
            Engagement::Engaged | Engagement::MinimalRisk if conditions.driver => {
                Engagement::Override
            }
            Engagement::Engaged | Engagement::MinimalRisk => {
                if free && !self.latched {
                    Engagement::Engaged
                } else {
                    Engagement::MinimalRisk
                }
            }
        };
        self.set(now, next);
    }

    fn set(&mut self, now: Time, next: Engagement) {
        if next != self.state {
            (self.state, self.since) = (next, now);
        }
        self.latched &= next.actuates();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: Conditions = Conditions {
        claimed: true,
        fresh: true,
        accepted: true,
        driver: false,
        wrong: false,
        intruder: false,
    };

    fn engaged() -> Clutch {
        let mut clutch = Clutch::default();
        clutch.update(Time(0), GOOD);
        clutch.wish();
        clutch.update(Time(1), GOOD);
        assert_eq!((clutch.state(), clutch.since()), (Engagement::Engaged, Time(1)));
        clutch
    }

    #[test]
    fn nothing_engages_without_a_wish_or_before_all_is_in_order() {
        let mut clutch = Clutch::default();
        for conditions in [
            Conditions { claimed: false, ..GOOD },
            Conditions { fresh: false, ..GOOD },
            Conditions { accepted: false, ..GOOD },
            Conditions { driver: true, ..GOOD },
            Conditions { wrong: true, ..GOOD },
            Conditions { intruder: true, ..GOOD },
        ] {
            for _ in 0..3 {
                clutch.wish();
                clutch.update(Time(0), conditions);
                assert_eq!(clutch.state(), Engagement::Off, "{conditions:?}");
            }
        }
        for _ in 0..3 {
            clutch.update(Time(0), GOOD);
            assert_eq!(clutch.state(), Engagement::Ready);
        }
        clutch.wish();
        clutch.update(Time(0), GOOD);
        assert_eq!(clutch.state(), Engagement::Engaged);
    }

    #[test]
    fn a_wish_in_the_tick_in_which_it_becomes_ready_is_too_early() {
        let mut clutch = Clutch::default();
        clutch.wish();
        clutch.update(Time(0), GOOD);
        clutch.update(Time(1), GOOD);
        assert_eq!(clutch.state(), Engagement::Ready);
    }

    #[test]
    fn what_is_missing_leads_to_minimal_risk_and_back() {
        for conditions in [
            Conditions { claimed: false, ..GOOD },
            Conditions { fresh: false, ..GOOD },
            Conditions { accepted: false, ..GOOD },
            Conditions { wrong: true, ..GOOD },
        ] {
            let mut clutch = engaged();
            clutch.update(Time(2), conditions);
            assert_eq!(clutch.state(), Engagement::MinimalRisk, "{conditions:?}");
            clutch.update(Time(3), GOOD);
            assert_eq!(clutch.state(), Engagement::Engaged);
        }
    }

    #[test]
    fn an_intruder_is_not_forgotten_when_he_is_silent() {
        let mut clutch = engaged();
        clutch.update(Time(2), Conditions { intruder: true, ..GOOD });
        for i in 3..9 {
            clutch.update(Time(i), GOOD);
            assert_eq!(clutch.state(), Engagement::MinimalRisk);
        }
        clutch.release(Time(9));
        clutch.update(Time(10), GOOD);
        clutch.wish();
        clutch.update(Time(11), GOOD);
        clutch.update(Time(12), GOOD);
        assert_eq!(clutch.state(), Engagement::Engaged);
    }

    #[test]
    fn a_stop_lasts_until_the_truck_is_let_go_or_the_driver_takes_it() {
        let mut idle = Clutch::default();
        idle.stop(Time(0));
        assert_eq!(idle.state(), Engagement::Off);
        for by_the_driver in [false, true] {
            let mut clutch = engaged();
            clutch.stop(Time(2));
            for i in 3..9 {
                clutch.wish();
                clutch.update(Time(i), GOOD);
                assert_eq!(clutch.state(), Engagement::MinimalRisk);
            }
            if by_the_driver {
                clutch.update(Time(9), Conditions { driver: true, ..GOOD });
                assert_eq!(clutch.state(), Engagement::Override);
            } else {
                clutch.release(Time(9));
                assert_eq!(clutch.state(), Engagement::Off);
            }
        }
    }

    #[test]
    fn a_driver_keeps_the_truck_until_the_system_is_engaged_again() {
        let driver = Conditions { driver: true, ..GOOD };
        for before in [GOOD, Conditions { fresh: false, ..GOOD }] {
            let mut clutch = engaged();
            clutch.update(Time(2), before);
            clutch.update(Time(3), driver);
            clutch.wish();
            clutch.update(Time(4), driver);
            assert_eq!(clutch.state(), Engagement::Override);
            for i in 5..8 {
                clutch.update(Time(i), GOOD);
                assert_eq!(clutch.state(), Engagement::Ready);
            }
        }
    }
}
