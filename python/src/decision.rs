//! What the stack decided in a tick, as a dictionary; the fields and their documentation are those
//! of `tractrix.Decision`.

use pyo3::IntoPyObject;
use serde::Serialize;
use tractrix_core::{Plan, Time};

use crate::fault::Fault;

/// The fields of `tractrix.Decision`.
#[derive(IntoPyObject)]
pub(crate) struct Decision {
    time_s: f64,
    maneuver: String,
    reason: Option<String>,
    refusal: Option<String>,
    speed_status: String,
    reference_speed_m_s: f64,
    target_speed_m_s: f64,
    target_accel_m_s2: f64,
    target_d_m: f64,
    lateral_error_m: f64,
    lane: u16,
    following: Option<u64>,
    guard: Vec<String>,
    accelerator_pedal_frac: f64,
    xbr_decel_m_s2: f64,
    steering_wheel_rad: f64,
    retarder_frac: f64,
}

impl Decision {
    /// The plan of the tick at `time`.
    pub(crate) fn new(time: Time, plan: &Plan) -> Result<Self, Fault> {
        Ok(Self {
            time_s: time.seconds(),
            maneuver: word(&plan.maneuver)?,
            reason: plan.reason.as_ref().map(word).transpose()?,
            refusal: plan.refusal.as_ref().map(word).transpose()?,
            speed_status: word(&plan.speed_status)?,
            reference_speed_m_s: plan.reference_speed_m_s,
            target_speed_m_s: plan.target_speed_m_s,
            target_accel_m_s2: plan.target_accel_m_s2,
            target_d_m: plan.target_d_m,
            lateral_error_m: plan.lateral_error_m,
            lane: plan.lane,
            following: plan.following,
            guard: plan.guard.iter().map(word).collect::<Result<_, _>>()?,
            accelerator_pedal_frac: plan.command.accelerator_pedal_frac,
            xbr_decel_m_s2: plan.command.xbr_decel_m_s2,
            steering_wheel_rad: plan.command.steering_wheel_rad,
            retarder_frac: plan.command.retarder_frac,
        })
    }
}

/// A field-less value by the word that files have for it.
pub(crate) fn word(value: &impl Serialize) -> Result<String, Fault> {
    match serde_json::to_value(value) {
        Ok(serde_json::Value::String(word)) => Ok(word),
        other => Err(Fault::Work(format!("not a word: {other:?}"))),
    }
}
