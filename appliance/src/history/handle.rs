//! How station and measuring task hand over to the history; nothing here waits for the card.

use super::entry::Entry;
use super::keeper::{self, Keeper};
use super::recordings::JudgedPart;
use super::seqs::{AHEAD, Numbering, Seqs};
use super::spool::{SLOTS, Spool, is_after};
use super::task::{MAX_WAITING, Message, Task};
use super::writer::Writer;
use super::{Bounds, DATABASE, HistoryError, RECORDINGS, Result};
use crate::recipe::Store;
use crate::station::{ResultRecord, Unstored, Verdict};
use std::os::unix::fs::MetadataExt as _;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::time::Duration;

/// Longest wait of a sign-in for its time to be stored.
const DATING: Duration = Duration::from_secs(2);

/// As many numbers are skipped where the counter is lost: those of results that were shown and not
/// stored.
const UNKNOWN: u32 = SLOTS + AHEAD;

/// The way to the history's threads. Cheap to clone.
#[derive(Clone)]
pub struct History {
    queue: SyncSender<Message>,
    /// Results that are not in the history because too many waited.
    pub(super) lost: Arc<AtomicU32>,
    pub(super) spool: Option<Arc<Spool>>,
    pub(super) seqs: Seqs,
    pub(super) keeper: Keeper,
}

/// Opens the history of a state folder, and stores what the run before has shown and the database
/// lacks. Answers with the way to it, its thread's side, the SEQ of the next result, and what had
/// to be set aside.
///
/// # Errors
/// If database, folder or counter can neither be opened nor begun.
pub fn open(
    state: &Path,
    numbering: Numbering,
    bounds: Bounds,
) -> Result<(History, Task, u32, Option<String>)> {
    let failed = |what: &str, error: std::io::Error| HistoryError {
        path: state.join(what),
        reason: format!("{error}: free space"),
        aside: None,
    };
    let (mut writer, complaint) = Writer::open(&state.join(DATABASE), bounds.results)?;
    let owner = std::fs::metadata(state).map_err(|error| failed("", error))?;
    // Where the system has no shared memory, or another process has it, a kill skips numbers and
    // loses results that wait.
    let spool = Spool::open(&numbering.serial, owner.uid()).ok();
    let found = spool.as_ref().and_then(|spool| match &numbering.counted {
        Ok(counted) => spool.of_run(counted.run),
        Err(_) => spool.of_any_run(),
    });
    let counted = numbering.counted.clone().unwrap_or_default();
    let (last, mut shown) = found.unwrap_or((counted.last, Vec::new()));
    let stored = writer.last_seq()?;
    shown.retain(|entry| stored.is_none_or(|stored| is_after(entry.seq, stored)));
    // A counter that was lost or taken from an older copy of the folder must not bring back a
    // number.
    let last = stored.filter(|&seq| is_after(seq, last)).unwrap_or(last);
    let lost = numbering.counted.clone().err();
    let skipped = match lost {
        Some(_) => UNKNOWN,
        None => 0,
    };
    let next = last.wrapping_add(skipped).wrapping_add(1);
    let lost = lost.map(|problem| {
        numbering.counter.put_aside();
        format!(
            "{problem}: it is put aside as result-seq.damaged; which results were shown last is not known, so RESULT_SEQ goes on \
             with {next}, behind all that the history has"
        )
    });
    let waiting = match writer.store(shown.iter()) {
        Ok(()) => Vec::new(),
        // It stays in the spool until it is stored.
        Err(_) => shown,
    };
    let numbered = numbering.reserve(spool, next);
    let (seqs, spool) = numbered.map_err(|error| failed("result-seq", error))?;
    let spool = spool.map(Arc::new);
    let (queue, inbox) = sync_channel(MAX_WAITING);
    let recipes = Store::at(&state.join("recipes"));
    let folder = state.join(RECORDINGS);
    let opened = keeper::open(&folder, recipes, bounds.recordings, queue.clone());
    let (keeper, keeping) = opened.map_err(|error| failed(RECORDINGS, error))?;
    let history = History {
        queue,
        lost: Arc::default(),
        spool,
        seqs,
        keeper,
    };
    let task = Task::new(history.clone(), inbox, writer, keeping, waiting);
    let complaints = lost.into_iter().chain(complaint);
    Ok((
        history,
        task,
        next,
        complaints.reduce(|all, more| all + "\n" + &more),
    ))
}

impl History {
    /// Takes a SEQ into use.
    ///
    /// # Errors
    /// No number is reserved after it. The card is asked for more, and the station hears when it
    /// has answered.
    pub fn take(&self, seq: u32) -> Result<(), Unstored> {
        self.seqs.take(seq)
    }

    /// Hands over a result before it is shown.
    pub fn record(&self, record: &ResultRecord) {
        let entry = Entry::of(record);
        if let Some(spool) = &self.spool
            && spool.put(&entry).is_err()
        {
            // Without the newest result it would bring back its number.
            spool.remove();
        }
        let message = Message::Result(Box::new(entry));
        if self.queue.try_send(message).is_err() {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Hands over the frames of a part, made by `part`, if it did not pass; after its result. Where
    /// those of another are still being written these are not kept, and the history says so: the
    /// line goes on.
    pub fn keep(&self, record: &ResultRecord, part: impl FnOnce() -> JudgedPart) {
        let failed = matches!(record.verdict, Verdict::Fail | Verdict::Invalid);
        if failed && let Err(why) = self.keeper.keep(part) {
            let (seq, kept) = (record.seq, Err(why));
            // A queue that is full has lost results as well, and says so.
            let _ = self.queue.try_send(Message::Frames { seq, kept });
        }
    }

    /// Stores when this start of the daemon, BOOT_ID, was by the clock of a signed-in user's
    /// browser; waits until that is done and answers whether it is.
    pub fn date(&self, boot_id: u32, utc_us: u64) -> bool {
        let (stored, done) = sync_channel(1);
        let dated = Message::Dated {
            boot_id: format!("{boot_id:08x}"),
            utc_us,
            stored,
        };
        self.queue.try_send(dated).is_ok() && done.recv_timeout(DATING).is_ok()
    }

    /// Results that the history has lost since the start because the card did not keep up.
    pub fn lost(&self) -> u32 {
        self.lost.load(Ordering::Relaxed)
    }

    /// Ends the threads once they have stored what they can; `last_seq` is the last of all. Answers
    /// whether they will: not while a card that hangs has filled the queue.
    pub fn stop(&self, last_seq: u32) -> bool {
        // A thread that is gone has stopped.
        let stop = self.queue.try_send(Message::Stop { last_seq });
        !matches!(stop, Err(TrySendError::Full(_)))
    }
}
