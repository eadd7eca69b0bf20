//! The door before the server of Foxglove's protocol, which looks at no header and bounds no message:
//! a connection is passed on when its handshake asks for this computer, and comes from a program or
//! from a page that may show runs; what it sends is bounded, and so is how long it may take nothing.

mod frames;
mod refusals;

use std::collections::hash_map::RandomState;
use std::hash::BuildHasher;
use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;

use foxglove::{FoxgloveError, PartialMetadata, WebSocketServer, WebSocketServerHandle};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::runtime;
use tokio::sync::Semaphore;
use tokio::time::timeout;
use tokio_io_timeout::TimeoutStream;
use tractrix_core::Time;

use self::frames::Frames;
use crate::dashboard::is_this_computer;
use crate::failure::Failure;
use crate::output;

/// Viewers at a time, those in the handshake included.
const MOST: usize = 16;
/// Longest head of a handshake, bytes.
const MAX_HEAD: usize = 8192;
/// Most headers of one.
const MAX_HEADERS: usize = 64;
/// A head is there after this time.
const HANDSHAKE: Duration = Duration::from_secs(5);
/// After an error of the listener, so that one that lasts takes no processor time.
const PAUSE: Duration = Duration::from_millis(100);
/// A viewer that takes nothing for so long is gone.
const WRITE_TIMEOUT: Duration = Duration::from_secs(20);
/// The page of Foxglove itself.
const FOXGLOVE: &str = "https://app.foxglove.dev";

/// A time for viewers, nanoseconds since the start of the run.
pub(crate) fn nanoseconds(time: Time) -> u64 {
    u64::try_from(time.0).unwrap_or_default()
}

/// The time of a message.
pub(crate) fn stamp(time: Time) -> PartialMetadata {
    PartialMetadata::with_log_time(nanoseconds(time))
}

/// An open port behind which nobody answers yet.
pub(crate) struct Door {
    listener: std::net::TcpListener,
    /// Where the server behind it listens.
    inner: Ipv4Addr,
    /// As it was asked for.
    port: u16,
}

impl Door {
    /// Opens it on 127.0.0.1; port 0 takes a free one.
    ///
    /// # Errors
    /// [`Failure::Input`]: the port is taken.
    pub(crate) fn open(port: u16) -> Result<Self, Failure> {
        refusals::log();
        #[expect(clippy::disallowed_methods, reason = "the shell owns its sockets")]
        let listener = std::net::TcpListener::bind((Ipv4Addr::LOCALHOST, port));
        let listener = listener.map_err(|e| unusable(port, &e))?;
        listener.set_nonblocking(true).map_err(|e| unusable(port, &e))?;
        Ok(Self { listener, inner: hidden(), port })
    }

    /// Starts a server behind it, which no viewer reaches before [`Door::let_in`]: what listens to
    /// viewers knows the server by then. Not to be called where the runtime runs.
    ///
    /// # Errors
    /// [`Failure::Input`]: the server cannot start.
    pub(crate) fn start(
        &self,
        server: WebSocketServer,
        runtime: &runtime::Handle,
    ) -> Result<WebSocketServerHandle, Failure> {
        let server = server.tokio_runtime(runtime).bind(self.inner.to_string(), 0);
        let wrong = |e: FoxgloveError| Failure::Input(format!("--foxglove {}: {e}", self.port));
        server.start_blocking().map_err(wrong)
    }

    /// Lets viewers in to the server behind it, until the runtime ends. `pages` are origins beside
    /// those of this computer and of Foxglove.
    ///
    /// # Errors
    /// [`Failure::Input`]: the port cannot be listened to.
    pub(crate) fn let_in(
        self,
        server: &WebSocketServerHandle,
        pages: Vec<String>,
        runtime: &runtime::Handle,
    ) -> Result<(), Failure> {
        let Self { listener, inner, port } = self;
        let address = listener.local_addr().map_err(|e| unusable(port, &e))?;
        let entered = runtime.enter();
        let listener = TcpListener::from_std(listener).map_err(|e| unusable(port, &e))?;
        drop(entered);
        runtime.spawn(keep(listener, (inner, server.port()).into(), pages));
        output::note(&format!("foxglove: ws://{address}"));
        Ok(())
    }
}

fn unusable(port: u16, e: &io::Error) -> Failure {
    match e.kind() {
        io::ErrorKind::AddrInUse => {
            Failure::Input(format!("--foxglove: port {port} on 127.0.0.1 is in use"))
        }
        _ => Failure::Input(format!("--foxglove {port}: {e}")),
    }
}

/// Where the protocol's own server listens: an address of this computer that a page would have to
/// guess, because whoever reaches it passes the door by.
fn hidden() -> Ipv4Addr {
    if !cfg!(target_os = "linux") {
        // Elsewhere 127.0.0.1 is the only address of the loopback interface.
        return Ipv4Addr::LOCALHOST;
    }
    let [a, b, c, ..] = RandomState::new().hash_one(0_u8).to_le_bytes();
    Ipv4Addr::new(127, a.max(1), b, c.clamp(1, 254))
}

/// Lets viewers in from `listener` to the server at `inner`.
async fn keep(listener: TcpListener, inner: SocketAddr, pages: Vec<String>) {
    let pages = Arc::new(pages);
    let places = Arc::new(Semaphore::new(MOST));
    loop {
        let Ok((mut viewer, _)) = listener.accept().await else {
            tokio::time::sleep(PAUSE).await;
            continue;
        };
        let Ok(place) = Arc::clone(&places).try_acquire_owned() else {
            let _ = refuse(&mut viewer, "503 Service Unavailable", "too many viewers").await;
            continue;
        };
        let pages = Arc::clone(&pages);
        tokio::spawn(async move {
            // Whoever hangs up ends his own connection only.
            let _ = let_in(viewer, inner, &pages).await;
            drop(place);
        });
    }
}

