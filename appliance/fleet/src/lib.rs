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

pub mod answer;
pub mod backup;
pub mod cli;
pub mod collect;
pub mod config;
pub mod error;
pub mod http;
pub mod log;
pub mod part;
pub mod schema;
pub mod simulate;
pub mod status;
pub mod store;
