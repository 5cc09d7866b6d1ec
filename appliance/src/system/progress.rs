//! A progress bar, and the log above it: both on stderr and not with `--quiet`, the bar only on a terminal.

use crate::system::journal::{self, Severity};
use crate::system::logbook::Logbook;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A progress bar and the log. Cheap to clone; clones share both.
#[derive(Clone, Debug)]
pub struct Progress {
    bar: ProgressBar,
    quiet: bool,
    logbook: Logbook,
}

/// Resolution of the bar.
const TICKS: u64 = 1000;

impl Progress {
    /// A bar, or none with `quiet`.
    pub fn new(quiet: bool) -> Self {
        let target = if quiet {
            ProgressDrawTarget::hidden()
        } else {
            // Draws nothing where stderr is no terminal.
            ProgressDrawTarget::stderr()
        };
        let bar = ProgressBar::with_draw_target(Some(TICKS), target);
        if let Ok(style) = ProgressStyle::with_template("{bar:32} {percent:>3} % {msg}") {
            bar.set_style(style);
        }
        Self {
            bar,
            quiet,
            logbook: Logbook::default(),
        }
    }

    /// Shows the share done, 0…1, and what is being done. From any thread.
    pub fn tell(&self, share: f64, words: &str) {
        if self.bar.message() != words {
            self.bar.set_message(words.to_owned());
        }
        self.bar
            .set_position((share.clamp(0.0, 1.0) * TICKS as f64) as u64);
    }

    /// Removes the bar until the next call of [`Progress::tell`].
    pub fn clear(&self) {
        self.bar.set_position(0);
        self.bar.set_message("");
        self.bar.set_draw_target(ProgressDrawTarget::hidden());
        if !self.quiet {
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
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
            self.bar.suspend(|| journal::write(severity, line));
        }
    }

    /// The last lines of the log, also those that were not shown because of `quiet`.
    pub fn logbook(&self) -> &Logbook {
        &self.logbook
    }
}
