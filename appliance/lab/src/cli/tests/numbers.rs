//! Boundary values in every number of the command line: each is refused with its option and bounds,
//! or lies within them.

use super::Arguments;
use crate::lists::{PerDirection, Series as Numbers, Size};
use clap::error::ErrorKind;
use clap::{Arg, ArgMatches, CommandFactory as _};
use std::any::TypeId;
use std::collections::BTreeSet;
use std::path::PathBuf;

/// The kind of value that an option takes.
#[derive(Clone, Copy, PartialEq)]
enum Takes {
    /// A number within bounds.
    Number(f64, f64),
    /// One number or several, each within bounds.
    Series(f64, f64),
    /// Such a series, or one for each direction of fringes.
    Directions(f64, f64),
    /// A lower number and a higher one, each so far from 0 at most.
    Range(f64),
    /// Columns and rows.
    Sides,
    /// Text, which has no numeric bounds.
    Words,
}
use Takes::{Directions, Number, Range, Series, Sides, Words};

/// Every option and positional argument that takes neither a path nor one word of a list; `*` is
/// every other command.
const TABLE: &[(&str, &str, Takes)] = &[
    ("*", "threads", Number(0.0, 256.0)),
    ("experiment", "part", Words),
    ("experiment", "seeds", Number(1.0, 100.0)),
    ("adapt", "projector_blur", Number(0.0, 20.0)),
    ("adapt", "camera_blur", Number(0.0, 20.0)),
    ("adapt", "projector_pitch", Number(2.0, 128.0)),
    ("adapt", "image_pitch", Number(2.0, 128.0)),
    ("patterns", "projector", Sides),
    ("patterns", "fringes", Directions(1e-3, 1000.0)),
    ("patterns", "pitch", Directions(2.0, 1e6)),
    ("patterns", "steps", Directions(3.0, 64.0)),
    ("patterns", "first_shift", Number(-1000.0, 1000.0)),
    ("patterns", "gray", Series(1.0, 13.0)),
    ("patterns", "gray_cell", Series(1.0, 8192.0)),
    ("patterns", "gray_offset", Series(0.0, 8192.0)),
    ("import", "projector", Sides),
    ("import", "fringes", Directions(1e-3, 1000.0)),
    ("import", "pitch", Directions(2.0, 1e6)),
    ("import", "steps", Directions(3.0, 64.0)),
    ("import", "first_shift", Number(-1000.0, 1000.0)),
    ("import", "gray", Series(1.0, 13.0)),
    ("import", "gray_cell", Series(1.0, 8192.0)),
    ("import", "gray_offset", Series(0.0, 8192.0)),
    ("patterns", "camera", Sides),
    ("patterns", "bit_depth", Number(8.0, 16.0)),
    ("import", "bit_depth", Number(9.0, 16.0)),
    ("import", "name", Words),
    ("import", "plane_at", Number(1.0, 10_000.0)),
    ("import", "noise", Number(1e-6, 65_535.0)),
    ("import", "range", Range(10_000.0)),
    ("capture", "patterns", Words),
    ("capture", "poses", Number(1.0, 99.0)),
    ("capture", "fringes", Number(1e-3, 1000.0)),
    ("capture", "levels", Number(1.0, 8.0)),
    ("capture", "steps", Number(3.0, 64.0)),
];

const VALUES: [&str; 16] = [
    "",
    "0",
    "-1",
    "1",
    "2",
    "65535",
    "2147483648",
    "4294967295",
    "4294967296",
    "9223372036854775808",
    "18446744073709551616",
    "NaN",
    "inf",
    "-inf",
    "1e999",
    "5e-324",
];

impl Takes {
    /// The arguments that are tried for a boundary value.
    fn texts(self, value: &str) -> Vec<String> {
        match self {
            Number(..) => vec![value.to_owned()],
            Series(low, _) => vec![value.to_owned(), format!("{low},{value}")],
            Directions(low, _) => vec![
                value.to_owned(),
                format!("{low},{value}"),
                format!("{low}/{value}"),
            ],
            Range(_) => vec![format!("-1,{value}"), format!("{value},2")],
            Sides => vec![format!("{value}x768"), format!("1024x{value}")],
            Words => Vec::new(),
        }
    }

    /// What a refusal says in addition to the option's name.
    fn bounds(self) -> Option<String> {
        match self {
            Number(low, high) | Series(low, high) | Directions(low, high) => {
                Some(format!("from {low} to {high}"))
            }
            Sides => Some("from 1 to 8192".into()),
            Range(most) => Some(format!("from -{most} to {most}")),
            Words => None,
        }
    }
}

