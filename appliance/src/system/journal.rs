//! Lines of the log: written on stderr, and the last ones kept for the page.

use super::stderr::{self, form_of, form_of_own};
use serde_json::{Value, json};
use std::backtrace::{Backtrace, BacktraceStatus};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

pub use super::stderr::Severity;

/// Writes one or more lines in the daemon's name.
pub fn write(severity: Severity, words: &str) {
    stderr::write(&form_of_own(severity, words));
}

/// Writes one or more lines in the name of `program`.
pub fn write_of(program: &str, severity: Severity, words: &str) {
    stderr::write(&form_of(program, severity, words));
}

/// Writes panics as lines of the log, too: the system's own way is to wait for stderr in the thread
/// that panics.
pub fn take_panics() {
    std::panic::set_hook(Box::new(|panic| {
        let thread = std::thread::current();
        let name = thread.name().unwrap_or("without a name");
        if name == stderr::THREAD {
            return;
        }
        let trace = Backtrace::capture();
        let mut words = format!("the thread {name} {panic}");
        if trace.status() == BacktraceStatus::Captured {
            words += &format!("\n{trace}");
        }
        write(Severity::Error, &words);
        if name == "main" {
            stderr::end();
        }
    }));
}

/// Lines that are kept.
const LINES: usize = 200;

/// The lines. Cheap to clone; clones share them.
#[derive(Clone, Debug)]
pub struct Logbook {
    begun: Instant,
    lines: Arc<Mutex<VecDeque<Value>>>,
}

impl Default for Logbook {
    fn default() -> Self {
        Self {
            begun: Instant::now(),
            lines: Arc::default(),
        }
    }
}

impl Logbook {
    /// Adds a line; beyond 200 lines the oldest is dropped.
    pub fn add(&self, words: &str) {
        let line = json!({
            "utc_us": crate::system::clock::utc_us(),
            "uptime_s": self.begun.elapsed().as_secs(),
            "words": words,
        });
        let mut lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
        if lines.len() >= LINES {
            lines.pop_front();
        }
        lines.push_back(line);
    }

    /// All lines, newest first: `utc_us` (null if the clock was not synchronised), `uptime_s`,
    /// `words`.
    pub fn latest(&self) -> Vec<Value> {
        let lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
        lines.iter().rev().cloned().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_line_comes_first_and_the_book_stays_bounded() {
        let book = Logbook::default();
        for at in 0..LINES + 5 {
            book.clone().add(&format!("line {at}"));
        }
        let lines = book.latest();
        assert_eq!(lines.len(), LINES);
        assert_eq!(lines[0]["words"], format!("line {}", LINES + 4));
    }
}
