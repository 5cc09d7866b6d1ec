//! The history's thread: takes results from a bounded queue and writes them into the database.

use super::entry::Entry;
use super::keeper::{self, Keeper, Keeping};
use super::mark::Mark;
pub(super) use super::message::Message;
use super::recordings::{FailedPart, seq_of};
use super::seqs::{self, Numbering, Reserving, Seqs};
use super::spool::Spool;
use super::syncing::{self, Syncer, Syncing};
use super::unkept::Unkept;
use super::writer::{Opening, Writer};
use super::{Bounds, DATABASE, HistoryError, RECORDINGS, Reader};
use crate::recipe::Store;
use crate::station::{Event, ResultRecord, StationHandle, Unstored, Verdict};
use std::collections::VecDeque;
use std::os::unix::fs::MetadataExt as _;
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, PoisonError, RwLock};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

/// Results that may wait for the card before the newest are lost to the history: half a minute of a fast line.
const MAX_WAITING: usize = 256;
/// A card that refuses is asked again this often.
const RETRY: Duration = Duration::from_secs(1);
/// Longest wait of a sign-in for its time to be stored.
const DATING: Duration = Duration::from_secs(2);
/// When the daemon ends, a recording that is being written has this long.
const LAST_PART: Duration = Duration::from_secs(1);

/// The way to the history's thread for station and measuring task. Nothing here waits. Cheap to clone.
#[derive(Clone)]
pub struct History {
    queue: SyncSender<Message>,
    shared: Arc<Shared>,
    spool: Option<Arc<Spool>>,
    run: u32,
    seqs: Seqs,
    keeper: Keeper,
    reader: Reader,
}

#[derive(Default)]
struct Shared {
    /// Results that found the queue full.
    lost: AtomicU32,
    /// Why the history is not being written, while it is not.
    problem: RwLock<Option<Arc<str>>>,
}

/// The thread's own side.
pub struct Task {
    inbox: Receiver<Message>,
    shared: Arc<Shared>,
    spool: Option<Arc<Spool>>,
    seqs: Seqs,
    reserving: Option<Reserving>,
    writer: Writer,
    keeper: Keeper,
    keeping: Option<Keeping>,
    syncer: Syncer,
    syncing: Option<Syncing>,
    /// Why the card did not take what was written, while it does not.
    unsynced: Option<String>,
    /// Results that the database has not taken yet, oldest first.
    waiting: VecDeque<Entry>,
    lost_before: u32,
}

/// Opens the history of a state folder. Answers with the way to it, its thread's side, the SEQ of the next result, and what
/// had to be set aside.
///
/// # Errors
/// If database, folder or counter can neither be opened nor begun.
pub fn open(
    state: &Path,
    numbering: Numbering,
    bounds: Bounds,
) -> Result<(History, Task, u32, Option<String>), HistoryError> {
    let failed = |what: &str, error: std::io::Error| HistoryError {
        path: state.join(what),
        reason: format!("{error}: free space"),
        damaged: false,
    };
    let Opening {
        mut writer,
        complaint,
    } = Writer::open(&state.join(DATABASE), bounds.results)?;
    let owner = std::fs::metadata(state).map_err(|error| failed("", error))?;
    let mark = Mark::open(&numbering.serial, owner.uid()).ok();
    let marked = mark.as_ref().and_then(Mark::read);
    let next = seqs::next_after(numbering.counted, marked);
    // A counter that was lost or taken from an older copy of the folder must not bring back a number.
    let next = match writer.last_seq()? {
        Some(last) if last.wrapping_sub(next) as i32 >= 0 => last.wrapping_add(1),
        _ => next,
    };
    let Numbering {
        counter,
        run,
        counted,
        serial,
    } = numbering;
    let spool = Spool::open(&serial, owner.uid()).ok().map(Arc::new);
    let waiting = match (&spool, counted.run) {
        // Run 0 means that none was recorded.
        (None, _) | (_, 0) => VecDeque::new(),
        (Some(spool), before) => recover(&mut writer, spool, (before, run))?,
    };
    let seqs = Seqs::reserve(counter, mark, run, next);
    let (seqs, reserving) = seqs.map_err(|error| failed("result-seq", error))?;
    let (queue, inbox) = sync_channel(MAX_WAITING);
    let (keeper, keeping) = keeper::open(
        &state.join(RECORDINGS),
        Store::at(&state.join("recipes")),
        bounds.recordings,
        queue.clone(),
    )
    .map_err(|error| failed(RECORDINGS, error))?;
    let shared = Arc::new(Shared::default());
    let (syncer, syncing) = syncing::open(&state.join(DATABASE), queue.clone());
    let history = History {
        queue,
        shared: shared.clone(),
        spool: spool.clone(),
        run,
        seqs: seqs.clone(),
        reader: Reader::of(state),
        keeper: keeper.clone(),
    };
    let task = Task {
        inbox,
        shared,
        spool,
        seqs,
        reserving: Some(reserving),
        writer,
        keeper,
        keeping: Some(keeping),
        syncer,
        syncing: Some(syncing),
        unsynced: None,
        waiting,
        lost_before: 0,
    };
    Ok((history, task, next, complaint))
}

