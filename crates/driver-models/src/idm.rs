//! Car following: the Intelligent Driver Model.
//!
//! Treiber, Hennecke, Helbing, Phys. Rev. E 62 (2000) 1805; Treiber & Kesting, *Traffic Flow
//! Dynamics* (2013), Eq. 11.14-11.15:
//!
//! ```text
//! dv/dt = a [ 1 - (v/v0)^4 - (s*/s)^2 ],   s* = s0 + max(0, v T + v dv / (2 sqrt(a b)))
//! ```
//! v speed (m/s), v0 desired speed (m/s), s bumper-to-bumper gap (m), dv = v - v_leader (m/s),
//! s0 standstill gap (m), T time headway (s), a acceleration (m/s²), b comfortable
//! deceleration (m/s²).
//!
//! Two clamps make it usable outside the textbook's range, both inactive in normal driving: a
//! driver who is faster than v0 slows with b at most, and no one brakes harder than their tyres
//! allow. Only IEEE-exact operations are used, the fourth power by squaring. Left out: reaction
//! time, anticipation of several leaders.

/// Parameters of one driver's car following.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Idm {
    /// Desired speed v0, m/s.
    pub desired_speed_m_s: f64,
    /// Time headway T, s.
    pub headway_s: f64,
    /// Standstill gap s0, m.
    pub min_gap_m: f64,
    /// Acceleration a, m/s².
    pub accel_m_s2: f64,
    /// Comfortable deceleration b, m/s².
    pub decel_m_s2: f64,
    /// Hardest braking, m/s².
    pub max_decel_m_s2: f64,
    /// `2 sqrt(a b)`, m/s²; kept so that no square root is drawn per step.
    two_sqrt_ab_m_s2: f64,
}

/// Smallest gap used in the formula, m; below it the vehicles touch.
const TOUCH_M: f64 = 0.01;

impl Idm {
    /// A driver. All arguments positive (checked by the configuration).
    #[inline]
    #[must_use]
    pub fn new(
        desired_speed_m_s: f64,
        headway_s: f64,
        min_gap_m: f64,
        accel_m_s2: f64,
        decel_m_s2: f64,
        max_decel_m_s2: f64,
    ) -> Self {
        Self {
            desired_speed_m_s,
            headway_s,
            min_gap_m,
            accel_m_s2,
            decel_m_s2,
            max_decel_m_s2,
            two_sqrt_ab_m_s2: 2.0 * libm::sqrt(accel_m_s2 * decel_m_s2),
        }
    }

    /// The same driver while he puts up with a part of his standstill gap and headway.
    #[inline]
    #[must_use]
    pub fn content_with(self, frac: f64) -> Self {
        Self { headway_s: frac * self.headway_s, min_gap_m: frac * self.min_gap_m, ..self }
    }

    /// Acceleration on a free road, m/s², with the desired speed capped by `limit_m_s`. A limit of
    /// zero asks for a stop with the comfortable deceleration.
    #[inline]
    #[must_use]
    pub fn free_m_s2(&self, speed_m_s: f64, limit_m_s: f64) -> f64 {
        let v0 = self.desired_speed_m_s.min(limit_m_s);
        if v0 <= 0.0 {
            return if speed_m_s > 0.0 { -self.decel_m_s2 } else { 0.0 };
        }
        let r = speed_m_s / v0;
        let r2 = r * r;
        (self.accel_m_s2 * (1.0 - r2 * r2)).max(-self.decel_m_s2)
    }

    /// The gap wanted now, `s*`, m. `closing_m_s` is own speed minus the leader's.
    #[inline]
    #[must_use]
    pub fn wanted_gap_m(&self, speed_m_s: f64, closing_m_s: f64) -> f64 {
        let dynamic = speed_m_s * (self.headway_s + closing_m_s / self.two_sqrt_ab_m_s2);
        self.min_gap_m + dynamic.max(0.0)
    }

    /// The part of the acceleration that a leader at `gap_m` takes away from who wants
    /// `wanted_gap_m`, m/s², zero or negative, unclamped: `-a (s*/s)^2`. For those who want more
    /// room than [`Idm::wanted_gap_m`], a safe gap for example.
    #[inline]
    #[must_use]
    pub fn hindrance_m_s2(&self, wanted_gap_m: f64, gap_m: f64) -> f64 {
        let r = wanted_gap_m / gap_m.max(TOUCH_M);
        -self.accel_m_s2 * r * r
    }

