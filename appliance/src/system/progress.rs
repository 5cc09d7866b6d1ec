//! A progress bar, and the log above it: both on stderr and not with `--quiet`, the bar only on a
//! terminal.

use crate::system::journal::Logbook;
use crate::system::journal::{self, Severity};
use crate::system::stderr;
use std::io::IsTerminal as _;

/// A progress bar and the log. Cheap to clone; clones share both.
#[derive(Clone, Debug)]
pub struct Progress {
    quiet: bool,
    /// Whether there is a bar.
    bar: bool,
    logbook: Logbook,
}

impl Progress {
    /// A bar, or none with `quiet`.
    pub fn new(quiet: bool) -> Self {
        Self {
            quiet,
            bar: !quiet && std::io::stderr().is_terminal(),
            logbook: Logbook::default(),
        }
    }

    /// Shows the share done, 0…1, and what is being done. From any thread.
    pub fn tell(&self, share: f64, words: &str) {
        if self.bar {
            stderr::show(Some((share, words.to_owned())));
        }
    }

    /// Removes the bar until the next call of [`Progress::tell`].
    pub fn clear(&self) {
        if self.bar {
            stderr::show(None);
        }
    }

    /// A line about normal operation for the log, above the bar.
    pub fn log(&self, line: &str) {
        self.report(Severity::Info, line);
    }

    /// A warning for the log, above the bar.
    pub fn warn(&self, line: &str) {
        self.report(Severity::Warning, line);
    }

    /// A line for the log, above the bar.
    pub fn report(&self, severity: Severity, line: &str) {
        self.logbook.add(line);
        if !self.quiet {
            journal::write(severity, line);
        }
    }

    /// The last lines of the log, also those that were not shown because of `quiet`.
    pub fn logbook(&self) -> &Logbook {
        &self.logbook
    }
}
