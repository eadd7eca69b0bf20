//! The truck under the names of Autoware, beside our own: `/localization/kinematic_state` and
//! `/vehicle/status/*`.

use byteorder::LittleEndian;
use recording::TopicMessage;
use ros2_client::Publisher;

use crate::bytes::{ENCAPSULATION, Encoded};
use crate::interfaces::autoware::{
    ControlModeReport, GearReport, SteeringReport, TruckState, VelocityReport,
};

/// Under which names the node shows the truck.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Names {
    /// Our own alone.
    Own,
    /// Those of Autoware too.
    Autoware,
}

/// Publishers of what Autoware's nodes listen to.
pub(crate) struct Autoware {
    pub(crate) kinematic_state: Publisher<Encoded>,
    pub(crate) velocity: Publisher<VelocityReport>,
    pub(crate) steering: Publisher<SteeringReport>,
    pub(crate) gear: Publisher<GearReport>,
    pub(crate) control_mode: Publisher<ControlModeReport>,
}

impl Autoware {
    /// Says a message of the recording again in Autoware's words. A reader that acknowledges nothing
    /// loses messages, not the run.
    pub(crate) fn say(&self, message: &TopicMessage) {
        match message.topic.name {
            "/odom" => {
                let _ = self.kinematic_state.publish(Encoded(message.cdr.clone()));
            }
            "/truck/state" => {
                let body = message.cdr.get(ENCAPSULATION..).unwrap_or_default();
                let read = cdr_encoding::from_bytes::<TruckState, LittleEndian>(body);
                let Ok((truck, _)) = read else { return };
                let _ = self.velocity.publish(truck.velocity());
                let _ = self.steering.publish(truck.steering());
                let _ = self.gear.publish(truck.gear());
                let _ = self.control_mode.publish(truck.control_mode());
            }
            _ => {}
        }
    }
}
