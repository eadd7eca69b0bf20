//! Lane changing: MOBIL, "minimizing overall braking induced by lane changes".
//!
//! Kesting, Treiber, Helbing, Transp. Res. Record 1999 (2007) 86-94. With a the acceleration of
//! the changing driver, n the new follower, o the old follower, and a tilde for "after the change":
//!
//! ```text
//! safety     ã_n >= -b_safe
//! incentive  ã - a + p [ (ã_n - a_n) + (ã_o - a_o) ] > Δa_th  (+ a_bias against, - towards keep-right)
//! ```
//! p politeness (0 selfish, 1 altruistic), b_safe (m/s²), Δa_th changing threshold (m/s²), a_bias
//! keep-right bias (m/s²). Beyond the paper, [`Mobil::is_safe`] also asks that the changing driver
//! need not brake harder than b_safe. Left out: the passing rule on the right (asymmetric MOBIL's Eq. 6).

/// Parameters of one driver's lane changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mobil {
    /// Politeness p, 0 to 1.
    pub politeness_frac: f64,
    /// Hardest braking that may be forced on a follower, m/s², positive.
    pub safe_decel_m_s2: f64,
    /// Changing threshold, m/s².
    pub threshold_m_s2: f64,
    /// Bias towards the right lane, m/s².
    pub right_bias_m_s2: f64,
}

/// Accelerations of the three drivers concerned, before and after the change, m/s².
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Change {
    /// Changing driver, now.
    pub own_before_m_s2: f64,
    /// Changing driver, in the target lane.
    pub own_after_m_s2: f64,
    /// Follower in the target lane, now.
    pub new_follower_before_m_s2: f64,
    /// Follower in the target lane, behind the changed vehicle.
    pub new_follower_after_m_s2: f64,
    /// Follower in the old lane, now.
    pub old_follower_before_m_s2: f64,
    /// Follower in the old lane, with the vehicle gone.
    pub old_follower_after_m_s2: f64,
}

impl Mobil {
    /// The paper's safety criterion.
    #[inline]
    #[must_use]
    pub fn spares_new_follower(&self, c: &Change) -> bool {
        c.new_follower_after_m_s2 >= -self.safe_decel_m_s2
    }

    /// The paper's criterion, and the changing driver need not brake harder either.
    #[inline]
    #[must_use]
    pub fn is_safe(&self, c: &Change) -> bool {
        self.spares_new_follower(c) && c.own_after_m_s2 >= -self.safe_decel_m_s2
    }

    /// The advantage over the threshold, m/s²; a change pays if it is positive.
    #[inline]
    #[must_use]
    pub fn incentive_m_s2(&self, c: &Change, to_the_right: bool) -> f64 {
        let bias = if to_the_right { self.right_bias_m_s2 } else { -self.right_bias_m_s2 };
        c.own_after_m_s2 - c.own_before_m_s2
            + self.politeness_frac
                * (c.new_follower_after_m_s2 - c.new_follower_before_m_s2
                    + c.old_follower_after_m_s2
                    - c.old_follower_before_m_s2)
            + bias
            - self.threshold_m_s2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHANGE: Change = Change {
        own_before_m_s2: -0.5,
        own_after_m_s2: 0.4,
        new_follower_before_m_s2: 0.3,
        new_follower_after_m_s2: -0.7,
        old_follower_before_m_s2: -0.2,
        old_follower_after_m_s2: 0.1,
    };

    #[test]
    fn the_incentive_equals_the_published_inequality() {
        let m = Mobil {
            politeness_frac: 0.5,
            safe_decel_m_s2: 4.0,
            threshold_m_s2: 0.1,
            right_bias_m_s2: 0.3,
        };
        let want = 0.9 + 0.5 * (-1.0 + 0.3) - 0.1;
        assert!((m.incentive_m_s2(&CHANGE, true) - (want + 0.3)).abs() < 1e-12);
        assert!((m.incentive_m_s2(&CHANGE, false) - (want - 0.3)).abs() < 1e-12);
    }

    #[test]
    fn a_polite_driver_forgoes_what_a_selfish_one_takes() {
        let selfish = Mobil {
            politeness_frac: 0.0,
            safe_decel_m_s2: 4.0,
            threshold_m_s2: 0.1,
            right_bias_m_s2: 0.0,
        };
        let polite = Mobil { politeness_frac: 1.2, ..selfish };
        assert!(selfish.incentive_m_s2(&CHANGE, false) > 0.0);
        assert!(polite.incentive_m_s2(&CHANGE, false) < 0.0);
    }

    #[test]
    fn nobody_is_made_to_brake_harder_than_is_safe() {
        let m = Mobil {
            politeness_frac: 0.0,
            safe_decel_m_s2: 2.0,
            threshold_m_s2: 0.0,
            right_bias_m_s2: 0.0,
        };
        assert!(m.is_safe(&CHANGE));
        assert!(!m.is_safe(&Change { new_follower_after_m_s2: -2.1, ..CHANGE }));
        let own = Change { own_after_m_s2: -2.1, ..CHANGE };
        assert!(!m.is_safe(&own) && m.spares_new_follower(&own));
    }
}
