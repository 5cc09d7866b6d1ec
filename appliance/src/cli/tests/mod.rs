//! The command line: each command offers exactly the options that it uses, before and behind its
//! name.

mod numbers;

use super::Arguments;
use super::options::behind_the_command;
use clap::error::ErrorKind;
use clap::{Arg, Command, CommandFactory as _, Parser as _};
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;

/// What each shared option does in each command that offers it. A shared option that a command
/// offers without an entry here fails the test; options of a single command are described in its
/// help.
const SHARED: &[(&str, &str, &str)] = &[
    ("serve", "config", "everything that is configured"),
    ("serve", "state", "where recipes, history and counter are"),
    ("serve", "modbus", "where the PLC connects"),
    ("serve", "http", "where the page is"),
    ("serve", "threads", "of the measuring task"),
    ("serve", "quiet", "no progress, no log"),
    ("demo", "config", "ports, threads, history"),
    ("demo", "state", "where its recipe is taught to"),
    ("demo", "modbus", "where its PLC connects"),
    ("demo", "http", "where the page is"),
    ("demo", "threads", "of the measuring task"),
    ("demo", "quiet", "no progress, no log, no table"),
    ("demo", "json", "the table"),
    ("measure", "threads", "of decoding and triangulating"),
    ("measure", "quiet", "no table"),
    ("measure", "json", "the report"),
    ("doctor", "config", "which head"),
    ("doctor", "state", "where the head's calibration is"),
    (
        "doctor",
        "threads",
        "of the simulated light and of decoding",
    ),
    ("doctor", "quiet", "no progress, no table"),
    ("doctor", "json", "the steps"),
    ("calibrate", "config", "which head"),
    ("calibrate", "state", "where the calibration is written"),
    (
        "calibrate",
        "threads",
        "of the simulated light and of decoding",
    ),
    ("calibrate", "quiet", "no progress, no table"),
    ("calibrate", "json", "the report"),
    ("board", "quiet", "no closing line"),
    ("record", "config", "which head"),
    ("record", "state", "where the head's calibration is"),
    ("record", "threads", "of the simulated light"),
    ("record", "quiet", "no progress, no closing line"),
    ("teach", "config", "which head"),
    ("teach", "state", "where calibration and recipes are"),
    ("teach", "threads", "of the measurements"),
    ("teach", "quiet", "no progress, no reasons"),
    ("teach", "json", "the summary"),
    (
        "changes",
        "config",
        "names the state, and the most of the record",
    ),
    ("changes", "state", "where the record is"),
    ("changes", "json", "the lines, or what the check finds"),
    ("backup", "config", "names the state, and is in the backup"),
    ("backup", "state", "what is backed up"),
    ("backup", "quiet", "no line about the file"),
    ("history", "config", "names the state"),
    ("history", "state", "where the results are"),
    ("history", "json", "the results"),
    ("study cg", "json", "the figures"),
    ("study grr", "json", "the figures"),
    ("study process", "config", "names the state"),
    ("study process", "state", "where the results are"),
    ("study process", "json", "the figures"),
    ("replay", "config", "names the state and the calibration"),
    ("replay", "state", "where recipes and results are"),
    ("replay", "threads", "of the measurement"),
    ("replay", "quiet", "no table"),
    ("replay", "json", "both results"),
    ("recipe list", "config", "names the state"),
    ("recipe list", "state", "where the recipes are"),
    ("recipe list", "json", "the list"),
    ("recipe kinds", "json", "the table"),
    ("recipe export", "config", "names the state"),
    ("recipe export", "state", "where the recipes are"),
    ("recipe export", "quiet", "no closing line"),
    ("recipe gauges", "json", "what golden has"),
    ("recipe import", "config", "which head, and the state"),
    (
        "recipe import",
        "state",
        "where calibration and recipes are",
    ),
    ("recipe import", "quiet", "no closing line"),
    ("recipe delete", "config", "names the state"),
    ("recipe delete", "state", "where the recipes are"),
    ("recipe delete", "quiet", "no closing line"),
    ("recipe undo", "config", "names the state"),
    ("recipe undo", "state", "where the recipes are"),
    ("recipe undo", "quiet", "no closing line"),
    ("config check", "quiet", "no closing line"),
    ("config check", "json", "what is wrong"),
    ("config keys", "json", "the keys"),
    ("idle", "config", "which lines"),
    ("registers", "json", "the map"),
];

/// The commands that do something, with their words.
fn leaves() -> Vec<(String, Command)> {
    fn walk(words: &str, command: &Command, found: &mut Vec<(String, Command)>) {
        if !command.has_subcommands() {
            found.push((words.trim().to_owned(), command.clone()));
        }
        for inner in command.get_subcommands() {
            walk(&format!("{words} {}", inner.get_name()), inner, found);
        }
    }
    let mut found = Vec::new();
    walk("", &Arguments::command(), &mut found);
    found
}

fn options(command: &Command) -> impl Iterator<Item = &Arg> {
    command
        .get_arguments()
        .filter(|arg| arg.get_long().is_some())
}

fn shared() -> BTreeSet<(String, String)> {
    let all = SHARED.iter();
    all.map(|(command, option, _)| ((*command).to_owned(), (*option).to_owned()))
        .collect()
}

/// A line of words, as the shell hands it over.
fn words(line: &str) -> Vec<OsString> {
    line.split_whitespace().map(OsString::from).collect()
}

fn parse(line: &str) -> Result<Arguments, clap::Error> {
    let tree = Arguments::command();
    let arguments = words(line).into_iter();
    Arguments::try_parse_from(behind_the_command(&tree, arguments))
}

/// The error of a line that must be refused.
fn refused(line: &str) -> clap::Error {
    parse(line).expect_err(line)
}

