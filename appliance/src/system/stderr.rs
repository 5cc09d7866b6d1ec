//! The thread that writes on stderr: the lines of the log, with the prefix that a person or a journal
//! needs, and the bar.
//!
//! stderr can be a pipe that nobody reads, a terminal that was stopped, or a journal that hangs: a
//! write then waits for as long as that lasts. Only the thread `stderr` waits. Lines are handed
//! over in a buffer of `ROOM` bytes; those that find no room there, and those that stderr refuses
//! (a full disk, a closed pipe), are counted, and the count is written once lines can be written
//! again.
//!
//! A command waits until its lines are written, so that they stand in order with what it prints. A
//! daemon does not, after [`detach`].

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::borrow::Cow;
use std::io::{self, Write};
use std::mem::take;
use std::sync::{Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::Builder;
use std::time::Duration;

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
    rustix::fs::fstat(io::stderr())
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

/// Name of the thread.
pub(super) const THREAD: &str = "stderr";
/// Bytes of lines that may wait.
const ROOM: usize = 256 << 10;
/// Longest wait of a daemon that ends for its last lines.
const LAST: Duration = Duration::from_millis(500);
/// Resolution of the bar.
const TICKS: u64 = 1000;

static STDERR: Outbox = Outbox::new();

/// What the bar shows: the share done, 0…1, and what is being done; none = no bar.
type Bar = Option<(f64, String)>;

/// Writes whole lines.
pub(super) fn write(lines: &str) {
    if begun() {
        STDERR.put(lines);
    } else {
        // Without a thread there is no other way.
        let _ = io::stderr().write_all(lines.as_bytes());
    }
}

/// Shows the bar, or removes it.
pub(super) fn show(bar: Bar) {
    if begun() {
        STDERR.show(bar);
    }
}

/// From now on no caller waits until its lines are written.
pub fn detach() {
    STDERR.waiting().detached = true;
}

/// Waits until everything is written and the bar removed, in a daemon for half a second at most.
/// Called at the end of the program.
pub fn end() {
    if THREAD_BEGUN.get() == Some(&true) {
        STDERR.end();
    }
}

static THREAD_BEGUN: OnceLock<bool> = OnceLock::new();

/// Starts the thread, if it is not there yet; whether it is there.
fn begun() -> bool {
    *THREAD_BEGUN.get_or_init(|| {
        let thread = Builder::new().name(THREAD.into());
        thread
            .spawn(|| STDERR.run(&mut Pen::new(io::stderr())))
            .is_ok()
    })
}

/// What is handed over to the thread.
struct Outbox {
    waiting: Mutex<WaitingLines>,
    changed: Condvar,
}

struct WaitingLines {
    /// Whole lines.
    lines: String,
    /// Lines behind them that found no room.
    lost: u64,
    /// The bar, if it is to change.
    bar: Option<Bar>,
    /// What was handed over so far.
    handed: u64,
    /// How much of what was handed over is done.
    done: u64,
    /// Whether callers go on before their lines are written.
    detached: bool,
}

impl WaitingLines {
    fn is_empty(&self) -> bool {
        self.lines.is_empty() && self.lost == 0 && self.bar.is_none()
    }
}

impl Outbox {
    const fn new() -> Self {
        let waiting = WaitingLines {
            lines: String::new(),
            lost: 0,
            bar: None,
            handed: 0,
            done: 0,
            detached: false,
        };
        Self {
            waiting: Mutex::new(waiting),
            changed: Condvar::new(),
        }
    }

    fn waiting(&self) -> MutexGuard<'_, WaitingLines> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn put(&self, lines: &str) {
        let mut waiting = self.waiting();
        // Behind a lost line others are lost, too, so that the count stands where they are missing.
        if waiting.lost == 0 && waiting.lines.len() + lines.len() <= ROOM {
            waiting.lines.push_str(lines);
        } else {
            waiting.lost += lines.lines().count() as u64;
        }
        self.hand_over(waiting);
    }

    /// Showing a bar does not wait; removing it does, since its caller may print next.
    fn show(&self, bar: Bar) {
        let removed = bar.is_none();
        let mut waiting = self.waiting();
        waiting.bar = Some(bar);
        match removed {
            true => self.hand_over(waiting),
            false => self.changed.notify_all(),
        }
    }

    /// Wakes the thread, and waits until it is done unless detached.
    fn hand_over(&self, mut waiting: MutexGuard<'_, WaitingLines>) {
        waiting.handed += 1;
        self.changed.notify_all();
        if !waiting.detached {
            let handed = waiting.handed;
            let ahead = |waiting: &mut WaitingLines| waiting.done < handed;
            drop(self.changed.wait_while(waiting, ahead));
        }
    }

    fn end(&self) {
        self.show(None);
        let waiting = self.waiting();
        let handed = waiting.handed;
        let ahead = |waiting: &mut WaitingLines| waiting.done < handed;
        drop(self.changed.wait_timeout_while(waiting, LAST, ahead));
    }

    /// Writes for ever.
    fn run(&self, pen: &mut Pen<impl Write>) {
        loop {
            let waiting = self
                .changed
                .wait_while(self.waiting(), |waiting| waiting.is_empty());
            let mut waiting = waiting.unwrap_or_else(PoisonError::into_inner);
            let (lines, lost) = (take(&mut waiting.lines), take(&mut waiting.lost));
            let (bar, handed) = (waiting.bar.take(), waiting.handed);
            drop(waiting);
            pen.write(&lines, lost);
            if let Some(bar) = bar {
                pen.show(bar);
            }
            self.waiting().done = handed;
            self.changed.notify_all();
        }
    }
}

