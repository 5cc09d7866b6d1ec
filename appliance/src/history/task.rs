//! The history's thread: takes results from a bounded queue and stores them. Each commit waits for
//! the card; results that come meanwhile go into the next one together.
//!
//! While the card hangs, 512 results wait for the database; later ones are lost to the history and
//! counted. Cycles go on with the numbers that are reserved, then fault 603 until the card answers.

use super::HistoryResult;
use super::entry::Entry;
use super::handle::History;
use super::handle::Keeping;
use super::handle::{MAX_WAITING, Message};
use super::recordings::Unkept;
use super::recordings::seq_of;
use super::writer::Writer;
use crate::station::{Event, StationHandle};
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, SyncSender};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

/// When nothing has come for this long, the log is brought into the database, and a card that
/// refused is asked again.
const PAUSE: Duration = Duration::from_secs(1);
/// The log is also brought into the database when it is longer by so many bytes than after the last
/// time.
const STRETCH: u64 = 4 << 20;
/// A log that is longer than this is a warning.
const TOO_LONG: u64 = 32 << 20;
/// When the daemon ends, a recording that is being written has this long.
const LAST_PART: Duration = Duration::from_secs(1);

/// What the thread `history` owns.
pub struct Task {
    history: History,
    inbox: Receiver<Message>,
    writer: Writer,
    keeping: Option<Keeping>,
    /// Results that the database has not taken yet, oldest first.
    waiting: VecDeque<Entry>,
    /// From which length on the log is brought into the database.
    due: u64,
    /// Who waits until everything before is stored.
    asking: Vec<SyncSender<()>>,
    /// Lost results that were reported to the station.
    lost_before: u32,
    /// The problem that was reported to the station last.
    problem: Option<Arc<str>>,
}

impl Task {
    pub(super) fn new(
        history: History,
        inbox: Receiver<Message>,
        writer: Writer,
        keeping: Keeping,
        waiting: Vec<Entry>,
    ) -> Self {
        Self {
            history,
            inbox,
            writer,
            keeping: Some(keeping),
            waiting: waiting.into(),
            due: STRETCH,
            asking: Vec::new(),
            lost_before: 0,
            problem: None,
        }
    }

    /// Works until [`History::stop`]. Problems go to the station, which warns of them.
    pub fn run(mut self, station: &StationHandle) {
        self.reconcile();
        let keeping = self.keeping.take();
        // Where the system has no more threads, no frames are kept.
        let keeping = keeping.and_then(|keeping| start("recordings", move || keeping.run()));
        let (seqs, waiting) = (self.history.seqs.clone(), station.clone());
        let again = move |seq| drop(waiting.event(Event::Stored { seq, failed: None }));
        let reserving = start("reserving", move || seqs.run(again));
        let mut settled = false;
        loop {
            // The queue never closes: `self.history` is one of its senders.
            let first = match settled {
                true => self.inbox.recv().ok(),
                false => self.inbox.recv_timeout(PAUSE).ok(),
            };
            let messages: Vec<_> = first.into_iter().chain(self.inbox.try_iter()).collect();
            let paused = messages.is_empty();
            let (mut problem, mut stop) = (None, None);
            for message in messages {
                match message {
                    Message::Stop { last_seq } => stop = Some(last_seq),
                    message => problem = problem.or(self.take(message)),
                }
            }
            let problem = self.flush(paused).or(problem);
            if let Some(last_seq) = stop {
                return self.end(last_seq, reserving, keeping);
            }
            settled = paused && problem.is_none();
            self.report(problem, station);
        }
    }

    /// Takes a message; what went wrong, in words.
    fn take(&mut self, message: Message) -> Option<String> {
        let done = match message {
            Message::Result(entry) => {
                if self.waiting.len() == MAX_WAITING {
                    self.waiting.pop_front();
                    self.history.lost.fetch_add(1, Ordering::Relaxed);
                }
                self.waiting.push_back(*entry);
                Ok(())
            }
            Message::Frames { seq, kept } => {
                let noted = self.note(seq, &kept);
                if let Some(words) = kept.err().and_then(|why| why.problem().map(str::to_owned)) {
                    return Some(words);
                }
                noted
            }
            Message::Removed { name, why } => {
                // A link to nothing is removed at the next start at the latest.
                let _ = self.writer.unlink(&name, &why);
                Ok(())
            }
            Message::Dated {
                boot_id,
                utc_us,
                stored,
            } => {
                self.writer.date(&boot_id, utc_us).map(|()| {
                    // The sign-in may have given up waiting.
                    let _ = stored.send(());
                })
            }
            Message::Reached(stored) => {
                self.asking.push(stored);
                Ok(())
            }
            Message::Stop { .. } | Message::RecordingsEnded => Ok(()),
        };
        done.err().map(|error| error.to_string())
    }

