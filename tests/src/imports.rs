//! Which files of a crate name items of which others, and the circles among them.
//!
//! Paths are read from the text: those of `use`, and those in the code that begin at the crate, at
//! a module, or at an imported name. A name that a module imports or re-exports is followed to the
//! file that has it, so no circle hides behind a folder's `mod.rs`. What files name of a module
//! above them does not count: a folder's `mod.rs` may hold what its files share.
//!
//! Not seen are globs, what is called without a path (a method whose `impl` is in another file than
//! its type), and names that macros put together.

use std::collections::{BTreeMap, BTreeSet};

/// A path, name by name. Those of modules begin at the crate's root, which is the empty one.
type Names = Vec<String>;

/// The files of a crate and what they name.
#[derive(Default)]
struct Crate<'a> {
    /// The file of each module that has one of its own.
    files: BTreeMap<Names, &'a str>,
    /// The paths in each module, files' and inline ones.
    paths: Vec<(Names, Names)>,
    /// What each module imports: the name there, and the path.
    imports: BTreeMap<Names, BTreeMap<String, Names>>,
}

/// The circles among files, given by their path below `src` and their text: of each circle which
/// file names what of which other.
pub fn circles(files: &[(String, String)]) -> Vec<String> {
    let all = Crate::of(files);
    let named = all.named();
    let mut steps = BTreeMap::<&Names, Vec<&Names>>::new();
    for (from, to) in named.keys() {
        steps.entry(from).or_default().push(to);
    }
    let reached = steps.keys().map(|from| (*from, reach(from, &steps)));
    let reached: BTreeMap<_, _> = reached.collect();
    let mut told = BTreeSet::new();
    let mut circles = Vec::new();
    for (from, reaches) in &reached {
        let circle = reaches
            .iter()
            .filter(|to| reached.get(*to).is_some_and(|back| back.contains(from)));
        let circle: BTreeSet<_> = circle.copied().collect();
        if !circle.is_empty() && told.insert(circle.clone()) {
            let inside = named
                .iter()
                .filter(|((from, to), _)| circle.contains(from) && circle.contains(to));
            let words = inside.map(|((from, to), path)| {
                format!("{} names {path} of {}", all.files[from], all.files[to])
            });
            circles.push(words.collect::<Vec<_>>().join("\n"));
        }
    }
    circles
}

/// Where files below a module name an item of a module that they lie in, whether it is defined or
/// only re-exported there.
pub fn upwards(files: &[(String, String)], below: &str) -> Vec<String> {
    let mut found = Vec::new();
    let all = Crate::of(files);
    for (here, path) in &all.paths {
        let Some(own) = all.module_in(here) else {
            continue;
        };
        let Some(full) = all.absolute(here, path) else {
            continue;
        };
        let owner = all.module_in(&full).unwrap_or_default();
        let is_item = full.len() > owner.len();
        let above = own.starts_with(owner) && own != owner;
        if is_item && above && owner.first().is_some_and(|first| first == below) {
            found.push(format!("{} names {}", all.files[own], path.join("::")));
        }
    }
    found
}

/// The modules that are reached from one, over any number of others.
fn reach<'a>(from: &Names, steps: &BTreeMap<&Names, Vec<&'a Names>>) -> BTreeSet<&'a Names> {
    let mut reached = BTreeSet::new();
    let mut ahead = steps.get(from).cloned().unwrap_or_default();
    while let Some(next) = ahead.pop() {
        if reached.insert(next) {
            ahead.extend(steps.get(next).into_iter().flatten());
        }
    }
    reached
}

/// The module of a file below `src`.
fn module_of(file: &str) -> Names {
    let mut names: Names = file
        .trim_end_matches(".rs")
        .split('/')
        .map(str::to_owned)
        .collect();
    names.pop_if(|last| ["mod", "lib", "main"].contains(&last.as_str()));
    names
}

