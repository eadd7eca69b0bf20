//! What a user may set about the stack. Every key ends in its unit; unknown keys are refused.

use crate::PlannerError;
use crate::decider::DeciderKind;
use crate::error::config_in;
use crate::pcc::horizon::HorizonConfig;
use crate::safety::{GuardConfig, RssConfig};
use crate::speed::{EstimatorConfig, FollowingConfig, LongitudinalConfig};
use crate::steering::{LaneChangeConfig, LateralConfig};
use serde::{Deserialize, Serialize};

/// Who sets the reference speed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SpeedPlannerKind {
    /// The set speed, limits and curves.
    #[default]
    Cruise,
    /// The fuel-optimal profile of predictive cruise control, cruise where there is none.
    Predictive,
}

/// How often each part runs, in ticks of the loop.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RatesConfig {
    /// Period of the loop, s.
    pub tick_s: f64,
    /// Controllers run every so many ticks.
    pub control_ticks: u32,
    /// Path, predictions and safety gate run every so many ticks.
    pub path_ticks: u32,
    /// The decider runs every so many ticks.
    pub decision_ticks: u32,
    /// The predictive speed planner runs every so many ticks.
    pub speed_plan_ticks: u32,
}

impl Default for RatesConfig {
    /// 100 Hz loop and control, 10 Hz path and gate, 1 Hz decisions, speed plan every 5 s.
    fn default() -> Self {
        Self {
            tick_s: 0.01,
            control_ticks: 1,
            path_ticks: 10,
            decision_ticks: 100,
            speed_plan_ticks: 500,
        }
    }
}

impl RatesConfig {
    /// Rates for another tick: control every tick, path at 10 Hz, decisions at 1 Hz, speed plan
    /// every 5 s, each rounded to whole ticks.
    #[must_use]
    pub fn for_tick(tick_s: f64) -> Self {
        let ticks = |period_s: f64| libm::round(period_s / tick_s).clamp(1.0, 1e6) as u32;
        Self {
            tick_s,
            control_ticks: 1,
            path_ticks: ticks(0.1),
            decision_ticks: ticks(1.0),
            speed_plan_ticks: ticks(5.0),
        }
    }

    /// Period of the controllers, s.
    #[must_use]
    pub fn control_s(&self) -> f64 {
        self.tick_s * f64::from(self.control_ticks)
    }
}

/// The stack's configuration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StackConfig {
    /// Speed that the driver sets, m/s.
    pub set_speed_m_s: f64,
    /// Who decides on lane changes.
    pub decider: DeciderKind,
    /// The law asks to keep right: rules and MOBIL return to the right lane where it serves.
    pub keep_right: bool,
    /// Who sets the reference speed.
    pub speed_planner: SpeedPlannerKind,
    /// Horizon of the predictive speed planner.
    pub speed_plan: HorizonConfig,
    /// Cruise control lets the truck roll this much above the set speed on descents before it
    /// brakes, m/s; speed limits and curves hold all the same. The predictive planner has its own
    /// band.
    pub overspeed_m_s: f64,
    /// Speed limits of the road count.
    pub obey_speed_limits: bool,
    /// Largest lateral acceleration in curves, m/s².
    pub curve_accel_m_s2: f64,
    /// How often each part runs.
    pub rates: RatesConfig,
    /// Safe gaps.
    pub rss: RssConfig,
    /// Car following.
    pub following: FollowingConfig,
    /// Lane changes.
    pub lane_change: LaneChangeConfig,
    /// Steering.
    pub lateral: LateralConfig,
    /// Pedal, retarder and brakes.
    pub longitudinal: LongitudinalConfig,
    /// Mass and rolling resistance from driving.
    pub estimator: EstimatorConfig,
    /// The last check before the vehicle.
    pub guard: GuardConfig,
}

impl Default for StackConfig {
    /// The paper's 72 km/h, lane keeping, cruise.
    fn default() -> Self {
        Self {
            set_speed_m_s: 20.0,
            decider: DeciderKind::default(),
            keep_right: true,
            speed_planner: SpeedPlannerKind::default(),
            speed_plan: HorizonConfig::default(),
            overspeed_m_s: 0.0,
            obey_speed_limits: true,
            curve_accel_m_s2: 1.5,
            rates: RatesConfig::default(),
            rss: RssConfig::default(),
            following: FollowingConfig::default(),
            lane_change: LaneChangeConfig::default(),
            lateral: LateralConfig::default(),
            longitudinal: LongitudinalConfig::default(),
            estimator: EstimatorConfig::default(),
            guard: GuardConfig::default(),
        }
    }
}

impl StackConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// [`PlannerError::Config`] names the first offending key.
    pub fn check(&self) -> Result<(), PlannerError> {
        config_in("set_speed_m_s", self.set_speed_m_s, 0.0, 40.0)?;
        config_in("overspeed_m_s", self.overspeed_m_s, 0.0, 10.0)?;
        config_in("curve_accel_m_s2", self.curve_accel_m_s2, 0.2, 4.0)?;
        let r = &self.rates;
        config_in("rates.tick_s", r.tick_s, 0.001, 0.1)?;
        config_in("rates.control_ticks * tick_s", r.control_s(), 0.001, 0.1)?;
        for (field, ticks, longest_s) in [
            ("rates.path_ticks", r.path_ticks, 0.5),
            ("rates.decision_ticks", r.decision_ticks, 10.0),
            ("rates.speed_plan_ticks", r.speed_plan_ticks, 60.0),
        ] {
            config_in(field, f64::from(ticks), 1.0, longest_s / r.tick_s)?;
        }
        let remainder = f64::from(r.decision_ticks % r.path_ticks);
        config_in("rates.decision_ticks modulo path_ticks", remainder, 0.0, 0.0)?;
        self.speed_plan.check()?;
        self.rss.check()?;
        self.following.check()?;
        self.lane_change.check()?;
        self.lateral.check()?;
        self.longitudinal.check()?;
        self.estimator.check()?;
        self.guard.check()?;
        self.decider.check()
    }
}
