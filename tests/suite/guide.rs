//! The operations guide has every error code, and only log lines that the program writes; the
//! manual page is complete.

use crate::written::{collector, laboratory, program};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use tests::files;
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

/// A manual page.
struct Page(String);

impl Page {
    fn of(program: &str) -> Self {
        let file = root().join("debian").join(program).with_extension("1");
        Self(fs::read_to_string(file).unwrap())
    }

    /// The first words of the items of a kind.
    fn items(&self, kind: &str) -> BTreeSet<String> {
        let of_kind = self.0.lines().filter_map(|line| line.strip_prefix(kind));
        of_kind
            .map(|item| item.split(' ').next().unwrap().to_owned())
            .collect()
    }

    fn exit_codes(&self) -> BTreeSet<u8> {
        let items = self.items(".It ");
        items.iter().filter_map(|item| item.parse().ok()).collect()
    }
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
    long.map(|(_, option)| format!("-{}", option.split(' ').next().unwrap()))
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
fn the_manual_page_has_exactly_the_commands_options_and_exit_codes_that_there_are() {
    let page = Page::of("fringed");
    let help = program().run(&["--help"]).stdout;
    let mut told = page.items(".It Cm ");
    assert!(told.insert("help".to_owned()) && told.len() > 10);
    assert_eq!(told, commands(&help));
    let mut options = options(&help);
    let mut told = page.items(".It Fl ");
    assert!(told.insert("-version".to_owned()));
    // `serve`, which runs without a command, prints no table.
    assert!(options.insert("-json".to_owned()));
    assert_eq!(told, options);
    assert!(exit_codes().contains(&78));
    assert_eq!(page.exit_codes(), exit_codes());
}

#[test]
fn the_other_manual_pages_have_exactly_the_commands_and_options_that_there_are() {
    for (name, program) in [
        ("fringed-lab", laboratory()),
        ("fringed-fleet", collector()),
    ] {
        let page = Page::of(name);
        let help = program.run(&["--help"]).stdout;
        let mut told = page.items(".It Cm ");
        assert!(told.insert("help".to_owned()));
        assert_eq!(told, commands(&help));
        let names = told.iter().filter(|name| *name != "help");
        let help: Vec<_> = names
            .map(|name| program.run(&[name.as_str(), "--help"]).stdout)
            .collect();
        assert_eq!(
            page.items(".It Fl "),
            help.iter().flat_map(|help| options(help)).collect()
        );
        assert!(page.exit_codes().is_subset(&exit_codes()));
    }
}
