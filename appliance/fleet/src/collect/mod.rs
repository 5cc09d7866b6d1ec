//! `fringed-fleet collect`: fetches the results of every head and writes them to the store.
//!
//! A task per head asks it once a second for what is behind the last result that was fetched; one
//! writer puts what they bring into batches. All run on one thread. A batch that cannot be written
//! is tried again until it is, and meanwhile the heads, which keep their results, are not asked.
//! Nothing is remembered elsewhere than in the store: a collector that was killed asks it how far
//! each history was fetched.

mod lines;
mod poll;
mod writer;

use crate::config::Fleet;
use crate::error::{Exit, Result};
use crate::log::{self, Severity};
use crate::part::Part;
use crate::store::Store;
use poll::{Plant, Poll};
use serde_json::json;
use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use tokio::time::{Instant, interval, timeout};
use writer::until_it_works;

/// Pieces that wait for the writer.
const WAITING: usize = 32;
/// Longest time for the last batch after a stop.
const STOPPING: Duration = Duration::from_secs(5);

/// Time between two lines about how it goes.
const TELLING: Duration = Duration::from_secs(10);
/// People get one line in this many, programs all.
const FEWER: u64 = 6;

/// Fetch the results of every head and write them to the store, until it is stopped.
#[derive(Debug, clap::Args)]
pub struct Collect {
    #[command(flatten)]
    fleet: Fleet,
    /// Which collector this is of how many, as 2/3: each head is asked by one of them.
    #[arg(long, value_name = "PART", default_value = "1/1")]
    part: Part,
    /// Print how it goes as a line of JSON every 10 s.
    #[arg(long)]
    json: bool,
}

impl Collect {
    /// Collects until SIGTERM or Ctrl-C.
    ///
    /// # Errors
    /// If the configuration is wrong, or the store cannot be what it says.
    pub async fn run(&self) -> Result<()> {
        let config = self.fleet.read()?;
        let heads = config.heads()?.to_vec();
        let mut store = Store::of(config.store()?, config.tls.clone())?;
        let failed = || Exit::Software.because("wait for signals");
        let mut terminated = signal(SignalKind::terminate()).map_err(failed())?;
        let mut interrupted = signal(SignalKind::interrupt()).map_err(failed())?;
        let stop = async {
            tokio::select! {
                _ = terminated.recv() => {}
                _ = interrupted.recv() => {}
            }
        };
        tokio::pin!(stop);
        // The store may start later than its collectors.
        let opening = until_it_works("open the store", async || {
            store.prepare().await?;
            Ok((store.ends().await?, store.heads().await?))
        });
        let (ends, known) = tokio::select! {
            read = opening => read,
            () = &mut stop => return Ok(()),
        };
        let ends = ends
            .into_iter()
            .map(|end| ((end.serial, end.history), end.seq));
        let known = known.into_iter().map(|head| (head.url.clone(), head));
        let mut known: HashMap<_, _> = known.collect();
        let count = heads.len();
        log::write(
            Severity::Info,
            format_args!("{count} heads are asked for results"),
        );
        let plant = Arc::new(Plant {
            config,
            part: self.part,
            ends: ends.collect(),
            places: Mutex::default(),
            tally: Tally::default(),
        });
        let (out, incoming) = mpsc::channel(WAITING);
        let mut asking = JoinSet::new();
        for (at, head) in heads.into_iter().enumerate() {
            // Questions are spread over the pause between two.
            let offset = plant.config.poll.mul_f64(at as f64 / count as f64);
            let state = known.remove(&head.url.to_string()).unwrap_or_default();
            let poll = Poll::new(head, state, plant.clone(), out.clone());
            asking.spawn(poll.run(offset));
        }
        drop(out);
        let writing = writer::write(&mut store, incoming, &plant.tally, plant.config.keep);
        tokio::pin!(writing);
        tokio::select! {
            written = &mut writing => return written,
            () = plant.tally.tell(self.json) => {}
            () = &mut stop => {
                asking.abort_all();
                // What was fetched is written; what is not is fetched by the next collector.
                if timeout(STOPPING, writing).await.is_err() {
                    log::write(Severity::Warning, "stopped before the last results were written: they will be fetched again");
                }
            }
        }
        Ok(())
    }
}

/// How the collecting goes.
#[derive(Debug, Default)]
struct Tally {
    /// Results that were written, those that the store had already included.
    rows: AtomicU64,
    /// Whether the head of each address answered the last question.
    answers: Mutex<HashMap<String, bool>>,
}

impl Tally {
    /// Counts a head among those that answer, those that do not, or neither; answers whether that is
    /// new.
    fn note(&self, url: &str, now: Option<bool>) -> bool {
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
    async fn tell(&self, as_json: bool) {
        let mut ticks = interval(TELLING);
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
