//! The last lines of the log, for the page.

use serde_json::{Value, json};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

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
