//! Heads that answer without light: their histories, which results each holds at a time, and when
//! each result was made.
//!
//! Nothing is stored. A result is a pure function of (seed, head, history, seq), and its time is
//! the start of its history + seq / rate, so an independent program can work out which rows a store
//! must have (`tests/fleet/plant.py`). Head N answers below `/h/N/`, N with four digits:
//! `api/results`, `api/history.csv`, `api/snapshot`, `api/recipes`, `api/recipes/R/file`,
//! `api/diagnostics.zip`, `metrics`, `healthz`.

mod answers;
mod csv;
mod results;
mod state;

#[cfg(test)]
mod tests;

pub use answers::serve;

use fringed_fleet::answer::Header;
use results::{Character, GaugeModel, mixed};
use std::collections::HashMap;
use std::sync::{Arc, Mutex};
use std::time::UNIX_EPOCH;

/// The most heads: their numbers have four digits.
const MOST_HEADS: i64 = 9999;
/// The most gauges of a result, as of a recipe.
const MOST_GAUGES: i64 = 64;
/// The most results per second of a head.
const MOST_RATE: f64 = 1e4;

/// Answers as many heads would, without light.
#[derive(Clone, Debug, clap::Parser)]
pub struct Options {
    /// Heads, below /h/0001/, /h/0002/ and so on.
    #[arg(long, default_value_t = 30, value_parser = clap::value_parser!(u32).range(1..=MOST_HEADS))]
    pub heads: u32,
    /// Results per second of each head.
    #[arg(long, default_value_t = 1.0, value_parser = rate)]
    pub rate: f64,
    /// Address to listen at.
    #[arg(long, default_value = "127.0.0.1:8200")]
    pub listen: String,
    /// Seed of every value and of the times of faults.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// What goes wrong, each on one head in twenty.
    #[arg(long, value_enum, value_delimiter = ',')]
    pub faults: Vec<Fault>,
    /// Gauges of a result.
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u16).range(1..=MOST_GAUGES))]
    pub gauges: u16,
    /// Results that each head has at the start.
    #[arg(long, default_value_t = 0)]
    pub backlog: u32,
    /// Results after which each head makes no more; those of the backlog count.
    #[arg(long, default_value_t = u32::MAX)]
    pub results: u32,
    /// Results that the history of a head keeps.
    #[arg(long, default_value_t = u32::MAX)]
    pub kept: u32,
}

/// Reads `--rate`.
fn rate(text: &str) -> Result<f64, String> {
    let rate = text.parse().ok();
    let rate = rate.filter(|&rate| rate > 0.0 && rate <= MOST_RATE);
    rate.ok_or_else(|| "write results per second, above 0, at most 10000".to_owned())
}

/// What goes wrong on one head in twenty, for 6 s in every 47 s, from a seeded time in the first
/// 24 s on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Fault {
    /// Requests are not answered.
    Silence,
    /// Answers come with 10 kB/s.
    Slow,
    /// The head is off: connections are closed, no parts are measured, and their SEQ are skipped.
    Restart,
    /// The history is made anew, with SEQ from 1.
    Renew,
    /// Answers end in the middle.
    Cut,
    /// Results behind the last one, without end.
    Endless,
    /// 1 GB without the end of a line.
    Line,
    /// Results of the next head.
    Serial,
    /// SEQ that falls.
    Falling,
    /// A value that is NaN.
    Nan,
    /// A redirection to the next head instead of an answer.
    Redirect,
}

/// One head in this many has a given fault: head 1 the first of the list, head 2 the second.
const FAULT_HEADS: u32 = 20;
/// Time between the beginnings of a fault, ms: no multiple of the time after which a collector asks
/// again, so that it does not ask in the next one.
const FAULT_PERIOD_MS: u64 = 47_000;
/// A fault begins for the first time before this, ms.
const FAULT_FIRST_MS: u64 = 24_000;
/// How long a fault lasts, ms.
const FAULT_LENGTH_MS: u64 = 6_000;

/// How often the fault of a head has begun `since_ms` after the start, and whether it lasts.
fn begun(phase_ms: u64, since_ms: u64) -> (u64, bool) {
    match since_ms.checked_sub(phase_ms) {
        Some(since) => (
            since / FAULT_PERIOD_MS + 1,
            since % FAULT_PERIOD_MS < FAULT_LENGTH_MS,
        ),
        None => (0, false),
    }
}

/// ms since 1970 UTC; 0 if the clock is before that.
fn now_ms() -> u64 {
    let since = UNIX_EPOCH.elapsed();
    since.map_or(0, |since| since.as_millis() as u64)
}

