//! The running daemon: starts and stops its threads, and connects them.
//!
//! One OS thread measures ([`crate::production`]), one serves the sockets on a current-thread
//! runtime, and others write the history, serve the lines and survey the machine. They share the
//! station through its handle.

mod rooms;
pub mod survey;

pub use crate::system::caller::Caller;

use crate::access::{Access, ChangeRecord, NewSecret, OpenedAccess};
use crate::backup::Backups;
use crate::config::{Backend, Config};
use crate::error::{Exit, Failure, Result};
use crate::head::calibration::Current;
use crate::history::{self, Bounds, History, Numbering, OpenedHistory, Reader};
use crate::modbus;
use crate::production::commissioning::Commission;
use crate::production::commissioning::live::Live;
use crate::production::latest::LastCycleRequests;
use crate::production::simulation::Simulation;
use crate::production::{Aborts, Order, backend};
use crate::recipe::Store;
use crate::recipe::teach::part::LastSeen;
use crate::station::snapshot::status;
use crate::station::{
    Buffered, Effect, Event, Identity, Limits, MAX_BUFFERED, Micros, PlcOrder, RecipeKey,
    RecipeResult, Request, Settings, Snapshot, Station, StationHandle, Teaching,
};
use crate::storage::state::{StateFolder, random};
use crate::system::caller::StopSignal;
use crate::system::computing::Computing;
use crate::system::journal::{self, Severity};
use crate::system::progress::Progress;
use crate::system::{clock, runtime, socket, stderr};
use rooms::Rooms;
use sim::Stage;
use std::net::{IpAddr, SocketAddr};
use std::path::Path;
use std::sync::mpsc::{SyncSender, TrySendError};
use std::sync::{Arc, mpsc};
use std::thread::JoinHandle;
use std::time::Instant;
use tokio::net::TcpListener;
use tokio::sync::watch;

/// Orders of the PLC that wait to be recorded; more are not.
const MOST_ORDERS: usize = 256;
/// Time between two checks for the stop signal during the start.
const POLLING: std::time::Duration = std::time::Duration::from_millis(20);

/// A running daemon.
pub struct Daemon {
    /// The station.
    pub station: StationHandle,
    /// Where Modbus TCP is served.
    pub modbus: SocketAddr,
    /// Where the page is served.
    pub http: SocketAddr,
    /// Where parts are placed in front of a simulated head.
    pub stage: Option<Stage>,
    /// Whether a recipe is loaded or taught at the start.
    awaited: bool,
    /// The way to the measuring task.
    orders: mpsc::Sender<Order>,
    /// What the PLC orders, to be recorded; nothing ends the thread that does.
    ordered: SyncSender<Option<(IpAddr, PlcOrder)>>,
    /// Ends the threads of the sockets and of the lines.
    sockets: watch::Sender<bool>,
    /// Ends the survey's thread once it is dropped.
    survey: mpsc::Sender<()>,
    /// The threads that measure, serve sockets, survey, serve lines and record what the PLC orders.
    threads: [JoinHandle<()>; 5],
    /// The thread of the history.
    writing: JoinHandle<()>,
    history: History,
    progress: Progress,
    /// Whether the measuring task only computes.
    computing: Computing,
    /// Locked as long as the daemon runs.
    _state: StateFolder,
}