    /// The part of the acceleration that the leader takes away, m/s², zero or negative, unclamped.
    /// `closing_m_s` is own speed minus the leader's.
    #[inline]
    #[must_use]
    pub fn interaction_m_s2(&self, speed_m_s: f64, gap_m: f64, closing_m_s: f64) -> f64 {
        self.hindrance_m_s2(self.wanted_gap_m(speed_m_s, closing_m_s), gap_m)
    }

    /// Acceleration behind a leader, m/s².
    #[inline]
    #[must_use]
    pub fn accel_m_s2(&self, speed_m_s: f64, limit_m_s: f64, gap_m: f64, closing_m_s: f64) -> f64 {
        let a = self.free_m_s2(speed_m_s, limit_m_s)
            + self.interaction_m_s2(speed_m_s, gap_m, closing_m_s);
        a.max(-self.max_decel_m_s2)
    }

    /// Free acceleration and what a leader takes away together, as in IDM+ (Schakel, van Arem,
    /// Netten, IEEE ITSC 2010, Eq. 4): `a min[1 - (v/v0)^4, 1 - (s*/s)^2]`, m/s². Followers keep the
    /// headway T at every speed, where the sum of both terms keeps the more the nearer v is to v0.
    #[inline]
    #[must_use]
    pub fn lesser_m_s2(&self, free_m_s2: f64, interaction_m_s2: f64) -> f64 {
        free_m_s2.min(self.accel_m_s2 + interaction_m_s2)
    }

    /// Gap at which a driver follows a leader of the same steady speed, m (Eq. 11.19 of Treiber &
    /// Kesting): `(s0 + v T) / sqrt(1 - (v/v0)^4)`; infinite at or above v0.
    #[inline]
    #[must_use]
    pub fn equilibrium_gap_m(&self, speed_m_s: f64) -> f64 {
        let r = speed_m_s / self.desired_speed_m_s;
        let free = 1.0 - r * r * r * r;
        if free <= 0.0 {
            return f64::INFINITY;
        }
        (self.min_gap_m + speed_m_s * self.headway_s) / libm::sqrt(free)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn car() -> Idm {
        Idm::new(33.3, 1.6, 2.0, 0.73, 1.67, 9.0)
    }

    #[test]
    fn acceleration_equals_the_published_equation() {
        let d = car();
        for v in [0.5, 10.0, 25.0, 33.0] {
            for gap in [20.0, 50.0, 120.0] {
                for dv in [-5.0, 0.0, 3.0] {
                    let s_star: f64 =
                        2.0 + (v * 1.6 + v * dv / (2.0 * libm::sqrt(0.73 * 1.67))).max(0.0);
                    let a = 0.73 * (1.0 - libm::pow(v / 33.3, 4.0) - libm::pow(s_star / gap, 2.0));
                    let got = d.accel_m_s2(v, 99.0, gap, dv);
                    assert!((got - a.max(-9.0)).abs() < 1e-12, "{v} {gap} {dv}: {got} {a}");
                }
            }
        }
    }

    #[test]
    fn a_driver_at_the_equilibrium_gap_neither_accelerates_nor_brakes() {
        let d = car();
        for v in [0.0, 5.0, 20.0, 33.0] {
            let a = d.accel_m_s2(v, 99.0, d.equilibrium_gap_m(v), 0.0);
            assert!(a.abs() < 1e-12, "{v}: {a}");
        }
        assert!(d.equilibrium_gap_m(33.3).is_infinite());
    }

    #[test]
    fn with_the_lesser_of_both_terms_the_headway_is_kept_up_to_the_desired_speed() {
        let d = car();
        for v in [5.0, 20.0, 33.0] {
            let (free, gap) = (d.free_m_s2(v, 99.0), 2.0 + 1.6 * v);
            assert!(d.lesser_m_s2(free, d.interaction_m_s2(v, gap, 0.0)).abs() < 1e-12);
            assert_eq!(d.lesser_m_s2(free, d.interaction_m_s2(v, 1e4, 0.0)), free);
        }
    }

    #[test]
    fn a_limit_of_zero_stops_the_vehicle_and_keeps_it_there() {
        let d = car();
        assert_eq!(d.accel_m_s2(10.0, 0.0, f64::INFINITY, 0.0), -1.67);
        assert_eq!(d.free_m_s2(0.0, 0.0), 0.0);
        assert!(d.accel_m_s2(10.0, 0.0, 0.0, 10.0) >= -9.0);
    }
}
