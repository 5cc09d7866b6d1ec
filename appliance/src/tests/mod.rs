//! Boundary values in every key of every file and request: each is refused, naming its key, or the
//! result can be used.
//!
//! In a valid example of a format, each value, each element of a list and each list as a whole is
//! replaced by each of [`VALUES`] in turn. The tests print their counts with `--nocapture`.

mod files;
mod recipes;
mod station;

use serde::de::IgnoredAny;
use serde_json::Value;
use std::fmt::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

pub(crate) use recipes::Bed;

/// The replacements of a value, as JSON text: the ends of every type, values beyond them, and text
/// that is not JSON.
const VALUES: [&str; 30] = [
    "0",
    "1",
    "-1",
    "2",
    "3",
    "0.5",
    "64",
    "65",
    "65535",
    "65536",
    "2147483647",
    "2147483648",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "9223372036854775808",
    "18446744073709551615",
    "18446744073709551616",
    "1e300",
    "-1e300",
    "5e-324",
    "1e999",
    "-1e999",
    "NaN",
    "null",
    "true",
    "\"\"",
    "\"\\u0000\\u001b[2J\"",
    "[]",
    "{}",
];
/// Marks the place of the replaced value while a tree is written as text.
const MARK: &str = "@here@";
/// Most bytes of a message.
const LONGEST_WORDS: usize = 3000;
/// Longest time of a case.
const LONGEST: Duration = Duration::from_secs(5);

/// All values, and a text of 900 kB: manifests of a megabyte or more are not read at all.
pub(crate) fn values() -> Vec<String> {
    let long = format!("\"{}\"", "x".repeat(900_000));
    let short = VALUES.iter().map(|value| (*value).to_owned());
    short.chain([long]).collect()
}

/// The path of a value in a tree: keys, and indices of list elements.
#[derive(Clone, Debug)]
pub(crate) struct Place(Vec<String>);

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0.join("."))
    }
}

impl Place {
    /// Whether a message about a value names one of the keys of its path or its line; for a limit
    /// of a gauge, the gauge and the key.
    pub fn is_named(&self, value: &str, words: &str) -> bool {
        if let [gauges, _, limit] = &self.0[..]
            && gauges == "gauges"
            && ["low", "high"].contains(&limit.as_str())
            && serde_json::from_str::<IgnoredAny>(value).is_ok()
        {
            return words.contains("gauge \"") && words.contains(limit);
        }
        let keys = self.0.iter().filter(|key| key.parse::<usize>().is_err());
        // A message about a list may name one element: `gauge` for `gauges`.
        words.contains("line ")
            || keys
                .clone()
                .any(|key| words.contains(key.trim_end_matches('s')))
    }

    fn of<'a>(&self, tree: &'a mut Value) -> Option<&'a mut Value> {
        self.0.iter().try_fold(tree, |node, key| match node {
            Value::Object(all) => all.get_mut(key),
            Value::Array(all) => all.get_mut(key.parse::<usize>().ok()?),
            _ => None,
        })
    }

    /// The tree's text with this value replaced; `write` makes the text of a tree.
    pub fn replaced(&self, tree: &Value, value: &str, write: impl Fn(&Value) -> String) -> String {
        let mut tree = tree.clone();
        *self.of(&mut tree).unwrap() = Value::from(MARK);
        write(&tree).replacen(&format!("\"{MARK}\""), value, 1)
    }

    /// If there is a list at this place: a list of its first element ten thousand times.
    fn repeated(&self, tree: &Value) -> Option<String> {
        let mut tree = tree.clone();
        let first = self.of(&mut tree)?.as_array()?.first()?.to_string();
        let mut list = String::from("[");
        for _ in 1..10_000 {
            let _ = write!(list, "{first},");
        }
        Some(list + &first + "]")
    }
}

