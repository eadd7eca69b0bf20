//! What was recorded in the places from which the stack and the truck's driver were given it.

use j1939::Frame;
use j1939::bus::{Bus, BusError};
use recording::{BusCall, GivenStep};
use tractrix_core::{
    Command, EgoState, Pose, PoseSource, RawFrame, Scene, Stamped, Time, TrafficSource, Vehicle,
    VehicleLimits, VehicleStatus,
};

/// It failed in the run as well.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("as recorded")]
pub(crate) struct AsRecorded;

/// The truck as the stack saw it in a step.
pub(crate) struct RecordedVehicle<'a> {
    pub(crate) step: &'a GivenStep,
    pub(crate) limits: &'a VehicleLimits,
}

impl Vehicle for RecordedVehicle<'_> {
    type Error = AsRecorded;

    fn ego(&mut self, _now: Time) -> Result<Stamped<EgoState>, AsRecorded> {
        self.step.ego.ok_or(AsRecorded)
    }

    fn command(&mut self, _now: Time, _command: &Command) -> Result<(), AsRecorded> {
        Ok(())
    }

    fn limits(&self) -> &VehicleLimits {
        self.limits
    }

    fn status(&self) -> VehicleStatus {
        self.step.status
    }
}

/// The other vehicles of a step.
pub(crate) struct RecordedTraffic<'a>(pub(crate) &'a GivenStep);

impl TrafficSource for RecordedTraffic<'_> {
    type Error = AsRecorded;

    fn advance(&mut self, _now: Time, _ego: &EgoState) -> Result<&Scene, AsRecorded> {
        self.0.scene.as_ref().ok_or(AsRecorded)
    }
}

/// The pose of a step. The ego state has it as it came from its source.
#[derive(Debug, Default)]
pub(crate) struct RecordedPose(pub(crate) Option<Stamped<Pose>>);

impl RecordedPose {
    pub(crate) fn of(step: &GivenStep) -> Self {
        Self(step.ego.map(|Stamped { time, value }| Stamped { time, value: sim::pose_of(&value) }))
    }
}

impl PoseSource for RecordedPose {
    type Error = AsRecorded;

    fn pose(&mut self, _now: Time) -> Result<Stamped<Pose>, AsRecorded> {
        self.0.ok_or(AsRecorded)
    }
}

/// A bus on which happens what happened in a reading.
#[derive(Debug, Default)]
pub(crate) struct RecordedBus {
    call: BusCall,
    received: usize,
    sent: usize,
    /// The first frame that is sent now and was not then.
    pub(crate) unheard_of: Option<RawFrame>,
}

impl RecordedBus {
    /// Goes on with another reading.
    pub(crate) fn begin(&mut self, call: BusCall) {
        *self = Self { call, ..Self::default() };
    }
}

impl Bus for RecordedBus {
    fn send(&mut self, _now: Time, frame: &Frame) -> Result<(), BusError> {
        let frame = RawFrame::from(frame);
        let rest = self.call.sent.iter().enumerate().skip(self.sent);
        // A frame that failed has lost its identifier to the class of its failure
        let alike = |sent: &recording::SentFrame| match sent.trouble {
            None => sent.frame == frame,
            Some(_) => sent.frame.data == frame.data && sent.frame.len == frame.len,
        };
        let Some((index, sent)) = rest.into_iter().find(|(_, sent)| alike(sent)) else {
            self.unheard_of.get_or_insert(frame);
            return Ok(());
        };
        self.sent = index + 1;
        sent.trouble.map_or(Ok(()), |trouble| Err(trouble.into()))
    }

    fn receive(&mut self, _now: Time) -> Result<Option<Stamped<Frame>>, BusError> {
        let heard = self.call.received.get(self.received);
        self.received += 1;
        match heard {
            None => Ok(None),
            Some(Err(trouble)) => Err((*trouble).into()),
            Some(Ok(Stamped { time, value })) => {
                Ok(Some(Stamped { time: *time, value: (*value).into() }))
            }
        }
    }
}
