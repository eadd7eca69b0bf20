//! The topics of a recording and their messages as bytes.

use std::marker::PhantomData;

use byteorder::LittleEndian;

use crate::error::RecordingError;
use crate::ros::Message;
use crate::ros::diagnostic::DiagnosticArray;
use crate::ros::input::{BusTick, CanFrame, StackChange, StackInput, StackLimits, StackScene};
use crate::ros::marker::MarkerArray;
use crate::ros::schema::schema_text;
use crate::ros::standard::{Clock, Imu, NavSatFix, Odometry, Path, TfMessage};
use crate::ros::truck::{PlanState, Scene, TruckState};

/// CDR, little endian, plain (OMG DDSI-RTPS 2.3, 10.5).
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

/// A topic: its name and what a subscriber must know about it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Topic {
    /// Name, with the leading slash.
    pub name: &'static str,
    /// Type of its messages as ROS 2 writes it: `package/msg/Type`.
    pub type_name: &'static str,
    /// Whether a late subscriber gets the last message (QoS transient local).
    pub is_latched: bool,
    /// Messages per second of simulation time, about; of what comes once or now and then 1.
    pub usual_rate_hz: u16,
    definition: &'static str,
}

impl Topic {
    /// The definition of the topic's type with all types that it uses (`ros2msg`).
    #[must_use]
    pub fn schema(&self) -> String {
        schema_text(self.definition).unwrap_or_default()
    }
}

/// A message of a topic, ready for a file or a network.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TopicMessage {
    /// Where it belongs.
    pub topic: Topic,
    /// The message: CDR, little endian, with its encapsulation header.
    pub cdr: Vec<u8>,
}

/// A topic that carries messages of one Rust type.
#[derive(Debug)]
pub(crate) struct TopicOf<M> {
    pub(crate) topic: Topic,
    message: PhantomData<fn(M)>,
}

impl<M: Message> TopicOf<M> {
    const fn new(name: &'static str, usual_rate_hz: u16) -> Self {
        let (type_name, definition) = (M::NAME, M::DEFINITION);
        let topic = Topic { name, type_name, is_latched: false, usual_rate_hz, definition };
        Self { topic, message: PhantomData }
    }

    const fn latched(name: &'static str) -> Self {
        let mut of = Self::new(name, 1);
        of.topic.is_latched = true;
        of
    }

    /// The message as bytes.
    pub(crate) fn encode(&self, message: &M) -> Result<TopicMessage, RecordingError> {
        let mut cdr = ENCAPSULATION.to_vec();
        cdr_encoding::to_writer::<M, LittleEndian, _>(&mut cdr, message)
            .map_err(|e| RecordingError::Encode { topic: self.topic.name, why: e.to_string() })?;
        Ok(TopicMessage { topic: self.topic, cdr })
    }

    /// The message that bytes from a file hold; `None` if they are too few or make no sense.
    pub(crate) fn decode(&self, cdr: &[u8]) -> Option<M>
    where
        M: serde::de::DeserializeOwned,
    {
        let body = cdr.strip_prefix(&ENCAPSULATION)?;
        cdr_encoding::from_bytes::<M, LittleEndian>(body).ok().map(|(message, _)| message)
    }
}

/// Rates of what comes with every tick and with the scene, 1/s.
const TICK_HZ: u16 = 100;
const SCENE_HZ: u16 = 10;
/// Frames of a bus of 250 kbit/s that is about half full, 1/s.
const FRAMES_HZ: u16 = 1_000;

/// Frames that do not change during a run.
pub(crate) const STATIC_FRAMES: TopicOf<TfMessage> = TopicOf::latched("/tf_static");
/// Latitude and longitude; only where the road has a geo reference.
pub(crate) const FIX: TopicOf<NavSatFix> = TopicOf::new("/fix", SCENE_HZ);
pub(crate) const CLOCK: TopicOf<Clock> = TopicOf::new("/clock", TICK_HZ);
pub(crate) const FRAMES: TopicOf<TfMessage> = TopicOf::new("/tf", TICK_HZ);
pub(crate) const ODOMETRY: TopicOf<Odometry> = TopicOf::new("/odom", TICK_HZ);
pub(crate) const IMU: TopicOf<Imu> = TopicOf::new("/imu", TICK_HZ);
pub(crate) const DIAGNOSTICS: TopicOf<DiagnosticArray> = TopicOf::new("/diagnostics", 1);
pub(crate) const TRUCK: TopicOf<TruckState> = TopicOf::new("/truck/state", TICK_HZ);
pub(crate) const PLAN: TopicOf<PlanState> = TopicOf::new("/truck/plan", TICK_HZ);
pub(crate) const PATH: TopicOf<Path> = TopicOf::new("/plan/path", SCENE_HZ);
pub(crate) const SCENE: TopicOf<Scene> = TopicOf::new("/scene", SCENE_HZ);
pub(crate) const MARKERS: TopicOf<MarkerArray> = TopicOf::new("/markers", SCENE_HZ);
pub(crate) const LANES: TopicOf<MarkerArray> = TopicOf::latched("/road/lanes");
pub(crate) const LIMITS: TopicOf<StackLimits> = TopicOf::new("/stack/limits", TICK_HZ);
pub(crate) const VEHICLES: TopicOf<StackScene> = TopicOf::new("/stack/scene", TICK_HZ);
pub(crate) const INPUT: TopicOf<StackInput> = TopicOf::new("/stack/input", TICK_HZ);
/// Changes of the stack between two ticks.
pub(crate) const CHANGES: TopicOf<StackChange> = TopicOf::new("/stack/change", 1);
/// Of a drive over a bus; `BUS` stands for its name.
pub(crate) const CAN_FRAMES: TopicOf<CanFrame> = TopicOf::new("/can/BUS/frames", FRAMES_HZ);
pub(crate) const CAN_TICKS: TopicOf<BusTick> = TopicOf::new("/can/BUS/ticks", TICK_HZ);

/// The frames of the bus that a truck is driven over. Its name has `BUS` where that of the bus
/// belongs ([`bus_name`]).
pub const BUS_FRAMES: Topic = CAN_FRAMES.topic;

/// The name of the bus that `--vehicle` means: `can0` of `can:can0`; `None` of a truck that is driven
/// directly.
#[must_use]
pub fn bus_name(vehicle: &str) -> Option<&str> {
    (vehicle != "direct").then(|| vehicle.rsplit([':', '/']).next().unwrap_or_default())
}

/// Every topic, in the order in which a file opens them.
pub const TOPICS: [Topic; 17] = [
    STATIC_FRAMES.topic,
    FIX.topic,
    CLOCK.topic,
    FRAMES.topic,
    ODOMETRY.topic,
    IMU.topic,
    DIAGNOSTICS.topic,
    TRUCK.topic,
    PLAN.topic,
    PATH.topic,
    SCENE.topic,
    MARKERS.topic,
    LANES.topic,
    LIMITS.topic,
    VEHICLES.topic,
    INPUT.topic,
    CHANGES.topic,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_topic_has_a_name_of_its_own_and_a_definition() {
        for (i, topic) in TOPICS.iter().enumerate() {
            assert!(!topic.schema().is_empty(), "{}", topic.name);
            assert!(TOPICS[..i].iter().all(|other| other.name != topic.name), "{}", topic.name);
        }
    }
}
