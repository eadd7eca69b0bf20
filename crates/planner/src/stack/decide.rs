//! The decision of a tick: what is wished, why, and whether it is driven.

use super::tactics::Tactics;
use crate::Situation;
use crate::decider::observation::{
    self, ObservationSpec, Observed, Observer, PROFILE_S, Seen, sees_anyone,
};
use crate::decider::{
    DeciderKind, LaneChoice, MobilConfig, View, keep_right, lane_ends, leave_ending_lane,
    leaving_gap_m, mobil, rollout, rules,
};
use crate::speed::power_reserve_w;
use crate::steering::{ManeuverPlanner, Outlook};
use tractrix_core::{LaneChangeReason, LaneChangeRefusal, Maneuver};

/// Headway that a return to the right lane leaves a follower under MOBIL, s.
const REAR_HEADWAY_S: f64 = 2.0;
/// Step of the profile of the reference speed, s.
const PROFILE_STEP_S: f64 = 0.25;
/// Numbers of the longest observation.
const OBSERVATION_MAX: usize = ObservationSpec::Tractrix1.size();

impl Tactics {
    /// Checks the change under way and looks at what is wished. Returns the reason of an abort or a
    /// refusal.
    pub(super) fn decide(
        &mut self,
        maneuver: &mut ManeuverPlanner,
        out: &Outlook<'_>,
        due: bool,
    ) -> Option<LaneChangeRefusal> {
        let at = out.at;
        let aborted = maneuver.update(out);
        if self.policy.is_some() {
            let reference = |s_m: f64| self.reference.at(s_m).map_or(0.0, |r| r.0);
            self.observer.push(observation::frame(at.ego, at.scene, at.road, reference));
        }
        let wish = match self.config.decider {
            DeciderKind::External => core::mem::take(&mut self.wish),
            _ if !due || maneuver.maneuver() != Maneuver::KeepLane => LaneChoice::Keep,
            DeciderKind::Dqn => {
                let view = self.view(at, maneuver.lane(), out.reference_speed_m_s);
                if lane_ends(&view) {
                    leave_ending_lane(&view)
                } else {
                    self.learned(maneuver, out, &view)
                }
            }
            kind => self.ruled(kind, maneuver, out),
        };
        if wish != LaneChoice::Keep {
            self.reason = Some(self.why(wish, maneuver.lane(), out));
        } else if maneuver.maneuver() == Maneuver::KeepLane {
            self.reason = None;
        }
        maneuver.request(wish, out).err().or(aborted)
    }

    /// What a decider would wish here, whoever decides in this truck: keep during a change, before
    /// the first tick, and for the deciders that need more than the scene (`dqn`, `external`).
    #[must_use]
    pub fn wish_of(&self, kind: DeciderKind, at: &Situation<'_>) -> LaneChoice {
        match (&self.maneuver, self.outlook(at)) {
            (Some(maneuver), Some(out)) if maneuver.maneuver() == Maneuver::KeepLane => {
                self.ruled(kind, maneuver, &out)
            }
            _ => LaneChoice::Keep,
        }
    }

    /// The wish of a decider that needs the scene alone.
    fn ruled(
        &self,
        kind: DeciderKind,
        maneuver: &ManeuverPlanner,
        out: &Outlook<'_>,
    ) -> LaneChoice {
        let at = out.at;
        let view = self.view(at, maneuver.lane(), out.reference_speed_m_s);
        let law = self.config.keep_right;
        match kind {
            _ if lane_ends(&view) => leave_ending_lane(&view),
            DeciderKind::Rules { distance_m } => match rules(&view, distance_m) {
                LaneChoice::Keep if law => keep_right(&view, |_| distance_m, distance_m),
                wish => wish,
            },
            DeciderKind::Mobil(config) => match mobil(&view, &config) {
                LaneChoice::Keep if law => {
                    let leaving = |v: f64| leaving_gap_m(&view, &config, v);
                    keep_right(&view, leaving, REAR_HEADWAY_S * at.ego.speed_m_s)
                }
                wish => wish,
            },
            DeciderKind::Rollout(config) => {
                let passes = |choice| maneuver.would_pass(choice, out).is_ok();
                match rollout(&view, &config, passes) {
                    LaneChoice::Keep if law => {
                        let leaving = |v: f64| leaving_gap_m(&view, &MobilConfig::default(), v);
                        keep_right(&view, leaving, REAR_HEADWAY_S * at.ego.speed_m_s)
                    }
                    wish => wish,
                }
            }
            DeciderKind::KeepLane | DeciderKind::Dqn | DeciderKind::External => LaneChoice::Keep,
        }
    }

