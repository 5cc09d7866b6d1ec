//! Listening on a TCP port, and comparing addresses with networks.

use crate::error::{Exit, Failure, Result};
use ipnet::IpNet;
use std::io;
use std::net::{IpAddr, Ipv6Addr, SocketAddr};
use tokio::net::TcpListener;

/// Opens the socket on which `what` is served. With port 0 the system chooses one: the listener's
/// own address has it.
///
/// # Errors
/// The address is in use, not permitted, or not of this machine (exit code 69).
pub async fn bind(what: &str, address: SocketAddr) -> Result<TcpListener> {
    TcpListener::bind(address).await.map_err(|error| {
        let words = match error.kind() {
            io::ErrorKind::AddrInUse => {
                "the port is in use; end the other program or choose another port".into()
            }
            // Ports below 1024 need a permission.
            io::ErrorKind::PermissionDenied => {
                "not permitted; choose a port from 1024 on or grant CAP_NET_BIND_SERVICE".into()
            }
            _ => format!("{error}; check that the address belongs to this machine"),
        };
        Failure::because(
            Exit::Unavailable,
            format!("serve {what} on {address}"),
            words,
        )
    })
}

/// Whether one of the networks contains an address. An IPv4-mapped IPv6 address counts as its IPv4
/// address.
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
