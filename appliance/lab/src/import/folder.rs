//! The pictures of a folder: which files they are, their pages, and their order.

use super::picture::{ENDINGS, Picture};
use super::{content, name};
use appliance::error::{Exit, Failure, Result};
use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// A picture of the folder: a file, or a page of one.
#[derive(Clone, Debug)]
pub struct Place {
    /// The file.
    pub file: PathBuf,
    /// Its page, counted from 0, if it has several.
    pub page: Option<usize>,
}

impl Place {
    /// The file's name, with the page counted from 1.
    pub fn name(&self) -> String {
        match self.page {
            None => name(&self.file),
            Some(page) => format!("{} page {}", name(&self.file), page + 1),
        }
    }

    /// The failure of an import that stumbles over it.
    pub fn wrong(&self, problem: impl std::fmt::Display) -> Failure {
        match self.page {
            None => content(&self.file, problem),
            Some(page) => content(&self.file, format!("page {}: {problem}", page + 1)),
        }
    }
}

/// The `expected` pictures of a folder whose names fit `pattern`, in the order of the numbers in
/// their names, a file of several pages in the order of its pages.
///
/// # Errors
/// If the folder is missing (66); if a file cannot be read, or there is another number of pictures
/// (65).
pub fn pictures(folder: &Path, pattern: &str, expected: usize) -> Result<Vec<Place>> {
    let files = files(folder, pattern)?;
    let mut found = Vec::new();
    for file in files {
        let pages = Picture::pages(&file).map_err(|problem| content(&file, problem))?;
        let several = pages > 1;
        found.extend((0..pages).map(|page| Place {
            file: file.clone(),
            page: several.then_some(page),
        }));
    }
    if found.len() == expected {
        return Ok(found);
    }
    let ends = match &found[..] {
        [first, .., last] => format!(" ({} to {})", first.name(), last.name()),
        _ => String::new(),
    };
    let names: Vec<String> = found.iter().map(|place| stem(&name(&place.file))).collect();
    let remedy = match cameras(&names, expected) {
        Some(patterns) => format!(
            "they are pictures of {} cameras: choose one with --name {}",
            patterns.len(),
            patterns.join(" or --name ")
        ),
        None => "correct the options, or choose pictures with --name".into(),
    };
    let words = format!(
        "{} pictures{ends}, but the options describe {expected}: {remedy}",
        found.len()
    );
    Err(content(folder, words))
}

fn files(folder: &Path, pattern: &str) -> Result<Vec<PathBuf>> {
    let what = format!("import {}", folder.display());
    let missing = Exit::Missing.advising(what, "name a folder of pictures");
    let entries = fs::read_dir(folder).map_err(missing)?;
    let is_picture = |path: &PathBuf| {
        let ending = path.extension().and_then(|ending| ending.to_str());
        let known = ending.is_some_and(|ending| {
            let mut known = ENDINGS.iter();
            known.any(|known| known.eq_ignore_ascii_case(ending))
        });
        let name = name(path);
        // Hidden files do not come from the camera: macOS puts a "._" companion beside each picture
        // that it copies.
        known && !name.starts_with('.') && fits(&name, pattern) && path.is_file()
    };
    let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
    let mut found: Vec<PathBuf> = paths.filter(is_picture).collect();
    found.sort_by(|a, b| by_numbers(&name(a), &name(b)));
    if !found.is_empty() {
        return Ok(found);
    }
    let which = match pattern {
        "" => "no picture".into(),
        pattern if has_wildcards(pattern) => format!("no picture whose name fits {pattern:?}"),
        beginning => format!("no picture whose name begins with {beginning:?}"),
    };
    let words = format!("{which}: PNG, BMP, TIFF and JPEG are read, not hidden files");
    Err(content(folder, words))
}

fn has_wildcards(pattern: &str) -> bool {
    pattern.contains(['*', '?'])
}

/// Whether a file's name, with or without its ending, fits a pattern of * (any text) and ? (any
/// letter), or begins with a text without them.
fn fits(name: &str, pattern: &str) -> bool {
    match has_wildcards(pattern) {
        true => matches(name, pattern) || matches(&stem(name), pattern),
        false => name.starts_with(pattern),
    }
}

fn matches(name: &str, pattern: &str) -> bool {
    let (name, pattern): (Vec<char>, Vec<char>) =
        (name.chars().collect(), pattern.chars().collect());
    let (mut at, mut next) = (0, 0);
    // The last *, and how much of the name it covers up to now.
    let mut star: Option<(usize, usize)> = None;
    while at < name.len() {
        match pattern.get(next) {
            Some('*') => {
                star = Some((next, at));
                next += 1;
            }
            Some(letter) if *letter == '?' || *letter == name[at] => {
                at += 1;
                next += 1;
            }
            _ => match &mut star {
                None => return false,
                Some((place, covered)) => {
                    *covered += 1;
                    (next, at) = (*place + 1, *covered);
                }
            },
        }
    }
    pattern[next..].iter().all(|letter| *letter == '*')
}

/// Most cameras whose pictures are distinguished by their names.
const MAX_CAMERAS: usize = 8;

