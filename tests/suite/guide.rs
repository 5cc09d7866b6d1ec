//! The operations guide has every error code, and only log lines that the program writes; manual
//! pages are complete.

use crate::written::{collector, laboratory, program};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use tests::files;
use tests::program::Program;
use tests::shared::root;

/// The first cell of each table row below a heading of the operations guide.
fn first_cells(heading: &str) -> Vec<String> {
    first_cells_of("operations.md", heading)
}

/// The first cell of each table row below a heading of any document in `docs`.
fn first_cells_of(document: &str, heading: &str) -> Vec<String> {
    let text = fs::read_to_string(root().join("docs").join(document)).unwrap();
    let (_, below) = text.split_once(&format!("\n## {heading}\n")).unwrap();
    let section = below.split("\n## ").next().unwrap();
    let rows = section
        .lines()
        .filter_map(|line| line.strip_prefix("| "))
        .filter_map(|row| row.split(" | ").next());
    // Without the header row.
    rows.skip(1).map(str::to_owned).collect()
}

/// The text of all Rust files below a folder, with single spaces.
fn source(folder: &Path) -> String {
    let mut all = String::new();
    for name in files::names(folder) {
        let path = folder.join(name);
        if path.is_dir() {
            all += &source(&path);
        } else if path.extension().is_some_and(|end| end == "rs") {
            let text = fs::read_to_string(&path).unwrap();
            all.extend(text.split_whitespace().flat_map(|word| [word, " "]));
        }
    }
    all
}

/// The error codes in the program's source.
fn error_codes() -> BTreeSet<String> {
    let file = root().join("appliance/src/station/error_code.rs");
    let text = fs::read_to_string(file).unwrap();
    let numbers = text
        .lines()
        .filter_map(|line| line.split_once(": u16 = ")?.1.strip_suffix(';'));
    let defined: BTreeSet<_> = numbers
        .filter(|number| number.len() == 3)
        .map(str::to_owned)
        .collect();
    assert!(defined.len() > 10, "{defined:?}");
    defined
}

#[test]
fn the_register_map_s_document_knows_exactly_the_error_codes_that_there_are() {
    let cells = first_cells_of("modbus.md", "Faults");
    let codes = cells.iter().flat_map(|cell| cell.split(", "));
    let codes = codes.filter(|code| code.bytes().all(|byte| byte.is_ascii_digit()));
    let told: BTreeSet<_> = codes.map(str::to_owned).collect();
    assert_eq!(told, error_codes());
}

#[test]
fn the_guide_knows_exactly_the_error_codes_that_there_are() {
    let defined = error_codes();
    let told: BTreeSet<_> = first_cells("Error codes").into_iter().collect();
    assert_eq!(told, defined);
}

#[test]
fn every_line_of_the_log_in_the_guide_is_one_that_the_program_writes() {
    let source = source(&root().join("appliance/src")) + &source(&root().join("hal/src"));
    let lines = first_cells("Lines of the log");
    assert!(lines.len() > 20);
    for line in lines {
        for words in line.split(['…', ':']).map(str::trim) {
            assert!(source.contains(words), "{words:?} of {line:?}");
        }
    }
}

/// The manual pages that a program writes, by name.
fn manual(program: &Program) -> BTreeMap<String, String> {
    let folder = tempfile::tempdir().unwrap();
    let written = program.run(&["manual", folder.path().to_str().unwrap()]);
    assert_eq!(written.code, 0, "{}", written.stderr);
    let names = files::names(folder.path()).into_iter();
    let pages = names.map(|name| {
        let page = fs::read_to_string(folder.path().join(&name)).unwrap();
        (name, page.replace("\\-", "-"))
    });
    pages.collect()
}

/// The commands in the help of a program.
fn commands(help: &str) -> BTreeSet<String> {
    let (_, commands) = help.split_once("\nCommands:\n").unwrap();
    let lines = commands.split("\n\n").next().unwrap().lines();
    let first_words = lines.filter_map(|line| line.split_whitespace().next());
    first_words.map(str::to_owned).collect()
}

/// The long options in a help text.
fn options(help: &str) -> BTreeSet<String> {
    let (_, options) = help.split_once("\nOptions:\n").unwrap();
    let long = options.lines().filter_map(|line| line.split_once(" --"));
    long.map(|(_, option)| format!("--{}", option.split(' ').next().unwrap()))
        .collect()
}

/// The exit codes in the guide for operators.
fn exit_codes() -> BTreeSet<u8> {
    let guide = fs::read_to_string(root().join("docs/operations.md")).unwrap();
    let (_, codes) = guide.split_once("\n## Exit codes\n").unwrap();
    let codes = codes.split("\n## ").next().unwrap();
    let rows = codes.lines().filter_map(|line| line.strip_prefix("| "));
    rows.filter_map(|row| row.split(' ').next()?.parse().ok())
        .collect()
}

#[test]
fn a_program_writes_a_manual_page_for_each_command_with_its_options_and_the_exit_codes() {
    assert!(exit_codes().contains(&78));
    for (name, program) in [
        ("fringed", program()),
        ("fringed-lab", laboratory()),
        ("fringed-fleet", collector()),
    ] {
        let pages = manual(&program);
        for code in exit_codes() {
            assert!(
                pages[&format!("{name}.1")].contains(&format!("\n{code}: ")),
                "{name}, {code}"
            );
        }
        let mut commands = commands(&program.run(&["--help"]).stdout);
        assert!(commands.remove("help") && commands.len() > 3);
        for command in commands {
            let page = &pages[&format!("{name}-{command}.1")];
            for option in options(&program.run(&[&command, "--help"]).stdout) {
                assert!(page.contains(&option), "{name} {command} {option}");
            }
        }
    }
}