/// The value of an option, if it is of this type.
fn one<T: Clone + Send + Sync + 'static>(matches: &ArgMatches, id: &str) -> Option<T> {
    matches.try_get_one::<T>(id).ok().flatten().cloned()
}

/// The numbers that were read.
fn read(matches: &ArgMatches, id: &str) -> Vec<f64> {
    fn list<T: Clone + Into<f64> + Send + Sync + 'static>(
        matches: &ArgMatches,
        id: &str,
    ) -> Option<Vec<f64>> {
        let single = one::<T>(matches, id).map(|number| vec![number]);
        let series = || one::<Numbers<T>>(matches, id).map(|Numbers(all)| all);
        let directions = || one::<PerDirection<T>>(matches, id).map(|lists| lists.0.concat());
        let found = single.or_else(series).or_else(directions)?;
        Some(found.into_iter().map(Into::into).collect())
    }
    let whole = || one::<u64>(matches, id).map(|whole| vec![whole as f64]);
    list::<f64>(matches, id)
        .or_else(|| list::<u8>(matches, id))
        .or_else(|| list::<u16>(matches, id))
        .or_else(whole)
        .unwrap_or_default()
}

#[test]
fn a_boundary_value_of_an_option_is_refused_with_its_bounds_or_lies_within_them() {
    let long = "x".repeat(100_000);
    let (mut cases, mut taken, mut known) = (0, 0, BTreeSet::new());
    for command in Arguments::command().get_subcommands() {
        let words = command.get_name().to_owned();
        let command = command
            .clone()
            .mut_args(|argument| argument.required(false));
        for argument in command.get_arguments() {
            let (id, parser) = (argument.get_id().as_str(), argument.get_value_parser());
            let named = parser.possible_values().is_some();
            if !argument.get_action().takes_values()
                || named
                || parser.type_id() == TypeId::of::<PathBuf>()
            {
                continue;
            }
            let row = TABLE.iter().position(|(command, option, _)| {
                *option == id && (*command == "*" || *command == words)
            });
            let row = row.unwrap_or_else(|| panic!("{words} {id}: what are its bounds?"));
            known.insert(row);
            let takes = TABLE[row].2;
            for value in VALUES.into_iter().chain([&*long]) {
                for text in takes.texts(value) {
                    let case = format!("{words} {id} {text:.60}");
                    let name = argument.get_long().unwrap_or_default();
                    let matches = command
                        .clone()
                        .no_binary_name(true)
                        .try_get_matches_from([format!("--{name}={text}")]);
                    cases += 1;
                    taken += usize::from(check(argument, takes, matches, &case));
                }
            }
        }
    }
    println!("{cases} boundary values of options, {taken} of them can be used");
    assert_eq!(known.len(), TABLE.len(), "an option is gone");
    assert_eq!(cases, 1020);
}

/// Checks the outcome of a case; returns whether its value was accepted.
fn check(
    argument: &Arg,
    takes: Takes,
    matches: Result<ArgMatches, clap::Error>,
    case: &str,
) -> bool {
    let id = argument.get_id().as_str();
    let matches = match matches {
        Ok(matches) => matches,
        // The value itself was accepted.
        Err(error) if error.kind() == ErrorKind::MissingRequiredArgument => return true,
        Err(error) => {
            // The program ends with 64.
            assert!(error.use_stderr(), "{case}");
            let words = error.to_string();
            let name = argument.get_long().unwrap_or_default();
            assert!(words.contains(&format!("--{name}")), "{case}: {words}");
            if let Some(bounds) = takes.bounds() {
                assert!(words.contains(&bounds), "{case}: {words}");
            }
            return false;
        }
    };
    match takes {
        Number(low, high) => {
            let [number] = read(&matches, id)[..] else {
                panic!("{case}: of another type");
            };
            assert!((low..=high).contains(&number), "{case}: {number}");
        }
        Range(most) => {
            let Some([low, high]) = one::<[f64; 2]>(&matches, id) else {
                panic!("{case}: of another type");
            };
            assert!(-most <= low && low < high && high <= most, "{case}");
        }
        Series(low, high) | Directions(low, high) => {
            let all = read(&matches, id);
            assert!(!all.is_empty(), "{case}: of another type");
            assert!(
                all.iter().all(|number| (low..=high).contains(number)),
                "{case}"
            );
        }
        Sides => {
            let Some(Size(width, height)) = one::<Size>(&matches, id) else {
                panic!("{case}: of another type");
            };
            assert!(
                [width, height].iter().all(|side| (1..=8192).contains(side)),
                "{case}"
            );
        }
        Words => panic!("{case} was taken"),
    }
    true
}
