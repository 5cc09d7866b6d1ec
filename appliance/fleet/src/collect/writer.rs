//! Puts what the heads bring into batches, and writes each until it is written.

use super::Tally;
use super::poll::PIECE;
use crate::error::{Exit, Failure};
use crate::log::{self, Severity};
use crate::now_ms;
use crate::store::{Batch, Complaint, Store};
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;
use tokio::sync::mpsc::Receiver;
use tokio::time::{Instant, sleep, timeout_at};

/// The most results of a batch.
const MOST: usize = 10_000;
/// Longest time that a result waits for others: with the pause between two questions, and the
/// writing, a result is in the store within two seconds.
const GATHERING: Duration = Duration::from_millis(500);
/// Pause before a store that does not work is tried again, at first and at most.
const PAUSES: [Duration; 2] = [Duration::from_millis(500), Duration::from_secs(10)];

/// Pause between two looks for results that are older than is kept.
const FORGETTING: Duration = Duration::from_secs(60);

/// Writes until all tasks that fetch have ended and everything is written; what is older than
/// `keep` is deleted.
///
/// # Errors
/// If the store is another one now: what it lacks is only fetched by a collector that begins.
pub(super) async fn write(
    store: &mut Store,
    mut incoming: Receiver<Batch>,
    tally: &Tally,
    keep: Option<Duration>,
) -> Result<(), Failure> {
    let mut forgot: Option<Instant> = None;
    while let Some(mut batch) = incoming.recv().await {
        let until = Instant::now() + GATHERING;
        while batch.rows.len() + PIECE <= MOST
            && let Ok(Some(more)) = timeout_at(until, incoming.recv()).await
        {
            batch.rows.extend(more.rows);
            batch.gaps.extend(more.gaps);
            batch.heads.extend(more.heads);
        }
        if let Some(words) = store.gone() {
            return Exit::Unavailable.fail(words);
        }
        until_it_works("write results", async || store.write(&batch).await).await;
        tally.rows.fetch_add(batch.rows.len() as u64, Relaxed);
        let due = forgot.is_none_or(|forgot| forgot.elapsed() >= FORGETTING);
        if let Some(keep) = keep.filter(|_| due) {
            let before = (now_ms() / 1000).saturating_sub(keep.as_secs());
            until_it_works("delete old results", async || store.forget(before).await).await;
            forgot = Some(Instant::now());
        }
    }
    Ok(())
}

/// Repeats an attempt on the store until it succeeds. The log has the first failure, and the end.
pub(super) async fn until_it_works<T>(
    what: &str,
    mut attempt: impl AsyncFnMut() -> Result<T, Complaint>,
) -> T {
    let mut pause = PAUSES[0];
    let mut complained = false;
    loop {
        match attempt().await {
            Ok(done) => {
                if complained {
                    log::write(Severity::Info, format_args!("{what}: it works again"));
                }
                return done;
            }
            Err(words) if !complained => log::write(
                Severity::Warning,
                format_args!("{what}: {words}: it is tried again until it works"),
            ),
            Err(_) => {}
        }
        complained = true;
        sleep(pause).await;
        pause = (2 * pause).min(PAUSES[1]);
    }
}
