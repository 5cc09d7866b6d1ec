//! Puts what the heads bring into batches, and writes each until it is written.

use super::tally::Tally;
use super::{LONGEST, poll};
use crate::log::{self, Severity};
use crate::store::{Batch, Store};
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;
use tokio::sync::mpsc::Receiver;
use tokio::time::{Instant, sleep, timeout_at};

/// The most results of a batch.
const MOST: usize = 10_000;
/// Longest time that a result waits for others: with the pause between two questions, and the
/// writing, a result is in the store within two seconds.
const GATHERING: Duration = Duration::from_millis(500);

/// Writes until all tasks that fetch have ended and everything is written.
pub(super) async fn write(store: &mut Store, mut incoming: Receiver<Batch>, tally: &Tally) {
    while let Some(mut batch) = incoming.recv().await {
        let until = Instant::now() + GATHERING;
        while batch.rows.len() + poll::PIECE <= MOST {
            match timeout_at(until, incoming.recv()).await {
                Ok(Some(more)) => {
                    batch.rows.extend(more.rows);
                    batch.gaps.extend(more.gaps);
                    batch.heads.extend(more.heads);
                }
                Ok(None) | Err(_) => break,
            }
        }
        let mut pause = Duration::from_millis(500);
        let mut complained = false;
        while let Err(words) = store.write(&batch).await {
            if !complained {
                let words = format!("write results: {words}: it is tried again until it works");
                log::write(Severity::Warning, &words);
            }
            complained = true;
            sleep(pause).await;
            pause = (2 * pause).min(LONGEST);
        }
        if complained {
            log::write(Severity::Info, "results are written again");
        }
        tally.rows.fetch_add(batch.rows.len() as u64, Relaxed);
    }
}
