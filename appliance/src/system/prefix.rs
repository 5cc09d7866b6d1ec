//! What stands in front of a line on stderr: the program's name for people, a priority for a
//! journal, which adds name and time itself.

use std::borrow::Cow;
use std::sync::OnceLock;

/// How much a line matters, as syslog numbers it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// Nothing is measured until its cause is removed.
    Error = 3,
    /// Measuring goes on, but something needs attention.
    Warning = 4,
    /// Rare and worth finding again: the device's secret, a start, a stop.
    Notice = 5,
    /// Normal operation.
    Info = 6,
}

/// Text with its control characters but tabs and ends of lines written out: those of a file's name or a
/// message are no commands to a terminal.
pub(crate) fn plain(text: &str) -> Cow<'_, str> {
    let is_command = |c: char| c.is_control() && !matches!(c, '\n' | '\t');
    if !text.contains(is_command) {
        return text.into();
    }
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        match is_command(c) {
            true => shown.extend(c.escape_default()),
            false => shown.push(c),
        }
    }
    shown.into()
}

/// Lines in the daemon's name, as they are written.
pub(super) fn form_of_own(severity: Severity, words: &str) -> String {
    form_of("fringed", severity, words)
}

/// Lines in the name of `program`, as they are written.
pub(super) fn form_of(program: &str, severity: Severity, words: &str) -> String {
    form(program, is_read_by_a_journal(), severity, words)
}

fn is_read_by_a_journal() -> bool {
    static JOURNAL: OnceLock<bool> = OnceLock::new();
    *JOURNAL.get_or_init(stderr_is_a_journal)
}

/// The lines with their prefix.
fn form(program: &str, journal: bool, severity: Severity, words: &str) -> String {
    let words = plain(words);
    let lines = words.lines().map(|line| match journal {
        true => format!("<{}>{line}\n", severity as u8),
        false => format!("{program}: {line}\n"),
    });
    lines.collect()
}

/// Whether stderr is the stream that systemd.exec(5) describes.
fn stderr_is_a_journal() -> bool {
    let named = std::env::var("JOURNAL_STREAM").unwrap_or_default();
    rustix::fs::fstat(std::io::stderr())
        .is_ok_and(|stream| is_named(&named, stream.st_dev, stream.st_ino))
}

/// Whether the text names this file as `device:inode`.
fn is_named(text: &str, device: u64, inode: u64) -> bool {
    let number = |text: &str| text.parse().ok();
    let named = text
        .split_once(':')
        .map(|(device, inode)| (number(device), number(inode)));
    named == Some((Some(device), Some(inode)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_journal_gets_the_priority_of_every_line_and_people_get_none() {
        let words = "fault 101: gone\nplug it in";
        let journal = form("fringed", true, Severity::Error, words);
        assert_eq!(journal, "<3>fault 101: gone\n<3>plug it in\n");
        let people = form("fringed", false, Severity::Error, words);
        assert_eq!(people, "fringed: fault 101: gone\nfringed: plug it in\n");
    }

    #[test]
    fn only_the_stream_that_is_named_is_a_journal() {
        assert!(is_named("8:15", 8, 15));
        for other in ["8:16", "9:15", "", "8", "8:", ":15", "8:15:1", "x:y"] {
            assert!(!is_named(other, 8, 15), "{other}");
        }
    }

    #[test]
    fn control_characters_are_written_out() {
        assert_eq!(plain("name\tand\nline"), "name\tand\nline");
        let lines = form("fringed", false, Severity::Error, "no \u{1b}[31mfile\u{7}");
        assert_eq!(lines, "fringed: no \\u{1b}[31mfile\\u{7}\n");
    }
}
