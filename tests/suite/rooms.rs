//! The rooms (groups of modules) of the daemon: which may import which.
//!
//! A second protocol beside Modbus would be a room of its own on its line, see what `SEEN` lists
//! (the snapshot by `StationHandle::subscribe`, requests by `event` and `write`), and neither
//! recipes, history nor the measuring thread.
//!
//! Checks every path in the code, also inside macros: `crate::a::B`, `crate::{a, b::C}`,
//! `super::super::a`. The root of the crate re-exports nothing, so every such path names its room.

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use tests::files;
use tests::shared::root;

/// The rooms from top to bottom. A room imports only rooms on lines below its own.
const ORDER: [&[&str]; 13] = [
    &["cli"],
    &["service"],
    &["web", "modbus", "lines"],
    &["production", "backup"],
    &["history", "measure"],
    &["recipe"],
    &["config"],
    &["head"],
    &["output", "access"],
    &["storage"],
    &["system", "study"],
    &["error"],
    &["station"],
];

/// Rooms whose imports are listed one by one: those that serve the PLC, the wires and the page.
const SEEN: [(&str, &[&str]); 3] = [
    ("modbus", &["config", "system", "station"]),
    ("lines", &["production", "system", "error", "station"]),
    (
        "web",
        &[
            "production",
            "backup",
            "access",
            "history",
            "recipe",
            "head",
            "output",
            "storage",
            "system",
            "study",
            "error",
            "station",
        ],
    ),
];

/// An imported path in a file of the daemon: the names of its modules from the root of the crate.
struct Import {
    file: PathBuf,
    from: Vec<String>,
    to: Vec<String>,
}

fn source() -> PathBuf {
    root().join("appliance/src")
}

/// Collects all Rust files in a folder, without those for tests only.
fn collect(folder: &Path, all: &mut Vec<PathBuf>) {
    for name in files::names(folder) {
        let path = folder.join(&name);
        if path.is_dir() {
            if name != "tests" {
                collect(&path, all);
            }
        } else if name.ends_with(".rs") && !name.ends_with("tests.rs") {
            all.push(path);
        }
    }
}

/// The module of a file.
fn module(file: &Path) -> Vec<String> {
    let path = file.strip_prefix(source()).unwrap().with_extension("");
    let names = path.iter().map(|name| name.to_str().unwrap().to_owned());
    let mut names: Vec<_> = names.collect();
    if matches!(
        names.last().map(String::as_str),
        Some("mod" | "lib" | "main")
    ) {
        names.pop();
    }
    names
}

/// Removes test-only modules from the tokens of a file.
fn without_tests(tokens: TokenStream) -> Vec<TokenTree> {
    let mut kept = Vec::new();
    let mut tokens = tokens.into_iter().peekable();
    while let Some(token) = tokens.next() {
        let of_tests = matches!(&token, TokenTree::Punct(mark) if mark.as_char() == '#')
            && tokens.peek().is_some_and(|next| {
                next.to_string() == "[cfg (test)]" || next.to_string() == "[cfg(test)]"
            });
        if !of_tests {
            kept.push(token);
            continue;
        }
        // Up to the end of the item.
        for token in tokens.by_ref() {
            match &token {
                TokenTree::Group(group) if group.delimiter() == Delimiter::Brace => break,
                TokenTree::Punct(mark) if mark.as_char() == ';' => break,
                _ => {}
            }
        }
    }
    kept
}

fn name(token: &TokenTree) -> Option<String> {
    match token {
        TokenTree::Ident(name) => Some(name.to_string()),
        _ => None,
    }
}

/// Whether `::` is at this position.
fn joint(tokens: &[TokenTree], at: usize) -> bool {
    let colon =
        |at: usize| matches!(tokens.get(at), Some(TokenTree::Punct(mark)) if mark.as_char() == ':');
    colon(at) && colon(at + 1)
}

/// Collects the paths that begin at this position after `prefix`, each with all of its names;
/// returns where the first of them ends.
fn follow(
    tokens: &[TokenTree],
    mut at: usize,
    mut prefix: Vec<String>,
    found: &mut Vec<Vec<String>>,
) -> usize {
    loop {
        match tokens.get(at) {
            Some(TokenTree::Group(group)) if group.delimiter() == Delimiter::Brace => {
                let inner: Vec<_> = group.stream().into_iter().collect();
                let mut place = 0;
                while place < inner.len() {
                    match name(&inner[place]) {
                        Some(_) => place = follow(&inner, place, prefix.clone(), found),
                        None => place += 1,
                    }
                }
                return at + 1;
            }
            Some(token) if name(token).is_some() => {
                prefix.extend(name(token).filter(|name| name != "self"));
                at += 1;
            }
            _ => {
                found.push(prefix);
                return at + 1;
            }
        }
        if !joint(tokens, at) {
            found.push(prefix);
            return at;
        }
        at += 2;
    }
}