impl Daemon {
    /// Starts everything and returns when the head is open. The station then loads its recipe; on a
    /// simulated head without one, it teaches one. For a service manager as `caller` it also
    /// returns if the head is missing; the measuring task then waits for the head as for a lost
    /// one. On the caller's stop signal it returns at once; the daemon can then only be stopped.
    ///
    /// # Errors
    /// If the state folder cannot be used (73), a port is in use or the head missing (69), or the
    /// configuration is wrong (78). Nothing keeps running then.
    pub fn start(
        config: &Config,
        pool: rayon::ThreadPool,
        progress: Progress,
        caller: &Caller,
    ) -> Result<Self> {
        let path = match &config.state {
            Some(path) => path.clone(),
            None => StateFolder::default_path()?,
        };
        // From here on no thread waits until stderr is read.
        stderr::detach();
        let state = StateFolder::open(&path)?;
        let record = ChangeRecord::of(&path, u64::from(config.access.record_mib) << 20);
        let utc_s = clock::utc_us().map(|us| us / 1_000_000);
        // Before anything of the state is used.
        if let Some(words) = Backups::of(&path).carry_out(&state, &record, utc_s)? {
            progress.report(Severity::Notice, &words);
        }
        let recipes = Store::of_state(&state)?;
        let access = open_access(&state, record.clone(), &progress)?;
        let wires = backend::lines(&config.lines)?;
        let runtime = runtime()?;
        let (plc, page) = runtime.block_on(listen(config))?;
        let (modbus, http) = (address_of(&plc)?, address_of(&page)?);
        let (orders, inbox) = mpsc::channel();
        let OpenedHistory {
            history,
            task,
            next_seq,
            buffered,
            complaint,
        } = open_history(config, &state)?;
        if let Some(complaint) = complaint {
            progress.warn(&complaint);
        }
        let buffered = left_of(&state, buffered, &progress);
        let aborts = Aborts::default();
        let (ordered, recorded) = mpsc::sync_channel(MOST_ORDERS);
        let sink = effects(
            orders.clone(),
            aborts.clone(),
            history.clone(),
            progress.clone(),
            ordered.clone(),
        );
        let settings = station(config, &state, (next_seq, buffered))?;
        let station = StationHandle::new(settings, Instant::now(), sink);
        let (commission, complaints) = Commission::open(&path);
        for complaint in complaints {
            progress.warn(&complaint);
        }
        let (sockets, stopped) = watch::channel(false);
        let rooms = Rooms {
            config,
            path: &path,
            station: station.clone(),
            recipes,
            history: history.clone(),
            progress: progress.clone(),
            calibration: Current::default(),
            last_cycle: LastCycleRequests::default(),
            seen: LastSeen::default(),
            simulation: Simulation::new(orders.clone()),
            live: Live::new(orders.clone(), commission.clone()),
            commission,
            computing: Computing::default(),
            clients: modbus::Clients::new(usize::from(config.modbus.connections)),
            stopped,
        };
        let computing = rooms.computing.clone();
        let recording = rooms.record(record, recorded)?;
        let writing = rooms.history(task)?;
        let wiring = rooms.lines(wires)?;
        let serving = rooms.sockets(runtime, plc, page, (access, caller))?;
        let (survey, surveying) = rooms.survey()?;
        let first = first_request(config, &rooms.recipes);
        let awaited = first.is_some();
        let (opened, opening) = mpsc::channel();
        let measuring = rooms.measuring(pool, caller, (inbox, aborts), first, opened)?;
        let daemon = Self {
            station,
            modbus,
            http,
            stage: None,
            awaited,
            orders,
            ordered,
            sockets,
            survey,
            threads: [measuring, serving, surveying, wiring, recording],
            writing,
            history,
            progress,
            computing,
            _state: state,
        };
        match opened_head(&opening, &caller.stop) {
            Ok(stage) => Ok(Self { stage, ..daemon }),
            Err(failure) => {
                daemon.end();
                Err(failure)
            }
        }
    }

    /// Waits until the station has its recipe or cannot get it. With a recipe it is READY, unless
    /// the PLC has not set ONLINE or selects another recipe.
    ///
    /// # Errors
    /// The station has a fault, or its recipe could be neither loaded nor taught.
    pub fn wait_until_ready(&self) -> Result<Arc<Snapshot>> {
        runtime()?.block_on(self.settled())
    }

