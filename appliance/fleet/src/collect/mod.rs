//! `fringed-fleet collect`: fetches the results of every head and writes them to the store.
//!
//! A task per head asks it once a second for what is behind the last result that was fetched; one
//! writer puts what they bring into batches. All run on one thread. A batch that cannot be written
//! is tried again until it is, and meanwhile the heads, which keep their results, are not asked.
//! Nothing is remembered elsewhere than in the store: a collector that was killed asks it how far
//! each history was fetched.

mod lines;
mod poll;
mod tally;
mod trouble;
mod writer;

use crate::config::{Config, Fleet};
use crate::error::{Exit, Result};
use crate::http::trusting;
use crate::log::{self, Severity};
use crate::part::Part;
use crate::store::{HeadState, Store};
use poll::{Plant, Poll};
use std::collections::HashMap;
use std::sync::{Arc, Mutex};
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use tally::Tally;
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use tokio::time::{sleep, timeout};

/// Pieces that wait for the writer.
const WAITING: usize = 32;
/// Longest time for the last batch after a stop.
const STOPPING: Duration = Duration::from_secs(5);
/// Longest pause before a store that does not work is tried again.
const LONGEST: Duration = Duration::from_secs(10);

/// Fetch the results of every head and write them to the store, until it is stopped.
#[derive(Debug, clap::Args)]
pub struct Collect {
    #[command(flatten)]
    fleet: Fleet,
    /// Which collector this is of how many, as 2/3: each head is asked by one of them.
    #[arg(long, value_name = "PART")]
    part: Option<Part>,
    /// Print how it goes as a line of JSON every 10 s.
    #[arg(long)]
    json: bool,
}

impl Collect {
    /// Collects until SIGTERM or Ctrl-C.
    ///
    /// # Errors
    /// If the configuration is wrong, or the store cannot be what it says.
    pub fn run(&self) -> Result<()> {
        let config = self.fleet.read()?;
        config.heads()?;
        let tls = config.ca.as_deref().map(trusting).transpose()?;
        let store = Store::of(config.store()?, tls.clone())?;
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build();
        let runtime = runtime.map_err(Exit::Software.because("start"))?;
        let plant = Plant {
            tls,
            part: self.part.unwrap_or(Part::WHOLE),
            poll: config.poll,
            state: config.state,
            ends: HashMap::new(),
            places: Mutex::default(),
            tally: Tally::default(),
        };
        runtime.block_on(self.collect(config, plant, store))
    }

    async fn collect(&self, config: Config, mut plant: Plant, mut store: Store) -> Result<()> {
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
        let known = tokio::select! {
            known = begin(&mut store, &mut plant) => known,
            () = &mut stop => return Ok(()),
        };
        let count = config.heads.len();
        log::write(
            Severity::Info,
            &format!("{count} heads are asked for results"),
        );
        let plant = Arc::new(plant);
        let (out, incoming) = mpsc::channel(WAITING);
        let mut asking = JoinSet::new();
        for (at, head) in config.heads.into_iter().enumerate() {
            // Questions are spread over the pause between two.
            let offset = config.poll.mul_f64(at as f64 / count as f64);
            let state = known.get(&head.url.to_string()).cloned();
            let poll = Poll::new(head, state.unwrap_or_default(), plant.clone(), out.clone());
            asking.spawn(poll.run(offset));
        }
        drop(out);
        let writing = writer::write(&mut store, incoming, &plant.tally);
        tokio::pin!(writing);
        tokio::select! {
            () = &mut writing => {}
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

/// Opens the store and reads how far each history was fetched, and the heads as they were; tries
/// again until it works, because the store may start later than its collectors.
async fn begin(store: &mut Store, plant: &mut Plant) -> HashMap<String, HeadState> {
    let mut pause = Duration::from_millis(500);
    loop {
        let read = async {
            store.prepare().await?;
            Ok::<_, String>((store.ends().await?, store.heads().await?))
        };
        match read.await {
            Ok((ends, heads)) => {
                let ends = ends
                    .into_iter()
                    .map(|end| ((end.serial, end.history), end.seq));
                plant.ends = ends.collect();
                return heads
                    .into_iter()
                    .map(|head| (head.url.clone(), head))
                    .collect();
            }
            Err(words) => {
                let words = format!("open the store: {words}: it is tried again in {pause:?}");
                log::write(Severity::Warning, &words);
            }
        }
        sleep(pause).await;
        pause = (2 * pause).min(LONGEST);
    }
}

/// ms since 1970 UTC.
fn now_ms() -> u64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    now.map_or(0, |now| now.as_millis() as u64)
}