    /// Notes where the frames of a result are, or why they are not kept.
    fn note(&mut self, seq: u32, kept: &Result<String, Unkept>) -> HistoryResult<()> {
        let waiting = self.waiting.iter_mut().find(|entry| entry.seq == seq);
        match (waiting, kept) {
            (Some(entry), Ok(name)) => entry.recording = Some(name.clone()),
            (Some(entry), Err(why)) => entry.unkept = Some(why.to_string()),
            (None, Ok(name)) => self.writer.link(seq, name)?,
            (None, Err(why)) => self.writer.leave_out(seq, why)?,
        }
        Ok(())
    }

    /// Stores what waits and bounds the log; what went wrong, in words. `paused`: nothing has come
    /// for a while.
    fn flush(&mut self, paused: bool) -> Option<String> {
        let stored = match self.store() {
            Ok(begun) => {
                self.waiting.clear();
                // Whoever asked may have given up waiting.
                for asked in self.asking.drain(..) {
                    let _ = asked.send(());
                }
                begun.or(self.bound_log(paused))
            }
            Err(error) => {
                self.asking.clear();
                Some(format!("{error}: free space"))
            }
        };
        let lost = self.history.lost();
        let more = lost.wrapping_sub(std::mem::replace(&mut self.lost_before, lost));
        let slow =
            || format!("{more} results are not in the history: the storage is too slow or full");
        let refused = stored.or_else(|| self.history.seqs.refused());
        refused.or_else(|| (more > 0).then(slow))
    }

    /// Stores what waits, if need be in a new database: then a line that says so.
    fn store(&mut self) -> HistoryResult<Option<String>> {
        if self.waiting.is_empty() {
            return Ok(None);
        }
        let begun = match self.writer.store(self.waiting.iter()) {
            Ok(()) => return Ok(None),
            Err(error) if error.aside.is_some() => self.writer.begin_anew(&error)?,
            Err(error) => {
                self.history.keeper.make_room();
                return Err(error);
            }
        };
        self.writer.store(self.waiting.iter())?;
        Ok(Some(begun))
    }

    /// Brings the log into the database where it has grown or nothing comes; what is wrong with it,
    /// in words.
    fn bound_log(&mut self, paused: bool) -> Option<String> {
        if paused || self.writer.log_bytes() >= self.due {
            let brought = self.writer.checkpoint();
            self.due = self.writer.log_bytes() + STRETCH;
            if let Err(error) = brought {
                return Some(format!("sync the history: {error}: free space"));
            }
        }
        (self.writer.log_bytes() > TOO_LONG).then(|| {
            format!(
                "{} has more than {} MiB: another program reads the history without an end, or the storage is too slow: \
                 end that program, or trigger more slowly",
                self.writer.log().display(),
                TOO_LONG >> 20
            )
        })
    }

    /// Gives back numbers that were not used, and waits for the recording that is being written:
    /// half of one is removed at the next start.
    fn end(
        mut self,
        last_seq: u32,
        reserving: Option<JoinHandle<()>>,
        keeping: Option<JoinHandle<()>>,
    ) {
        let History {
            seqs,
            spool,
            keeper,
            ..
        } = self.history.clone();
        seqs.stop();
        drop(reserving.map(JoinHandle::join));
        // Not settled, the reservation is skipped at the next start: no number is used twice.
        let settled = seqs.settle(last_seq).is_ok();
        if settled && self.waiting.is_empty() {
            spool.inspect(|spool| spool.remove());
        }
        keeper.stop();
        let until = Instant::now() + LAST_PART;
        while keeping.is_some() {
            let left = until.saturating_duration_since(Instant::now());
            match self.inbox.recv_timeout(left) {
                Ok(Message::RecordingsEnded) | Err(_) => return,
                // The station ends as well: a problem is not reported any more.
                Ok(message) => drop(self.take(message)),
            }
        }
    }

    /// Makes links and recordings agree after an end without a stop.
    fn reconcile(&mut self) {
        let Some(keeping) = &self.keeping else {
            return;
        };
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

    /// Reports to the station when the history begins to fail and when it works again.
    fn report(&mut self, problem: Option<String>, station: &StationHandle) {
        let problem = problem.map(Arc::from);
        if problem != self.problem {
            self.problem.clone_from(&problem);
            station.event(Event::History { problem });
        }
    }
}

/// Starts a thread, where the system has one more.
fn start(name: &str, run: impl FnOnce() + Send + 'static) -> Option<JoinHandle<()>> {
    Builder::new().name(name.into()).spawn(run).ok()
}
