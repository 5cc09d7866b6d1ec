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
    let mut all = Crate::default();
    for (name, _) in files {
        all.files.insert(module_of(name), name);
    }
    for (name, text) in files {
        all.read(&module_of(name), &tokens(untested(text)));
    }
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

impl Crate<'_> {
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
            let known = (0..=path.len())
                .rev()
                .find(|&n| self.files.contains_key(&path[..n]))?;
            let (module, rest) = path.split_at(known);
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
            let mut above = (0..=here.len()).rev().map(|n| &here[..n]);
            let own = above.find(|above| self.files.contains_key(*above));
            if let (Some(own), Some(owner)) = (own, owner)
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
