//! The session for viewers of Foxglove's WebSocket protocol (`foxglove.sdk.v1`): the recording's
//! topics with the recording's own bytes and schemas, simulation time, the commands of the API as
//! services and published messages, and how the session is set as parameters. On the loopback
//! interface; the protocol authenticates nobody.

mod channels;
mod commands;
mod parameters;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use foxglove::websocket::Capability;
use foxglove::{Context, WebSocketServer, WebSocketServerHandle};
use recording::Listener;
use tokio::runtime;

use self::channels::Channels;
use self::commands::{Commands, services};
use self::parameters::Parameters;
use crate::failure::Failure;
use crate::foxglove_door::{Door, nanoseconds};
use crate::session::Handle;

/// Messages on their way to a viewer; of more the oldest are lost to it.
const BACKLOG: usize = 4096;
/// Viewers are told the time this often at most (wall time): one that takes nothing is cut off when
/// its backlog of them is full.
const TIME_PERIOD: Duration = Duration::from_millis(20);

/// A server of viewers.
pub(crate) struct Live {
    server: Arc<WebSocketServerHandle>,
    channels: Arc<Channels>,
    /// A run has been shown.
    has_begun: AtomicBool,
}

impl Live {
    /// Starts to serve a session on 127.0.0.1; port 0 takes a free one. Pages of these origins may
    /// show it, beside those of this computer and Foxglove's own.
    ///
    /// # Errors
    /// [`Failure::Input`]: the port is taken.
    pub(crate) fn start(
        port: u16,
        pages: Vec<String>,
        session: &Handle,
        runtime: &runtime::Handle,
    ) -> Result<Self, Failure> {
        let door = Door::open(port)?;
        let context = Context::new();
        let channels = Arc::new(Channels::open(&context)?);
        let commands = Commands::new(session.clone(), Arc::clone(&channels), runtime.clone());
        let server = WebSocketServer::new()
            .name("tractrix")
            .context(&context)
            .capabilities([Capability::Time, Capability::ClientPublish])
            .supported_encodings(["json"])
            .services(services(session))
            .parameter_handler(Arc::new(Parameters::new(session.clone(), runtime.clone())))
            .listener(Arc::new(commands))
            .message_backlog_size(BACKLOG);
        let server = Arc::new(door.start(server, runtime)?);
        runtime.spawn(parameters::tell(session.clone(), Arc::clone(&server)));
        door.let_in(&server, pages, runtime)?;
        Ok(Self { server, channels, has_begun: AtomicBool::new(false) })
    }

    /// What the recording of the next run tells the viewers; they forget the run before.
    pub(crate) fn listener(&self) -> Listener {
        self.channels.forget();
        if self.has_begun.swap(true, Ordering::Relaxed) {
            self.server.clear_session(None);
        }
        let (server, channels) = (Arc::clone(&self.server), Arc::clone(&self.channels));
        let mut told: Option<Instant> = None;
        Box::new(move |now, message| {
            channels.say(now, message);
            #[expect(clippy::disallowed_methods, reason = "viewers live in wall time")]
            let wall = Instant::now();
            if told.is_none_or(|at| wall.saturating_duration_since(at) >= TIME_PERIOD) {
                told = Some(wall);
                server.broadcast_time(nanoseconds(now));
            }
        })
    }
}
