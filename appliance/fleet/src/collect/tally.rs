//! How the collecting goes: counts, told now and then.

use crate::log::{self, Severity};
use serde_json::json;
use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;
use tokio::time::{Instant, interval};

/// Time between two lines.
const PERIOD: Duration = Duration::from_secs(10);
/// Of so many lines people get one.
const FEWER: u64 = 6;

/// Counts since the start.
#[derive(Debug, Default)]
pub(super) struct Tally {
    /// Results that were written, those that the store had already included.
    pub(super) rows: AtomicU64,
    /// Whether the head of each address answered the last question.
    answers: Mutex<HashMap<String, bool>>,
}

impl Tally {
    /// Counts a head among those that answer, those that do not, or neither; answers whether that is
    /// new.
    pub(super) fn note(&self, url: &str, now: Option<bool>) -> bool {
        let mut answers = self.answers.lock().unwrap_or_else(PoisonError::into_inner);
        now != match now {
            Some(now) => answers.insert(url.to_owned(), now),
            None => answers.remove(url),
        }
    }

    /// How many heads answer, and how many do not.
    fn heads(&self) -> (usize, usize) {
        let answers = self.answers.lock().unwrap_or_else(PoisonError::into_inner);
        let answering = answers.values().filter(|answers| **answers).count();
        (answering, answers.len() - answering)
    }

    /// Tells how it goes for as long as the program runs: as a line of JSON on stdout, or now and
    /// then in words.
    pub(super) async fn tell(&self, as_json: bool) {
        let mut ticks = interval(PERIOD);
        let (mut before, mut since) = (0, Instant::now());
        for tick in 0u64.. {
            ticks.tick().await;
            if tick == 0 || !(as_json || tick.is_multiple_of(FEWER)) {
                continue;
            }
            let (rows, (answering, failing)) = (self.rows.load(Relaxed), self.heads());
            let per_s = (rows - before) as f64 / since.elapsed().as_secs_f64();
            (before, since) = (rows, Instant::now());
            if as_json {
                let rate = (per_s * 10.0).round() / 10.0;
                let counts = json!({ "answering": answering, "failing": failing, "rows": rows, "rows_per_s": rate });
                say!("{counts}");
            } else {
                log::write(
                    Severity::Info,
                    format_args!(
                        "{answering} heads answer, {failing} do not; {rows} results, {per_s:.0} per s"
                    ),
                );
            }
        }
    }
}
