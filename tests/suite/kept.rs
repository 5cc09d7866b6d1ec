//! A recording that a station kept is judged again, and replayed as a head.

use crate::history::{place_with_a_dent, reader, recording};
use crate::page::Browser;
use crate::station_plc::{Daemon, Place, Plc, long};
use crate::written::{FRINGED, program};
use appliance::recipe::file::archive;
use appliance::station::Verdict;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use tests::files;
use tests::program::Run;
use tests::shared::root;

/// Word of VERDICT.
const FAIL: u16 = 2;

fn replay(folder: &Path, more: &[&str]) -> Run {
    let mut arguments = vec!["replay", folder.to_str().unwrap()];
    arguments.extend(more);
    program().run(&arguments)
}

/// Starts the station of a place, with a new secret, and measures a part that FAILs: its SEQ, and the
/// folder of what is kept of it.
pub(crate) fn kept_failure(place: &Place) -> (Daemon, u32, PathBuf) {
    // The secret is shown once.
    let _ = fs::remove_file(place.path("state/access/secret"));
    let daemon = Daemon::start(place);
    let words = Plc::connect(&daemon).measure(9);
    assert_eq!(words[8], FAIL);
    let seq = long(&words, 0);
    let folder = recording(place, seq);
    (daemon, seq, folder)
}

#[test]
fn a_failed_part_is_kept_and_replays_bit_by_bit_and_a_difference_is_said() {
    let place = place_with_a_dent();
    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    let words = plc.measure(9);
    assert_eq!(words[8], FAIL);
    let folder = recording(&place, long(&words, 0));
    daemon.kill();
    let entry = reader(&place).result(long(&words, 0)).unwrap().unwrap();
    assert_eq!((entry.verdict, entry.part_id), (Verdict::Fail, 0x10009));
    assert_eq!(entry.gauges.len(), usize::from(words[27]));
    let first = entry.gauges[0].value.unwrap();
    assert_eq!(
        (first as f32).to_bits(),
        long(&words, 64),
        "the same value as in the registers"
    );

    let run = replay(&folder, &[]).succeeded();
    assert!(
        run.stdout.contains("FAIL") && run.stdout.contains("bit by bit"),
        "{}",
        run.stdout
    );
    // One thread and many give the same result.
    replay(&folder, &["--threads", "1"]).succeeded();

    // One frame of the finest level is replaced by another.
    fs::copy(folder.join("frames/008.png"), folder.join("frames/011.png")).unwrap();
    let run = replay(&folder, &[]);
    assert_eq!(run.code, 70, "{}", run.stderr);
    assert!(
        run.stderr.contains("differs from result 1"),
        "{}",
        run.stderr
    );

    // On another station the recording is unknown, but it can be judged.
    let elsewhere = place.path("elsewhere");
    fs::rename(&folder, &elsewhere).unwrap();
    let state = place.path("state");
    let run = replay(&elsewhere, &["--state", state.to_str().unwrap()]);
    assert_eq!(run.code, 66, "{}", run.stderr);
    assert!(
        run.stdout.contains("FAIL") && run.stderr.contains("compared with nothing"),
        "{}",
        run.stderr
    );
}

#[test]
fn a_kept_part_is_judged_again_by_its_own_recipe_after_that_was_edited_or_deleted_also_from_the_pages_zip()
 {
    let place = place_with_a_dent();
    let (daemon, seq, folder) = kept_failure(&place);
    let mut browser = Browser::new(&daemon);
    let (status, zip) = browser.ask("GET", &format!("/api/history/{seq}/recording.zip"), &[]);
    assert_eq!(status, 200);
    let file = place.path("part.zip");
    fs::write(&file, zip).unwrap();
    // Without limits the dent passes. With the new name no generation of the recipe that judged the
    // part remains.
    let taught = fs::read(place.recipe()).unwrap();
    assert_eq!(taught, fs::read(folder.join("recipe.recipe")).unwrap());
    browser.sign_in(&daemon);
    for name in ["lenient", "renamed"] {
        let recipe = browser.get("/api/recipes/1");
        let mut gauges = recipe["gauges"].clone();
        for gauge in gauges.as_array_mut().unwrap() {
            let gauge = gauge.as_object_mut().unwrap();
            gauge.retain(|key, _| key != "low" && key != "high");
        }
        let fingerprint = &recipe["fingerprint"];
        let edit = serde_json::json!({
            "fingerprint": fingerprint, "gauges": gauges, "name": name, "judges_nothing": true,
        });
        let (status, answer) = browser.json("PUT", "/api/recipes/1", &edit);
        assert_eq!(status, 200, "{answer}");
        browser.wait_for_another(fingerprint.as_str().unwrap());
    }
    daemon.kill();
    let own = |run: Run| {
        let said = run.succeeded().stdout;
        assert!(said.contains("the recording's own recipe"), "{said}");
        assert!(
            said.contains("FAIL") && said.contains("bit by bit"),
            "{said}"
        );
    };
    let state = place.path("state");
    let of_zip = ["--state", state.to_str().unwrap()];
    own(replay(&folder, &[]));
    own(replay(&file, &of_zip));
    let run = replay(&folder, &["--recipe", "stored"]).succeeded();
    assert!(
        run.stdout.starts_with("PASS") && run.stdout.contains("is FAIL, judged by another recipe"),
        "{}",
        run.stdout
    );
    for recipe in [
        place.recipe(),
        place.path("state/recipes/0001.recipe.previous"),
    ] {
        fs::remove_file(recipe).unwrap();
    }
    own(replay(&folder, &[]));
    own(replay(&file, &of_zip));
    let out = place.path("out");
    program().measure(&file, &out, &[]).succeeded();
    assert!(out.join("height.npy").exists());
    assert_eq!(replay(&folder, &["--recipe", "stored"]).code, 66);
    // A recording for whose recipe there was no room has none in it, so the recipe file is given.
    let named = place.path("named.recipe");
    fs::rename(folder.join("recipe.recipe"), &named).unwrap();
    assert_eq!(replay(&folder, &[]).code, 66);
    let run = replay(&folder, &["--recipe", named.to_str().unwrap()]).succeeded();
    assert!(run.stdout.contains("bit by bit"), "{}", run.stdout);
}

/// Changes which of its sequences the recipe in a file projects in production.
fn project(recipe: &Path, production: usize) {
    let (mut file, arrays) = files::recipe(&fs::read(recipe).unwrap());
    file.production = production;
    fs::write(recipe, archive::pack(&file, &arrays).unwrap().0).unwrap();
}

#[test]
fn a_kept_fail_plays_as_a_head_to_test_a_plc_with_by_the_documented_commands() {
    let documented = fs::read_to_string(root().join("docs/modbus.md")).unwrap();
    // A taught recipe projects all frames. If it starts with the shortest sequence, the head that
    // measured had the patterns of others too.
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
        // The commands run in the folder of the configuration.
        let elsewhere = Place::new();
        fs::write(elsewhere.path("test.toml"), block("toml")).unwrap();
        let typed = import.replace("fringed", FRINGED);
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
