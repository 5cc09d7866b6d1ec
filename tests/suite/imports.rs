//! Files that are uploaded to the page go to the storage: they use no memory, and no temporary file
//! remains.

use crate::page::{Browser, signed_in};
use crate::station_plc::{Daemon, Place};
use std::fs;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::time::Duration;
use tests::until::{PATIENCE, until};

/// Clients that send a file at the same time.
const CLIENTS: usize = 8;
/// Memory that they may use together, KiB.
const ALLOWED: u64 = 64 << 10;
/// Longest time until the memory is returned.
const BACK: Duration = Duration::from_secs(10);
/// Memory that may stay in use then, KiB.
const LEFT: u64 = 16 << 10;

/// A value in KiB of proc_pid_status(5).
fn memory(daemon: &Daemon, name: &str) -> u64 {
    let status = fs::read_to_string(format!("/proc/{}/status", daemon.pid())).unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix(name));
    let words = line.unwrap().trim_start_matches(':').split_whitespace();
    words.map(|word| word.parse().unwrap()).next().unwrap()
}

/// Number and total size of the incomplete files in the state folder.
fn arriving(place: &Place) -> (usize, u64) {
    let entries = fs::read_dir(place.path("state/recipes")).unwrap();
    let sizes: Vec<_> = entries
        .map(Result::unwrap)
        .filter(|entry| entry.file_name().to_string_lossy().ends_with(".new"))
        .filter_map(|entry| Some(entry.metadata().ok()?.len()))
        .collect();
    (sizes.len(), sizes.iter().sum())
}

/// Sends a body without its last byte, as far as the server reads it.
fn send(mut stream: TcpStream, mib: usize) -> TcpStream {
    let piece = vec![0x5A; 1 << 20];
    stream.set_write_timeout(Some(PATIENCE)).unwrap();
    for at in 0..mib {
        let end = piece.len() - usize::from(at + 1 == mib);
        if stream.write_all(&piece[..end]).is_err() {
            break;
        }
    }
    stream
}

/// The part of the answer that arrived before the connection ended.
fn answer(stream: &mut TcpStream) -> String {
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    String::from_utf8_lossy(&answer).into_owned()
}

fn imports_take_no_memory(mib: usize) {
    let (place, daemon, mut browser) = signed_in();
    browser.wait_for_another("none");
    let idle = memory(&daemon, "VmRSS");
    // From here on the peak counts.
    fs::write(format!("/proc/{}/clear_refs", daemon.pid()), "5").unwrap();
    let held: Vec<_> = (0..CLIENTS)
        .map(|_| browser.begin("POST", "/api/recipes", mib << 20))
        .map(|stream| std::thread::spawn(move || send(stream, mib)))
        .collect();
    let mut held: Vec<_> = held.into_iter().map(|sent| sent.join().unwrap()).collect();
    let all_but_one = ((mib as u64) << 20) - 1;
    until("two files", PATIENCE, || match arriving(&place) {
        (2, bytes) if bytes == 2 * all_but_one => Ok(()),
        others => Err(others),
    });
    let peak = memory(&daemon, "VmHWM");
    // A client that is told to come later has an answer; two still wait for their last byte.
    let mut open = Vec::new();
    for mut stream in held.drain(..) {
        stream
            .set_read_timeout(Some(Duration::from_millis(100)))
            .unwrap();
        let said = answer(&mut stream);
        match said.is_empty() {
            true => open.push(stream),
            false => assert!(
                said.starts_with("HTTP/1.1 503") && said.contains("retry-after: "),
                "{said}"
            ),
        }
    }
    println!("{CLIENTS} files of {mib} MiB: {idle} KiB idle, {peak} KiB at most");
    assert!(peak <= idle + ALLOWED, "{peak} KiB after {idle} KiB");
    // One of them is finished and is not a recipe. The others are dropped.
    let mut last = open.pop().unwrap();
    last.set_read_timeout(Some(PATIENCE)).unwrap();
    last.write_all(&[0x5A]).unwrap();
    let said = answer(&mut last);
    assert!(said.starts_with("HTTP/1.1 422"), "{said}");
    drop(open);
    until("end of the files", BACK, || match arriving(&place) {
        (0, _) => Ok(()),
        left => Err(left),
    });
    until("memory given back", BACK, || {
        match memory(&daemon, "VmRSS") {
            much if much > idle + LEFT => Err(much),
            _ => Ok(()),
        }
    });
    // A recipe can still be imported.
    let (_, recipe) = browser.ask("GET", "/api/recipes/1/file", &[]);
    assert_eq!(browser.ask("POST", "/api/recipes", &recipe).0, 201);
}

#[test]
fn eight_files_held_open_take_no_memory_and_leave_nothing_behind() {
    imports_take_no_memory(20);
}

/// Run by `.ci/run full`.
#[test]
#[ignore = "writes 300 MB"]
fn eight_files_of_150_mb_held_open_take_no_memory() {
    imports_take_no_memory(150);
}

#[test]
fn what_a_kill_leaves_of_an_import_is_removed_by_the_next_start() {
    let (place, daemon, browser) = signed_in();
    let stream = send(browser.begin("POST", "/api/recipes", 2 << 20), 1);
    until("file", PATIENCE, || match arriving(&place) {
        (1, _) => Ok(()),
        others => Err(others),
    });
    daemon.kill();
    drop(stream);
    assert_eq!(arriving(&place).0, 1);
    let _again = Daemon::start(&place);
    assert_eq!(arriving(&place).0, 0);
}

#[test]
fn nothing_of_a_file_is_taken_from_somebody_who_did_not_sign_in() {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let stranger = Browser::new(&daemon);
    let mut stream = stranger.begin("POST", "/api/recipes", 20 << 20);
    let said = answer(&mut stream);
    assert!(said.starts_with("HTTP/1.1 401"), "{said}");
    assert_eq!(arriving(&place).0, 0);
}
