//! Who hears a session's telemetry beside its recording, over the network.

use recording::Listener;
use tokio::runtime;

use crate::failure::Failure;
use crate::session::Handle;

/// The networks that a session is shown on.
#[derive(Default)]
pub(crate) struct Listeners {
    ros2: Option<ros2::Node>,
    foxglove: Option<crate::foxglove_live::Live>,
}

/// What is asked for.
#[derive(Debug, Clone)]
pub(crate) struct Wanted {
    /// How the truck is reached, as `--vehicle` says.
    pub(crate) vehicle: String,
    /// A node of a ROS 2 domain.
    pub(crate) ros2: bool,
    /// Under Autoware's names too.
    pub(crate) with_autoware: bool,
    /// A server of Foxglove's protocol, on this port.
    pub(crate) foxglove: Option<u16>,
    /// Origins of pages that it shows the run to, beside those of this computer and Foxglove's own.
    pub(crate) foxglove_origins: Vec<String>,
}

impl Listeners {
    /// Joins what was asked for.
    ///
    /// # Errors
    /// [`Failure::Input`]: a ROS domain with a clock already, a port that is taken.
    pub(crate) fn start(
        wanted: Wanted,
        session: &Handle,
        runtime: &runtime::Handle,
    ) -> Result<Self, Failure> {
        Ok(Self {
            ros2: wanted
                .ros2
                .then(|| crate::ros2_node::start(session, &wanted.vehicle, wanted.with_autoware))
                .transpose()?,
            foxglove: wanted
                .foxglove
                .map(|port| {
                    let pages = wanted.foxglove_origins;
                    crate::foxglove_live::Live::start(port, pages, session, runtime)
                })
                .transpose()?,
        })
    }

    /// What the recording of the next run tells them.
    pub(crate) fn listener(&self) -> Option<Listener> {
        let asked_for: [Option<Listener>; 2] = [
            self.ros2.as_ref().map(ros2::Node::listener),
            self.foxglove.as_ref().map(crate::foxglove_live::Live::listener),
        ];
        let mut all: Vec<Listener> = asked_for.into_iter().flatten().collect();
        match all.len() {
            0 => None,
            1 => all.pop(),
            _ => Some(Box::new(move |now, message| {
                for listener in &mut all {
                    listener(now, message);
                }
            })),
        }
    }
}
