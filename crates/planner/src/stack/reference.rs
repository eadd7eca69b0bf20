//! How fast: the reference speed with its plan, what a jam asks for, and car following.

use super::speed::Ahead;
use super::{SpeedPlannerKind, Tactics};
use crate::Situation;
use crate::decider::DeciderKind;
use crate::pcc::horizon::{HorizonPoint, LeadAhead};
use crate::safety::RearResponse;
use crate::speed::{Following, Lead, SpeedBounds, follow, leads, steady_gap_m};
use crate::steering::ManeuverPlanner;
use tractrix_core::{PlanStatus, SpeedPoint};

impl Tactics {
    /// Whether the speed is planned while driving.
    pub(super) fn plans_ahead(&self) -> bool {
        self.config.speed_planner == SpeedPlannerKind::Predictive && self.profile.is_none()
    }

    /// The plan at a station, where the speed is planned while driving.
    pub(super) fn planned(&self, s_m: f64) -> Option<HorizonPoint> {
        self.plans_ahead().then(|| self.speed.at(s_m)).flatten()
    }

    /// Takes note that traffic, not the plan, sets the acceleration.
    pub(super) fn held_up(&mut self) {
        if self.plans_ahead() {
            self.speed.held_up();
        }
    }

    /// The reference ahead.
    pub(super) fn speed_points(&self) -> impl Iterator<Item = SpeedPoint> {
        self.reference.points()
    }

    /// The speed that the truck would drive without others, m/s. A plan begins at the speed that it
    /// has, and may be made for staying behind somebody: the reference then wishes nothing.
    pub(super) fn wish_speed_m_s(&self, s_m: f64, reference_m_s: f64) -> f64 {
        let allowed = self.plans_ahead().then(|| self.ceiling.at(s_m)).flatten();
        allowed.map_or(reference_m_s, |(m_s, _)| m_s.max(reference_m_s))
    }

    /// Whether the truck may roll above the reference on descents.
    pub(super) fn may_overspeed(&self) -> bool {
        self.config.speed_planner == SpeedPlannerKind::Cruise && self.config.overspeed_m_s > 0.0
    }

    /// Plans the speed of the next kilometres, if it is time to.
    pub(super) fn plan_speed(&mut self, at: &Situation<'_>, maneuver: &ManeuverPlanner) {
        if !self.plans_ahead() {
            return;
        }
        let Situation { now, ego, road, limits, .. } = *at;
        let response = self.config.rss.ego_response(limits);
        let leads = leads(&self.lead_view(at), maneuver);
        let lead = ahead_of(&leads).map(|lead| LeadAhead {
            id: lead.id,
            gap_m: lead.gap_m,
            speed_m_s: lead.speed_m_s,
            wanted_gap_m: steady_gap_m(&self.config.following, &response, lead),
        });
        let lead = lead.filter(|lead| {
            self.config.decider == DeciderKind::KeepLane || self.speed.settled(ego, lead)
        });
        let ahead = Ahead { now, ego, road, lane: maneuver.path().lane, limits, lead };
        self.speed.update(self.ticks, &self.config, &ahead);
    }

    pub(super) fn update_reference(&mut self, at: &Situation<'_>, lane: u16) {
        let bounds = SpeedBounds {
            set_speed_m_s: self.config.set_speed_m_s,
            obey_speed_limits: self.config.obey_speed_limits,
            curve_accel_m_s2: self.config.curve_accel_m_s2,
        };
        let s_m = at.ego.s_m;
        let profile = match self.config.speed_planner {
            SpeedPlannerKind::Predictive => self.profile.as_ref(),
            SpeedPlannerKind::Cruise => None,
        };
        let ahead = self.plans_ahead().then_some(&self.speed);
        let planned = |s_m: f64| match ahead {
            Some(speed) => speed.at(s_m).map(|p| p.speed_m_s),
            None => profile.and_then(|p| p.at(s_m)),
        };
        let planned: Option<&dyn Fn(f64) -> Option<f64>> =
            if ahead.is_some() || profile.is_some() { Some(&planned) } else { None };
        self.reference.update(at.road, lane, s_m, &at.limits.geometry, &bounds, planned);
        if self.may_overspeed() || self.plans_ahead() {
            let over_m_s = if self.may_overspeed() { self.config.overspeed_m_s } else { 0.0 };
            self.ceiling.update_like(&self.reference, bounds.set_speed_m_s + over_m_s);
        }
        self.speed_status = match (self.config.speed_planner, profile) {
            (SpeedPlannerKind::Cruise, _) => PlanStatus::Cruise,
            (SpeedPlannerKind::Predictive, None) => self.speed.status(s_m),
            (SpeedPlannerKind::Predictive, Some(p)) if p.at(s_m).is_some() => p.status(),
            (SpeedPlannerKind::Predictive, _) => PlanStatus::Fallback,
        };
    }

    /// What a jam asks for, by the nearest vehicle in the path.
    pub(super) fn stop_and_go(
        &mut self,
        leads: &[Option<Lead>; 2],
        response: &RearResponse,
        speed_m_s: f64,
    ) -> f64 {
        let config = &self.config.following;
        let lead = ahead_of(leads);
        let steady_gap = |speed_m_s: f64| {
            lead.map_or(0.0, |lead| steady_gap_m(config, response, &Lead { speed_m_s, ..*lead }))
        };
        self.jam.step(self.config.rates.control_s(), config, speed_m_s, lead, steady_gap)
    }

    /// The strictest request of car following, and whom it follows.
    pub(super) fn follow(
        &self,
        leads: &[Option<Lead>; 2],
        response: &RearResponse,
        speed_m_s: f64,
        grade_rad: f64,
    ) -> Option<(u64, Following)> {
        let config = &self.config.following;
        leads
            .iter()
            .flatten()
            .map(|lead| (lead.id, follow(config, response, speed_m_s, grade_rad, lead)))
            .min_by(|a, b| a.1.accel_m_s2.total_cmp(&b.1.accel_m_s2))
    }
}

/// The nearest vehicle in the path that is not being left.
fn ahead_of(leads: &[Option<Lead>; 2]) -> Option<&Lead> {
    let in_path = leads.iter().flatten().filter(|lead| lead.in_path && !lead.being_left);
    in_path.min_by(|a, b| a.gap_m.total_cmp(&b.gap_m))
}
