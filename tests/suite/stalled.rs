//! Nobody takes what the station gives away: its log, its results, its counter, its events.
//! Everything else is as if somebody did.

use crate::station_plc::{Daemon, ONLINE, Place, Plc, READY, RECIPE_OK, long};
use rusqlite::Connection;
use std::fs::OpenOptions;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::os::fd::AsRawFd;
use std::os::unix::fs::OpenOptionsExt as _;
use std::process::Stdio;
use std::time::{Duration, Instant};

const PASS: u16 = 1;
/// RECIPE_LOAD of CONTROL.
const RECIPE_LOAD: u16 = 1 << 3;
/// A recipe that is not there: to load it writes a line of the log.
const NO_RECIPE: u16 = 9;
/// A request or a cycle takes no longer, on a machine that does something else as well.
const AT_ONCE: Duration = Duration::from_secs(5);

/// The start of the page's answer to a request.
fn get(daemon: &Daemon, path: &str) -> String {
    let mut stream = TcpStream::connect(daemon.http).unwrap();
    stream.set_read_timeout(Some(AT_ONCE)).unwrap();
    let head = format!(
        "GET {path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n",
        daemon.http
    );
    stream.write_all(head.as_bytes()).unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    String::from_utf8_lossy(&answer).into_owned()
}

/// Page, /healthz and Modbus answer, a recipe is refused and another one loaded, and parts get
/// their verdicts; each at once.
fn works(daemon: &Daemon, plc: &mut Plc, tokens: std::ops::Range<u16>) {
    for path in ["/", "/healthz", "/api/snapshot", "/api/log"] {
        assert!(get(daemon, path).starts_with("HTTP/1.1 200"), "{path}");
    }
    plc.write(0, &[ONLINE]);
    for number in [NO_RECIPE, 1] {
        let began = Instant::now();
        plc.write(0, &[ONLINE | RECIPE_LOAD, 0, number, 0, 0, 0, 0, 0]);
        plc.wait("answer to the load", |status| match number {
            NO_RECIPE => status.recipe_result() != 0,
            _ => status.recipe_result() == 0 && status.has(READY | RECIPE_OK),
        });
        plc.write(0, &[ONLINE]);
        assert!(began.elapsed() < AT_ONCE, "loading {number}");
    }
    for token in tokens {
        let began = Instant::now();
        assert_eq!(plc.measure(token)[8], PASS);
        assert!(began.elapsed() < AT_ONCE, "token {token}");
    }
}

/// Fills a pipe to its last byte, without leaving its writer in a mode in which nobody waits.
fn fill(writer: &impl AsRawFd) {
    let mut again = OpenOptions::new()
        .write(true)
        .custom_flags(rustix::fs::OFlags::NONBLOCK.bits() as i32)
        .open(format!("/proc/self/fd/{}", writer.as_raw_fd()))
        .unwrap();
    for bytes in [&[b'x'; 4096][..], b"x", b"\n"] {
        while again.write(bytes).is_ok() {}
    }
}

#[test]
fn a_log_that_nobody_reads_stops_neither_a_start_nor_a_cycle_nor_a_request_nor_a_stop() {
    let place = Place::new();
    let (reader, writer) = std::io::pipe().unwrap();
    fill(&writer);
    let daemon = Daemon::unheard(&place, writer.try_clone().unwrap());
    works(&daemon, &mut Plc::connect(&daemon), 1..4);
    // The reader is back: what was said meanwhile comes, and nothing is missing.
    let mut lines = BufReader::new(reader).lines().map_while(Result::ok);
    let mut said = String::new();
    let refused = format!("recipe {NO_RECIPE}");
    while !said.contains(&refused) {
        said += &lines.next().unwrap();
        said += "\n";
    }
    assert!(said.contains("shown this once"), "{said}");
    assert!(!said.contains("lost here"), "{said}");
    fill(&writer);
    assert_eq!(daemon.terminate().code(), Some(0));
}

#[test]
fn a_log_whose_reader_is_gone_or_whose_disk_is_full_stops_nothing() {
    let (_, closed) = std::io::pipe().unwrap();
    let full = OpenOptions::new().write(true).open("/dev/full").unwrap();
    for stderr in [Stdio::from(closed), Stdio::from(full)] {
        let place = Place::taught();
        let daemon = Daemon::unheard(&place, stderr);
        works(&daemon, &mut Plc::connect(&daemon), 1..4);
        assert_eq!(daemon.terminate().code(), Some(0));
    }
}

#[test]
fn a_history_that_is_locked_and_events_that_nobody_reads_stop_nothing() {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    plc.measure(1);
    let locked = Connection::open(place.path("state/history.db")).unwrap();
    locked.busy_timeout(AT_ONCE).unwrap();
    locked.execute_batch("BEGIN EXCLUSIVE").unwrap();
    // They ask for events, and read none of them.
    let deaf: Vec<TcpStream> = (0..4)
        .map(|_| {
            let mut stream = TcpStream::connect(daemon.http).unwrap();
            let ask = format!("GET /events HTTP/1.1\r\nHost: {}\r\n\r\n", daemon.http);
            stream.write_all(ask.as_bytes()).unwrap();
            stream
        })
        .collect();
    works(&daemon, &mut plc, 2..30);
    assert_eq!(daemon.terminate().code(), Some(0));
    drop((deaf, locked));
}

#[test]
fn a_card_that_hangs_stops_no_request_and_no_stop() {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    plc.measure(1);
    place.counter_that_hangs();
    works(&daemon, &mut plc, 2..40);
    let measured = long(&plc.status().0, 12);
    assert_eq!(measured, 39);
    assert_eq!(daemon.terminate().code(), Some(0));
}
