//! The HTTP server: accepts connections within their limits, and closes those that are too slow.

use std::convert::Infallible;
use std::future::{Future, poll_fn};
use std::io::{self, ErrorKind};
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use axum::Router;
use hyper::Request;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::{Service as _, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::io::AsyncWrite as _;
use tokio::net::{TcpListener, TcpStream};
use tokio_io_timeout::TimeoutStream;

use super::gate::Peer;
use super::router::router;
use super::site::Site;
use super::slots::{Slot, Slots};
use super::view::Following;
use crate::system::clock;

/// The most connections at a time.
const MOST_CONNECTIONS: usize = 64;
/// The most of them from one address: a browser opens 6.
const MOST_EACH: usize = 16;
/// Longest wait for a request and its header.
const HEADER_TIME: Duration = Duration::from_secs(10);
/// Longest wait for a client to accept the next bytes of an answer.
const WRITE_TIME: Duration = Duration::from_secs(15);
/// Longest wait for a client to end what it sends after an answer that refuses it.
const LAST_TIME: Duration = Duration::from_secs(10);
/// The most header lines of a request.
const MOST_HEADERS: usize = 64;
/// The most bytes of a connection that are buffered.
const READ_AHEAD: usize = 64 << 10;
/// Pause after a connection that could not be accepted.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Serves the page on `listener` until `shutdown`. Open connections end with the runtime, not
/// before.
pub async fn serve(listener: TcpListener, site: Site, shutdown: impl Future<Output = ()>) {
    let router = router(site.clone());
    let slots = Slots::new(MOST_CONNECTIONS, MOST_EACH);
    let accepting = async {
        loop {
            match listener.accept().await {
                // Without a slot it is closed at once: all others are being answered.
                Ok((stream, peer)) => {
                    if let Some(slot) = slots.enter(site.holder(peer.ip()), Instant::now()) {
                        tokio::spawn(answer(stream, peer, Arc::new(slot), router.clone()));
                    }
                }
                // No file descriptor is left, or the client is gone: others can still be served.
                Err(_) => tokio::time::sleep(ACCEPT_PAUSE).await,
            }
        }
    };
    tokio::select! {
        () = accepting => {}
        () = shutdown => {}
    }
}

/// Answers the requests of one connection.
async fn answer(stream: TcpStream, peer: SocketAddr, slot: Arc<Slot>, router: Router) {
    if clock::is_past_calendars() {
        // hyper would panic: it puts a date into each answer.
        refuse(&stream).await;
        return;
    }
    let mut stream = TimeoutStream::new(stream);
    stream.set_write_timeout(Some(WRITE_TIME));
    let asked = slot.clone();
    let refused = Arc::new(AtomicBool::new(false));
    let refusing = refused.clone();
    let inner = TowerToHyperService::new(router);
    let service = service_fn(move |mut request: Request<Incoming>| {
        asked.mark(None);
        request.extensions_mut().insert(Peer(peer.ip()));
        let (answered, answering) = (asked.clone(), inner.call(request));
        let refused = refusing.clone();
        Box::pin(async move {
            let Ok(response) = answering.await;
            let refuses =
                response.status().is_client_error() || response.status().is_server_error();
            refused.store(refuses, Ordering::Relaxed);
            if response.extensions().get::<Following>().is_none() {
                answered.mark(Some(Instant::now()));
            }
            Ok::<_, Infallible>(response)
        })
    });
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEADER_TIME)
        .max_headers(MOST_HEADERS)
        .max_buf_size(READ_AHEAD)
        .serve_connection(TokioIo::new(Box::pin(stream)), service)
        .without_shutdown();
    let answering = async {
        // A connection that the client breaks off is not an error of the server.
        let Ok(ended) = connection.await else { return };
        let mut stream = ended.io.into_inner();
        // Fails only where the client is gone.
        let _ = poll_fn(|context| stream.as_mut().poll_shutdown(context)).await;
        if refused.load(Ordering::Relaxed) {
            let _ = tokio::time::timeout(LAST_TIME, drain(stream.get_ref())).await;
        }
    };
    tokio::select! {
        () = answering => {}
        () = slot.left() => {}
    }
}

/// Reads what a client still sends, until it ends: a socket that is closed before breaks off the
/// answer on its way to the client.
async fn drain(stream: &TcpStream) -> io::Result<()> {
    let mut sent = vec![0; READ_AHEAD];
    loop {
        stream.readable().await?;
        match stream.try_read(&mut sent) {
            Ok(0) => return Ok(()),
            Err(error) if error.kind() != ErrorKind::WouldBlock => return Err(error),
            _ => tokio::task::yield_now().await,
        }
    }
}

/// Answers a connection while the system clock shows a time that HTTP cannot express.
pub(super) async fn refuse(stream: &TcpStream) {
    let words =
        r#"{"error":"the clock of this device is before 1970 or past the year 9999: set it"}"#;
    let answer = format!(
        "HTTP/1.1 503 Service Unavailable\r\nContent-Type: application/json\r\nContent-Length: {}\r\n\
         Connection: close\r\n\r\n{words}",
        words.len()
    );
    let answered = async {
        stream.readable().await?;
        stream.try_read(&mut [0; 4096])?;
        stream.writable().await?;
        stream.try_write(answer.as_bytes())
    };
    // A client that breaks off or sends nothing is not an error of the server.
    let _ = tokio::time::timeout(HEADER_TIME, answered).await;
}