#[test]
fn every_command_offers_exactly_the_shared_options_that_do_something_there() {
    let names: BTreeSet<String> = shared().into_iter().map(|(_, option)| option).collect();
    let mut offered = BTreeSet::new();
    for (words, command) in leaves() {
        for option in options(&command).filter_map(Arg::get_long) {
            if names.contains(option) {
                offered.insert((words.clone(), option.to_owned()));
            }
        }
    }
    assert_eq!(offered, shared());
    // The program without a command is `serve`.
    let tree = Arguments::command();
    let serve = tree.find_subcommand("serve").unwrap();
    let names = |command| {
        options(command)
            .filter_map(Arg::get_long)
            .collect::<Vec<_>>()
    };
    assert_eq!(names(&tree), names(serve));
}

#[test]
fn an_option_that_a_command_does_not_offer_is_refused_in_front_of_it_and_behind_it() {
    let names: BTreeMap<String, bool> = leaves()
        .iter()
        .flat_map(|(_, command)| options(command).cloned().collect::<Vec<_>>())
        .map(|option| {
            let takes = option.get_action().takes_values();
            (option.get_long().unwrap_or_default().to_owned(), takes)
        })
        .collect();
    let mut count = 0;
    for (command, tree) in leaves() {
        let own: BTreeSet<_> = options(&tree).filter_map(Arg::get_long).collect();
        for (option, takes) in names
            .iter()
            .filter(|(name, _)| !own.contains(name.as_str()))
        {
            let value = if *takes { "=1" } else { "" };
            for line in [
                format!("fringed --{option}{value} {command}"),
                format!("fringed {command} --{option}{value}"),
            ] {
                let error = refused(&line);
                assert_eq!(error.kind(), ErrorKind::UnknownArgument, "{line}: {error}");
                assert!(
                    error.to_string().contains(&format!("--{option}")),
                    "{error}"
                );
                count += 1;
            }
        }
    }
    assert!(count > 500, "{count}");
}

#[test]
fn an_option_stands_in_front_of_its_command_or_behind_it() {
    let tree = Arguments::command();
    for (given, read) in [
        ("fringed --config a serve", "fringed serve --config a"),
        ("fringed serve --config a", "fringed serve --config a"),
        ("fringed --config a", "fringed --config a"),
        (
            "fringed --config=a --quiet doctor --json",
            "fringed doctor --config=a --quiet --json",
        ),
        (
            "fringed --state a recipe list --json",
            "fringed recipe list --state a --json",
        ),
        (
            "fringed recipe --state a list",
            "fringed recipe list --state a",
        ),
        (
            "fringed --json --threads 2 measure serve --out x",
            "fringed measure --json --threads 2 serve --out x",
        ),
        // A value that is called like a command is a value.
        (
            "fringed --state serve history",
            "fringed history --state serve",
        ),
        ("fringed --no-such serve", "fringed --no-such serve"),
        ("fringed --help", "fringed --help"),
        ("fringed help serve", "fringed help serve"),
        ("fringed --config", "fringed --config"),
    ] {
        let moved = behind_the_command(&tree, words(given).into_iter());
        assert_eq!(moved, words(read), "{given}");
    }
}

#[test]
fn an_option_takes_a_value_in_every_command_or_in_none() {
    let mut takes = BTreeMap::new();
    for (words, command) in leaves() {
        for option in options(&command) {
            let name = option.get_long().unwrap_or_default().to_owned();
            let now = option.get_action().takes_values();
            assert_eq!(*takes.entry(name).or_insert(now), now, "{words} {option}");
        }
    }
}

#[test]
fn every_command_option_and_argument_says_in_the_help_what_it_does() {
    for (words, command) in leaves() {
        assert!(command.get_about().is_some(), "{words}");
        for argument in command.get_arguments() {
            let help = argument.get_help().map(ToString::to_string);
            let help = help.unwrap_or_default();
            assert!(help.len() > 5, "{words} {argument}: {help:?}");
        }
    }
}

#[test]
fn an_output_is_refused_whose_name_says_another_content() {
    for (line, remedy) in [
        ("fringed teach --number 2 --out x.npy", ".recipe"),
        (
            "fringed teach --number 2 --golden r --out x.json",
            ".recipe",
        ),
        ("fringed recipe export 2 x.zip", ".recipe"),
        ("fringed measure r --out height.png", "folder"),
        ("fringed measure r --out cloud.ply", "folder"),
        ("fringed record part.zip", "folder"),
    ] {
        let error = refused(line);
        assert_eq!(error.kind(), ErrorKind::ValueValidation, "{line}");
        assert!(error.to_string().contains(remedy), "{line}: {error}");
    }
    for line in [
        "fringed teach --number 2 --out 2.recipe",
        "fringed recipe export 2 2.recipe",
        "fringed measure r --out result",
        "fringed measure r --out part-1.5mm",
        "fringed record ../parts/2026.11.22",
    ] {
        assert!(parse(line).is_ok(), "{line}");
    }
}

#[test]
fn options_that_contradict_each_other_are_refused() {
    for line in [
        "fringed teach --number 2 --golden r --out 2.recipe --state s",
        "fringed doctor --scenario s.toml --state s",
        "fringed calibrate --unit mm",
        "fringed calibrate --z-away",
        "fringed calibrate --board checker:9x13:10 --poses a b --camera c --projector p",
        "fringed calibrate --board checker:9x13:10 --poses a b --scenario s.toml",
        "fringed history --csv --json",
    ] {
        let error = refused(line);
        let kinds = [
            ErrorKind::ArgumentConflict,
            ErrorKind::MissingRequiredArgument,
        ];
        assert!(kinds.contains(&error.kind()), "{line}: {error}");
    }
}
