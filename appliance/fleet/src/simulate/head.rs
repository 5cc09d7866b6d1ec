//! One head at one time: its history, which results it holds, and when each was made.

use super::Simulate;
use super::fault::{FIRST_MS, Fault, PERIOD_MS, SHARE, begun};
use super::gauge::{Character, Gauge, mixed};
use crate::answer::Header;
use std::collections::HashMap;
use std::sync::{Arc, Mutex};

/// What every answer depends on.
#[derive(Debug)]
pub(super) struct Plant {
    pub options: Simulate,
    /// When the first histories began, ms since 1970 UTC.
    pub start_ms: u64,
    pub gauges: Vec<Gauge>,
    /// What the metrics have counted of each head and history: the last SEQ; PASS, FAIL, INVALID.
    pub counted: Mutex<HashMap<(u32, u64), [u32; 4]>>,
}

impl Plant {
    /// Head `number`, from 1, at a time in ms since 1970 UTC; `None` if there is no such head.
    pub(super) fn head(self: &Arc<Self>, number: u32, now_ms: u64) -> Option<Head> {
        let options = &self.options;
        if number == 0 || number > options.heads {
            return None;
        }
        let key = mixed(mixed(options.seed) ^ u64::from(number));
        let fault = options.faults.get(((number - 1) % SHARE) as usize).copied();
        let phase_ms = key % FIRST_MS;
        let (times, lasts) = begun(phase_ms, now_ms.saturating_sub(self.start_ms));
        // Each time that the fault begins a new history does, too.
        let (history, begun_ms) = match (fault, times) {
            (Some(Fault::Renew), 1..) => (times, phase_ms + (times - 1) * PERIOD_MS),
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
pub(super) struct Head {
    pub plant: Arc<Plant>,
    pub number: u32,
    /// The time that it is seen at, and when its history began, ms since 1970 UTC.
    pub now_ms: u64,
    pub start_ms: u64,
    /// Which of its histories this is, from 0.
    pub history: u64,
    /// What its values depend on. One head in eight drifts, another one makes scrap.
    pub character: Character,
    fault: Option<Fault>,
    /// The fault that it has now.
    pub ails: Option<Fault>,
    key: u64,
    phase_ms: u64,
    /// The SEQ that it has come to, whether or not there is a result with it.
    reached: u32,
}

impl Head {
    /// Its serial number.
    pub(super) fn serial(&self) -> String {
        format!("SIM{:05}", self.number)
    }

    /// The id of its history.
    pub(super) fn history(&self) -> String {
        format!("{:016x}", mixed(self.key ^ mixed(self.history)))
    }

    /// The number of the head beside it.
    pub(super) fn next(&self) -> u32 {
        self.number % self.plant.options.heads + 1
    }

    /// SEQ of the last result; 0 if there is none.
    pub(super) fn last(&self) -> u32 {
        self.newest().next().unwrap_or(0)
    }

    /// The first line of an answer with results.
    pub(super) fn header(&self) -> Header {
        Header {
            serial: self.serial(),
            history: self.history(),
            first: self.results(1).next(),
            last: self.newest().next(),
        }
    }

    /// Where its clock comes from: one head in 32 has none, another one that of a browser.
    pub(super) fn clock(&self) -> &'static str {
        match self.number % 32 {
            5 => "none",
            7 => "browser",
            _ => "synchronised",
        }
    }

    /// When result `seq` was made, ms since 1970 UTC.
    pub(super) fn at_ms(&self, seq: u32) -> u64 {
        self.start_ms + (f64::from(seq) * 1000.0 / self.plant.options.rate) as u64
    }

    /// Whether there is a result of this SEQ: not if it was due while the head was off.
    fn has(&self, seq: u32) -> bool {
        let since = self.at_ms(seq) - self.plant.start_ms;
        self.fault != Some(Fault::Restart) || !begun(self.phase_ms, since).1
    }

    /// The results from SEQ `from` on, ascending.
    pub(super) fn results(&self, from: u32) -> impl DoubleEndedIterator<Item = u32> + use<> {
        let oldest = self.reached.saturating_sub(self.plant.options.kept) + 1;
        let head = self.clone();
        (from.max(oldest)..=self.reached).filter(move |&seq| head.has(seq))
    }

    /// The results from the last one down.
    pub(super) fn newest(&self) -> impl Iterator<Item = u32> + use<> {
        self.results(1).rev()
    }
}
