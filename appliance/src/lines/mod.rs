//! Digital lines: start in, and busy, ok and fault out, for presses without Modbus and for lamps.
//!
//! One thread serves them. It blocks only on its own chip, and on the station's lock for one step of
//! another event. It gets snapshots through a channel that keeps only the latest, so no other thread
//! waits for it.
//!
//! It follows the station's snapshots, as Modbus and the page do, and its
//! start is a trigger by edge, as the page's is. When the GPIO chip is lost it is opened again
//! until that succeeds; meanwhile pull resistors hold the fault line on.

use crate::error::Result;
use crate::production::backend::Wires;
use crate::station::control::TRIGGER;
use crate::station::snapshot::status;
use crate::station::{Client, ControlWrite, Event, Snapshot, StationHandle, Verdict};
use crate::system::progress::Progress;
use crate::system::runtime;
use hal::clock::monotonic;
use hal::error::Error;
use hal::lines::StartLine;
use hal::units::Timestamp;
use std::future::pending;
use std::os::fd::OwnedFd;
use std::time::Duration;
use tokio::io::unix::AsyncFd;
use tokio::sync::watch;

/// Wait before the first attempt to open the lines again; it doubles with each attempt.
const FIRST_WAIT: Duration = Duration::from_millis(100);
/// Longest of these waits.
const LONGEST_WAIT: Duration = Duration::from_secs(2);

/// Opens the lines again.
pub type Reopen = Box<dyn Fn() -> Result<Wires> + Send + Sync>;

/// Serves the lines until `stopped` is true; then they are released.
///
/// # Errors
/// If the system gives no runtime.
pub fn serve(
    wires: Wires,
    open: &Reopen,
    station: &StationHandle,
    progress: &Progress,
    mut stopped: watch::Receiver<bool>,
) -> Result<()> {
    runtime()?.block_on(async {
        let stop = stopped.wait_for(|stop| *stop);
        tokio::select! {
            // An error means that the daemon itself is gone: stop as well.
            _ = stop => {}
            () = follow(wires, open, station, progress) => {}
        }
    });
    Ok(())
}

/// Follows the station for ever, and opens the lines again when they fail.
async fn follow(mut wires: Wires, open: &Reopen, station: &StationHandle, progress: &Progress) {
    loop {
        if let Err(error) = wires.follow(station).await {
            progress.log(&format!("{error}; opened again when it is there"));
        }
        drop(wires);
        wires = reopened(open, progress).await;
        progress.log("the lines are there again");
    }
}

async fn reopened(open: &Reopen, progress: &Progress) -> Wires {
    let (mut wait, mut said) = (FIRST_WAIT, String::new());
    loop {
        tokio::time::sleep(wait).await;
        wait = (2 * wait).min(LONGEST_WAIT);
        match open() {
            Ok(wires) => return wires,
            Err(failure) if failure.to_string() != said => {
                said = failure.to_string();
                progress.log(&said);
            }
            Err(_) => {}
        }
    }
}

impl Wires {
    /// Follows the station until a line fails.
    async fn follow(&mut self, station: &StationHandle) -> Result<(), Error> {
        if self.none() {
            pending::<()>().await;
        }
        let mut snapshots = station.subscribe();
        let first = snapshots.borrow_and_update().clone();
        let (mut follower, signals) = Follower::new(&first);
        self.say(signals)?;
        let descriptor = self.start.as_deref().map(descriptor).transpose()?;
        loop {
            tokio::select! {
                changed = snapshots.changed() => {
                    let snapshot = snapshots.borrow_and_update().clone();
                    for signals in follower.follow(&snapshot) {
                        self.say(signals)?;
                    }
                    if changed.is_err() {
                        // The station is gone; the stop follows.
                        pending::<()>().await;
                    }
                }
                () = moved(descriptor.as_ref(), self.start.as_deref().and_then(StartLine::settles)) => {
                    self.started(station)?;
                }
            }
        }
    }

    fn none(&self) -> bool {
        let outputs = [&self.busy, &self.ok, &self.fault];
        self.start.is_none() && outputs.into_iter().all(Option::is_none)
    }

