//! The command line as clap takes it: each command offers what it uses.

mod numbers;

use super::Arguments;
use clap::error::ErrorKind;
use clap::{CommandFactory as _, Parser as _};
use std::collections::{BTreeMap, BTreeSet};

/// What each option that the programs share does in each command that offers it; the options that
/// one command has for itself say so in its help. A pair that is not here is refused.
const SHARED: [(&str, &str, &str); 21] = [
    ("accuracy", "threads", "of everything"),
    ("accuracy", "quiet", "no progress, no tables"),
    ("accuracy", "json", "the tables"),
    ("experiment", "threads", "of everything"),
    ("experiment", "quiet", "no progress, no tables"),
    ("experiment", "json", "the means"),
    ("bench", "threads", "of accuracy and budget"),
    ("bench", "quiet", "no progress, no tables"),
    ("bench", "json", "the tables"),
    ("adapt", "threads", "of the measurement"),
    ("adapt", "quiet", "no table"),
    ("adapt", "json", "the report"),
    ("patterns", "threads", "of the rasters"),
    ("patterns", "quiet", "no closing line"),
    ("import", "threads", "of reading the pictures"),
    ("import", "json", "the summary"),
    ("import", "quiet", "no summary"),
    ("capture", "config", "which head"),
    ("capture", "state", "where the head's calibration is"),
    ("capture", "threads", "of the simulated light"),
    ("capture", "quiet", "no progress, no closing line"),
];

fn refused(line: &str) -> clap::Error {
    Arguments::try_parse_from(line.split_whitespace()).expect_err(line)
}

#[test]
fn every_command_offers_exactly_the_shared_options_that_do_something_there() {
    let shared: BTreeSet<_> = SHARED
        .map(|(command, option, _)| (command.to_owned(), option.to_owned()))
        .into();
    let names: BTreeSet<_> = SHARED.map(|(_, option, _)| option).into();
    let mut offered = BTreeSet::new();
    for command in Arguments::command().get_subcommands() {
        let options = command
            .get_arguments()
            .filter_map(|option| option.get_long());
        for option in options.filter(|option| names.contains(option)) {
            offered.insert((command.get_name().to_owned(), option.to_owned()));
        }
    }
    assert_eq!(offered, shared);
}

#[test]
fn an_option_takes_a_value_in_every_command_or_in_none() {
    let mut takes = BTreeMap::new();
    for command in Arguments::command().get_subcommands() {
        let options = command.get_arguments();
        for option in options.filter(|option| option.get_long().is_some()) {
            let name = option.get_long().unwrap_or_default().to_owned();
            let now = option.get_action().takes_values();
            assert_eq!(*takes.entry(name).or_insert(now), now, "{option}");
        }
    }
}

#[test]
fn every_command_option_and_argument_says_in_the_help_what_it_does() {
    for command in Arguments::command().get_subcommands() {
        assert!(command.get_about().is_some(), "{}", command.get_name());
        for argument in command.get_arguments() {
            let help = argument.get_help().map(ToString::to_string);
            let help = help.unwrap_or_default();
            assert!(help.len() > 5, "{argument}: {help:?}");
        }
    }
}

#[test]
fn an_output_is_refused_whose_name_says_another_content() {
    for (line, remedy) in [
        ("fringed-lab experiment --out experiments.csv", "folder"),
        ("fringed-lab bench --out benchmarks.json", "folder"),
        ("fringed-lab bench --frames frames.NPY", "folder"),
        ("fringed-lab adapt r --method fringed --out x.png", ".npy"),
        ("fringed-lab adapt r --method fringed --out phase", ".npy"),
        ("fringed-lab adapt r --method fringed --out .npy", ".npy"),
    ] {
        let error = refused(line);
        assert_eq!(error.kind(), ErrorKind::ValueValidation, "{line}");
        assert!(error.to_string().contains(remedy), "{line}: {error}");
    }
    for line in [
        "fringed-lab adapt r --method fringed --out a.folder/x.npy",
        "fringed-lab adapt r --method fringed --out X.NPY",
    ] {
        let parsed = Arguments::try_parse_from(line.split_whitespace());
        assert!(parsed.is_ok(), "{line}");
    }
}

#[test]
fn a_number_out_of_its_bounds_is_refused_with_its_option_and_them() {
    for value in ["", "0", "-1", "101", "1.5", "18446744073709551616", "NaN"] {
        let line = format!("fringed-lab experiment --out x --seeds={value}");
        let error = refused(&line);
        assert_eq!(error.kind(), ErrorKind::ValueValidation, "{line}: {error}");
        for words in ["--seeds", "from 1 to 100"] {
            assert!(error.to_string().contains(words), "{line}: {error}");
        }
    }
    for value in [1, 100] {
        let line = format!("fringed-lab experiment --out x --seeds={value}");
        let parsed = Arguments::try_parse_from(line.split_whitespace());
        assert!(parsed.is_ok(), "{line}");
    }
}

#[test]
fn options_that_contradict_each_other_are_refused() {
    for line in [
        "fringed-lab bench --frames f --json",
        "fringed-lab bench --frames f --threads 1",
    ] {
        let error = refused(line);
        assert_eq!(error.kind(), ErrorKind::ArgumentConflict, "{line}: {error}");
    }
}