/// A file without the tests at its end.
fn untested(text: &str) -> &str {
    const TESTS: &str = "\n#[cfg(test)]\n";
    let end = text.match_indices(TESTS).find(|(at, _)| {
        let line = text[at + TESTS.len()..].lines().next().unwrap_or_default();
        line.contains("mod ") && line.ends_with('{')
    });
    end.map_or(text, |(at, _)| &text[..at])
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Words, `::`, and other characters one by one, without comments.
fn tokens(text: &str) -> Vec<&str> {
    let mut tokens = Vec::new();
    for line in text.lines() {
        let mut rest = line.split("//").next().unwrap_or_default().trim_start();
        while let Some(first) = rest.chars().next() {
            let length = match first {
                _ if is_word(first) => rest.find(|c| !is_word(c)).unwrap_or(rest.len()),
                _ if rest.starts_with("::") => 2,
                _ => first.len_utf8(),
            };
            let (token, after) = rest.split_at(length);
            tokens.push(token);
            rest = after.trim_start();
        }
    }
    tokens
}

/// Whether an import may begin behind this token: not in a text, and not in a type.
fn begins(after: Option<&str>) -> bool {
    after.is_none_or(|token| [";", "{", "}", "]", ")", "pub"].contains(&token))
}

impl<'a> Crate<'a> {
    /// The crate of files that are given by their path below `src` and their text.
    fn of(files: &'a [(String, String)]) -> Self {
        let mut all = Self::default();
        for (name, _) in files {
            all.files.insert(module_of(name), name);
        }
        for (name, text) in files {
            all.read(&module_of(name), &tokens(untested(text)));
        }
        all
    }

    /// The longest beginning of a path that is a module with a file of its own.
    fn module_in<'p>(&self, path: &'p [String]) -> Option<&'p [String]> {
        let mut shorter = (0..=path.len()).rev().map(|n| &path[..n]);
        shorter.find(|module| self.files.contains_key(*module))
    }

    /// Collects the imports and paths of a file.
    fn read(&mut self, file: &Names, tokens: &[&str]) {
        let mut here = file.clone();
        // How deep in braces the code is, and where the modules in the file began.
        let (mut depth, mut begun) = (0_usize, Vec::new());
        let mut at = 0;
        while at < tokens.len() {
            at += match tokens[at..] {
                ["use", ..] if begins(at.checked_sub(1).map(|at| tokens[at])) => {
                    self.tree(&here, &[], &tokens[at + 1..]) + 1
                }
                ["mod", name, "{", ..] | ["mod", "$", name, "{", ..] => {
                    here.push(name.to_owned());
                    begun.push(depth);
                    // On to the brace.
                    if tokens[at + 1] == "$" { 3 } else { 2 }
                }
                ["{", ..] => {
                    depth += 1;
                    1
                }
                ["}", ..] => {
                    depth = depth.saturating_sub(1);
                    if begun.pop_if(|begun| *begun == depth).is_some() {
                        here.pop();
                    }
                    1
                }
                [first, "::", ..] if first.chars().all(is_word) => {
                    let rest = tokens[at + 1..].chunks_exact(2);
                    let rest =
                        rest.take_while(|pair| pair[0] == "::" && pair[1].chars().all(is_word));
                    let names: Names = std::iter::once(first)
                        .chain(rest.map(|pair| pair[1]))
                        .map(str::to_owned)
                        .collect();
                    let length = 2 * names.len() - 1;
                    self.paths.push((here.clone(), names));
                    length
                }
                _ => 1,
            };
        }
    }

    /// Reads one tree of imports behind a path, up to what ends it; returns its tokens.
    fn tree(&mut self, here: &Names, before: &[String], tokens: &[&str]) -> usize {
        let mut path = before.to_vec();
        let mut at = 0;
        while let Some(&token) = tokens.get(at) {
            match token {
                "," | "}" | ";" => break,
                "{" => {
                    at += 1;
                    while tokens
                        .get(at)
                        .is_some_and(|token| !["}", ";"].contains(token))
                    {
                        at += self.tree(here, &path, &tokens[at..]);
                        at += usize::from(tokens.get(at) == Some(&","));
                    }
                    return at + 1;
                }
                "as" => {
                    let name = tokens.get(at + 1).copied().unwrap_or_default();
                    self.import(here, name.to_owned(), path);
                    return at + 2;
                }
                "::" | "$" => {}
                name => path.push(name.to_owned()),
            }
            at += 1;
        }
        path.pop_if(|last| ["self", "*"].contains(&last.as_str()));
        if let Some(name) = path.last().cloned() {
            self.import(here, name, path);
        }
        at
    }

    fn import(&mut self, here: &Names, name: String, path: Names) {
        self.paths.push((here.clone(), path.clone()));
        if let Some(path) = self.absolute(here, &path) {
            let imports = self.imports.entry(here.clone()).or_default();
            imports.insert(name, path);
        }
    }

    /// A path from the crate's root; `None` of one that leads out of the crate.
    fn absolute(&self, here: &Names, path: &[String]) -> Option<Names> {
        let [first, rest @ ..] = path else {
            return None;
        };
        let child = || [&here[..], &path[..1]].concat();
        let imported = || self.imports.get(here)?.get(first).cloned();
        let from = match first.as_str() {
            "crate" => Names::new(),
            "self" => here.clone(),
            "super" => {
                let (_, above) = here.split_last()?;
                let above = above.to_vec();
                return match rest.first().map(String::as_str) {
                    Some("super") => self.absolute(&above, rest),
                    _ => Some([&above[..], rest].concat()),
                };
            }
            _ if self.files.contains_key(&child()) => child(),
            _ => imported()?,
        };
        Some([&from[..], rest].concat())
    }

    /// The module whose file has what a path from the root names.
    fn owner(&self, path: &[String]) -> Option<Names> {
        let mut path = path.to_vec();
        // Two modules may import a name of each other that neither has.
        for _ in 0..16 {
            let (module, rest) = path.split_at(self.module_in(&path)?.len());
            let imports = self.imports.get(module);
            match rest
                .split_first()
                .and_then(|(name, rest)| Some((imports?.get(name)?, rest)))
            {
                Some((from, rest)) => path = [&from[..], rest].concat(),
                None => return Some(module.to_vec()),
            }
        }
        None
    }

    /// Which files name others, and by which path.
    fn named(&self) -> BTreeMap<(Names, Names), String> {
        let mut named = BTreeMap::new();
        for (here, path) in &self.paths {
            let owner = self.absolute(here, path).and_then(|path| self.owner(&path));
            // A module in a file is no file of its own.
            if let (Some(own), Some(owner)) = (self.module_in(here), owner)
                && !own.starts_with(&owner)
            {
                named
                    .entry((own.to_vec(), owner))
                    .or_insert_with(|| path.join("::"));
            }
        }
        named
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_circle_of_files_is_found_behind_a_mod_rs() {
        let found = |files: &[(&str, &str)]| {
            let files = files.iter();
            let files = files.map(|(name, text)| ((*name).to_owned(), (*text).to_owned()));
            circles(&files.collect::<Vec<_>>())
        };
        let mut files = [
            ("lib.rs", "pub mod a;\nmod b;\nmod c;\n"),
            (
                "a/mod.rs",
                "mod x;\nmod y;\npub use {x::{Left, One as Other}, y::Right};\npub const SHARED: u8 = 1;\n",
            ),
            (
                "a/x.rs",
                "use super::{Right, SHARED};\npub struct Left;\npub struct One;\n",
            ),
            (
                "a/y.rs",
                "pub struct Right;\n// super::Left\n\n#[cfg(test)]\nmod tests {\n    use super::super::Left;\n}\n",
            ),
            (
                "b.rs",
                "use crate::c;\nfn go() { c::run(crate::a::SHARED) }\n",
            ),
            ("c.rs", "pub fn run(_: u8) {}\n"),
        ];
        assert_eq!(found(&files), [""; 0]);
        files[3].1 =
            "mod inside { fn go() -> super::super::Other { todo() } }\npub struct Right;\n";
        files[5].1 = "pub fn run() { crate::b::go() }\n";
        let expected = [
            "a/x.rs names super::Right of a/y.rs\na/y.rs names super::super::Other of a/x.rs",
            "b.rs names crate::c of c.rs\nc.rs names crate::b::go of b.rs",
        ];
        assert_eq!(found(&files), expected);
    }

    #[test]
    fn an_item_of_a_module_above_is_found_by_every_way_to_name_it() {
        let found = |code: &str| {
            let files = [
                ("lib.rs", "mod stages;\nmod units;\n"),
                ("units.rs", "pub struct Height;\n"),
                ("stages/mod.rs", "mod a;\nmod b;\npub use a::Plan;\n"),
                ("stages/a.rs", "pub struct Plan;\n"),
                ("stages/b.rs", code),
            ];
            let files = files.map(|(name, text)| (name.to_owned(), text.to_owned()));
            upwards(&files, "stages")
        };
        for code in [
            "use super::Plan;",
            "use crate::stages::Plan;",
            "use crate::{\n    stages::{a::Other, Plan},\n};",
            "fn f(plan: super::Plan) {}",
            "mod inside { use super::super::Plan; }",
        ] {
            assert_eq!(found(code).len(), 1, "{code}: {:?}", found(code));
        }
        let fine = "use super::a::Plan;\npub(in crate::stages) fn f();\nuse crate::stages::a;\n\
                    use crate::units::Height;\nuse self::inside::One;\nmod inside { pub struct One; }\n\
                    #[cfg(test)]\nmod tests {\n    use super::super::Plan;\n}\n";
        assert_eq!(found(fine), [""; 0]);
    }
}
