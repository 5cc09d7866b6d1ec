//! The threads of the daemon, one for each room that waits or works by itself; and how they are stopped:
//! each is asked to end, and waited for within a limit.

use super::Daemon;
use super::survey::Survey;
use crate::access::{Access, Change, ChangeRecord, Way};
use crate::backup::Backups;
use crate::config::{Config, Looking};
use crate::error::{Exit, Result};
use crate::head::calibration::Current;
use crate::head::placed::Placed;
use crate::history::studies::Studies;
use crate::history::{History, Reader, Task};
use crate::production::backend::{self, Wires};
use crate::production::commissioning::Commission;
use crate::production::commissioning::live::Live;
use crate::production::drift::Watch;
use crate::production::latest::LastCycleRequests;
use crate::production::opening::Opening;
use crate::production::shelf::Shelf;
use crate::production::simulation::Simulation;
use crate::production::warm_up::WarmUp;
use crate::production::{Aborts, JudgedBy, Order, Worker};
use crate::recipe::Store;
use crate::recipe::teach::part::LastSeen;
use crate::station::{Event, PlcOrder, RecipeKey, Request, StationHandle, tick};
use crate::system::caller::Caller;
use crate::system::clock;
use crate::system::computing::Computing;
use crate::system::progress::Progress;
use crate::{lines, modbus, web};
use sim::Stage;
use std::net::IpAddr;
use std::path::Path;
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};
use tokio::net::TcpListener;
use tokio::runtime::Runtime;
use tokio::sync::watch;

/// What the rooms share.
pub(super) struct Rooms<'a> {
    pub config: &'a Config,
    /// The state folder.
    pub path: &'a Path,
    pub station: StationHandle,
    pub recipes: Store,
    pub history: History,
    pub progress: Progress,
    pub calibration: Current,
    pub last_cycle: LastCycleRequests,
    pub seen: LastSeen,
    pub simulation: Simulation,
    pub commission: Commission,
    pub live: Live,
    pub computing: Computing,
    pub clients: modbus::Clients,
    /// Ends sockets and lines.
    pub stopped: watch::Receiver<bool>,
}

/// A room's thread.
type Room = Result<JoinHandle<()>>;

impl Rooms<'_> {
    /// Stores results.
    pub fn history(&self, task: Task) -> Room {
        let station = self.station.clone();
        spawn("history", move || task.run(&station))
    }

    /// Records what the PLC orders, until nothing comes.
    pub fn record(
        &self,
        record: ChangeRecord,
        orders: Receiver<Option<(IpAddr, PlcOrder)>>,
    ) -> Room {
        let (station, progress) = (self.station.clone(), self.progress.clone());
        spawn("recording orders", move || {
            while let Ok(Some((from, order))) = orders.recv() {
                let snapshot = station.snapshot();
                let (action, subject) = match order {
                    PlcOrder::Teach(number) => ("teach recipe", format!("recipes/{number}")),
                    PlcOrder::Load(RecipeKey::Number(number)) => {
                        ("load recipe", format!("recipes/{number}"))
                    }
                    PlcOrder::Load(RecipeKey::PartNumber(part)) => {
                        ("load recipe", format!("part number {part}"))
                    }
                };
                let change = Change::of_station(&snapshot, (Way::Plc, from), action, subject);
                if let Err(error) = record.add(&change) {
                    progress.warn(&format!("record an order of the PLC: {error}: free space"));
                }
            }
        })
    }

    /// Serves the lines.
    pub fn lines(&self, wires: Wires) -> Room {
        let (station, progress) = (self.station.clone(), self.progress.clone());
        let (setup, stopped) = (self.config.lines.clone(), self.stopped.clone());
        let open: lines::Reopen = Box::new(move || backend::lines(&setup));
        spawn("lines", move || {
            if let Err(failure) = lines::serve(wires, &open, &station, &progress, stopped) {
                progress.warn(&failure.to_string());
            }
        })
    }

    /// Serves Modbus and the page.
    pub fn sockets(
        &self,
        runtime: Runtime,
        plc: TcpListener,
        page: TcpListener,
        (access, caller): (Access, &Caller),
    ) -> Room {
        let (config, station) = (self.config.clone(), self.station.clone());
        let (dating, boot_id) = (self.history.clone(), station.snapshot().boot_id);
        let storing = self.history.clone();
        let site = web::Site::new(web::Parts {
            station: station.clone(),
            access,
            recipes: self.recipes.clone(),
            calibration: self.calibration.clone(),
            last_cycle: self.last_cycle.clone(),
            seen: self.seen.clone(),
            simulation: self.simulation.clone(),
            commission: self.commission.clone(),
            live: self.live.clone(),
            history: Reader::of(self.path),
            studies: Studies::of(self.path),
            date: Box::new(move |utc_us| dating.date(boot_id, utc_us)),
            is_stored: Box::new(move || storing.is_stored()),
            log: self.progress.logbook().clone(),
            registers: modbus::live,
            configuration: toml::to_string(&config).unwrap_or_default(),
            calibration_file: config.head.calibration.clone(),
            hosts: config.http.hosts.clone(),
            proxies: config.http.proxies.clone(),
            looking_is_open: config.access.looking == Looking::Anyone,
            collectors: config.access.collectors.clone(),
            backups: Backups::of(self.path),
            restart: caller.restart(),
        });
        let plc = PlcSide {
            listener: plc,
            clients: self.clients.clone(),
            refusals: modbus::Refusals::new(self.progress.clone()),
        };
        let stopped = self.stopped.clone();
        spawn("sockets", move || {
            runtime.block_on(serve(plc, page, station, site, &config, stopped));
        })
    }

    /// Surveys the machine, until what this returns with the thread is dropped.
    pub fn survey(&self) -> Result<(Sender<()>, JoinHandle<()>)> {
        let (end, ended) = mpsc::channel();
        let (clients, progress) = (self.clients.clone(), self.progress.clone());
        let survey = Survey::new(self.path, self.recipes.clone(), clients, progress);
        let station = self.station.clone();
        let thread = spawn("survey", move || survey.run(&station, &ended))?;
        Ok((end, thread))
    }

    /// Opens the head, sends the outcome to `opened`, and measures.
    pub fn measuring(
        self,
        pool: rayon::ThreadPool,
        caller: &Caller,
        (inbox, aborts): (Receiver<Order>, Aborts),
        first: Option<Request>,
        opened: Sender<Result<Option<Stage>>>,
    ) -> Room {
        let mut config = self.config.head_in(self.path);
        let waiting = match first {
            Some(Request::Teach(_)) => Placed::after_teaching(&mut config.part),
            _ => None,
        };
        let watch = Watch::every(self.config.station.geometry_check_cycles);
        let (patient, pulse) = (caller.notify.is_connected(), caller.notify.pulse());
        let Self {
            station,
            recipes,
            history,
            progress,
            calibration,
            last_cycle,
            seen,
            simulation,
            commission,
            computing,
            ..
        } = self;
        spawn("measuring", move || {
            let opening = Opening {
                config: &config,
                pool: &pool,
                progress: &progress,
                station: &station,
                pulse: &pulse,
                patient,
                computing: &computing,
            };
            let Some((head, begin)) = opening.run(&inbox, &opened) else {
                return;
            };
            simulation.opened(head.stage.as_ref());
            let worker = Worker {
                opened: head,
                calibration,
                pool,
                recipes,
                station,
                last_cycle,
                seen,
                history,
                progress,
                config,
                aborts,
                lost: None,
                plan: None,
                last: JudgedBy::default(),
                shelf: Shelf::default(),
                pulse,
                computing,
                waiting,
                commission,
                live: false,
                watch,
                warm_up: WarmUp::default(),
            };
            worker.run(&inbox, begin, first);
        })
    }
}

