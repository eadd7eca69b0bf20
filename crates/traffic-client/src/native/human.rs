//! What people do that equations of car following leave out: they misjudge, they get used to a gap,
//! and they remember why they changed lanes.
//!
//! - *Estimation errors* (Treiber, Kesting, Helbing, Physica A 360 (2006) 71, Sec. 2.2): the gap is
//!   seen as `s exp(V_s w_s)`, the closing speed as `dv + s r_c w_v`; `w_s`, `w_v` are independent
//!   Wiener processes with mean 0, variance 1 and correlation time tau. They are drawn anew at each
//!   decision of a driver, from seed, vehicle and tick.
//! - *Relaxation* (Laval & Leclercq, Transp. Res. B 42 (2008) 511; Schakel, Knoop, van Arem, Transp.
//!   Res. Record 2316 (2012) 47): who changes lanes, and who is cut in on, takes a gap shorter than
//!   he would choose, down to `least_headway_s`, and goes back to his own headway with the time
//!   constant `relaxation_s`.
//! - *Standing*: behind another one nobody drives slower than `creep_m_s`. Who would have to stops,
//!   and stands until he could drive that fast (in the way of slow-to-start rules: Barlovic, Santen,
//!   Schadschneider, Schreckenberg, Eur. Phys. J. B 5 (1998) 793). Without, drivers roll up to their
//!   standstill gap ever more slowly, as the IDM does.
//! - *Memory*: a change is not undone within `keep_lane_s` unless its cause is gone.
//!
//! Left out: the reaction time of that paper, which its anticipation of several leaders makes up
//! for (its Sec. 4), and that anticipation.

use serde::{Deserialize, Serialize};

use super::lanes::NO_LANE;
use crate::philox::{Draws, Stream};

/// Human factors, the same for all classes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HumanConfig {
    /// Relative error of a gap that is seen, V_s, standard deviation.
    pub gap_error_frac: f64,
    /// Error of the inverse time to collision that is seen, r_c, standard deviation, 1/s.
    pub closing_error_1_s: f64,
    /// Correlation time of these errors, tau, s.
    pub error_memory_s: f64,
    /// Time constant with which a driver goes back to his own headway, s.
    pub relaxation_s: f64,
    /// Shortest headway accepted in a needed lane change, s.
    pub least_headway_s: f64,
    /// A lane change is not undone for so long unless its cause is gone, s.
    pub keep_lane_s: f64,
    /// Slowest speed that drivers keep up behind another vehicle, m/s; 0: they creep.
    pub creep_m_s: f64,
}

impl Default for HumanConfig {
    /// Errors: Treiber, Kesting, Helbing (2006), Table 1. Relaxation: Schakel et al. (2012),
    /// Table 1.
    fn default() -> Self {
        Self {
            gap_error_frac: 0.05,
            closing_error_1_s: 0.01,
            error_memory_s: 20.0,
            relaxation_s: 25.0,
            least_headway_s: 0.56,
            keep_lane_s: 15.0,
            creep_m_s: 0.0,
        }
    }
}

impl HumanConfig {
    /// Keys, values and ranges.
    pub(crate) fn ranges(&self) -> [(&'static str, f64, f64, f64); 7] {
        [
            ("human.gap_error_frac", self.gap_error_frac, 0.0, 0.2),
            ("human.closing_error_1_s", self.closing_error_1_s, 0.0, 0.05),
            ("human.error_memory_s", self.error_memory_s, 1.0, 600.0),
            ("human.relaxation_s", self.relaxation_s, 1.0, 600.0),
            ("human.least_headway_s", self.least_headway_s, 0.2, 5.0),
            ("human.keep_lane_s", self.keep_lane_s, 0.0, 600.0),
            ("human.creep_m_s", self.creep_m_s, 0.0, 3.0),
        ]
    }

    /// How errors go on over `step_s`: what stays of the old ones, and what is new.
    fn memory(&self, step_s: f64) -> (f64, f64) {
        let stays = libm::exp(-step_s / self.error_memory_s);
        (stays, libm::sqrt(1.0 - stays * stays))
    }
}

/// The last lane change of a driver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LastChange {
    /// The lane that he left, or [`NO_LANE`].
    from: u16,
    at_tick: u64,
    /// Number of the vehicle that was ahead of him there.
    behind: Option<u64>,
}

/// What changes in a driver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Mind {
    /// Headway kept now over the own one, 0 to 1.
    pub(crate) headway_frac: f64,
    /// `w_s` and `w_v`.
    errors: [f64; 2],
    /// A gap is seen this many times as long.
    gap_seen_frac: f64,
    /// A closing speed is seen greater by this per metre of gap, 1/s.
    closing_seen_1_s: f64,
    last_change: LastChange,
}

impl Default for Mind {
    fn default() -> Self {
        Self {
            headway_frac: 1.0,
            errors: [0.0; 2],
            gap_seen_frac: 1.0,
            closing_seen_1_s: 0.0,
            last_change: LastChange { from: NO_LANE, at_tick: 0, behind: None },
        }
    }
}

/// How all minds go on, with what does not change kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Minds {
    config: HumanConfig,
    seed: u64,
    /// Between two decisions: what stays of an error, and what is new.
    memory: (f64, f64),
    /// Part of the way back to the own headway in a tick.
    relaxes_frac: f64,
    /// The same between two decisions.
    far_relaxes_frac: f64,
    keep_lane_ticks: u64,
}

