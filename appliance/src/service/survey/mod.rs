//! The survey: load, memory, storage, temperature, power, versions, stored recipes and Modbus
//! clients, once a second.
//!
//! It has its own thread, so that a storage that hangs delays neither sockets nor measuring.

mod boots;
mod system;

use crate::modbus::Clients;
use crate::recipe::Store;
use crate::station::{Event, Power, StationHandle, System};
use crate::system::host::{Host, major_minor};
use crate::system::progress::Progress;
use boots::{Boots, RunState};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

/// Time between two surveys.
const PERIOD: Duration = Duration::from_secs(1);
/// A measuring task that missed its deadlines in this many surveys in a row hangs. Opening a lost
/// head again takes less time, so that it does not cause writes to the card.
const HANGING: u32 = 10;

/// What is surveyed.
pub struct Survey {
    folder: PathBuf,
    boots: Boots,
    recipes: Store,
    clients: Clients,
    progress: Progress,
}

impl Survey {
    /// A survey of the state folder, the recipes in it and the clients; counts this start.
    pub fn new(folder: &Path, recipes: Store, clients: Clients, progress: Progress) -> Self {
        let boots = Boots::begin(folder);
        let survey = Self {
            folder: folder.to_path_buf(),
            boots,
            recipes,
            clients,
            progress,
        };
        survey.store_boots();
        survey
    }

    /// Sends a survey to the station once a second until `stopped` receives a message or is closed;
    /// then counts a clean end.
    pub fn run(mut self, station: &StationHandle, stopped: &Receiver<()>) {
        let mut processors = system::Processors::default();
        let mut late = 0_u32;
        let host = Host::default();
        let version = |text: Option<String>| major_minor(&text?);
        let kernel = version(host.kernel());
        let mut power: Option<Power> = None;
        loop {
            power = host.throttled().map(|bits| Power::of(bits, power));
            let (clients, writer_connected) = self.clients.open();
            let after = station.event(Event::Surveyed(System {
                cpu_percent: processors.load_percent(),
                free_memory_mib: system::free_memory_mib(),
                free_storage_mib: system::free_storage_mib(&self.folder),
                cpu_temperature_c: host.temperature_c(),
                power,
                kernel,
                libcamera: version(host.libcamera()),
                boots: self.boots.starts,
                unclean_boots: self.boots.unclean,
                watchdog_restarts: self.boots.after_hanging,
                clients,
                writer_connected,
                recipes: Arc::from(self.recipes.numbers()),
            }));
            late = match after.worker_alive {
                true => 0,
                false => late.saturating_add(1),
            };
            let condition = match late {
                HANGING.. => RunState::Hanging,
                _ => RunState::Running,
            };
            if condition != self.boots.condition {
                self.boots.condition = condition;
                self.store_boots();
            }
            match stopped.recv_timeout(PERIOD) {
                Err(RecvTimeoutError::Timeout) => {}
                Ok(()) | Err(RecvTimeoutError::Disconnected) => break,
            }
        }
        self.boots.condition = RunState::Stopped;
        self.store_boots();
    }

    fn store_boots(&self) {
        if let Err(error) = self.boots.store(&self.folder) {
            self.progress
                .log(&format!("store the number of starts: {error}: free space"));
        }
    }
}
