//! One head at one time: its history, which results it holds, and when each was made.

use super::fault::{FIRST_MS, Fault, PERIOD_MS, begun};
use super::figures::mixed;
use super::gauge::{Character, Gauge};
use std::collections::HashMap;
use std::sync::Mutex;

/// Where a head's clock comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Clock {
    /// The system clock is synchronised.
    Synchronised,
    /// A browser has told the time.
    Browser,
    /// Results have no time.
    None,
}

impl Clock {
    /// Its word in results.
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Synchronised => "synchronised",
            Self::Browser => "browser",
            Self::None => "none",
        }
    }
}

/// What the metrics of a head have counted of its results.
#[derive(Clone, Debug, Default)]
pub(super) struct Counted {
    pub history: String,
    /// SEQ of the last result that was counted.
    pub last: u32,
    /// PASS, FAIL, INVALID.
    pub counts: [u64; 3],
}

/// What every answer depends on.
#[derive(Debug)]
pub(super) struct Plant {
    pub seed: u64,
    pub heads: u32,
    /// Results per second of each head.
    pub rate: f64,
    /// When the first histories began, ms since 1970 UTC.
    pub start_ms: u64,
    /// Results after which a history has no more.
    pub results: u32,
    /// Results that a history keeps.
    pub kept: u32,
    pub faults: Vec<Fault>,
    pub gauges: Vec<Gauge>,
    /// What the metrics of each head have counted.
    pub counted: Mutex<HashMap<u32, Counted>>,
}

impl Plant {
    /// Head `number`, from 1, at a time in ms since 1970 UTC; `None` if there is no such head.
    pub(super) fn head(&self, number: u32, now_ms: u64) -> Option<Head<'_>> {
        if number == 0 || number > self.heads {
            return None;
        }
        let key = mixed(mixed(self.seed) ^ u64::from(number));
        let fault = Fault::of(&self.faults, number);
        let phase_ms = key % FIRST_MS;
        let (times, lasts) = begun(phase_ms, now_ms.saturating_sub(self.start_ms));
        // Each time that the fault begins a new history does, too.
        let (history, begun_ms) = match (fault, times) {
            (Some(Fault::Renew), 1..) => (times, phase_ms + (times - 1) * PERIOD_MS),
            _ => (0, 0),
        };
        let start_ms = self.start_ms + begun_ms;
        let most = now_ms.saturating_sub(start_ms) as f64 * self.rate / 1000.0;
        Some(Head {
            plant: self,
            number,
            key,
            fault,
            ails: lasts,
            phase_ms,
            history,
            start_ms,
            reached: (most as u32).min(self.results),
            now_ms,
        })
    }
}

/// One head at one time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Head<'a> {
    pub plant: &'a Plant,
    pub number: u32,
    key: u64,
    fault: Option<Fault>,
    ails: bool,
    phase_ms: u64,
    history: u64,
    start_ms: u64,
    /// The SEQ that it has come to, whether or not there is a result with it.
    reached: u32,
    now_ms: u64,
}

impl Head<'_> {
    /// The fault that it has now.
    pub(super) fn ails(&self) -> Option<Fault> {
        self.fault.filter(|_| self.ails)
    }

    /// Its serial number.
    pub(super) fn serial(&self) -> String {
        format!("SIM{:05}", self.number)
    }

    /// The id of its history.
    pub(super) fn history(&self) -> String {
        format!("{:016x}", mixed(self.key ^ mixed(self.history)))
    }

    /// When its history began, ms since 1970 UTC.
    pub(super) fn start_ms(&self) -> u64 {
        self.start_ms
    }

    /// The time that it is seen at, ms since 1970 UTC.
    pub(super) fn now_ms(&self) -> u64 {
        self.now_ms
    }

    /// SEQ of the last result; 0 if there is none.
    pub(super) fn last(self) -> u32 {
        self.newest().next().unwrap_or(0)
    }

    /// The first line of an answer with results.
    pub(super) fn header(self) -> String {
        let bound = |seq: Option<u32>| seq.map_or("null".into(), |seq| seq.to_string());
        let first = bound(self.results(1).next());
        let last = bound(self.newest().next());
        let (serial, history) = (self.serial(), self.history());
        format!(
            "{{\"serial\":\"{serial}\",\"history\":\"{history}\",\"first\":{first},\"last\":{last}}}\n"
        )
    }

    /// What its values depend on. One head in eight drifts, another one makes scrap.
    pub(super) fn character(&self) -> Character {
        Character {
            key: mixed(self.key ^ self.history),
            drifts: self.number % 8 == 3,
            scraps: self.number % 8 == 6,
        }
    }

    /// Where its clock comes from: one head in 32 has none, another one that of a browser.
    pub(super) fn clock(&self) -> Clock {
        match self.number % 32 {
            5 => Clock::None,
            7 => Clock::Browser,
            _ => Clock::Synchronised,
        }
    }

    /// When result `seq` was made, ms since 1970 UTC.
    pub(super) fn at_ms(&self, seq: u32) -> u64 {
        self.start_ms + (f64::from(seq) * 1000.0 / self.plant.rate) as u64
    }

    /// Whether there is a result of this SEQ: not if it was due while the head was off.
    pub(super) fn has(&self, seq: u32) -> bool {
        if seq == 0 || seq > self.reached {
            return false;
        }
        let since = self.at_ms(seq) - self.plant.start_ms;
        self.fault != Some(Fault::Restart) || !begun(self.phase_ms, since).1
    }

    /// The results from SEQ `from` on, ascending.
    pub(super) fn results(self, from: u32) -> impl Iterator<Item = u32> {
        (from.max(self.oldest())..=self.reached).filter(move |&seq| self.has(seq))
    }

    /// The results from the last one down.
    pub(super) fn newest(self) -> impl Iterator<Item = u32> {
        (self.oldest()..=self.reached)
            .rev()
            .filter(move |&seq| self.has(seq))
    }

    fn oldest(&self) -> u32 {
        self.reached.saturating_sub(self.plant.kept) + 1
    }
}
