//! Listening on a TCP port, and why that is not possible.

use std::io;
use std::net::SocketAddr;
use thiserror::Error;
use tokio::net::TcpListener;

/// Why nobody listens there.
#[derive(Debug, Error)]
pub enum BindError {
    /// Something else does.
    #[error(
        "serve {what} on {address}: the port is in use; end the other program or choose another port"
    )]
    InUse {
        /// What is served.
        what: &'static str,
        /// What was attempted.
        address: SocketAddr,
    },
    /// Ports below 1024 belong to the system.
    #[error(
        "serve {what} on {address}: not permitted; choose a port from 1024 on or grant CAP_NET_BIND_SERVICE"
    )]
    NotPermitted {
        /// What is served.
        what: &'static str,
        /// What was attempted.
        address: SocketAddr,
    },
    /// Anything else.
    #[error("serve {what} on {address}: {source}; check that the address belongs to this machine")]
    Other {
        /// What is served.
        what: &'static str,
        /// What was attempted.
        address: SocketAddr,
        /// What the system said.
        source: io::Error,
    },
}

/// Opens the socket on which `what` is served; the listener's own address tells the port if 0 was asked for.
///
/// # Errors
/// The address is in use, not permitted, or not of this machine.
pub async fn bind(what: &'static str, address: SocketAddr) -> Result<TcpListener, BindError> {
    TcpListener::bind(address)
        .await
        .map_err(|source| match source.kind() {
            io::ErrorKind::AddrInUse => BindError::InUse { what, address },
            io::ErrorKind::PermissionDenied => BindError::NotPermitted { what, address },
            _ => BindError::Other {
                what,
                address,
                source,
            },
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_port_in_use_is_named_with_what_wants_it_and_the_remedy() {
        let first = bind("the page", "127.0.0.1:0".parse().unwrap())
            .await
            .unwrap();
        let address = first.local_addr().unwrap();
        let words = bind("the page", address).await.unwrap_err().to_string();
        assert!(
            words.contains("the page") && words.contains(&address.to_string()),
            "{words}"
        );
        assert!(words.contains("choose another port"), "{words}");
    }
}
