//! The stack of a recording, driven again step by step.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use planner::{DriveError, Stack, drive_tick};
use recording::GivenStep;
use road::Road;
use sim::StackChange;
use tractrix_core::{Recorder, Vehicle, VehicleLimits};

use super::{AsRecorded, RecordedTraffic, RecordedVehicle, Setup};
use crate::failure::Failure;

/// A stack that is given what the recorded one was given.
pub(crate) struct Again {
    file: PathBuf,
    setup: Setup,
    drive: Option<(Stack, VehicleLimits)>,
    set_speed_m_s: Option<f64>,
}

/// A step that is about to be driven again.
pub(crate) struct Prepared<'a> {
    stack: &'a mut Stack,
    /// What the truck can do.
    pub(crate) limits: &'a VehicleLimits,
    road: Arc<Road>,
    step: &'a GivenStep,
}

impl Again {
    /// Of a file, before its first step.
    pub(crate) fn new(file: &Path, setup: Setup) -> Self {
        Self { file: file.to_owned(), setup, drive: None, set_speed_m_s: None }
    }

    /// Sets the stack as it was set for a step.
    ///
    /// # Errors
    /// [`Failure::Input`]: the stack cannot be built, or a change of it is not understood.
    pub(crate) fn prepare<'a>(
        &'a mut self,
        step: &'a mut GivenStep,
    ) -> Result<Prepared<'a>, Failure> {
        let (stack, limits) = match (&mut self.drive, step.limits.take()) {
            (Some(drive), None) => drive,
            (Some(drive), Some(now)) => {
                drive.1 = *now;
                drive
            }
            (none, Some(limits)) => none.insert((self.setup.stack(&limits)?, *limits)),
            (None, None) => return Err(Failure::file(&self.file, "it has no /stack/limits")),
        };
        for words in &step.changes {
            let change = StackChange::from_toml(words).and_then(|change| change.apply(stack));
            change.map_err(|why| Failure::file(&self.file, why))?;
        }
        // What was set before the first step is in the configuration, which may be changed
        let was = self.set_speed_m_s.replace(step.set_speed_m_s);
        if was.is_some_and(|was| was != step.set_speed_m_s) {
            stack.set_speed(step.set_speed_m_s);
        }
        if stack.wish() != step.wish {
            stack.request_lane_change(step.wish);
        }
        let road = self.setup.road(step.limit_cap_m_s);
        Ok(Prepared { stack, limits, road, step })
    }

    /// The stack as the last step left it, and what the truck can do; none before the first one.
    pub(crate) fn driven(&self) -> Option<(&Stack, &VehicleLimits)> {
        self.drive.as_ref().map(|(stack, limits)| (stack, limits))
    }

    /// The road that was driven.
    pub(crate) const fn whole_road(&self) -> &Arc<Road> {
        self.setup.whole_road()
    }
}

impl Prepared<'_> {
    /// Drives the step with the recorded state of the truck. Who failed in the run fails here, and
    /// the stack deals with it.
    pub(crate) fn drive(self, recorder: &mut impl Recorder) {
        let mut vehicle = RecordedVehicle { step: self.step, limits: self.limits };
        let _: Result<(), DriveError<AsRecorded, AsRecorded>> =
            self.drive_with(&mut vehicle, recorder);
    }

    /// Drives the step with another reader of the truck.
    ///
    /// # Errors
    /// [`DriveError`] as [`drive_tick`].
    pub(crate) fn drive_with<V: Vehicle>(
        self,
        vehicle: &mut V,
        recorder: &mut impl Recorder,
    ) -> Result<(), DriveError<V::Error, AsRecorded>> {
        let Self { stack, road, step, .. } = self;
        let traffic = &mut RecordedTraffic(step);
        drive_tick(step.now, vehicle, traffic, stack, &road, recorder).map(drop)
    }
}
