//! Everything that the answers of the page need, and the limits of concurrent work.

use std::convert::Infallible;
use std::net::IpAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicU32;

use axum::extract::FromRequestParts;
use axum::http::request::Parts as RequestParts;
use ipnet::IpNet;
use serde_json::Value;
use tokio::sync::{Mutex, Semaphore, oneshot};
use tokio::time::Instant;

use super::desk::Desk;
use super::problem::{Answered, Problem};
use super::slots::Slots;
use super::slots::Tries;
use crate::access::Access;
use crate::backup::Backups;
use crate::head::calibration::Current;
use crate::history::Reader;
use crate::history::studies::Studies;
use crate::production::commissioning::Commission;
use crate::production::commissioning::live::Live;
use crate::production::latest::LastCycleRequests;
use crate::production::simulation::Simulation;
use crate::recipe::Store;
use crate::recipe::edit::trying::EditedRecipe;
use crate::recipe::plan::Layers;
use crate::recipe::teach::part::LastSeen;
use crate::station::{Snapshot, StationHandle};
use crate::system::journal::Logbook;
use crate::system::socket;

/// The most pages that follow the events at a time.
pub const MAX_FOLLOWERS: usize = 16;
/// The most of them from one address: half of its connections are left for requests.
pub const MAX_FOLLOWERS_EACH: usize = 8;
/// The most pictures, files and recipes that are computed at a time; the measuring task needs the
/// cores.
const MAX_ASIDE: usize = 2;
/// The most sign-ins, changes and records of them at a time. They have a limit of their own, so
/// that reading does not delay them.
const MAX_CHANGES: usize = 2;
/// The most files that are received at a time: each takes storage, and memory while it is checked.
const MAX_ARRIVING: usize = 2;
/// The most files that are sent at a time: each is in memory until its client has received it.
const MAX_FILES: usize = 4;
/// The most programs that collect results at a time, beside the files of people.
const MAX_COLLECTING: usize = 4;

/// The maps that were computed last, and the SEQ of their result.
pub(super) type LastKept = Option<(u32, Arc<Layers>)>;
/// The recipe whose edit was tried last, and when.
pub(super) type LastOpened = Option<(EditedRecipe, Instant)>;

/// What the daemon hands to the page.
pub struct Parts {
    /// The station.
    pub station: StationHandle,
    /// Users, sessions and the record of changes.
    pub access: Access,
    /// The station's recipes.
    pub recipes: Store,
    /// The calibration of the open head.
    pub calibration: Current,
    /// Requests about the last cycle: its maps and downloads.
    pub last_cycle: LastCycleRequests,
    /// What teaching took for the part.
    pub seen: LastSeen,
    /// The part in front of a simulated head.
    pub simulation: Simulation,
    /// Steps of commissioning.
    pub commission: Commission,
    /// Live pictures of the head.
    pub live: Live,
    /// The stored results.
    pub history: Reader,
    /// Guided studies.
    pub studies: Studies,
    /// Stores the time of this start of the daemon, µs since 1970 UTC, by the clock of a signed-in
    /// user's browser; answers whether it is stored.
    pub date: Box<dyn Fn(u64) -> bool + Send + Sync>,
    /// Waits until every result so far is stored; answers whether they are.
    pub is_stored: Box<dyn Fn() -> bool + Send + Sync>,
    /// The log.
    pub log: Logbook,
    /// The registers with their values, as the PLC reads them.
    pub registers: fn(&Snapshot) -> Value,
    /// The configuration as TOML, for the diagnostic bundle.
    pub configuration: String,
    /// The file of the calibration, for the same.
    pub calibration_file: Option<PathBuf>,
    /// Host names of the page, besides IP addresses and `localhost`.
    pub hosts: Vec<String>,
    /// Networks of proxies: one such address stands for many clients.
    pub proxies: Vec<IpNet>,
    /// Whether everybody may look without signing in.
    pub looking_is_open: bool,
    /// Networks of programs that collect without signing in.
    pub collectors: Vec<IpNet>,
    /// Backups of this device, and the way back.
    pub backups: Backups,
    /// Ends the program where a service manager starts it anew; none without one.
    pub restart: Option<Box<dyn Fn() + Send + Sync>>,
}