/// Stores what the run before showed and the database lacks, where it ended without a stop. The answer is what the database
/// does not take yet; it is handed on to the next run.
fn recover(
    writer: &mut Writer,
    spool: &Spool,
    (before, run): (u32, u32),
) -> Result<VecDeque<Entry>, HistoryError> {
    let left = spool.left(before, writer.last_seq()?);
    if left.is_empty() || writer.store(left.iter()).is_ok() {
        return Ok(VecDeque::new());
    }
    for entry in &left {
        // A system without memory loses what it would have lost without a spool.
        let _ = spool.put(run, entry);
    }
    Ok(left.into())
}

impl History {
    /// Hands over a result that is being published.
    pub fn record(&self, record: &ResultRecord) {
        let entry = Entry::of(record);
        if let Some(spool) = &self.spool {
            // A result that did not go in is as safe as its way to the database.
            let _ = spool.put(self.run, &entry);
        }
        let message = Message::Result(Box::new(entry));
        if self.queue.try_send(message).is_err() {
            self.shared.lost.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Hands over the frames of a part, made by `part`, if it did not pass; after its result. Where those of another are
    /// still being written these are not kept, and the history says so: the line goes on.
    pub fn keep(&self, record: &ResultRecord, part: impl FnOnce() -> FailedPart) {
        let failed = matches!(record.verdict, Verdict::Fail | Verdict::Invalid);
        if let (true, seq) = (failed, record.seq)
            && let Err(why) = self.keeper.keep(part)
        {
            let problem = None;
            // A queue that is full has lost results as well, and says so.
            let _ = self.queue.try_send(Message::NotKept { seq, why, problem });
        }
    }

    /// Stores when this start of the daemon, BOOT_ID, was by the clock of a signed-in user's browser; waits until that is done
    /// and answers whether it is.
    pub fn date(&self, boot_id: u32, utc_us: u64) -> bool {
        let (stored, done) = sync_channel(1);
        let dated = Message::Dated {
            boot_id: format!("{boot_id:08x}"),
            utc_us,
            stored,
        };
        self.queue.try_send(dated).is_ok() && done.recv_timeout(DATING).is_ok()
    }

    /// Takes a SEQ into use.
    ///
    /// # Errors
    /// No number is reserved after it. The card is asked for more, and the station hears when it has answered.
    pub fn take(&self, seq: u32) -> Result<(), Unstored> {
        self.seqs.take(seq)
    }

    /// Results that the history has lost since the start because the card did not keep up.
    pub fn lost(&self) -> u32 {
        self.shared.lost.load(Ordering::Relaxed)
    }

    /// Why the history is not being written, while it is not.
    pub fn problem(&self) -> Option<Arc<str>> {
        let problem = self.shared.problem.read();
        problem.unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// A reader of what is stored.
    pub fn reader(&self) -> &Reader {
        &self.reader
    }

    /// Ends the thread once it has stored what it can; `last_seq` is the last of all.
    pub fn stop(&self, last_seq: u32) {
        // A thread that is gone has stopped.
        let _ = self.queue.send(Message::Stop { last_seq });
    }
}

impl Task {
    /// Works until told to stop. Problems are told to the station, which warns of them.
    pub fn run(mut self, station: &StationHandle) {
        let keeping = self.keep_parts();
        let mut syncing = self.sync();
        let mut reserving = self.reserve(station);
        // When it ends, whatever the keeper still writes: half a recording is removed at the next start.
        let mut stopping: Option<Instant> = None;
        loop {
            let message =
                if self.waiting.is_empty() && self.problem().is_none() && stopping.is_none() {
                    self.inbox
                        .recv()
                        .map_err(|_| RecvTimeoutError::Disconnected)
                } else {
                    self.inbox.recv_timeout(RETRY)
                };
            let mut next = match message {
                Ok(message) => Some(message),
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => break,
            };
            let mut news = Vec::new();
            while let Some(message) = next {
                match message {
                    Message::Result(entry) => self.queue(*entry),
                    news_of_parts => news.push(news_of_parts),
                }
                next = self.inbox.try_recv().ok();
            }
            let mut problem = self.flush();
            let kept = || keeping.as_ref().is_none_or(JoinHandle::is_finished);
            let mut ended = stopping.is_some_and(|until| Instant::now() >= until || kept());
            for message in news {
                match message {
                    Message::Kept { seq, name } => problem = problem.or(self.link(seq, name)),
                    Message::NotKept {
                        seq,
                        why,
                        problem: words,
                    } => problem = problem.or(words).or(self.leave_out(seq, &why)),
                    // A link to nothing is removed at the next start at the latest.
                    Message::Removed { name, why } => drop(self.writer.unlink(&name, &why)),
                    Message::Dated {
                        boot_id,
                        utc_us,
                        stored,
                    } => match self.writer.date(&boot_id, utc_us) {
                        // The requester may have given up.
                        Ok(()) => drop(stored.send(())),
                        Err(error) => problem = problem.or(Some(error.to_string())),
                    },
                    Message::Stop { last_seq } => {
                        self.syncer.stop();
                        self.seqs.stop();
                        drop(syncing.take().map(JoinHandle::join));
                        drop(reserving.take().map(JoinHandle::join));
                        // Not settled, the reservation is skipped at the next start: nothing is used twice.
                        let _ = self.seqs.settle(last_seq);
                        if let Some(spool) = self.spool.as_ref().filter(|_| self.waiting.is_empty())
                        {
                            spool.remove();
                        }
                        self.keeper.stop();
                        stopping = Some(Instant::now() + LAST_PART);
                    }
                    Message::Synced { problem: found } => {
                        problem = problem.or(found.clone());
                        self.unsynced = found;
                    }
                    Message::KeeperEnded => ended = true,
                    Message::Result(_) => {}
                }
            }
            if ended {
                break;
            }
            self.tell(problem, station);
        }
    }

    /// Starts the thread that waits for the card.
    fn sync(&mut self) -> Option<JoinHandle<()>> {
        let syncing = self.syncing.take()?;
        let run = move || syncing.run();
        Builder::new().name("syncing".into()).spawn(run).ok()
    }

    /// Starts the thread that reserves numbers.
    fn reserve(&mut self, station: &StationHandle) -> Option<JoinHandle<()>> {
        let reserving = self.reserving.take()?;
        let station = station.clone();
        let again = move |seq| {
            station.event(Event::Stored { seq, failed: None });
        };
        let run = move || reserving.run(again);
        Builder::new().name("reserving".into()).spawn(run).ok()
    }

    /// Starts the thread that keeps recordings.
    fn keep_parts(&mut self) -> Option<JoinHandle<()>> {
        let keeping = self.keeping.take()?;
        self.reconcile(&keeping);
        // A system without threads has not come this far; without this one no frames are kept.
        Builder::new()
            .name("recordings".into())
            .spawn(move || keeping.run())
            .ok()
    }

    fn queue(&mut self, entry: Entry) {
        if self.waiting.len() == MAX_WAITING {
            self.waiting.pop_front();
            self.shared.lost.fetch_add(1, Ordering::Relaxed);
        }
        self.waiting.push_back(entry);
    }

    /// Stores what waits; what did not go, in words.
    fn flush(&mut self) -> Option<String> {
        let mut problem = self.unsynced.clone().or_else(|| self.seqs.refused());
        if !self.waiting.is_empty() {
            let stored = self.store();
            self.syncer.wake();
            match stored {
                Ok(begun) => {
                    self.waiting.clear();
                    problem = begun.or(problem);
                }
                Err(error) => problem = Some(format!("{error}: free space")),
            }
        }
        let lost = self.shared.lost.load(Ordering::Relaxed);
        let more = lost.wrapping_sub(std::mem::replace(&mut self.lost_before, lost));
        let slow =
            || format!("{more} results are not in the history: the storage is too slow or full");
        problem.or_else(|| (more > 0).then(slow))
    }

    /// Stores what waits, if need be in a new database: then a line that says so.
    fn store(&mut self) -> Result<Option<String>, HistoryError> {
        let begun = match self.writer.store(self.waiting.iter()) {
            Ok(()) => return Ok(None),
            Err(error) if error.damaged => Some(self.writer.begin_anew(&error)?),
            Err(error) => {
                self.keeper.make_room();
                return Err(error);
            }
        };
        self.writer.store(self.waiting.iter())?;
        Ok(begun)
    }

    /// Notes where the frames of a result are; what did not go, in words.
    fn link(&mut self, seq: u32, name: String) -> Option<String> {
        if let Some(entry) = self.waiting.iter_mut().find(|entry| entry.seq == seq) {
            entry.recording = Some(name);
            return None;
        }
        let linked = self.writer.link(seq, &name);
        linked.err().map(|error| error.to_string())
    }

    /// Notes why the frames of a result are not kept; what did not go, in words.
    fn leave_out(&mut self, seq: u32, why: &Unkept) -> Option<String> {
        if let Some(entry) = self.waiting.iter_mut().find(|entry| entry.seq == seq) {
            entry.unkept = Some(why.to_string());
            return None;
        }
        let noted = self.writer.leave_out(seq, why);
        noted.err().map(|error| error.to_string())
    }

    /// Makes links and recordings agree after an end without a stop.
    fn reconcile(&mut self, keeping: &Keeping) {
        let linked = self.writer.linked().unwrap_or_default();
        for name in &linked {
            if !keeping.recordings().names().any(|kept| kept == name) {
                let _ = self.writer.unlink(name, &Unkept::Gone);
            }
        }
        for name in keeping.recordings().names() {
            if let Some(seq) = seq_of(name)
                && !linked.iter().any(|linked| linked == name)
            {
                let _ = self.writer.link(seq, name);
            }
        }
    }

    fn problem(&self) -> Option<Arc<str>> {
        let problem = self.shared.problem.read();
        problem.unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Tells the station when the history begins to fail and when it works again.
    fn tell(&mut self, problem: Option<String>, station: &StationHandle) {
        let problem: Option<Arc<str>> = problem.map(Arc::from);
        if problem == self.problem() {
            return;
        }
        let mut shown = self
            .shared
            .problem
            .write()
            .unwrap_or_else(PoisonError::into_inner);
        *shown = problem.clone();
        drop(shown);
        station.event(Event::History { problem });
    }
}
