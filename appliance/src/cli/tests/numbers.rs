//! Boundary values in every number of the command line: each is refused with its option and bounds,
//! or lies within them.

use super::super::options::SimulatedPart;
use super::{Arg, leaves};
use crate::config::HeadConfig;
use crate::error::Exit;
use crate::head::calibration::file::{COLDEST_C, HOTTEST_C};
use crate::study::Decimal;
use algo::calibration::Board;
use clap::error::ErrorKind;
use clap::{ArgMatches, FromArgMatches as _};
use std::any::TypeId;
use std::collections::BTreeSet;
use std::net::SocketAddr;
use std::path::PathBuf;

/// The kind of value that an option takes.
#[derive(Clone, Copy, PartialEq)]
enum Takes {
    /// A number within bounds.
    Number(f64, f64),
    /// So many numbers, each so far from 0 at most.
    List(usize, f64),
    /// An address with a port.
    Address,
    /// A number as it is written.
    AsWritten,
    /// A date; none of the values is one.
    Date,
    /// A defect of a simulated part.
    Defect,
    /// A floor below a simulated part.
    Floor,
    /// What changes in time.
    Unsteady,
    /// A checkerboard.
    Checker,
    /// Text, which has no numeric bounds.
    Words,
}
use Takes::{Address, AsWritten, Checker, Date, Defect, Floor, List, Number, Unsteady, Words};

/// Every option and positional argument that takes neither a path nor one word of a list; `*` is
/// every other command.
const TABLE: &[(&str, &str, Takes)] = &[
    ("*", "threads", Number(0.0, 256.0)),
    ("*", "number", Number(1.0, 9999.0)),
    ("*", "modbus", Address),
    ("*", "http", Address),
    ("history", "part", Number(0.0, 4_294_967_295.0)),
    ("*", "part", Words),
    ("*", "defect", Defect),
    ("*", "floor", Floor),
    ("*", "unsteady", Unsteady),
    ("*", "shift", List(3, 1000.0)),
    ("*", "tilt", List(2, 80.0)),
    ("*", "pose", Number(1.0, 10.0)),
    ("*", "rotate", Number(-360.0, 360.0)),
    ("calibrate", "temperature", Number(COLDEST_C, HOTTEST_C)),
    ("calibrate", "plane_at", Number(1.0, 10_000.0)),
    ("calibrate", "board", Checker),
    ("calibrate", "board_sigma_ppm", Number(0.0, 1e5)),
    ("calibrate", "check_length", Number(1e-3, 1e5)),
    ("board", "board", Checker),
    ("record", "fringes", Number(1e-3, 1000.0)),
    ("record", "levels", Number(1.0, 8.0)),
    ("record", "steps", Number(3.0, 64.0)),
    ("teach", "part_number", Words),
    ("teach", "name", Words),
    ("teach", "tolerance", Number(0.0, 20.0)),
    ("teach", "limit", Number(0.001, 100.0)),
    ("teach", "exposures", Number(1.0, 4.0)),
    ("teach", "frames", Number(2.0, 2.0)),
    ("changes", "recipe", Number(1.0, 9999.0)),
    ("changes", "user", Words),
    ("changes", "since", Date),
    ("changes", "until", Date),
    ("changes", "limit", Number(1.0, 1e7)),
    ("history", "recipe", Number(1.0, 9999.0)),
    ("history", "verdict", Words),
    ("history", "since", Date),
    ("history", "until", Date),
    ("history", "limit", Number(1.0, 1e7)),
    ("*", "characteristic", Words),
    ("*", "reference", AsWritten),
    ("*", "low", AsWritten),
    ("*", "high", AsWritten),
    ("study cg", "tolerance", Number(1e-12, 1e12)),
    ("*", "resolution", Number(0.0, 1e12)),
    ("*", "u_reference", Number(0.0, 1e12)),
    ("*", "u_other", Number(0.0, 1e12)),
    ("study cg", "share", Number(0.1, 100.0)),
    ("study cg", "spread", Number(1.0, 12.0)),
    ("study cg", "least_cg", Number(0.0, 100.0)),
    ("study cg", "least_cgk", Number(0.0, 100.0)),
    ("*", "most_q", Number(0.0, 1000.0)),
    ("study grr", "pool", Number(0.0, 1.0)),
    ("study grr", "fit", Number(0.0, 1000.0)),
    ("study grr", "conditions", Number(0.0, 1000.0)),
    ("study grr", "least_ndc", Number(0.0, 1000.0)),
    ("study process", "recipe", Number(1.0, 9999.0)),
    ("study process", "slot", Number(1.0, 64.0)),
    ("study process", "since", Date),
    ("study process", "until", Date),
    ("study process", "tests", Number(1.0, 8.0)),
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
        let beside = |others: &[&str]| {
            (0..others.len())
                .map(|at| {
                    let mut all = others.to_vec();
                    all[at] = value;
                    all.join(",")
                })
                .collect()
        };
        match self {
            Number(..) | AsWritten | Date => vec![value.to_owned()],
            List(count, _) => beside(&["0"; 3][..count]),
            Address => vec![format!("127.0.0.1:{value}")],
            Defect => {
                let dents: Vec<String> = beside(&["0", "0", "0.3", "8"]);
                let dents = dents.into_iter().map(|numbers| format!("dent:{numbers}"));
                let others = ["missing_hole", "bent_flange"].map(|kind| format!("{kind}:{value}"));
                dents.chain(others).collect()
            }
            Unsteady => ["lamp_depth={}", "lamp_hz=50,shake_mm=[0,0,{}]"]
                .map(|form| form.replace("{}", value))
                .into(),
            Floor => beside(&["0.35", "20"]),
            Checker => ["{}x13:10", "9x{}:10", "9x13:{}"]
                .map(|form| format!("checker:{}", form.replace("{}", value)))
                .into(),
            Words => Vec::new(),
        }
    }

    /// What a refusal says in addition to the option's name.
    fn bounds(self) -> Vec<String> {
        match self {
            Number(low, high) => vec![format!("from {low} to {high}")],
            List(_, most) => vec![format!("from -{most} to {most}")],
            Address => vec!["0 to 65535".into()],
            AsWritten => vec!["write a number".into()],
            Date => vec!["write a date".into()],
            Defect | Floor | Unsteady => vec!["write ".into()],
            Checker => vec!["write checker:".into()],
            Words => Vec::new(),
        }
    }
}