    fn view<'a>(&self, at: &Situation<'a>, lane: u16, reference_m_s: f64) -> View<'a> {
        let wish_m_s = self.wish_speed_m_s(at.ego.s_m, reference_m_s);
        View::new(at.ego, &at.limits.geometry, at.scene, at.road, lane, wish_m_s)
    }

    /// Why the decider wishes a change.
    fn why(&self, wish: LaneChoice, lane: u16, out: &Outlook<'_>) -> LaneChangeReason {
        let (at, reference_m_s) = (out.at, out.reference_speed_m_s);
        let view = View::new(at.ego, &at.limits.geometry, at.scene, at.road, lane, reference_m_s);
        let slower_within = |distance_m: f64| {
            view.ahead(lane).is_some_and(|(n, gap)| gap < distance_m && n.speed_m_s < reference_m_s)
        };
        match self.config.decider {
            DeciderKind::External => LaneChangeReason::Requested,
            _ if lane_ends(&view) => LaneChangeReason::LaneEnds,
            DeciderKind::Dqn => LaneChangeReason::Policy,
            DeciderKind::Rules { distance_m } if slower_within(distance_m) => {
                LaneChangeReason::SlowerAhead
            }
            _ if wish == LaneChoice::Right => LaneChangeReason::KeepRight,
            _ => LaneChangeReason::SlowerAhead,
        }
    }

    /// The learned policy's choice: the paper's among the lanes that exist, none while nobody is in
    /// sight; ours among the changes that the gate would pass.
    fn learned(
        &mut self,
        maneuver: &ManeuverPlanner,
        out: &Outlook<'_>,
        view: &View<'_>,
    ) -> LaneChoice {
        let Some(policy) = self.policy.clone() else { return LaneChoice::Keep };
        let spec = policy.spec();
        let paper = spec == ObservationSpec::Paper216;
        if paper && !self.observer.latest().is_some_and(sees_anyone) {
            return LaneChoice::Keep;
        }
        let allowed = [LaneChoice::Left, LaneChoice::Right].map(|choice| {
            if paper {
                view.beside(choice).is_some()
            } else {
                maneuver.would_pass(choice, out).is_ok()
            }
        });
        let mut numbers = [0.0; OBSERVATION_MAX];
        let numbers = &mut numbers[..spec.size()];
        spec.write(&self.observe(maneuver, out, &self.observer, allowed), numbers);
        let mut scratch = core::mem::take(&mut self.scratch);
        let choice = policy.choose(numbers, &mut scratch, |choice| match choice {
            LaneChoice::Left => allowed[0],
            LaneChoice::Right => allowed[1],
            LaneChoice::Keep => true,
        });
        self.scratch = scratch;
        choice
    }

    /// What an [`ObservationSpec`] writes here; `passes` says for the left and the right whether the
    /// gate would pass a change ([`Self::would_pass`]). `None` before the first tick.
    #[must_use]
    pub fn observed<'a>(
        &self,
        at: &Situation<'_>,
        frames: &'a Observer,
        passes: [bool; 2],
    ) -> Option<Observed<'a>> {
        Some(self.observe(self.maneuver.as_ref()?, &self.outlook(at)?, frames, passes))
    }

    fn observe<'a>(
        &self,
        maneuver: &ManeuverPlanner,
        out: &Outlook<'_>,
        frames: &'a Observer,
        passes: [bool; 2],
    ) -> Observed<'a> {
        let at = out.at;
        let ego = at.ego;
        let view = self.view(at, maneuver.lane(), out.reference_speed_m_s);
        let ahead = |lane: Option<u16>| {
            let (n, gap_m) = view.ahead(lane?)?;
            Some(Seen { gap_m, speed_m_s: n.speed_m_s })
        };
        let lanes_on = |side: LaneChoice| {
            let mut count = 0;
            let mut beside = view;
            while let Some(lane) = beside.beside(side).filter(|_| count < u16::MAX) {
                (count, beside.lane) = (count + 1, lane);
            }
            count
        };
        let mut profile_m_s = [0.0; 3];
        let (mut time_s, mut s_m) = (0.0, ego.s_m);
        for (speed_m_s, until_s) in profile_m_s.iter_mut().zip(PROFILE_S) {
            let at_m_s = |s_m: f64| self.reference.at(s_m).map_or(0.0, |r| r.0);
            while time_s < until_s {
                s_m += PROFILE_STEP_S * at_m_s(s_m);
                time_s += PROFILE_STEP_S;
            }
            *speed_m_s = at_m_s(s_m);
        }
        Observed {
            frames,
            maneuver: maneuver.maneuver(),
            progress_frac: maneuver.progress_frac(ego.s_m),
            lanes: [lanes_on(LaneChoice::Right), lanes_on(LaneChoice::Left)],
            speed_m_s: ego.speed_m_s,
            accel_m_s2: ego.accel_x_m_s2,
            passes,
            ahead: [
                ahead(Some(view.lane)),
                ahead(view.beside(LaneChoice::Left)),
                ahead(view.beside(LaneChoice::Right)),
            ],
            wish_speed_m_s: view.wish_speed_m_s,
            mass_kg: at.limits.road_load.mass_kg,
            power_reserve_w: power_reserve_w(at.limits, ego, at.grade_rad()),
            profile_m_s,
        }
    }
}
