//! The server: accepts connections on top of `tokio-modbus`, within their limits of number and
//! time.

use std::future::Future;
use std::net::{IpAddr, SocketAddr};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use tokio::net::{TcpListener, TcpStream};
use tokio_modbus::server::tcp::Server;

use super::clients::Clients;
use super::clients::{Refusals, RefusedPeer};
use super::guard::Guard;
use super::service::{FrameFlaw, PlcService};
use crate::config::ModbusConfig;
use crate::station::{Client, ConnectionEdges, StationHandle};
use crate::system::socket::holds;

/// The server's settings.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Word order, unit id, and who may read and write.
    pub config: ModbusConfig,
    /// A connection without a request for this long is closed.
    pub idle: Duration,
    /// Time to finish a started frame, and for the client to read an answer.
    pub frame: Duration,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            config: ModbusConfig::default(),
            idle: Duration::from_secs(300),
            frame: Duration::from_secs(10),
        }
    }
}

/// Serves the station on `listener` to `clients` until `shutdown`; then every connection is closed.
pub async fn serve(
    listener: TcpListener,
    handle: StationHandle,
    options: Options,
    clients: Clients,
    refusals: Refusals,
    shutdown: impl Future<Output = ()>,
) {
    let server = Server::new(listener);
    let connections = AtomicU64::new(0);
    let admit = |peer: IpAddr| {
        if !holds(&options.config.readers, peer) {
            refusals.note(RefusedPeer::Connection, peer);
            return None;
        }
        let may_write = holds(&options.config.writers, peer);
        let place = clients.admit(may_write);
        if place.is_none() {
            refusals.note(RefusedPeer::Full, peer);
        }
        place.map(|place| (place, may_write))
    };
    let on_connected = |stream: TcpStream, peer: SocketAddr| {
        let connection = admit(peer.ip()).map(|(place, may_write)| {
            let number = connections.fetch_add(1, Ordering::Relaxed);
            // Nagle's algorithm would delay the small answers. If it cannot be switched off the
            // connection still works.
            let _ = stream.set_nodelay(true);
            let flaw = FrameFlaw::default();
            let service = PlcService {
                handle: handle.clone(),
                word_order: options.config.word_order,
                strict_unit_id: options.config.strict_unit_id,
                flaw: flaw.clone(),
                edges: Mutex::new(ConnectionEdges::of(Client::Plc(number, peer.ip()))),
                peer: peer.ip(),
                may_write,
                refusals: refusals.clone(),
            };
            (
                service,
                Guard::new(stream, place, flaw, options.idle, options.frame),
            )
        });
        std::future::ready(Ok(connection))
    };
    let accept = async {
        loop {
            // Returns only when accept fails, for example without free file descriptors: wait, then
            // go on.
            let _ = server.serve(&on_connected, |_broken_connection| ()).await;
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    };
    tokio::select! {
        () = accept => {}
        () = shutdown => {}
    }
}