fn spawn(name: &str, run: impl FnOnce() + Send + 'static) -> Room {
    Builder::new()
        .name(name.into())
        .spawn(run)
        .map_err(Exit::Software.because(format!("start the thread {name}")))
}

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

/// Time between two checks whether a thread has ended.
const POLLING: Duration = Duration::from_millis(2);
/// A measuring task that has not ended after this time is abandoned: each wait for a device ends
/// after 2 s.
const MEASURING: Duration = Duration::from_secs(3);
/// A thread that has not ended after this time is abandoned: a stop takes at most 5 s, whatever
/// hangs.
const STOPPING: Duration = Duration::from_millis(4500);

impl Daemon {
    /// Stops everything: the cycle in flight ends with its result, INVALID if it was still
    /// exposing; then the sockets close.
    pub fn stop(self) {
        self.station.event(Event::Stop);
        self.end();
    }

    /// Ends measuring, then the sockets, the survey and the history.
    pub(super) fn end(self) {
        let began = Instant::now();
        let until = began + STOPPING;
        // Fails only if the measuring task has ended already.
        drop(self.orders.send(Order::Stop));
        let [measuring, serving, surveying, wiring, recording] = self.threads;
        let join = |thread| join_while(thread, until, &self.progress, &|| true);
        // A thread that only computes may end with the program.
        join_while(measuring, began + MEASURING, &self.progress, &|| {
            !self.computing.is_under_way()
        });
        // A cycle that has no result by now gets none from the measuring task.
        self.station.event(Event::Stop);
        let _ = self.sockets.send(true);
        join(serving);
        join(wiring);
        // Behind what was ordered before. Where the queue is full the storage hangs.
        let _ = self.ordered.try_send(None);
        join(recording);
        drop(self.survey);
        join(surveying);
        // Last, so that the results of the others are stored.
        let last_seq = self.station.snapshot().result_seq;
        while !self.history.stop(last_seq) && Instant::now() < until {
            std::thread::sleep(POLLING);
        }
        join(self.writing);
    }
}

/// Waits for a thread to end as long as it is `needed`, until `until` at most: a thread that hangs
/// in a device or the storage must not keep the program alive.
fn join_while(
    thread: JoinHandle<()>,
    until: Instant,
    progress: &Progress,
    needed: &dyn Fn() -> bool,
) {
    while !thread.is_finished() {
        if !needed() {
            return;
        }
        if Instant::now() > until {
            let name = thread.thread().name().unwrap_or_default();
            progress.warn(&format!(
                "the thread {name} does not end and is left behind"
            ));
            return;
        }
        std::thread::sleep(POLLING);
    }
    // The message of a panic is in the log already.
    drop(thread.join());
}
