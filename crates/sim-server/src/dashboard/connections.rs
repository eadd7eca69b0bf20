//! Connections: how many there are, and how long each may take its time.

use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;
use tokio_io_timeout::TimeoutStream;

/// Connections at once, at most; viewers of `/ws` have places of their own.
const MAX_CONNECTIONS: usize = 64;
/// The head of a request arrives within this time, or the connection ends, also an idle one.
const HEAD_TIMEOUT: Duration = Duration::from_secs(10);
/// Longest head, bytes.
const MAX_HEAD_BYTES: usize = 16_384;
/// A client that takes nothing of its answer for so long is gone.
const WRITE_TIMEOUT: Duration = Duration::from_secs(20);
/// Pause after the system refused a connection (no descriptors left).
const REFUSED_PAUSE: Duration = Duration::from_millis(100);
/// What one connection too many hears.
const TOO_MANY: &[u8] = b"HTTP/1.1 503 Service Unavailable\r\nRetry-After: 1\r\n\
    Connection: close\r\nContent-Length: 0\r\n\r\n";

/// Serves until the future is dropped.
pub(super) async fn serve(listener: TcpListener, router: Router) {
    let places = Arc::new(Semaphore::new(MAX_CONNECTIONS));
    let mut server = http1::Builder::new();
    server.timer(TokioTimer::new()).header_read_timeout(HEAD_TIMEOUT).max_buf_size(MAX_HEAD_BYTES);
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            tokio::time::sleep(REFUSED_PAUSE).await;
            continue;
        };
        let Ok(place) = Arc::clone(&places).try_acquire_owned() else {
            let _ = stream.try_write(TOO_MANY);
            continue;
        };
        let service = TowerToHyperService::new(router.clone());
        let served = server.serve_connection(bounded(stream), service).with_upgrades();
        tokio::spawn(async move {
            let _ = served.await;
            drop(place);
        });
    }
}

fn bounded(stream: TcpStream) -> TokioIo<std::pin::Pin<Box<TimeoutStream<TcpStream>>>> {
    // Without it a frame waits for the acknowledgement of the one before
    let _ = stream.set_nodelay(true);
    let mut stream = TimeoutStream::new(stream);
    stream.set_write_timeout(Some(WRITE_TIMEOUT));
    TokioIo::new(Box::pin(stream))
}
