//! The sockets' thread: Modbus, the page, and the station's tick.

use crate::config::Config;
use crate::station::{StationHandle, tick};
use crate::system::clock;
use crate::{modbus, web};
use tokio::net::TcpListener;
use tokio::sync::watch;

/// What the Modbus server needs.
pub(super) struct PlcSide {
    pub(super) listener: TcpListener,
    pub(super) clients: modbus::Clients,
    pub(super) refusals: modbus::Refusals,
}

pub(super) async fn serve(
    plc: PlcSide,
    page: TcpListener,
    station: StationHandle,
    site: web::Site,
    config: &Config,
    stopped: watch::Receiver<bool>,
) {
    let stop = || {
        let mut stopped = stopped.clone();
        async move {
            // An error means that the daemon is gone, which is a reason to stop too.
            let _ = stopped.wait_for(|stop| *stop).await;
        }
    };
    let options = modbus::Options {
        config: config.modbus.clone(),
        ..modbus::Options::default()
    };
    tokio::join!(
        tick(station.clone(), clock::utc_us, stop()),
        modbus::serve(
            plc.listener,
            station,
            options,
            plc.clients,
            plc.refusals,
            stop()
        ),
        web::serve(page, site, stop()),
    );
}
