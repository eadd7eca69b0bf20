//! Where the fit begins: at a truck that is stable at the driven speeds.
//!
//! A truck file with stiff steer tyres and soft drive tyres oversteers and has a critical speed (ISO
//! 8855). Replayed above it the truck spins, whatever was measured: noise learned beside it is large, no
//! step from it leads anywhere, and the file would come back as what the drives say, with narrow
//! intervals.

use crate::causes::param::{P, PARAMS};
use crate::replay::{Group, Module as M, Prepared, Residuals, replay_group};
use crate::{Drive, Plant};

use super::DiagnosisError;
use super::figures::{FIGURES, Figure, Standing};

/// Part by which steer tyres are softer and drive tyres stiffer, step by step, and steps at most.
const STEP_FRAC: f64 = 0.1;
const STEPS: usize = 12;

/// Moves stiffnesses until no drive is replayed worse than by a truck that does not turn.
///
/// # Errors
/// A truck that nothing makes of.
pub(super) fn stable(standing: &mut Standing, drives: &[Drive]) -> Result<(), DiagnosisError> {
    let of = |p: P, by: f64| FIGURES.iter().find(|f| f.p == p).map(|f| (f, by));
    let step: Vec<(&Figure, f64)> =
        [of(P::CFront, -STEP_FRAC), of(P::CDrive, STEP_FRAC)].into_iter().flatten().collect();
    for _ in 0..STEPS {
        let plant = Plant::of_truck(&standing.truck)?;
        if !drives.iter().any(|d| explains_nothing(&Prepared::new(d, &plant), &plant)) {
            break;
        }
        standing.apply(&step);
    }
    Ok(())
}

/// Whether the replay is farther from the measured yaw rate than one of a truck that does not turn.
fn explains_nothing(d: &Prepared, plant: &Plant) -> bool {
    let mut out = Residuals::default();
    replay_group(d, plant, &[0.0; PARAMS], Group::Lateral, &mut out);
    let rows =
        out[M::Yaw as usize].iter().zip(d.yaw.chunks_exact(2)).zip(&d.valid[M::Yaw as usize]);
    let (left, all) =
        rows.filter(|(_, ok)| **ok).fold((0.0, 0.0), |(left, all), ((r, pair), _)| {
            let measured = 0.5 * (pair[0] + pair[1]);
            (left + r * r, all + measured * measured)
        });
    left > all
}
