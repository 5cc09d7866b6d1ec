//! A part that a station kept plays as a head.

use crate::history::{place_with_a_dent, recording};
use crate::station_plc::{Daemon, Place, Plc, long};
use appliance::recipe::{Recipe, archive};
use std::fs;
use std::path::Path;
use std::process::Command;

/// Word of VERDICT.
const FAIL: u16 = 2;

/// The recipe in a file projects this of its sequences in production.
fn project(recipe: &Path, production: usize) {
    let Recipe {
        mut file, arrays, ..
    } = Recipe::from_bytes(&fs::read(recipe).unwrap()).unwrap();
    file.production = production;
    fs::write(recipe, archive::pack(&file, &arrays).unwrap().0).unwrap();
}

#[test]
fn a_kept_fail_plays_as_a_head_to_test_a_plc_with_by_the_documented_commands() {
    let documented =
        fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/modbus.md"))
            .unwrap();
    // As taught all frames are projected; from the shortest on, the head that measured had the patterns of more.
    for production in [None, Some(0)] {
        let place = place_with_a_dent();
        if let Some(production) = production {
            project(&place.recipe(), production);
        }
        let daemon = Daemon::start(&place);
        let mut plc = Plc::connect(&daemon);
        let measured = plc.measure(9);
        assert_eq!(measured[8], FAIL);
        let kept = recording(&place, long(&measured, 0));
        assert_eq!(daemon.terminate().code(), Some(0));

        let (_, section) = documented
            .split_once("## A kept part as a test head")
            .unwrap();
        let block = |language: &str| {
            let (_, from) = section.split_once(&format!("```{language}\n")).unwrap();
            let (block, _) = from.split_once("```").unwrap();
            block.replace(
                "STATE/recordings/0000000042-0001-fail",
                kept.to_str().unwrap(),
            )
        };
        let commands = block("sh");
        let (import, serve) = commands.trim().split_once('\n').unwrap();
        assert!(
            serve.starts_with("fringed serve --config test.toml"),
            "{serve}"
        );
        // Where the commands are typed: beside the configuration.
        let elsewhere = Place::new();
        fs::write(elsewhere.path("test.toml"), block("toml")).unwrap();
        let typed = import.replace("fringed", env!("CARGO_BIN_EXE_fringed-under-test"));
        let mut words = typed.split_whitespace();
        let imported = Command::new(words.next().unwrap())
            .args(words)
            .current_dir(elsewhere.path(""))
            .output()
            .unwrap();
        assert!(imported.status.success(), "{imported:?}");
        fs::rename(elsewhere.path("test.toml"), elsewhere.path("fringed.toml")).unwrap();
        let daemon = Daemon::start(&elsewhere);
        let mut plc = Plc::connect(&daemon);
        for token in [3, 4] {
            let played = plc.measure(token);
            assert_eq!((played[3], played[8]), (measured[3], FAIL));
            assert_eq!(played[64..96], measured[64..96], "the same values");
        }
    }
}
