//! Who hears a session's telemetry beside its recording, over the network.

use recording::Listener;

use crate::failure::Failure;
use crate::session::Handle;

/// The networks that a session is shown on.
#[derive(Default)]
pub(crate) struct Listeners {
    #[cfg(feature = "ros2")]
    ros2: Option<ros2::Node>,
}

impl Listeners {
    /// Joins what was asked for.
    ///
    /// # Errors
    /// As [`crate::ros2_node::start`].
    #[cfg(feature = "ros2")]
    pub(crate) fn start(ros2: bool, session: &Handle) -> Result<Self, Failure> {
        let ros2 = ros2.then(|| crate::ros2_node::start(session)).transpose()?;
        Ok(Self { ros2 })
    }

    /// This program was built without any.
    #[cfg(not(feature = "ros2"))]
    pub(crate) fn start(_: bool, _: &Handle) -> Result<Self, Failure> {
        Ok(Self::default())
    }

    /// What a recording tells them.
    pub(crate) fn listener(&self) -> Option<Listener> {
        #[cfg(feature = "ros2")]
        return self.ros2.as_ref().map(ros2::Node::listener);
        #[cfg(not(feature = "ros2"))]
        None
    }
}
