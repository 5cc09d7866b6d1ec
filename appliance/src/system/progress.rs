//! Progress of anything longer than a second: on stderr, only on a terminal, not with `--quiet`.

use crate::system::journal::{self, Severity};
use crate::system::logbook::Logbook;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A progress bar that stays away where nobody looks. Cheap to clone; clones share the bar.
#[derive(Clone, Debug)]
pub struct Progress {
    bar: ProgressBar,
    quiet: bool,
    logbook: Logbook,
}

/// Steps of the bar.
const STEPS: u64 = 1000;

impl Progress {
    /// A bar, or none with `quiet`.
    pub fn new(quiet: bool) -> Self {
        let target = if quiet {
            ProgressDrawTarget::hidden()
        } else {
            // Draws nothing where stderr is no terminal.
            ProgressDrawTarget::stderr()
        };
        let bar = ProgressBar::with_draw_target(Some(STEPS), target);
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
            .set_position((share.clamp(0.0, 1.0) * STEPS as f64) as u64);
    }

    /// Takes the bar away until something is told again.
    pub fn clear(&self) {
        self.bar.set_position(0);
        self.bar.set_message("");
        self.bar.set_draw_target(ProgressDrawTarget::hidden());
        if !self.quiet {
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
        }
    }

    /// An everyday line for the log, above the bar.
    pub fn log(&self, line: &str) {
        self.report(Severity::Info, line);
    }

    /// A line for the log that somebody should look at.
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