impl Minds {
    pub(crate) fn new(config: &HumanConfig, seed: u64, tick_s: f64, decision_ticks: u64) -> Self {
        Self {
            config: *config,
            seed,
            memory: config.memory(decision_ticks as f64 * tick_s),
            relaxes_frac: (tick_s / config.relaxation_s).min(1.0),
            far_relaxes_frac: 1.0
                - libm::exp(-(decision_ticks as f64) * tick_s / config.relaxation_s),
            keep_lane_ticks: (config.keep_lane_s / tick_s) as u64,
        }
    }

    /// Judges anew: one step of both Wiener processes.
    pub(crate) fn judge(&self, mind: &mut Mind, vehicle: u64, tick: u64) {
        // Uniform in ±sqrt(3): variance 1.
        let new = Draws::new(self.seed, Stream::Judgement, vehicle).two(tick as u32);
        for (error, u) in mind.errors.iter_mut().zip(new) {
            *error =
                self.memory.0 * *error + self.memory.1 * 1.732_050_807_568_877_2 * (2.0 * u - 1.0);
        }
        mind.gap_seen_frac = libm::exp(self.config.gap_error_frac * mind.errors[0]);
        mind.closing_seen_1_s = self.config.closing_error_1_s * mind.errors[1];
    }

    /// A tick of getting used to the own headway again.
    pub(crate) fn relax(&self, mind: &mut Mind) {
        mind.headway_frac += self.relaxes_frac * (1.0 - mind.headway_frac);
    }

    /// The time between two decisions of getting used to the own headway again.
    pub(super) fn relax_far(&self, mind: &mut Mind) {
        mind.headway_frac += self.far_relaxes_frac * (1.0 - mind.headway_frac);
    }

    /// Shortest headway over the own one that is accepted in a needed change.
    pub(crate) fn least_frac(&self, own_headway_s: f64) -> f64 {
        (self.config.least_headway_s / own_headway_s).min(1.0)
    }
}

impl Mind {
    /// Gap and closing speed as they are seen, m and m/s.
    pub(crate) fn sees(&self, gap_m: f64, closing_m_s: f64) -> (f64, f64) {
        (gap_m * self.gap_seen_frac, closing_m_s + gap_m.max(0.0) * self.closing_seen_1_s)
    }

    /// Accepts the gap that he is in now as long as nobody asks for less than `least_frac`.
    pub(crate) fn accept(&mut self, steady_headway_frac: f64, least_frac: f64) {
        self.headway_frac = self.headway_frac.min(steady_headway_frac.clamp(least_frac, 1.0));
    }

    /// Remembers a change out of lane `from`, where vehicle `behind` was ahead.
    pub(crate) fn changed(&mut self, from: u16, at_tick: u64, behind: Option<u64>) {
        self.last_change = LastChange { from, at_tick, behind };
    }

    /// Would a change into `lane`, ahead of vehicle `follower`, undo the last one for no new reason?
    /// The reason is new if the vehicle that he fled from is overtaken.
    pub(crate) fn would_undo(
        &self,
        minds: &Minds,
        lane: u16,
        tick: u64,
        follower: impl Fn() -> Option<u64>,
    ) -> bool {
        let last = &self.last_change;
        let recent = || tick < last.at_tick + minds.keep_lane_ticks;
        let overtaken = || last.behind.is_some() && last.behind == follower();
        last.from == lane && recent() && !overtaken()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_judgement_have_variance_one_and_the_memory_that_is_asked_for() {
        let minds = Minds::new(&HumanConfig::default(), 5, 0.1, 5);
        let mut mind = Mind::default();
        let x: Vec<f64> = (0..400_000)
            .map(|k| {
                minds.judge(&mut mind, 7, 5 * k);
                mind.errors[0]
            })
            .collect();
        let n = x.len() as f64;
        let mean = x.iter().sum::<f64>() / n;
        let variance = x.iter().map(|w| w * w).sum::<f64>() / n;
        // 40 steps of 0.5 s are the memory of 20 s.
        let later = x.windows(41).map(|w| w[0] * w[40]).sum::<f64>() / n;
        assert!(mean.abs() < 0.05 && (variance - 1.0).abs() < 0.05, "{mean} {variance}");
        assert!((later / variance - libm::exp(-1.0)).abs() < 0.05, "{later}");
    }

    #[test]
    fn a_change_is_undone_only_once_its_cause_is_gone() {
        let minds = Minds::new(&HumanConfig::default(), 1, 0.1, 5);
        let mut mind = Mind::default();
        assert!(!mind.would_undo(&minds, 0, 10, || None), "he never changed");
        mind.changed(0, 100, Some(4));
        assert!(mind.would_undo(&minds, 0, 200, || Some(9)), "the slow one is still ahead");
        assert!(!mind.would_undo(&minds, 0, 200, || Some(4)), "it was overtaken");
        assert!(!mind.would_undo(&minds, 2, 200, || Some(9)), "that is another lane");
        assert!(!mind.would_undo(&minds, 0, 250, || Some(9)), "15 s are over");
    }

    #[test]
    fn a_short_gap_is_accepted_and_given_up_with_the_time_constant() {
        let minds = Minds::new(&HumanConfig::default(), 1, 0.1, 5);
        let mut mind = Mind::default();
        mind.accept(0.2, minds.least_frac(1.4));
        assert!((mind.headway_frac - 0.4).abs() < 1e-12);
        for _ in 0..250 {
            minds.relax(&mut mind);
        }
        assert!((mind.headway_frac - (1.0 - 0.6 * libm::exp(-1.0))).abs() < 2e-3);
    }
}
