//! The socket of the page.

use std::future::Future;
use std::io;
use std::net::SocketAddr;

use thiserror::Error;
use tokio::net::TcpListener;

use super::router::{Site, router};

/// Why there is no page.
#[derive(Debug, Error)]
pub enum WebError {
    /// Something else listens there.
    #[error(
        "could not serve the page on {address}: the port is in use; end the other program or choose another port"
    )]
    InUse {
        /// What was attempted.
        address: SocketAddr,
    },
    /// Ports below 1024 belong to the system.
    #[error(
        "could not serve the page on {address}: not permitted; choose a port from 1024 on or grant CAP_NET_BIND_SERVICE"
    )]
    NotPermitted {
        /// What was attempted.
        address: SocketAddr,
    },
    /// Anything else.
    #[error(
        "could not serve the page on {address}: {source}; check that the address belongs to this machine"
    )]
    Bind {
        /// What was attempted.
        address: SocketAddr,
        /// What the system said.
        source: io::Error,
    },
    /// Serving ended by itself.
    #[error("the page's server ended: {0}; restart fringed")]
    Ended(io::Error),
}

/// Opens the socket; the listener's own address tells the port if 0 was asked for.
///
/// # Errors
/// The address is in use, not permitted, or not of this machine.
pub async fn bind(address: SocketAddr) -> Result<TcpListener, WebError> {
    TcpListener::bind(address)
        .await
        .map_err(|source| match source.kind() {
            io::ErrorKind::AddrInUse => WebError::InUse { address },
            io::ErrorKind::PermissionDenied => WebError::NotPermitted { address },
            _ => WebError::Bind { address, source },
        })
}

/// Serves the page on `listener` until `shutdown`. Open event streams end with the runtime, not before.
///
/// # Errors
/// Serving ended by itself.
pub async fn serve(
    listener: TcpListener,
    site: Site,
    shutdown: impl Future<Output = ()>,
) -> Result<(), WebError> {
    tokio::select! {
        ended = axum::serve(listener, router(site)).into_future() => ended.map_err(WebError::Ended),
        () = shutdown => Ok(()),
    }
}