/// The places of all values below the root.
pub(crate) fn places(tree: &Value) -> Vec<Place> {
    fn collect(node: &Value, at: &[String], all: &mut Vec<Place>) {
        if !at.is_empty() {
            all.push(Place(at.to_vec()));
        }
        let inner: Vec<(String, &Value)> = match node {
            Value::Object(map) => map.iter().map(|(key, node)| (key.clone(), node)).collect(),
            Value::Array(list) => (0..).map(|at: usize| at.to_string()).zip(list).collect(),
            _ => Vec::new(),
        };
        for (key, node) in inner {
            let mut at = at.to_vec();
            at.push(key);
            collect(node, &at, all);
        }
    }
    let mut all = Vec::new();
    collect(tree, &[], &mut all);
    all
}

/// One in so many cases is run, other values at each place. With `BOUNDARY_VALUES=all`, as in
/// `.ci/run full`, all are.
pub(crate) fn one_in() -> usize {
    match std::env::var_os("BOUNDARY_VALUES") {
        Some(_) => 1,
        None => 4,
    }
}

/// The cases of places with these values, of which [`one_in`] so many is run.
pub(crate) fn cases(
    places: Vec<Place>,
    values: impl Fn(&Place) -> Vec<String>,
) -> Vec<(Place, String)> {
    let mut chosen = Vec::new();
    for (at, place) in places.into_iter().enumerate() {
        let of_place = values(&place).into_iter().skip(at % one_in());
        chosen.extend(
            of_place
                .step_by(one_in())
                .map(|value| (place.clone(), value)),
        );
    }
    chosen
}

/// Counts the cases of a test, and those whose result could be used.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    cases: usize,
    used: usize,
    /// What went wrong.
    wrong: Vec<String>,
}

impl Tally {
    /// Adds the outcome of a case: its result could be used, or why it was refused.
    pub fn take(&mut self, place: &Place, value: &str, answer: Result<(), String>) {
        let named = |words: &str| place.is_named(value, words);
        let short: String = value.chars().take(60).collect();
        self.cases += 1;
        match answer {
            Ok(()) => self.used += 1,
            Err(words) if words.len() > LONGEST_WORDS => {
                let bytes = words.len();
                self.wrong
                    .push(format!("{place} = {short}: {bytes} bytes of words"));
            }
            Err(words) if !named(&words) => {
                self.wrong
                    .push(format!("{place} = {short} is not named: {words}"));
            }
            Err(_) => {}
        }
    }

    /// Runs a case that must neither panic nor take long.
    pub fn run(&mut self, place: &Place, value: &str, case: impl FnOnce() -> Result<(), String>) {
        let began = Instant::now();
        let answer = catch_unwind(AssertUnwindSafe(case));
        let short: String = value.chars().take(60).collect();
        let took = began.elapsed();
        if took > LONGEST {
            self.wrong.push(format!("{place} = {short} took {took:?}"));
        }
        match answer {
            Ok(answer) => self.take(place, value, answer),
            Err(_) => self.wrong.push(format!("{place} = {short} panicked")),
        }
    }

    /// Runs the cases of all places of a tree.
    pub fn walk(&mut self, tree: &Value, case: impl Fn(&Place, &str) -> Result<(), String>) {
        let values = |place: &Place| values().into_iter().chain(place.repeated(tree)).collect();
        for (place, value) in cases(places(tree), values) {
            self.run(&place, &value, || case(&place, &value));
        }
    }

    /// Prints the counts, and checks that of all cases there are at least `least`, and that some were
    /// used and some refused.
    pub fn end(&self, what: &str, least: usize) {
        let Self { cases, used, wrong } = self;
        println!("{what}: {cases} boundary values, {used} of them can be used");
        assert!(
            wrong.is_empty(),
            "{what}, {}:\n{}",
            wrong.len(),
            wrong.join("\n")
        );
        assert!(*cases * one_in() >= least, "{what}: only {cases} cases");
        assert!(*used > 0 && used < cases, "{what}: {used} of {cases}");
    }
}
