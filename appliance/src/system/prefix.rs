//! What stands in front of a line on stderr: the program's name for people, a priority for a
//! journal, which adds name and time itself.

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
}
