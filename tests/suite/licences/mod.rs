//! The licences of everything that the program is made of, without the network: which are taken, that no crate comes
//! twice unseen, and that `docs/licences.txt` has their texts.

mod crates;
mod texts;

use crates::Crate;
use spdx::{Expression, Licensee, ParseMode};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::PathBuf;

/// What may be part of the program or of its tests. None of them asks more of whoever passes the program on than to
/// pass on its text, and MPL-2.0 to say where the source of that crate is.
const TAKEN: [&str; 10] = [
    "MIT",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-3-Clause",
    "BSL-1.0",
    "IJG",
    "ISC",
    "MPL-2.0",
    "Unicode-3.0",
    "Zlib",
];

/// Crates that are there in two versions, and what holds the older one. Whatever comes twice is compiled twice.
const TWICE: [(&str, &str); 9] = [
    ("hashbrown", "hashlink, of rusqlite"),
    ("linux-raw-sys", "drm-sys, of drm"),
    ("miniz_oxide", "flate2, of png"),
    ("shlex", "bindgen and cc disagree"),
    ("syn", "derives that have not moved on"),
    ("thiserror", "libcamera, filedescriptor"),
    ("thiserror-impl", "as thiserror"),
    ("toml_datetime", "num_enum, of libcamera"),
    ("winnow", "num_enum, of libcamera"),
];

/// The crates, or nothing where their sources are not on this machine, said so.
fn dependencies() -> Option<Vec<Crate>> {
    crates::all()
        .inspect_err(|reason| {
            eprintln!("SKIPPED: `cargo fetch --locked` makes them available: {reason}");
        })
        .ok()
}

/// Whether the terms of a crate can be kept with the licences that are taken.
fn is_taken(licence: Option<&str>) -> bool {
    let allowed = TAKEN.map(|name| Licensee::parse(name).unwrap());
    licence
        .and_then(|text| Expression::parse_mode(text, ParseMode::LAX).ok())
        .is_some_and(|terms| {
            terms.evaluate(|asked| allowed.iter().any(|ours| ours.satisfies(asked)))
        })
}

/// Names that come in more than one version, with these.
fn twice(crates: &[Crate]) -> BTreeMap<&str, BTreeSet<&str>> {
    let mut versions: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for one in crates {
        versions.entry(&one.name).or_default().insert(&one.version);
    }
    versions.retain(|_, versions| versions.len() > 1);
    versions
}

/// The committed file.
fn file() -> PathBuf {
    crates::root().join("docs/licences.txt")
}

#[test]
fn every_crate_has_a_licence_that_is_taken_and_comes_from_the_registry() {
    let Some(crates) = dependencies() else { return };
    for one in &crates {
        assert!(
            is_taken(one.licence.as_deref()),
            "{one} has the licence {:?}, which is not on the list in tests/suite/licences/mod.rs: do without it, or ask who \
             answers for the product and add it",
            one.licence
        );
        assert!(
            one.source.starts_with("registry+"),
            "{one} comes from {}, not from the registry",
            one.source
        );
    }
    assert!(crates.len() > 150, "only {} crates?", crates.len());
}

#[test]
fn no_crate_comes_twice_unseen() {
    let Some(crates) = dependencies() else { return };
    let twice = twice(&crates);
    for (name, versions) in &twice {
        assert!(
            versions.len() == 2 && TWICE.iter().any(|(known, _)| known == name),
            "{name} comes as {versions:?}: bring its users to one version (`cargo tree --invert {name}`), or add it to the list"
        );
    }
    for (name, holder) in TWICE {
        assert!(
            twice.contains_key(name),
            "{name} comes once now ({holder}): take it off the list"
        );
    }
}

#[test]
fn the_file_of_licences_has_the_texts_of_what_is_shipped() {
    let Some(crates) = dependencies() else { return };
    let written = fs::read_to_string(file()).unwrap();
    // Not compared as a whole, which would print it as a whole.
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

#[test]
fn a_licence_that_is_not_taken_and_a_second_version_are_found() {
    for good in [
        "MIT",
        "MIT/Apache-2.0",
        "GPL-2.0-only OR MIT",
        "(MIT OR Apache-2.0) AND Unicode-3.0",
    ] {
        assert!(is_taken(Some(good)), "{good}");
    }
    for bad in [
        "GPL-3.0-only",
        "MIT AND GPL-2.0-or-later",
        "LGPL-2.1-only",
        "SSPL-1.0",
        "mine",
        "",
    ] {
        assert!(!is_taken(Some(bad)), "{bad}");
    }
    assert!(!is_taken(None));
    let one = |name: &str, version: &str| Crate {
        name: name.into(),
        version: version.into(),
        ..Crate::default()
    };
    let crates = [one("a", "1.0.0"), one("b", "1.0.0"), one("a", "2.0.0")];
    assert_eq!(twice(&crates).into_keys().collect::<Vec<_>>(), ["a"]);
}
