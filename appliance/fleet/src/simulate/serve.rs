//! The server: one thread, as many connections as there are collectors and heads.

use super::answer::answer;
use super::head::Plant;
use crate::error::{Exit, Result};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::TokioIo;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;

/// Pause after a connection that could not be accepted, because no file descriptor is left.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Listens at `listen`, has the plant made, which gets the address, and answers until the program is
/// stopped.
///
/// # Errors
/// If the address cannot be listened at.
pub(super) fn serve(listen: &str, plant: impl FnOnce(SocketAddr) -> Plant) -> Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build();
    let runtime = runtime.map_err(Exit::Software.because("start a runtime"))?;
    runtime.block_on(async {
        let failed = || format!("listen at {listen}");
        let listener = TcpListener::bind(listen).await;
        let listener = listener.map_err(Exit::Unavailable.because(failed()))?;
        let address = listener
            .local_addr()
            .map_err(Exit::Unavailable.because(failed()))?;
        let plant = Arc::new(plant(address));
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
    })
}

async fn connection(stream: TokioIo<tokio::net::TcpStream>, plant: Arc<Plant>) {
    let service = service_fn(|request| {
        let plant = plant.clone();
        async move { answer(&plant, hyper::Request::uri(&request)).await }
    });
    // A connection that either side breaks off is no error of the server.
    let _ = http1::Builder::new()
        .serve_connection(stream, service)
        .await;
}
