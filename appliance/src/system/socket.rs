//! Listening on a TCP port, and comparing addresses with networks.

use ipnet::IpNet;
use std::io;
use std::net::{IpAddr, Ipv6Addr, SocketAddr};
use thiserror::Error;
use tokio::net::TcpListener;

/// Why a port cannot be listened on.
#[derive(Debug, Error)]
pub enum BindError {
    /// Another program listens there.
    #[error(
        "serve {what} on {address}: the port is in use; end the other program or choose another port"
    )]
    InUse {
        /// What is served.
        what: &'static str,
        /// What was attempted.
        address: SocketAddr,
    },
    /// Ports below 1024 need a permission.
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

/// Opens the socket on which `what` is served. With port 0 the system chooses one: the listener's own address has it.
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

/// Whether one of the networks contains an address. An IPv4-mapped IPv6 address counts as its IPv4 address.
pub fn holds(networks: &[IpNet], address: IpAddr) -> bool {
    let address = address.to_canonical();
    networks.iter().any(|network| network.contains(&address))
}

/// The network of one host: an IPv4 address, or the /64 of an IPv6 address.
pub fn network(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V6(six) => {
            let [a, b, c, d, ..] = six.segments();
            Ipv6Addr::new(a, b, c, d, 0, 0, 0, 0).into()
        }
        four => four,
    }
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