/// What every answer depends on.
#[derive(Debug)]
pub struct Plant {
    pub options: Options,
    /// When the first histories began, ms since 1970 UTC.
    pub start_ms: u64,
    gauges: Vec<GaugeModel>,
    /// What the metrics have counted of each head and history: the last SEQ; PASS, FAIL, INVALID.
    counted: Mutex<HashMap<(u32, u64), [u32; 4]>>,
}

impl Plant {
    /// Heads whose first histories began when the backlog's first result was made.
    pub fn new(options: Options) -> Arc<Self> {
        let backlog_ms = f64::from(options.backlog) * 1000.0 / options.rate;
        Arc::new(Self {
            start_ms: now_ms().saturating_sub(backlog_ms as u64),
            gauges: GaugeModel::table(options.gauges),
            counted: Mutex::default(),
            options,
        })
    }

    /// Head `number`, from 1, at a time in ms since 1970 UTC; `None` if there is no such head.
    fn head(self: &Arc<Self>, number: u32, now_ms: u64) -> Option<Head> {
        let options = &self.options;
        if number == 0 || number > options.heads {
            return None;
        }
        let key = mixed(mixed(options.seed) ^ u64::from(number));
        let place = (number - 1) % FAULT_HEADS;
        let fault = options.faults.get(place as usize).copied();
        let phase_ms = key % FAULT_FIRST_MS;
        let (times, lasts) = begun(phase_ms, now_ms.saturating_sub(self.start_ms));
        // Each time that the fault begins a new history does, too.
        let (history, begun_ms) = match (fault, times) {
            (Some(Fault::Renew), 1..) => (times, phase_ms + (times - 1) * FAULT_PERIOD_MS),
            _ => (0, 0),
        };
        let start_ms = self.start_ms + begun_ms;
        let most = now_ms.saturating_sub(start_ms) as f64 * options.rate / 1000.0;
        Some(Head {
            plant: self.clone(),
            number,
            now_ms,
            start_ms,
            history,
            character: Character {
                key: mixed(key ^ history),
                drifts: number % 8 == 3,
                scraps: number % 8 == 6,
            },
            fault,
            ails: fault.filter(|_| lasts),
            key,
            phase_ms,
            reached: (most as u32).min(options.results),
        })
    }
}

/// One head at one time.
#[derive(Clone, Debug)]
struct Head {
    plant: Arc<Plant>,
    number: u32,
    /// The time that it is seen at, and when its history began, ms since 1970 UTC.
    now_ms: u64,
    start_ms: u64,
    /// Which of its histories this is, from 0.
    history: u64,
    /// What its values depend on. One head in eight drifts, another one makes scrap.
    character: Character,
    fault: Option<Fault>,
    /// The fault that it has now.
    ails: Option<Fault>,
    key: u64,
    phase_ms: u64,
    /// The SEQ that it has come to, whether or not there is a result with it.
    reached: u32,
}

impl Head {
    /// Its serial number.
    fn serial(&self) -> String {
        format!("SIM{:05}", self.number)
    }

    /// The id of its history.
    fn history(&self) -> String {
        format!("{:016x}", mixed(self.key ^ mixed(self.history)))
    }

    /// The number of the head beside it.
    fn next(&self) -> u32 {
        self.number % self.plant.options.heads + 1
    }

    /// SEQ of the last result; 0 if there is none.
    fn last(&self) -> u32 {
        self.newest().next().unwrap_or(0)
    }

    /// The first line of an answer with results.
    fn header(&self) -> Header {
        Header {
            serial: self.serial(),
            history: self.history(),
            first: self.results(1).next(),
            last: self.newest().next(),
            earlier: Vec::new(),
        }
    }

    /// Where its clock comes from: one head in 32 has none, another one that of a browser.
    fn clock(&self) -> &'static str {
        match self.number % 32 {
            5 => "none",
            7 => "browser",
            _ => "synchronised",
        }
    }

    /// When result `seq` was made, ms since 1970 UTC.
    fn at_ms(&self, seq: u32) -> u64 {
        self.start_ms + (f64::from(seq) * 1000.0 / self.plant.options.rate) as u64
    }

    /// Whether there is a result of this SEQ: not if it was due while the head was off.
    fn has(&self, seq: u32) -> bool {
        let since = self.at_ms(seq) - self.plant.start_ms;
        self.fault != Some(Fault::Restart) || !begun(self.phase_ms, since).1
    }

    /// The results from SEQ `from` on, ascending.
    fn results(&self, from: u32) -> impl DoubleEndedIterator<Item = u32> + use<> {
        let oldest = self.reached.saturating_sub(self.plant.options.kept) + 1;
        let head = self.clone();
        (from.max(oldest)..=self.reached).filter(move |&seq| head.has(seq))
    }

    /// The results from the last one down.
    fn newest(&self) -> impl Iterator<Item = u32> + use<> {
        self.results(1).rev()
    }
}
