//! Two recordings, step by step.

use std::path::Path;

use recording::{GivenStep, Inputs};
use tractrix_core::{Recorder, Step, VehicleLimits};

use super::compare::{Comparison, Difference};
use crate::failure::Failure;

/// How two recordings are alike.
pub(crate) struct Compared {
    /// Steps that both have.
    pub(crate) ticks: u64,
    /// Those of them that differ.
    pub(crate) differing: u64,
    pub(crate) first: Option<Difference>,
    /// Time at which the other vehicles first are others, s.
    pub(crate) other_scene_s: Option<f64>,
    /// Steps that only the one or the other has, behind them.
    pub(crate) more: [u64; 2],
}

/// Compares what the stack was given and what it commanded, bit for bit.
///
/// # Errors
/// [`Failure::Input`] names the file that cannot be read.
pub(crate) fn compare(a: &Path, b: &Path) -> Result<Compared, Failure> {
    let (mut a, mut b) = (Inputs::open(a, false)?, Inputs::open(b, false)?);
    let mut comparison = Comparison::default();
    let mut limits: Option<Box<VehicleLimits>> = None;
    let mut other_scene_s = None;
    loop {
        let (one, other) = (a.next_step()?, b.next_step()?);
        let (Some(one), Some(mut other)) = (one.clone(), other.clone()) else {
            let more = [rest(&mut a, one)?, rest(&mut b, other)?];
            let Comparison { ticks, differing, first, .. } = comparison;
            return Ok(Compared { ticks, differing, first, other_scene_s, more });
        };
        limits = other.limits.take().or(limits);
        let Some(limits) = &limits else {
            return Err(Failure::Input("a recording has no /stack/limits".to_owned()));
        };
        if one.scene != other.scene {
            other_scene_s.get_or_insert(one.now.seconds());
        }
        comparison.expect(one);
        comparison.step(&Step {
            now: other.now,
            ego: other.ego.as_ref(),
            status: &other.status,
            scene: other.scene.as_ref(),
            limits,
            limit_cap_m_s: other.limit_cap_m_s,
            set_speed_m_s: other.set_speed_m_s,
            wish: other.wish,
            command: &other.command,
        });
    }
}

/// Steps from this one on.
fn rest(inputs: &mut Inputs, first: Option<GivenStep>) -> Result<u64, Failure> {
    let mut count = u64::from(first.is_some());
    while inputs.next_step()?.is_some() {
        count += 1;
    }
    Ok(count)
}
