//! The wish of `--engage-after-checks`: it stands until the truck is driven for the first time.

use j1939::truck::Engagement;

/// The wish, as long as it stands.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct FirstWish {
    stands: bool,
}

impl FirstWish {
    /// All checks are passed, and somebody wants the truck driven then, or not.
    pub(crate) const fn begins(wanted: bool) -> Self {
        Self { stands: wanted }
    }

    /// Somebody has said since what he wishes.
    pub(crate) const fn is_over(&mut self) {
        self.stands = false;
    }

    /// Whether it is to be said now, by who drives after a tick. It may have to be said again: a signal
    /// may come late in the very tick that it is looked at in.
    pub(crate) fn is_open(&mut self, drives: Engagement) -> bool {
        self.stands &= !drives.actuates() && drives != Engagement::Override;
        self.stands && drives == Engagement::Ready
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Which ticks it is said in.
    fn said(wish: &mut FirstWish, drives: &[Engagement]) -> Vec<bool> {
        drives.iter().map(|&drives| wish.is_open(drives)).collect()
    }

    #[test]
    fn a_signal_that_is_late_in_the_tick_of_the_wish_does_not_undo_it() {
        // The story: two programs on a busy machine; all checks were passed, a signal was late in the
        // next tick, and the truck that was to drive after its checks stood for a minute, ready.
        use Engagement::{Engaged, Off, Ready};
        let mut wish = FirstWish::begins(true);
        assert_eq!(
            said(&mut wish, &[Off, Off, Ready, Off, Ready]),
            [false, false, true, false, true]
        );
        assert_eq!(said(&mut wish, &[Engaged, Off, Ready]), [false; 3], "once");
    }

    #[test]
    fn it_ends_with_the_first_drive_a_takeover_or_another_wish() {
        for drives in [Engagement::Engaged, Engagement::MinimalRisk, Engagement::Override] {
            let mut wish = FirstWish::begins(true);
            assert_eq!(said(&mut wish, &[drives, Engagement::Ready]), [false; 2], "{drives:?}");
        }
        let mut wish = FirstWish::begins(true);
        wish.is_over();
        assert_eq!(said(&mut wish, &[Engagement::Ready]), [false]);
        assert!(!FirstWish::begins(false).is_open(Engagement::Ready));
    }
}
