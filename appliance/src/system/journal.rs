//! Lines of the log on stderr.

pub use super::prefix::Severity;

use super::prefix::{form_of, form_of_own};
use super::stderr;
use std::backtrace::{Backtrace, BacktraceStatus};

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
