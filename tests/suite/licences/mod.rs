//! `docs/licences.txt` has the licence texts of every crate in the programs; the test needs no
//! network. `deny.toml` lists the accepted licences, and the crates that may occur in two versions.

mod crates;
mod texts;

use crates::Crate;
use std::fs;
use std::path::PathBuf;
use tests::shared::root;

/// The crates; `None` with a message if their sources are not on this machine.
fn dependencies() -> Option<Vec<Crate>> {
    crates::all()
        .inspect_err(|reason| {
            eprintln!("SKIPPED: `cargo fetch --locked` makes them available: {reason}");
        })
        .ok()
}

/// The committed file.
fn file() -> PathBuf {
    root().join("docs/licences.txt")
}

#[test]
fn the_file_of_licences_has_the_texts_of_what_is_shipped() {
    let Some(crates) = dependencies() else { return };
    let written = fs::read_to_string(file()).unwrap();
    // Compared line by line, as a failed comparison prints everything.
    let differs = texts::document(&crates)
        .lines()
        .zip(written.lines().chain(std::iter::repeat("")))
        .find(|(now, then)| now != then)
        .map(|(now, then)| format!("{then:?} should be {now:?}"));
    let longer = texts::document(&crates).len() != written.len();
    assert!(
        differs.is_none() && !longer,
        "docs/licences.txt is of other crates ({}); write it anew: cargo test -p tests --test suite -- --ignored licences::",
        differs.unwrap_or_default()
    );
}

#[test]
#[ignore = "writes docs/licences.txt"]
fn the_file_of_licences_is_written_anew() {
    fs::write(file(), texts::document(&crates::all().unwrap())).unwrap();
}