/// The parts with the limits of concurrent work, shared by all requests. Cheap to clone.
#[derive(Clone)]
pub struct Site {
    parts: Arc<Parts>,
    /// Slots of pages that follow the events.
    pub(super) followers: Slots,
    /// Permits to receive a file.
    pub(super) arriving: Arc<Semaphore>,
    /// Permits to send a file.
    pub(super) files: Arc<Semaphore>,
    /// Permits to collect results.
    pub(super) collecting: Arc<Semaphore>,
    /// A permit to work statistics out.
    pub(super) reckoning: Arc<Semaphore>,
    /// The uptime at which a refused change of somebody who had not signed in was recorded last, and
    /// one more, s; 0 if none was.
    pub(super) stranger_at_s: Arc<AtomicU32>,
    /// Held while a backup is made, or one is checked.
    pub(super) carrying: Arc<Mutex<()>>,
    /// The uptime at which a program asked for results last, s; 0 if none did.
    pub(super) collected_at_s: Arc<AtomicU32>,
    /// The maps of a kept part that were computed last; locked while something else is computed of
    /// one.
    pub(super) kept: Arc<Mutex<LastKept>>,
    /// The recipe whose edit was tried last; locked while an edit is tried.
    pub(super) opened: Arc<Mutex<LastOpened>>,
    /// Held from the look-up of a trigger's token until its result is stored.
    pub(super) asking: Arc<Mutex<()>>,
    /// The guided study that runs.
    pub(super) desk: Desk,
    /// The tries that are being answered.
    pub(super) tries: Tries,
    looking: Arc<Semaphore>,
    changing: Arc<Semaphore>,
}

impl FromRequestParts<Self> for Site {
    type Rejection = Infallible;

    async fn from_request_parts(_: &mut RequestParts, site: &Self) -> Result<Self, Infallible> {
        Ok(site.clone())
    }
}

impl std::ops::Deref for Site {
    type Target = Parts;

    fn deref(&self) -> &Parts {
        &self.parts
    }
}

impl Site {
    /// The page of a station.
    pub fn new(parts: Parts) -> Self {
        Self {
            parts: Arc::new(parts),
            followers: Slots::new(MAX_FOLLOWERS, MAX_FOLLOWERS_EACH),
            arriving: Arc::new(Semaphore::new(MAX_ARRIVING)),
            files: Arc::new(Semaphore::new(MAX_FILES)),
            collecting: Arc::new(Semaphore::new(MAX_COLLECTING)),
            reckoning: Arc::new(Semaphore::new(1)),
            stranger_at_s: Arc::default(),
            carrying: Arc::default(),
            collected_at_s: Arc::default(),
            kept: Arc::default(),
            opened: Arc::default(),
            asking: Arc::default(),
            desk: Desk::default(),
            tries: Tries::default(),
            looking: Arc::new(Semaphore::new(MAX_ASIDE)),
            changing: Arc::new(Semaphore::new(MAX_CHANGES)),
        }
    }

    /// The address or network to which connections from this address are counted; none for a proxy.
    pub(super) fn holder(&self, address: IpAddr) -> Option<IpAddr> {
        (!socket::holds(&self.proxies, address)).then(|| socket::network(address))
    }

    /// Reads or computes something on a blocking thread, a few at a time.
    ///
    /// # Errors
    /// What `work` answers.
    pub async fn aside<T: Send + 'static>(
        &self,
        work: impl FnOnce(&Self) -> Answered<T> + Send + 'static,
    ) -> Answered<T> {
        self.queued(self.looking.clone(), work).await
    }

    /// Changes something on a blocking thread, a few at a time.
    ///
    /// # Errors
    /// What `work` answers.
    pub async fn change<T: Send + 'static>(
        &self,
        work: impl FnOnce(&Self) -> Answered<T> + Send + 'static,
    ) -> Answered<T> {
        self.queued(self.changing.clone(), work).await
    }

    async fn queued<T: Send + 'static>(
        &self,
        places: Arc<Semaphore>,
        work: impl FnOnce(&Self) -> Answered<T> + Send + 'static,
    ) -> Answered<T> {
        let gone = |_| Problem::broken("the page's workers are gone; restart fringed");
        let permit = places.acquire_owned().await.map_err(gone)?;
        let site = self.clone();
        let done = tokio::task::spawn_blocking(move || {
            let _permit = permit;
            work(&site)
        });
        done.await
            .map_err(|_| Problem::broken("working it out failed; see the log"))?
    }

    /// The last result's SEQ, 0 before the first.
    pub fn last_seq(&self) -> u32 {
        let snapshot = self.station.snapshot();
        snapshot.result.as_ref().map_or(0, |result| result.seq)
    }
}

/// Does something on a thread of its own: a stop would wait for one of the runtime's.
///
/// # Errors
/// `failed`, where there is no thread or it panics.
pub(super) async fn alone<T: Send + 'static>(
    name: &str,
    failed: &str,
    work: impl FnOnce() -> T + Send + 'static,
) -> Answered<T> {
    let (done, answer) = oneshot::channel();
    let run = move || {
        // The client may have closed its connection.
        let _ = done.send(work());
    };
    let begun = std::thread::Builder::new().name(name.into()).spawn(run);
    begun.map_err(|_| Problem::broken(failed))?;
    answer.await.map_err(|_| Problem::broken(failed))
}