async fn let_in(mut viewer: TcpStream, inner: SocketAddr, pages: &[String]) -> io::Result<()> {
    let head = match timeout(HANDSHAKE, head(&mut viewer)).await {
        Ok(Ok(Some(head))) => head,
        Ok(Err(e)) => return Err(e),
        Ok(Ok(None)) => {
            return refuse(&mut viewer, "431 Request Header Fields Too Large", "too long").await;
        }
        Err(_) => return refuse(&mut viewer, "408 Request Timeout", "no handshake").await,
    };
    if let Err(why) = may_enter(&head, pages) {
        log::error!(target: "foxglove", "refused a viewer: {why}");
        return refuse(&mut viewer, "403 Forbidden", &why).await;
    }
    let mut server = TcpStream::connect(inner).await?;
    server.set_nodelay(true)?;
    viewer.set_nodelay(true)?;
    server.write_all(&head).await?;
    let mut viewer = TimeoutStream::new(viewer);
    viewer.set_write_timeout(Some(WRITE_TIMEOUT));
    let mut viewer = Box::pin(viewer);
    let (mut from_viewer, mut to_viewer) = tokio::io::split(&mut viewer);
    let (mut from_server, mut to_server) = server.split();
    // Who hangs up, or is cut off, ends both ways
    tokio::select! {
        heard = pass_on(&mut from_viewer, &mut to_server, after_head(&head)) => heard,
        told = tokio::io::copy(&mut from_server, &mut to_viewer) => told.map(drop),
    }
}

/// What came behind a request's head.
fn after_head(head: &[u8]) -> &[u8] {
    let end = head.windows(4).position(|end| end == b"\r\n\r\n");
    end.and_then(|at| head.get(at + 4..)).unwrap_or_default()
}

/// Passes on what a viewer sends, whose first bytes have been passed on already; one whose message
/// is too long is cut off.
async fn pass_on(
    viewer: &mut (impl AsyncReadExt + Unpin),
    server: &mut (impl AsyncWriteExt + Unpin),
    first: &[u8],
) -> io::Result<()> {
    let mut frames = Frames::default();
    let mut bytes = vec![0_u8; 8192];
    let mut goes_on = frames.read(first);
    while goes_on {
        let got = viewer.read(&mut bytes).await?;
        let got = bytes.get(..got).unwrap_or_default();
        if got.is_empty() {
            return Ok(());
        }
        goes_on = frames.read(got);
        if goes_on {
            server.write_all(got).await?;
        }
    }
    let most = frames::MAX_MESSAGE_BYTES;
    log::error!(target: "foxglove", "cut a viewer off: its message has more than {most} bytes");
    Ok(())
}

/// What was read up to the end of a request's head; none when it is too long.
async fn head(viewer: &mut TcpStream) -> io::Result<Option<Vec<u8>>> {
    let mut read = Vec::with_capacity(1024);
    loop {
        if viewer.read_buf(&mut read).await? == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        if read.windows(4).any(|end| end == b"\r\n\r\n") {
            return Ok(Some(read));
        }
        if read.len() >= MAX_HEAD {
            return Ok(None);
        }
    }
}

/// Whether a handshake names this computer, and comes from a program or a page that may show runs.
fn may_enter(head: &[u8], pages: &[String]) -> Result<(), String> {
    let mut headers = [httparse::EMPTY_HEADER; MAX_HEADERS];
    let mut request = httparse::Request::new(&mut headers);
    request.parse(head).map_err(|e| format!("the handshake is no HTTP request: {e}"))?;
    let values = |name: &str| -> Vec<&[u8]> {
        let named = request.headers.iter().filter(|h| h.name.eq_ignore_ascii_case(name));
        named.map(|h| h.value).collect()
    };
    let said =
        |value: &[u8]| -> String { String::from_utf8_lossy(value).chars().take(80).collect() };
    match values("host")[..] {
        [host] if is_this_computer(&said(host)) => {}
        _ => return Err("its Host is not this computer".to_owned()),
    }
    match values("origin")[..] {
        [] => Ok(()),
        [origin] if may_show(&said(origin), pages) => Ok(()),
        [origin, ..] => {
            let origin = said(origin);
            let hint = match origin.contains("://") {
                true => format!(" (--foxglove-origin {origin} would let it in)"),
                false => String::new(),
            };
            Err(format!("origin {origin:?}{hint}"))
        }
    }
}

/// Pages of this computer, Foxglove's own, and those that were named.
fn may_show(origin: &str, pages: &[String]) -> bool {
    let local = origin.strip_prefix("http://").or_else(|| origin.strip_prefix("https://"));
    local.is_some_and(is_this_computer) || origin == FOXGLOVE || pages.iter().any(|p| p == origin)
}

async fn refuse(viewer: &mut TcpStream, status: &str, why: &str) -> io::Result<()> {
    let length = why.len();
    let answer = format!(
        "HTTP/1.1 {status}\r\nContent-Type: text/plain; charset=utf-8\r\n\
         Content-Length: {length}\r\nConnection: close\r\n\r\n{why}"
    );
    match timeout(HANDSHAKE, viewer.write_all(answer.as_bytes())).await {
        Ok(written) => written,
        Err(_) => Err(io::ErrorKind::TimedOut.into()),
    }
}
