//! Lines for people on stderr, which under systemd is the journal.

use std::fmt::Display;
use std::io::Write as _;

/// How grave a line is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// A command or a collector ends.
    Error = 3,
    /// A head or the store does not do what it should.
    Warning = 4,
    /// Something begins, ends or works again.
    Info = 6,
}

/// Writes one line: the program's name, and below systemd the priority before it. Control
/// characters of `words`, which may come from a head, are replaced.
pub fn write(severity: Severity, words: impl Display) {
    let clean = words.to_string().replace(char::is_control, " ");
    let prefix = match std::env::var_os("JOURNAL_STREAM") {
        Some(_) => format!("<{}>", severity as u8),
        None => String::new(),
    };
    // If stderr is closed, there is nothing to do about it.
    let _ = writeln!(std::io::stderr(), "{prefix}fringed-fleet: {clean}");
}
