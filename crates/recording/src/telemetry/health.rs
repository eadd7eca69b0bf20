//! `/diagnostics`: what the guard changed, how the speed is planned, what refuses a lane change.

use tractrix_core::{GuardReason, Plan, PlanStatus, Tick};

use super::in_map;
use crate::ros::diagnostic::{DiagnosticArray, DiagnosticStatus, KeyValue, Level};
use crate::ros::truck::word;

/// The state of the stack's parts in a tick.
pub(super) fn diagnostics(tick: &Tick<'_>) -> DiagnosticArray {
    let plan = tick.plan;
    DiagnosticArray { header: in_map(tick.now), status: vec![guard(plan), speed(plan), lane(plan)] }
}

/// A command that was changed is a warning; no plan, or a bus or a sensor that fails, an error.
fn guard(plan: &Plan) -> DiagnosticStatus {
    let level = plan.guard.iter().map(|reason| match reason {
        GuardReason::Range | GuardReason::Rate | GuardReason::Headway | GuardReason::Driver => {
            Level::Warn
        }
        GuardReason::Stale
        | GuardReason::NonFinite
        | GuardReason::Frozen
        | GuardReason::Jump
        | GuardReason::NoPlan
        | GuardReason::Bus
        | GuardReason::Intruder => Level::Error,
    });
    let reasons: Vec<String> = plan.guard.iter().map(word).collect();
    let message =
        if reasons.is_empty() { "commands as planned".to_owned() } else { reasons.join(", ") };
    DiagnosticStatus::new(level.max().unwrap_or(Level::Ok), "stack: guard", message, Vec::new())
}

fn speed(plan: &Plan) -> DiagnosticStatus {
    let level = match plan.speed_status {
        PlanStatus::LastProfile | PlanStatus::Fallback => Level::Warn,
        _ => Level::Ok,
    };
    let speed_m_s = |key, value: f64| KeyValue { key, value: format!("{value:.2}") };
    let values = vec![
        speed_m_s("reference_speed_m_s", plan.reference_speed_m_s),
        speed_m_s("target_speed_m_s", plan.target_speed_m_s),
        KeyValue { key: "held_up", value: plan.held_up.to_string() },
    ];
    DiagnosticStatus::new(level, "stack: speed plan", word(&plan.speed_status), values)
}

fn lane(plan: &Plan) -> DiagnosticStatus {
    let refusal = plan.refusal.as_ref().map_or_else(String::new, word);
    let values = vec![
        KeyValue { key: "lane", value: plan.lane.to_string() },
        KeyValue { key: "refusal", value: refusal },
    ];
    DiagnosticStatus::new(Level::Ok, "stack: lane", word(&plan.maneuver), values)
}

#[cfg(test)]
mod tests {
    use tractrix_core::{EgoState, Scene, Time};

    use super::*;

    #[test]
    fn the_worst_of_the_guards_reasons_is_its_level() {
        let (ego, scene) = (EgoState::default(), Scene::default());
        for (reasons, level, words) in [
            (vec![], 0, "as planned"),
            (vec![GuardReason::Rate], 1, "rate"),
            (vec![GuardReason::Rate, GuardReason::Stale], 2, "rate, stale"),
        ] {
            let plan = Plan { guard: reasons, ..Plan::default() };
            let tick = Tick { now: Time::ZERO, ego: &ego, scene: &scene, plan: &plan };
            let message = crate::topic::DIAGNOSTICS.encode(&diagnostics(&tick)).unwrap();
            // Behind the encapsulation: header (8 + 4 + "map\0"), then the count of the statuses
            assert_eq!(message.cdr[4 + 16..4 + 20], [3, 0, 0, 0]);
            assert_eq!(message.cdr[4 + 20], level, "{words}");
            assert!(String::from_utf8_lossy(&message.cdr).contains(words));
        }
    }
}
