//! One tick of the loop: the same body in the server, in training, in the tests and on the truck.

use crate::Stack;
use road::Road;
use tractrix_core::{
    EgoState, Maneuver, Recorder, Stamped, Step, Tick, Time, TrafficSource, Vehicle,
};

/// What a tick came to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TickOutcome {
    /// The ego state that the plan was made with.
    pub ego: Stamped<EgoState>,
    /// The manoeuvre that is being driven.
    pub maneuver: Maneuver,
    /// The guard changed something.
    pub guarded: bool,
}

/// A seam that failed. The minimal-risk command has been sent all the same, unless sending failed.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DriveError<V: core::error::Error, T: core::error::Error> {
    /// The truck could not be read.
    #[error("the truck's state could not be read: {0}")]
    Ego(V),
    /// The traffic source failed.
    #[error("the traffic source failed: {0}")]
    Traffic(T),
    /// The command could not be delivered.
    #[error("the command could not be delivered: {0}")]
    Command(V),
}

/// Drives one tick: ego, status, scene, plan, command, record.
///
/// # Errors
/// [`DriveError`] when a seam fails. When the truck cannot be read or the traffic source fails, the
/// stack's minimal-risk command is delivered before the error is returned; the caller decides
/// whether the run goes on, and calling again is always allowed.
pub fn drive_tick<V: Vehicle, T: TrafficSource, R: Recorder>(
    now: Time,
    vehicle: &mut V,
    traffic: &mut T,
    stack: &mut Stack,
    road: &Road,
    recorder: &mut R,
) -> Result<TickOutcome, DriveError<V::Error, T::Error>> {
    let read = vehicle.ego(now);
    let status = vehicle.status();
    let ego = read.as_ref().ok().copied();
    let seen = match read {
        Ok(ego) => match traffic.advance(now, &ego.value) {
            Ok(scene) => Ok((ego, scene)),
            Err(error) => Err(DriveError::Traffic(error)),
        },
        Err(error) => Err(DriveError::Ego(error)),
    };
    let (ego, scene) = (ego.as_ref(), seen.as_ref().ok().map(|(_, scene)| *scene));
    let (set_speed_m_s, wish) = (stack.config().set_speed_m_s, stack.wish());
    let limits = vehicle.limits();
    let plan = match (ego, scene) {
        (Some(ego), Some(scene)) => stack.tick(now, ego, &status, scene, road, limits),
        _ => stack.minimal_risk(now, ego, &status, road, limits),
    };
    recorder.step(&Step {
        now,
        ego,
        status: &status,
        scene,
        limits,
        limit_cap_m_s: road.limit_cap_m_s(),
        set_speed_m_s,
        wish,
        command: &plan.command,
    });
    vehicle.command(now, &plan.command).map_err(DriveError::Command)?;
    let (ego, scene) = seen?;
    recorder.record(&Tick { now, ego: &ego.value, scene, plan });
    Ok(TickOutcome { ego, maneuver: plan.maneuver, guarded: !plan.guard.is_empty() })
}