    /// As [`Daemon::wait_until_ready`], as a future.
    ///
    /// # Errors
    /// As [`Daemon::wait_until_ready`].
    pub async fn settled(&self) -> Result<Arc<Snapshot>> {
        if !self.awaited {
            let message = "there is no recipe yet: load or teach one, or import one with `fringed recipe import`";
            return Exit::Unavailable.fail(message);
        }
        let mut snapshots = self.station.subscribe();
        let refused = |snapshot: &Snapshot| snapshot.recipe_result != RecipeResult::Ok;
        let settled = |snapshot: &Arc<Snapshot>| {
            let broken = snapshot.fault.is_some() || snapshot.error.is_some();
            let loaded = snapshot.recipe.is_some() && !snapshot.is_working();
            loaded || broken || refused(snapshot)
        };
        let snapshot = snapshots.wait_for(settled).await.map(|found| found.clone());
        let snapshot = snapshot
            .map_err(|_| Failure::new(Exit::Software, "the station ended before it was ready"))?;
        match (&snapshot.fault, &snapshot.error) {
            (Some(fault), _) => {
                let message = format!("{}: {}", fault.cause, fault.remedy);
                Exit::Unavailable.fail(message)
            }
            (None, error) if refused(&snapshot) => {
                let otherwise = "the recipe was not loaded: load another, or teach it again";
                let message = error.as_deref().unwrap_or(otherwise);
                Exit::Content.fail(message)
            }
            (None, Some(error)) if !snapshot.is(status::READY) => Exit::Unavailable.fail(error),
            _ => Ok(snapshot),
        }
    }
}

/// Waits for the measuring task's head, or for the stop signal: where parts are placed in front of
/// a simulated head.
fn opened_head(
    opening: &mpsc::Receiver<Result<Option<Stage>>>,
    stop: &StopSignal,
) -> Result<Option<Stage>> {
    loop {
        match opening.recv_timeout(POLLING) {
            Ok(outcome) => return outcome,
            Err(mpsc::RecvTimeoutError::Timeout) if stop.has_arrived() => return Ok(None),
            Err(mpsc::RecvTimeoutError::Timeout) => {}
            Err(mpsc::RecvTimeoutError::Disconnected) => {
                return Exit::Software.fail("the measuring task ended before its head was open");
            }
        }
    }
}

/// The service manager's credential with the secret of this device.
const SECRET: &str = "fringed.secret";

/// Opens the access control; the secret of a new device is written to stderr here and never again.
fn open_access(state: &StateFolder, record: ChangeRecord, progress: &Progress) -> Result<Access> {
    let folder = state.path().join("access");
    let given =
        std::env::var_os("CREDENTIALS_DIRECTORY").map(|given| Path::new(&given).join(SECRET));
    let OpenedAccess {
        access,
        made,
        complaint,
    } = Access::open(&folder, given.as_deref(), record)?;
    complaint.inspect(|complaint| progress.warn(complaint));
    if let Some(NewSecret { secret, complaint }) = made {
        if let Some(complaint) = complaint {
            progress.warn(&complaint);
        }
        // Also with `--quiet`: without the secret it is impossible to sign in.
        let words = format!(
            "the secret of this device, shown this once: {secret} (sign in on the page with it; for another one \
             delete {} and start again)",
            folder.join("secret").display()
        );
        journal::write(Severity::Notice, &words);
    }
    Ok(access)
}

async fn listen(config: &Config) -> Result<(TcpListener, TcpListener)> {
    let plc = socket::bind("Modbus TCP", config.modbus.listen).await?;
    let page = socket::bind("the page", config.http.listen).await?;
    Ok((plc, page))
}

fn address_of(listener: &TcpListener) -> Result<SocketAddr> {
    listener
        .local_addr()
        .map_err(Exit::Unavailable.because("ask for a socket's port"))
}