/// Patterns that divide the names into cameras of `expected` pictures each: names that differ in
/// one word or number.
fn cameras(names: &[String], expected: usize) -> Option<Vec<String>> {
    let count = names.len() / expected.max(1);
    if count * expected != names.len() || !(2..=MAX_CAMERAS).contains(&count) {
        return None;
    }
    let words: Vec<Vec<&str>> = names.iter().map(|name| words(name)).collect();
    let length = words.first()?.len();
    if words.iter().any(|words| words.len() != length) {
        return None;
    }
    (0..length).find_map(|at| {
        let mut groups: BTreeMap<&str, Vec<&[&str]>> = BTreeMap::new();
        for words in &words {
            groups.entry(words[at]).or_default().push(words);
        }
        let even = groups.len() == count && groups.values().all(|group| group.len() == expected);
        // Each camera has a picture of each shot.
        let mut shots = groups.values().map(|group| {
            let others = |words: &&[&str]| [&words[..at], &words[at + 1..]].concat().concat();
            group.iter().map(others).collect::<BTreeSet<String>>()
        });
        let first = shots.next();
        let alike = shots.all(|others| Some(&others) == first.as_ref());
        (even && alike).then(|| groups.values().map(|group| common(group)).collect())
    })
}

/// The pattern of names: their common words, and * for those that differ.
fn common(names: &[&[&str]]) -> String {
    let mut pattern = String::new();
    for at in 0..names[0].len() {
        let word = names[0][at];
        match names.iter().all(|words| words[at] == word) {
            true => pattern.push_str(word),
            false if pattern.ends_with('*') => {}
            false => pattern.push('*'),
        }
    }
    pattern
}

/// Numbers, and what stands between them.
fn words(mut text: &str) -> Vec<&str> {
    let mut words = Vec::new();
    while !text.is_empty() {
        let is_number = begins_with_digit(text);
        let end = text.find(|letter: char| letter.is_ascii_digit() != is_number);
        let (word, rest) = text.split_at(end.unwrap_or(text.len()));
        words.push(word);
        text = rest;
    }
    words
}

fn begins_with_digit(text: &str) -> bool {
    text.starts_with(|letter: char| letter.is_ascii_digit())
}

fn stem(name: &str) -> String {
    name.rsplit_once('.').map_or(name, |(stem, _)| stem).into()
}

/// Compares names so that pat2 comes before pat10.
fn by_numbers(a: &str, b: &str) -> Ordering {
    /// A number's place is that of its value, before any text.
    fn place(word: &str) -> (bool, usize, &str) {
        let number = word.trim_start_matches('0');
        match begins_with_digit(word) {
            true => (false, number.len(), number),
            false => (true, 0, word),
        }
    }
    let places = |name| words(name).into_iter().map(place);
    places(a).cmp(places(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_taken_in_the_order_of_the_numbers_in_their_names() {
        let mut names = [
            "p10.png",
            "p2.png",
            "p1.png",
            "a3_20.png",
            "a3_3.png",
            "p02b.png",
        ];
        names.sort_by(|a, b| by_numbers(a, b));
        assert_eq!(
            names,
            [
                "a3_3.png",
                "a3_20.png",
                "p1.png",
                "p2.png",
                "p02b.png",
                "p10.png"
            ]
        );
    }

    #[test]
    fn a_name_fits_its_beginning_or_a_pattern_with_or_without_its_ending() {
        for (name, pattern, expected) in [
            ("pat10.png", "", true),
            ("pat10.png", "pat", true),
            ("pat10.png", "at", false),
            ("07-left.png", "*-left", true),
            ("07-left.png", "*-left.png", true),
            ("07-right.png", "*-left", false),
            ("07-left-b.png", "*-left", false),
            ("a-left-left.png", "*-left", true),
            ("im_3.tif", "im_?", true),
            ("im_13.tif", "im_?", false),
            ("im_13.tif", "*m*3*", true),
            ("im_13.tif", "*", true),
        ] {
            assert_eq!(fits(name, pattern), expected, "{name} {pattern}");
        }
    }

    #[test]
    fn pictures_of_several_cameras_are_told_apart_by_one_word_or_number() {
        let of = |names: &[&str], expected| {
            let names: Vec<String> = names.iter().map(|&name| name.into()).collect();
            cameras(&names, expected)
        };
        let patterns = |texts: [&str; 2]| Some(texts.map(String::from).to_vec());
        assert_eq!(
            of(
                &[
                    "0-left", "0-right", "1-left", "1-right", "2-left", "2-right"
                ],
                3
            ),
            patterns(["*-left", "*-right"])
        );
        assert_eq!(
            of(&["L_01", "L_02", "L_03", "R_01", "R_02", "R_03"], 3),
            patterns(["L_*", "R_*"])
        );
        assert_eq!(
            of(
                &[
                    "cam0_a1", "cam0_a2", "cam0_a3", "cam1_a1", "cam1_a2", "cam1_a3"
                ],
                3
            ),
            patterns(["cam0_a*", "cam1_a*"])
        );
        assert_eq!(of(&["a1", "a2", "b1", "c2"], 2), None);
        assert_eq!(of(&["a1", "a2", "a3", "a4"], 2), None);
    }
}