/// All paths of a file that begin with `crate` or `super`, from the root of the crate.
fn paths(tokens: &[TokenTree], module: &[String], found: &mut Vec<Vec<String>>) {
    let mut at = 0;
    while at < tokens.len() {
        if let TokenTree::Group(group) = &tokens[at] {
            let inner: Vec<_> = group.stream().into_iter().collect();
            paths(&inner, module, found);
        }
        let begins = name(&tokens[at]).is_some_and(|name| name == "crate" || name == "super");
        let inside = at >= 2 && joint(tokens, at - 2);
        if !begins || inside || !joint(tokens, at + 1) {
            at += 1;
            continue;
        }
        let mut all = Vec::new();
        at = follow(tokens, at, Vec::new(), &mut all);
        for path in all {
            let ups = path.iter().take_while(|name| *name == "super").count();
            let names = &path[ups.max(1)..];
            let base = match ups {
                0 => &[][..],
                _ => &module[..module.len().saturating_sub(ups)],
            };
            found.push(base.iter().chain(names).cloned().collect());
        }
    }
}

fn imports() -> Vec<Import> {
    let mut all = Vec::new();
    collect(&source(), &mut all);
    let mut imports = Vec::new();
    for file in all {
        let text = fs::read_to_string(&file).unwrap();
        let tokens = without_tests(text.parse().unwrap());
        let from = module(&file);
        let mut found = Vec::new();
        paths(&tokens, &from, &mut found);
        imports.extend(found.into_iter().map(|to| Import {
            file: file.clone(),
            from: from.clone(),
            to,
        }));
    }
    imports
}

fn line(room: &str) -> Option<usize> {
    ORDER.iter().position(|rooms| rooms.contains(&room))
}

#[test]
fn a_room_of_the_daemon_imports_only_rooms_below_it() {
    let imports = imports();
    let mut broken = BTreeSet::new();
    let mut looked = 0;
    for Import { file, from, to } in &imports {
        let (Some(from), Some(to)) = (from.first(), to.first()) else {
            continue;
        };
        // An item of the root is not a room.
        let item = to.starts_with(char::is_uppercase);
        if from == to || item {
            continue;
        }
        let file = file.strip_prefix(source()).unwrap().display();
        match (line(from), line(to)) {
            (Some(above), Some(below)) if above < below => looked += 1,
            (Some(_), Some(_)) => {
                broken.insert(format!("{file} imports {to}, which is not below {from}"));
            }
            _ => {
                broken.insert(format!("{file}: {from} or {to} is in no line of the order"));
            }
        }
        let seen = SEEN.iter().find(|(room, _)| room == from);
        if seen.is_some_and(|(_, rooms)| !rooms.contains(&to.as_str())) {
            broken.insert(format!("{file} imports {to}, which {from} does not see"));
        }
    }
    let broken: Vec<_> = broken.into_iter().collect();
    let order: Vec<_> = ORDER.iter().map(|rooms| rooms.join(" | ")).collect();
    println!("{}\n{looked} imports", order.join("\n"));
    assert!(
        broken.is_empty(),
        "a room imports only rooms on the lines below its own:\n{}\n\n{}",
        order.join("\n"),
        broken.join("\n")
    );
    assert!(looked > 300, "{looked} imports");
}

#[test]
fn every_folder_and_file_at_the_top_of_the_daemon_is_a_room() {
    let tops = files::names(&source());
    let rooms = tops.iter().map(|name| name.trim_end_matches(".rs"));
    let rooms: BTreeSet<_> = rooms
        .filter(|name| !["lib", "main", "tests"].contains(name))
        .collect();
    let known: BTreeSet<_> = ORDER.concat().into_iter().collect();
    assert_eq!(rooms, known);
    let root = fs::read_to_string(source().join("lib.rs")).unwrap();
    let uses = root.lines().filter(|line| line.contains("use "));
    assert_eq!(
        uses.count(),
        0,
        "the root re-exports nothing: a path names its room"
    );
}

#[test]
fn imports_are_found_however_they_are_written() {
    let text = "use crate::a::{self, b::C, d}; use super::super::e::F; fn x() { write!(out, \"{}\", crate::g::H) } \
                #[cfg(test)] mod tests { use crate::i::J; } use crate::k;";
    let tokens = without_tests(text.parse().unwrap());
    let mut found = Vec::new();
    let here = ["room", "file"].map(str::to_owned);
    paths(&tokens, &here, &mut found);
    let found: Vec<_> = found.iter().map(|path| path.join("::")).collect();
    assert_eq!(found, ["a", "a::b::C", "a::d", "e::F", "g::H", "k"]);
}
