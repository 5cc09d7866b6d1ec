//! The program `fringed-fleet`: collects the results of many heads into one store, says how the
//! heads are, and keeps their recipes.
//!
//! Heads open no connection; they answer. A collector asks each for the results behind the last
//! that the store has, so it keeps no state of its own, and whatever it writes twice the store
//! folds by the key (serial, history, seq).

/// Prints a line of the result. A pipe that the reader has closed is not an error.
macro_rules! say {
    ($($argument:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stdout(), $($argument)*);
    }};
}

/// ms since 1970 UTC; 0 if the clock is before that.
fn now_ms() -> u64 {
    let since = std::time::UNIX_EPOCH.elapsed();
    since.map_or(0, |since| since.as_millis() as u64)
}

pub mod answer;
pub mod backup;
pub mod cli;
pub mod collect;
pub mod config;
pub mod error;
pub mod http;
pub mod log;
pub mod part;
pub mod simulate;
pub mod status;
pub mod store;
