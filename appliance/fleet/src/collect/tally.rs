//! How the collecting goes: counts, told now and then.

use crate::log::{self, Severity};
use serde_json::json;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
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
    /// Heads that answered the last question.
    pub(super) answering: AtomicU64,
    /// Heads that did not.
    pub(super) failing: AtomicU64,
}

impl Tally {
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
            let [rows, answering, failing] =
                [&self.rows, &self.answering, &self.failing].map(|count| count.load(Relaxed));
            let per_s = (rows - before) as f64 / since.elapsed().as_secs_f64();
            (before, since) = (rows, Instant::now());
            if as_json {
                let rate = (per_s * 10.0).round() / 10.0;
                say!(
                    "{}",
                    json!({ "answering": answering, "failing": failing, "rows": rows, "rows_per_s": rate })
                );
            } else {
                let words = format!(
                    "{answering} heads answer, {failing} do not; {rows} results, {per_s:.0} per s"
                );
                log::write(Severity::Info, &words);
            }
        }
    }
}
