//! The HTTP server: accepts connections within their limits, and closes those that are too slow.

use std::convert::Infallible;
use std::future::Future;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::Router;
use hyper::Request;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::{Service as _, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio_io_timeout::TimeoutStream;

use super::events::Following;
use super::gate::Peer;
use super::router::router;
use super::site::Site;
use super::slots::{Slot, Slots};
use crate::system::clock;

/// The most connections at a time.
const MOST_CONNECTIONS: usize = 64;
/// The most of them from one address: a browser opens 6.
const MOST_EACH: usize = 16;
/// Longest wait for a request and its header.
const HEADER_TIME: Duration = Duration::from_secs(10);
/// Longest wait for a client to accept the next bytes of an answer.
const WRITE_TIME: Duration = Duration::from_secs(15);
/// The most header lines of a request.
const MOST_HEADERS: usize = 64;
/// The most bytes of a connection that are buffered.
const READ_AHEAD: usize = 64 << 10;
/// Pause after a connection that could not be accepted.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Serves the page on `listener` until `shutdown`. Open connections end with the runtime, not before.
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
    let inner = TowerToHyperService::new(router);
    let service = service_fn(move |mut request: Request<Incoming>| {
        asked.mark(None);
        request.extensions_mut().insert(Peer(peer.ip()));
        let (answered, answering) = (asked.clone(), inner.call(request));
        async move {
            let Ok(response) = answering.await;
            if response.extensions().get::<Following>().is_none() {
                answered.mark(Some(Instant::now()));
            }
            Ok::<_, Infallible>(response)
        }
    });
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEADER_TIME)
        .max_headers(MOST_HEADERS)
        .max_buf_size(READ_AHEAD)
        .serve_connection(TokioIo::new(Box::pin(stream)), service);
    // A connection that the client breaks off is not an error of the server.
    tokio::select! {
        _ = connection => {}
        () = slot.left() => {}
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