/// What the thread writes with: lines above the bar. The bar is drawn on a terminal only.
struct Pen<W> {
    out: W,
    bar: ProgressBar,
    /// Lines that are lost and were not reported yet.
    lost: u64,
}

impl<W: Write> Pen<W> {
    fn new(out: W) -> Self {
        let bar = ProgressBar::with_draw_target(Some(TICKS), ProgressDrawTarget::stderr());
        if let Ok(style) = ProgressStyle::with_template("{bar:32} {percent:>3} % {msg}") {
            bar.set_style(style);
        }
        bar.finish_and_clear();
        Self { out, bar, lost: 0 }
    }

    /// Writes lines, and how many were lost behind them.
    fn write(&mut self, lines: &str, lost_behind: u64) {
        let Self { out, bar, lost } = self;
        bar.suspend(|| {
            for line in lines.split_inclusive('\n') {
                *lost = report(out, *lost);
                let written = *lost == 0 && out.write_all(line.as_bytes()).is_ok();
                *lost += u64::from(!written);
            }
            *lost = report(out, *lost + lost_behind);
        });
    }

    fn show(&self, bar: Bar) {
        let Some((share, words)) = bar else {
            return self.bar.finish_and_clear();
        };
        if self.bar.is_finished() {
            self.bar.reset();
        }
        if self.bar.message() != words {
            self.bar.set_message(words);
        }
        self.bar
            .set_position((share.clamp(0.0, 1.0) * TICKS as f64) as u64);
    }
}

/// Reports lines that are lost, if there are any; returns how many are still to be reported.
fn report(out: &mut impl Write, lost: u64) -> u64 {
    if lost == 0 {
        return 0;
    }
    let words = format!(
        "{lost} lines of the log are lost here: stderr was not read, or could not be written; the page has the last 200 of all lines"
    );
    let line = form_of_own(Severity::Warning, &words);
    match out.write_all(line.as_bytes()) {
        Ok(()) => 0,
        Err(_) => lost,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{BufRead as _, BufReader};
    use std::sync::Arc;

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

    /// An outbox whose thread writes into this.
    fn writing(out: impl Write + Send + 'static, detached: bool) -> Arc<Outbox> {
        let outbox = Arc::new(Outbox::new());
        outbox.waiting().detached = detached;
        let own = outbox.clone();
        std::thread::spawn(move || own.run(&mut Pen::new(out)));
        outbox
    }

    #[test]
    fn nobody_waits_for_a_reader_and_what_is_lost_is_counted_where_it_is_missing() {
        let (reader, writer) = io::pipe().unwrap();
        let outbox = writing(writer, true);
        let put = 40_000;
        for at in 0..put {
            outbox.put(&format!("line {at}\nits second line\n"));
        }
        outbox.show(Some((0.5, "measuring".into())));
        let mut lines = BufReader::new(reader).lines().map_while(Result::ok);
        // The reader is back.
        let (mut read, mut lost) = (0, 0);
        while 2 * read + lost < 2 * put {
            let line = lines.next().unwrap();
            if let Some((before, _)) = line.split_once(" lines of the log are lost here") {
                lost += before.rsplit(' ').next().unwrap().parse::<usize>().unwrap();
                continue;
            }
            assert_eq!(line, format!("line {}", read + lost / 2));
            assert_eq!(lines.next().unwrap(), "its second line");
            read += 1;
        }
        assert!(read > 1000 && lost > 1000, "{read} {lost}");
        assert_eq!(2 * read + lost, 2 * put);
        outbox.put("after that\n");
        assert_eq!(lines.next().unwrap(), "after that");
    }

    /// Refuses so many lines, then tells what it is given.
    struct Refusing(usize, std::sync::mpsc::Sender<String>);

    impl Write for Refusing {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            if self.0 > 0 {
                self.0 -= 1;
                return Err(io::ErrorKind::StorageFull.into());
            }
            let text = String::from_utf8_lossy(bytes).into_owned();
            self.1.send(text).map_err(io::Error::other)?;
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_line_that_stderr_refuses_is_counted_and_ends_nothing() {
        let (told, hear) = std::sync::mpsc::channel();
        // The first line, and two reports of it, the second of which is in front of the second
        // line.
        let outbox = writing(Refusing(3, told), false);
        outbox.put("first\n");
        outbox.put("second\n");
        outbox.put("third\n");
        let heard: Vec<String> = hear.try_iter().collect();
        let [report, third] = &heard[..] else {
            panic!("{heard:?}");
        };
        assert!(
            report.contains("2 lines of the log are lost here"),
            "{report}"
        );
        assert_eq!(third, "third\n");
    }
}