/// The results that the run before has left in BUFFERED mode; `acknowledged` is the last SEQ that was
/// acknowledged in it.
fn left_of(state: &StateFolder, acknowledged: Option<u32>, progress: &Progress) -> Buffered {
    let behind = |seq| Reader::of(state.path()).after(seq, MAX_BUFFERED)?.page();
    let entries = match acknowledged.map(behind) {
        None => Vec::new(),
        Some(Ok(page)) => page.results,
        Some(Err(error)) => {
            progress.warn(&format!(
                "results that were not acknowledged before the start are not queued: {error}"
            ));
            Vec::new()
        }
    };
    Buffered {
        acknowledged,
        queue: entries
            .iter()
            .map(|entry| Arc::new(entry.record()))
            .collect(),
    }
}

fn open_history(config: &Config, state: &StateFolder) -> Result<OpenedHistory> {
    let bounds = Bounds {
        results: u64::from(config.history.results),
        recordings: u64::from(config.history.recordings_mib) << 20,
        good_every: config.history.good_every,
    };
    let numbering = Numbering {
        counted: state.counted(),
        counter: state.counter(),
        serial: state.serial()?,
        // Run 0 means that none was recorded.
        run: random()?.max(1),
        utc_s: clock::utc_us().map(|us| us / 1_000_000),
    };
    history::open(state.path(), numbering, bounds).map_err(Exit::CannotCreate.failure())
}

fn station(
    config: &Config,
    state: &StateFolder,
    (next_seq, buffered): (u32, Buffered),
) -> Result<Station> {
    let settings = Settings {
        next_seq,
        buffered,
        boot_id: random()?,
        teach_allowed: config.station.teach_allowed,
        identity: Arc::new(Identity {
            vendor: "fringed".into(),
            product: "fringed 3-D smart sensor".into(),
            serial: state.serial()?,
            version: env!("CARGO_PKG_VERSION").into(),
        }),
        limits: Limits {
            plc: Micros::from_millis(u64::from(config.station.plc_timeout_s) * 1000),
            ..Limits::default()
        },
    };
    Ok(Station::new(settings, Micros(0)))
}

/// Carries out the station's effects. It is called with the station locked, so it only hands them
/// over and never waits.
fn effects(
    orders: mpsc::Sender<Order>,
    aborts: Aborts,
    history: History,
    progress: Progress,
    ordered: SyncSender<Option<(IpAddr, PlcOrder)>>,
) -> impl FnMut(Effect) -> Option<Event> {
    // If the measuring task is gone, the order is lost, and the station's deadline for the job
    // passes.
    let order = move |order| drop(orders.send(order));
    move |effect| {
        match effect {
            Effect::Measure(job) => order(Order::Measure(job)),
            Effect::Load { job, key } => order(Order::Load(job, key)),
            Effect::Teach { job, teaching } => order(Order::Teach(job, teaching)),
            Effect::Commission { job } => order(Order::Commission(job)),
            Effect::Ordered { from, order } => {
                if let Err(TrySendError::Full(_)) = ordered.try_send(Some((from, order))) {
                    let words = "an order of the PLC is not recorded: the storage is too slow";
                    progress.log(words);
                }
            }
            Effect::PersistSeq(seq) => {
                let failed = history.take(seq).err();
                return Some(Event::Stored { seq, failed });
            }
            Effect::Log(line) => progress.log(&line),
            Effect::Alarm(line) => progress.report(Severity::Error, &line),
            Effect::Abort { job } => aborts.abort(job),
            Effect::Publish(result) => history.record(&result),
            Effect::Buffered(acknowledged) => history.buffer(acknowledged),
        }
        None
    }
}

/// The station's first request: to load its recipe. Without one, a simulated head teaches the part
/// in front of it.
fn first_request(config: &Config, recipes: &Store) -> Option<Request> {
    let number = config.station.recipe;
    if recipes.numbers().contains(&number) {
        Some(Request::Load(RecipeKey::Number(number)))
    } else {
        let simulated = config.head.backend == Backend::Sim;
        simulated.then_some(Request::Teach(Teaching::of(number)))
    }
}
