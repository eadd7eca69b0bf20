//! The session for viewers of Foxglove's WebSocket protocol (`foxglove.sdk.v1`): the recording's
//! topics with the recording's own bytes and schemas, simulation time, and the commands of the API
//! as services and published messages. On the loopback interface; the protocol authenticates nobody.

mod channels;
mod commands;
mod gate;
mod refusals;

use std::net::Ipv4Addr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use foxglove::websocket::Capability;
use foxglove::{Context, FoxgloveError, WebSocketServer, WebSocketServerHandle};
use recording::Listener;
use tokio::runtime;

use self::channels::Channels;
use self::commands::{Commands, services};
use crate::failure::Failure;
use crate::output;
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
        refusals::log();
        let taken = |e: std::io::Error| match e.kind() {
            std::io::ErrorKind::AddrInUse => {
                Failure::Input(format!("--foxglove: port {port} on 127.0.0.1 is in use"))
            }
            _ => Failure::Input(format!("--foxglove {port}: {e}")),
        };
        let door = std::net::TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(taken)?;
        door.set_nonblocking(true).map_err(taken)?;
        let address = door.local_addr().map_err(taken)?;
        let hidden = gate::hidden();
        let context = Context::new();
        let channels = Arc::new(Channels::open(&context)?);
        let commands = Commands::new(session.clone(), Arc::clone(&channels), runtime.clone());
        let server = WebSocketServer::new()
            .name("tractrix")
            .context(&context)
            .tokio_runtime(runtime)
            .bind(hidden.to_string(), 0)
            .capabilities([Capability::Time, Capability::ClientPublish])
            .supported_encodings(["json"])
            .services(services(session))
            .listener(Arc::new(commands))
            .message_backlog_size(BACKLOG)
            .start_blocking()
            .map_err(|e: FoxgloveError| Failure::Input(format!("--foxglove {port}: {e}")))?;
        let entered = runtime.enter();
        let door = tokio::net::TcpListener::from_std(door).map_err(taken)?;
        drop(entered);
        runtime.spawn(gate::keep(door, (hidden, server.port()).into(), pages));
        output::note(&format!("foxglove: ws://{address}"));
        Ok(Self { server: Arc::new(server), channels, has_begun: AtomicBool::new(false) })
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
                server.broadcast_time(channels::nanoseconds(now));
            }
        })
    }
}