    /// Takes the starts that have come.
    fn started(&mut self, station: &StationHandle) -> Result<(), Error> {
        let Some(start) = &mut self.start else {
            return Ok(());
        };
        while start.poll_start()?.is_some() {
            // An edge without a write: the registers of the PLC stay as it wrote them.
            let (write, rising) = (ControlWrite::default(), TRIGGER);
            station.event(Event::Write {
                write,
                rising,
                client: Client::Line,
            });
        }
        Ok(())
    }

    /// Sets the lines. Busy is set last, so that ok and fault are right when it falls.
    fn say(&mut self, signals: Signals) -> Result<(), Error> {
        let Signals { busy, ok, fault } = signals;
        for (line, on) in [
            (&mut self.ok, ok),
            (&mut self.fault, fault),
            (&mut self.busy, busy),
        ] {
            if let Some(line) = line {
                line.set(on)?;
            }
        }
        Ok(())
    }
}

/// The start line's descriptor, to wait for.
#[expect(
    deprecated,
    reason = "unsound for a value that does not own its descriptor; this one does"
)]
fn descriptor(start: &dyn StartLine) -> Result<AsyncFd<OwnedFd>, Error> {
    let own = start.as_fd().try_clone_to_owned();
    own.and_then(AsyncFd::new).map_err(|error| {
        let remedy = "raise the limit of open files of the service";
        Error::unsupported(format!("waiting for the start line: {error}"), remedy)
    })
}

/// Waits until the start line has edges, or may have settled.
async fn moved(descriptor: Option<&AsyncFd<OwnedFd>>, settles: Option<Timestamp>) {
    let edges = async {
        match descriptor {
            // The caller takes all edges, so the descriptor is not readable until others come.
            Some(descriptor) => {
                if let Ok(mut ready) = descriptor.readable().await {
                    ready.clear_ready();
                }
            }
            None => pending().await,
        }
    };
    let still = async {
        match settles {
            Some(at) => tokio::time::sleep(at.since(monotonic())).await,
            None => pending().await,
        }
    };
    tokio::select! { () = edges => {} () = still => {} }
}

/// The output lines. A start is taken exactly while busy and fault are both off.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Signals {
    /// The station measures, loads, teaches, starts or stops.
    pub busy: bool,
    /// The part of the last start was measured and passed.
    pub ok: bool,
    /// The station is idle, but takes no start: somebody has to do something first.
    pub fault: bool,
}

/// Follows a station. Ok is never on for a part that was not measured: not for the part before, nor
/// for one whose start was missed.
#[derive(Clone, Copy, Debug)]
pub struct Follower {
    seq: u32,
    missed: u32,
    passed: bool,
    said: Signals,
}

impl Follower {
    /// Starts with a snapshot and its signals. Its result is of an earlier part, so it does not
    /// count.
    pub fn new(snapshot: &Snapshot) -> (Self, Signals) {
        let mut follower = Self {
            seq: snapshot.result_seq,
            missed: snapshot.missed,
            passed: false,
            said: Signals::default(),
        };
        follower.said = follower.signals(snapshot);
        (follower, follower.said)
    }

    /// The signals to set after this snapshot, in order; none if nothing changed. Snapshots in
    /// between may be missing.
    pub fn follow(&mut self, snapshot: &Snapshot) -> impl Iterator<Item = Signals> + use<> {
        let finished = snapshot.result_seq != self.seq;
        let missed = snapshot.missed != self.missed;
        let verdict = snapshot.result.as_ref().map(|result| result.verdict);
        if finished {
            self.passed = verdict == Some(Verdict::Pass);
        }
        // Work in this snapshot is on a later part.
        self.passed &= !snapshot.is_working() && !missed;
        (self.seq, self.missed) = (snapshot.result_seq, snapshot.missed);
        // A whole cycle may pass between two snapshots; a machine that waits for busy must still
        // see it.
        let unseen = (finished && !self.said.busy).then_some(Signals {
            busy: true,
            ..Signals::default()
        });
        let signals = self.signals(snapshot);
        self.passed &= !signals.fault;
        let changed = (unseen.is_some() || signals != self.said).then_some(signals);
        self.said = signals;
        unseen.into_iter().chain(changed)
    }

    fn signals(&self, snapshot: &Snapshot) -> Signals {
        let busy = snapshot.is_working();
        let fault = !busy && !snapshot.is(status::READY);
        Signals {
            busy,
            ok: self.passed && !busy && !fault,
            fault,
        }
    }
}

#[cfg(test)]
mod tests;
