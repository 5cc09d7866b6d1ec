//! The server: one thread, as many connections as there are collectors and heads.

use super::answer::answer;
use super::head::Plant;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::TokioIo;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};

/// Pause after a connection that could not be accepted, because no file descriptor is left.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Answers until the program is stopped.
pub(super) async fn serve(listener: TcpListener, plant: Arc<Plant>) -> ! {
    loop {
        match listener.accept().await {
            Ok((stream, _)) => {
                // Without it a short answer may wait for the acknowledgement of the one before.
                let _ = stream.set_nodelay(true);
                tokio::spawn(connection(TokioIo::new(stream), plant.clone()));
            }
            Err(_) => tokio::time::sleep(ACCEPT_PAUSE).await,
        }
    }
}

async fn connection(stream: TokioIo<TcpStream>, plant: Arc<Plant>) {
    let service = service_fn(|request| {
        let plant = plant.clone();
        async move { answer(&plant, hyper::Request::uri(&request)).await }
    });
    // A connection that either side breaks off is no error of the server.
    let _ = http1::Builder::new()
        .serve_connection(stream, service)
        .await;
}
