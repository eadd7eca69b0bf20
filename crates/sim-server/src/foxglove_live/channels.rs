//! The channels: the topics of a recording, one to one.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use foxglove::websocket::Client;
use foxglove::{ChannelBuilder, Context, RawChannel, Schema};
use recording::{MOST_LATCHED, TOPICS, TopicMessage};
use tractrix_core::Time;

use crate::failure::Failure;
use crate::foxglove_door::stamp;

/// The open channels.
pub(super) struct Channels {
    /// Channels live as long as it.
    _context: Arc<Context>,
    by_topic: BTreeMap<&'static str, Arc<RawChannel>>,
    latched: Mutex<Vec<(Time, TopicMessage)>>,
}

impl Channels {
    /// Opens a channel for each topic of a recording that is not the stack's own.
    ///
    /// # Errors
    /// [`Failure::Work`].
    pub(super) fn open(context: &Arc<Context>) -> Result<Self, Failure> {
        let topics = TOPICS.into_iter().filter(|topic| !topic.name.starts_with("/stack/"));
        let open = |topic: recording::Topic| {
            let schema = Schema::new(topic.type_name, "ros2msg", topic.schema().into_bytes());
            let channel = ChannelBuilder::new(topic.name).context(context).schema(schema);
            Ok((topic.name, channel.message_encoding("cdr").build_raw()?))
        };
        let by_topic: Result<_, foxglove::FoxgloveError> = topics.map(open).collect();
        let by_topic = by_topic.map_err(Failure::work)?;
        Ok(Self { _context: Arc::clone(context), by_topic, latched: Mutex::default() })
    }

    /// Hands a message to the viewers that want its topic.
    pub(super) fn say(&self, now: Time, message: &TopicMessage) {
        let Some(channel) = self.by_topic.get(message.topic.name) else { return };
        if message.topic.is_latched {
            let mut latched = self.latched();
            // The pieces of a long road push out its own, not another topic
            let is_of_it = |(_, kept): &(Time, TopicMessage)| kept.topic == message.topic;
            if latched.iter().filter(|m| is_of_it(m)).count() >= MOST_LATCHED
                && let Some(oldest) = latched.iter().position(is_of_it)
            {
                latched.remove(oldest);
            }
            latched.push((now, message.clone()));
        }
        channel.log_with_meta(&message.cdr, stamp(now));
    }

    /// What a viewer gets that subscribes a latched topic.
    pub(super) fn welcome(&self, viewer: &Client, topic: &str) {
        let Some(channel) = self.by_topic.get(topic) else { return };
        for (time, message) in self.latched().iter().filter(|(_, m)| m.topic.name == topic) {
            channel.log_with_meta_to_sink(&message.cdr, stamp(*time), viewer.sink_id());
        }
    }

    /// Another run begins.
    pub(super) fn forget(&self) {
        self.latched().clear();
    }

    fn latched(&self) -> MutexGuard<'_, Vec<(Time, TopicMessage)>> {
        self.latched.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
