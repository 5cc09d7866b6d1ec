//! The licence texts from the sources of the crates, as one document.

use super::crates::Crate;
use spdx::{Expression, Licensee, ParseMode};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// How the names of licence files begin.
const TERMS: [&str; 6] = [
    "LICENSE",
    "LICENCE",
    "COPYING",
    "COPYRIGHT",
    "NOTICE",
    "UNLICENSE",
];

const HEAD: &str = "\
Licences of what fringed is made of

fringed itself is under MIT or Apache-2.0, as you like. Its binary contains the crates listed here, each under the
licence beside it; where several are offered and MIT is one of them, MIT is taken. Their texts follow, each once, under
the crates that bring it. The source of NAME VERSION is at https://crates.io/crates/NAME/VERSION, also of those under
MPL-2.0, unchanged.

Beside the crates the binary contains

  SQLite, in C, brought by libsqlite3-sys: in the public domain, https://sqlite.org/copyright.html
  the standard library of Rust: MIT or Apache-2.0, The Rust Project Contributors, https://www.rust-lang.org; of what
  it contains in turn, compiler-rt is under Apache-2.0 with LLVM exception

It loads from the system and does not contain the C library, and where it is built with `libcamera`, libcamera (LGPL-2.1-or-later)
and the C++ library.
";

/// The document for those of `crates` that are in the programs.
pub fn document(crates: &[Crate]) -> String {
    let shipped: Vec<&Crate> = crates.iter().filter(|one| one.shipped).collect();
    let mut texts: Vec<(String, Vec<String>)> = Vec::new();
    let mut table = String::new();
    let mut without = String::new();
    for one in shipped {
        let licence = one.licence.as_deref().unwrap_or("-");
        let _ = writeln!(table, "  {:<38} {licence}", one.to_string());
        let found = terms(one);
        if found.is_empty() {
            let authors = one.authors.join(", ");
            let by = match authors.is_empty() {
                true => "no authors named",
                false => &authors,
            };
            let _ = writeln!(without, "  {one}: {licence}, {by}");
        }
        for text in found {
            match texts.iter_mut().find(|(known, _)| same(known, &text)) {
                Some((_, users)) => users.push(one.to_string()),
                None => texts.push((text, vec![one.to_string()])),
            }
        }
    }
    let mut document = format!("{HEAD}\nCrates\n\n{table}\n");
    let _ = writeln!(
        document,
        "Without a text of their own, by their manifests\n\n{without}"
    );
    for (text, mut users) in texts {
        users.dedup();
        let _ = writeln!(
            document,
            "{}\n{}\n\n{text}\n",
            "-".repeat(80),
            users.join(", ")
        );
    }
    document
}

/// The texts in a crate that apply.
fn terms(one: &Crate) -> Vec<String> {
    let mut found = Vec::new();
    collect(&one.folder, &mut found);
    found.sort();
    let mit = Licensee::parse("MIT").unwrap();
    let suffices = one
        .licence
        .as_deref()
        .and_then(|terms| Expression::parse_mode(terms, ParseMode::LAX).ok())
        .is_some_and(|terms| terms.evaluate(|asked| mit.satisfies(asked)));
    if suffices && found.iter().any(|(name, _)| name.contains("MIT")) {
        let more = ["MIT", "COPYRIGHT", "NOTICE", "THIRD-PARTY"];
        found.retain(|(name, _)| more.iter().any(|part| name.contains(part)));
    }
    found.into_iter().map(|(_, text)| text).collect()
}

/// Collects the names, in capitals, and the texts of the licence files in a folder, and in folders
/// with such a name.
fn collect(folder: &Path, found: &mut Vec<(String, String)>) {
    for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let name = entry.file_name().to_string_lossy().to_uppercase();
        if entry.path().is_dir() {
            if name == "LICENSES" {
                for inside in fs::read_dir(entry.path()).unwrap().map(Result::unwrap) {
                    let name = inside.file_name().to_string_lossy().to_uppercase();
                    found.push((name, tidy(&inside.path())));
                }
            }
        } else if TERMS.iter().any(|begin| name.starts_with(begin)) {
            found.push((name, tidy(&entry.path())));
        }
    }
}

/// Reads a text; changes its line ends to this system's and removes spaces before them.
fn tidy(path: &Path) -> String {
    let bytes = fs::read(path).unwrap();
    let text = String::from_utf8_lossy(&bytes);
    let lines: Vec<&str> = text.lines().map(str::trim_end).collect();
    lines.join("\n").trim_matches('\n').to_owned()
}

/// Whether two texts have the same words.
fn same(a: &str, b: &str) -> bool {
    a.split_whitespace().eq(b.split_whitespace())
}