/// The numbers that were read.
fn read(matches: &ArgMatches, id: &str) -> Vec<f64> {
    fn one<T: Copy + Send + Sync + 'static>(matches: &ArgMatches, id: &str) -> Option<T> {
        matches.try_get_one::<T>(id).ok().flatten().copied()
    }
    let single = one::<f64>(matches, id)
        .or_else(|| one::<u8>(matches, id).map(f64::from))
        .or_else(|| one::<u16>(matches, id).map(f64::from))
        .or_else(|| one::<u32>(matches, id).map(f64::from))
        .or_else(|| one::<u64>(matches, id).map(|whole| whole as f64));
    let list = one::<[f64; 2]>(matches, id).map(Vec::from);
    let list = list.or_else(|| one::<[f64; 3]>(matches, id).map(Vec::from));
    single
        .map(|number| vec![number])
        .or(list)
        .unwrap_or_default()
}

#[test]
fn a_boundary_value_of_an_option_is_refused_with_its_bounds_or_lies_within_them() {
    let long = "x".repeat(100_000);
    let (mut cases, mut taken, mut known) = (0, 0, BTreeSet::new());
    for (words, command) in leaves() {
        let command = command.mut_args(|argument| argument.required(false));
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
                    let written = match argument.get_long() {
                        Some(long) => vec![format!("--{long}={text}")],
                        None => vec!["--".into(), text],
                    };
                    let matches = command
                        .clone()
                        .no_binary_name(true)
                        .try_get_matches_from(written);
                    cases += 1;
                    taken += usize::from(check(argument, takes, matches, &case));
                }
            }
        }
    }
    println!("{cases} boundary values of options, {taken} of them can be used");
    assert_eq!(known.len(), TABLE.len(), "an option is gone");
    assert_eq!(cases, 2057);
}

/// Checks the outcome of a case; returns whether its value was accepted.
fn check(
    argument: &Arg,
    takes: Takes,
    matches: Result<ArgMatches, clap::Error>,
    case: &str,
) -> bool {
    let id = argument.get_id().as_str();
    let name = argument
        .get_long()
        .map_or(id.to_uppercase(), |long| format!("--{long}"));
    let matches = match matches {
        Ok(matches) => matches,
        // The value itself was accepted.
        Err(error) if error.kind() == ErrorKind::MissingRequiredArgument => return true,
        Err(error) => {
            // The program ends with 64.
            assert!(error.use_stderr(), "{case}");
            let words = error.to_string();
            assert!(words.contains(&name), "{case}: {words}");
            for bounds in takes.bounds() {
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
        List(count, most) => {
            let numbers = read(&matches, id);
            assert_eq!(numbers.len(), count, "{case}");
            assert!(numbers.iter().all(|number| number.abs() <= most), "{case}");
        }
        Address => assert!(matches.get_one::<SocketAddr>(id).is_some(), "{case}"),
        Defect | Floor | Unsteady => {
            let part = SimulatedPart::from_arg_matches(&matches).unwrap();
            if let Err(refused) = part.placed(&HeadConfig::default()) {
                assert_eq!(refused.exit, Exit::Usage, "{case}");
                let words = refused.to_string();
                assert!(words.contains(&name), "{case}: {words}");
                assert!(words.contains(&takes.bounds()[0]), "{case}: {words}");
                return false;
            }
        }
        AsWritten => assert!(matches.get_one::<Decimal>(id).is_some(), "{case}"),
        Checker => assert!(matches.get_one::<Board>(id).is_some(), "{case}"),
        Date | Words => panic!("{case} was taken"),
    }
    true
}
