//! The history: what it shows, and that it survives kill -9.

use crate::page::Browser;
use crate::station_plc::{Daemon, Place, Plc, READY, long, trigger};
use crate::written::{FRINGED, program};
use appliance::history::{Entry, Filter, Reader, Writer};
use appliance::station::Verdict;
use std::fs;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use tests::program::Program;
use tests::random::Random;
use tests::until::{PATIENCE, until};

pub(crate) fn reader(place: &Place) -> Reader {
    Reader::of(&place.path("state"))
}

fn all() -> Filter {
    Filter {
        limit: usize::MAX,
        ..Filter::default()
    }
}

/// Kills a measuring daemon `times` times at random moments; the PLC remembers every SEQ that it
/// read.
fn kills(times: usize) {
    let place = Place::taught();
    let mut random = Random::new(0x5EED_0019);
    let mut shown: Vec<u32> = Vec::new();
    // The last SEQ that the PLC read before each kill: it may not have been stored yet.
    let mut in_flight: Vec<u32> = Vec::new();
    let mut skipped = 0;
    for _ in 0..times {
        let daemon = Daemon::start(&place);
        let mut plc = Plc::connect(&daemon);
        let before = plc.wait("READY", |status| status.has(READY)).seq();
        assert!(
            shown.last().is_none_or(|&last| before >= last),
            "a SEQ comes back"
        );
        skipped += before - shown.last().copied().unwrap_or(0);
        for token in 1..=1 + (random.below(4) as u16) {
            shown.push(long(&plc.measure(token), 0));
        }
        // One more cycle is running: it may be anywhere between its trigger and the time after its
        // result.
        plc.wait("READY", |status| status.has(READY));
        plc.write(1, &trigger(100));
        let moment = Duration::from_micros(random.below(20_000) as u64);
        let triggered = Instant::now();
        while triggered.elapsed() < moment {
            let words = plc.read(200, 20).unwrap();
            if words[2] == 100 && shown.last() != Some(&long(&words, 0)) {
                shown.push(long(&words, 0));
            }
        }
        daemon.kill();
        in_flight.extend(shown.last());
    }
    let daemon = Daemon::start(&place);
    assert_eq!(daemon.terminate().code(), Some(0));
    assert!(
        shown.is_sorted_by(|a, b| a < b),
        "a SEQ was used twice: {shown:?}"
    );
    let mut stored: Vec<u32> = reader(&place)
        .results(&all())
        .unwrap()
        .iter()
        .map(|entry| entry.seq)
        .collect();
    stored.reverse();
    assert!(
        stored.is_sorted_by(|a, b| a < b),
        "a SEQ is stored twice: {stored:?}"
    );
    let missing = |seq: &&u32| !stored.contains(seq);
    let lost: Vec<_> = shown.iter().filter(missing).collect();
    assert!(
        lost.iter().all(|seq| in_flight.contains(seq)),
        "lost: {lost:?}"
    );
    // Each kill loses at most the result of the running cycle.
    assert!(skipped <= times as u32, "{skipped}");
    println!(
        "{times} kills: {} results shown, {} of them in flight and lost, {skipped} SEQs skipped, none used twice",
        shown.len(),
        lost.len()
    );
}

#[test]
fn kill_9_loses_at_most_the_result_in_flight_and_no_seq_comes_back() {
    kills(6);
}

#[test]
#[ignore = "minutes: `.ci/run full` does it"]
fn many_kills_lose_at_most_the_result_in_flight_and_no_seq_comes_back() {
    kills(200);
}

/// A station that was taught with a good part, and now sees a part with a dent.
pub(crate) fn place_with_a_dent() -> Place {
    let place = Place::taught();
    let scenario = fs::read_to_string(place.path("small.toml")).unwrap();
    let dent = "{ kind = \"dent\", x = 0.0, y = -8.0, depth_mm = 0.9, diameter_mm = 14.0 }";
    let part = format!("{scenario}\n[part]\nkind = \"sheet_metal\"\ndefects = [{dent}]\n");
    fs::write(place.path("small.toml"), part).unwrap();
    place
}

/// Waits for the recording of a result.
pub(crate) fn recording(place: &Place, seq: u32) -> PathBuf {
    until(&format!("recording of result {seq}"), PATIENCE, || {
        reader(place).recording(seq).unwrap().ok_or(())
    })
}

#[test]
fn the_history_is_shown_and_exported_while_the_station_runs() {
    let place = place_with_a_dent();
    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    let seq = long(&plc.measure(9), 0);
    recording(&place, seq);
    let state = place.path("state");
    let history = |more: &[&str]| {
        let mut arguments = vec!["history", "--state", state.to_str().unwrap()];
        arguments.extend(more);
        program().run(&arguments)
    };
    let shown = history(&[]).succeeded().stdout;
    assert!(
        shown.contains("FAIL") && shown.contains("deviation -"),
        "{shown}"
    );
    let csv = history(&["--csv", "--verdict", "fail"]).succeeded().stdout;
    assert_eq!(csv.lines().count(), 2, "{csv}");
    assert_eq!(
        history(&["--csv", "--verdict", "pass"])
            .succeeded()
            .stdout
            .lines()
            .count(),
        1
    );
    // A disk that is full is told, and a pager that was closed is none of the user's concern.
    let into = |end: &str| {
        let (fringed, state) = (FRINGED, state.display());
        let words = format!("set -o pipefail; {fringed} history --csv --state {state} {end}");
        Program::at("bash").run(&["-c", &words])
    };
    let full = into("> /dev/full");
    assert_eq!(full.code, 73, "{}", full.stderr);
    assert!(full.stderr.contains("free space"), "{}", full.stderr);
    into("| true").succeeded();
    let json = history(&["--json", "--recipe", "1"]).succeeded().stdout;
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["results"][0]["verdict"], "FAIL");
    assert_eq!(json["results"][0]["gauges"][0]["name"], "deviation");
    assert_eq!(history(&["--verdict", "good"]).code, 64);
    assert_eq!(daemon.terminate().code(), Some(0));
    let nothing = place.path("nothing");
    let run = program().run(&["history", "--state", nothing.to_str().unwrap()]);
    assert_eq!(run.code, 66, "{}", run.stderr);
}

#[test]
fn recipes_are_listed_exported_imported_and_deleted_and_nothing_damaged_or_foreign_comes_in() {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let config = place.path("fringed.toml");
    let recipe = |more: &[&str]| {
        let mut arguments = vec!["recipe", "--config", config.to_str().unwrap()];
        arguments.extend(more);
        program().run(&arguments)
    };
    let file = place.path("one.recipe");
    let file = file.to_str().unwrap();
    recipe(&["export", "1", file]).succeeded();
    let exported = fs::read(file).unwrap();
    assert_eq!(exported, fs::read(place.recipe()).unwrap());
    assert_eq!(daemon.terminate().code(), Some(0));
    recipe(&["delete", "1"]).succeeded();
    assert_eq!(recipe(&["delete", "1"]).code, 66);
    assert!(!place.recipe().exists());

    let mut damaged = exported.clone();
    let middle = damaged.len() / 2;
    damaged[middle] ^= 1;
    for (content, words) in [
        (&damaged[..], "checksum"),
        (&exported[..999], "recipe"),
        (b"", "recipe"),
    ] {
        fs::write(file, content).unwrap();
        let run = recipe(&["import", file]);
        assert_eq!(run.code, 65, "{}", run.stderr);
        assert!(
            run.stderr.contains(words) && run.stderr.contains("one.recipe"),
            "{}",
            run.stderr
        );
    }
    assert_eq!(recipe(&["import", "/no/such.recipe"]).code, 66);
    fs::write(file, &exported).unwrap();
    let foreign = program().run(&[
        "recipe",
        "import",
        file,
        "--state",
        place.path("other").to_str().unwrap(),
    ]);
    assert_eq!(foreign.code, 65, "{}", foreign.stderr);
    assert!(foreign.stderr.contains("calibration"), "{}", foreign.stderr);
    assert!(!place.recipe().exists());
    recipe(&["import", file]).succeeded();
    recipe(&["import", file]).succeeded();
    assert_eq!(fs::read(place.recipe()).unwrap(), exported);
    let listed = recipe(&["list", "--json"]).succeeded().stdout;
    let listed: serde_json::Value = serde_json::from_str(&listed).unwrap();
    let only = &listed["recipes"][0];
    assert_eq!(
        (&only["number"], &only["previous"]),
        (&1.into(), &false.into()),
        "the same recipe again takes no previous generation's place"
    );
    assert_eq!(only["bytes"], exported.len());
    assert!(recipe(&["list"]).succeeded().stdout.contains("PART-0001"));
}

#[test]
fn a_stored_result_opens_with_the_pictures_of_the_live_view_and_one_without_frames_says_why() {
    let place = place_with_a_dent();
    let config = fs::read_to_string(place.path("fringed.toml")).unwrap();
    // Space for two parts with their pattern, and for one recipe.
    let bounded = format!("{config}[history]\nrecordings_mib = 24\n");
    fs::write(place.path("fringed.toml"), bounded).unwrap();
    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    let mut browser = Browser::new(&daemon);
    let seq = long(&plc.measure(1), 0);
    recording(&place, seq);
    let one = browser.get(&format!("/api/history/{seq}"));
    assert!(one["no_frames"].is_null(), "{one}");
    assert_eq!(one["result"]["gauges"][0]["name"], "deviation");
    let flags = one["flags"].to_string();
    assert!(flags.contains("the head is simulated"), "{flags}");
    for layer in ["height", "deviation", "modulation"] {
        let (status, live) = browser.ask("GET", &format!("/api/picture/{layer}"), &[]);
        let (kept_status, kept) =
            browser.ask("GET", &format!("/api/history/{seq}/picture/{layer}"), &[]);
        assert_eq!((status, kept_status), (200, 200), "{layer}");
        assert!(live == kept, "{layer}: not the live view's picture");
    }
    assert_eq!(
        browser
            .ask("GET", &format!("/api/history/{seq}/picture/x"), &[])
            .0,
        404
    );
    assert_eq!(browser.ask("GET", "/api/history/99", &[]).0, 404);
    let mut last = seq;
    while reader(&place).recording(seq).unwrap().is_some() {
        assert!(last < seq + 20, "the quota removes nothing");
        last = long(&plc.measure(last as u16 + 1), 0);
        // Each has been written, or the first one removed.
        until(&format!("recording of result {last}"), PATIENCE, || {
            let [first, newest] = [seq, last].map(|seq| reader(&place).recording(seq).unwrap());
            (first.is_none() || newest.is_some())
                .then_some(())
                .ok_or(first)
        });
    }
    let why = browser.get(&format!("/api/history/{seq}"))["no_frames"].to_string();
    assert!(why.contains("history.recordings_mib"), "{why}");
    drop((plc, daemon));
    fs::write(
        place.path("fringed.toml"),
        format!("{config}[history]\nrecordings_mib = 0\n"),
    )
    .unwrap();
    let daemon = Daemon::start(&place);
    let mut browser = Browser::new(&daemon);
    let seq = long(&Plc::connect(&daemon).measure(1), 0);
    until("words about the recording", PATIENCE, || {
        let path = format!("/api/history/{seq}/picture/height");
        let (status, answer) = browser.ask("GET", &path, &[]);
        let words = String::from_utf8(answer).unwrap();
        assert_eq!(status, 404, "{words}");
        match words.contains("switched off") {
            true => Ok(()),
            false => Err(words),
        }
    });
}

#[test]
fn a_list_by_time_says_how_many_results_it_leaves_out_because_their_time_is_not_known() {
    let folder = tempfile::tempdir().unwrap();
    let database = folder.path().join("history.db");
    let mut writer = Writer::open(&database, 1000).unwrap().0;
    let entries: Vec<_> = (1..=3)
        .map(|seq| Entry {
            seq,
            time_utc_us: (seq == 3).then_some(1_790_000_000_000_000),
            uptime_s: 3600,
            boot_id: "0000b007".into(),
            verdict: Verdict::Pass,
            ..Entry::default()
        })
        .collect();
    writer.store(entries.iter()).unwrap();
    let state = folder.path().to_str().unwrap();
    let history = |more: &[&str]| {
        let arguments = [&["history", "--state", state][..], more];
        program().run(&arguments.concat()).succeeded()
    };
    let words = "2 results are left out";
    for more in [&["--csv"][..], &["--json"], &[]] {
        let run = history(&[&["--since", "2026-01-01"][..], more].concat());
        assert!(run.stderr.contains(words), "{}", run.stderr);
        assert!(!run.stdout.contains(words), "{}", run.stdout);
        assert_eq!(history(more).stderr, "");
    }
    let shown = history(&[]).stdout;
    assert!(shown.contains("1:00:00 after start"), "{shown}");
    writer.date("0000b007", 1_780_000_000_000_000).unwrap();
    let run = history(&["--since", "2026-01-01"]);
    assert_eq!(run.stderr, "");
    assert!(
        run.stdout.contains("≈2026-05-28T21:26:40"),
        "{}",
        run.stdout
    );
}

/// Position of TIME in the registers from 200.
const TIME: usize = 14;

#[test]
fn the_time_of_a_browser_dates_history_and_log_and_never_the_register() {
    let place = place_with_a_dent();
    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    let before = long(&plc.measure(1), 0);
    let mut browser = Browser::new(&daemon);
    let time_ms = 1_790_000_000_000_u64;
    let said = browser.sign_in_at(&daemon, time_ms);
    let words = plc.measure(2);
    let time = &words[TIME..TIME + 4];
    let results = until("second result", PATIENCE, || {
        let results = browser.get("/api/history")["results"].clone();
        match results.as_array().unwrap().len() {
            2 => Ok(results),
            _ => Err(results),
        }
    });
    let log = browser.get("/api/log")["lines"].clone();
    if said == "not needed" {
        // This computer's clock is synchronised.
        assert!(time != [0; 4] && results[0]["browser_utc_us"].is_null());
        return;
    }
    assert_eq!((said.as_str(), time), ("taken", &[0; 4][..]));
    // Both results of this start, also the one before the sign-in.
    assert_eq!(results[1]["seq"], before);
    for result in [&results[0], &results[1], &log[0]] {
        let us = result["browser_utc_us"].as_u64().unwrap();
        assert!(us.abs_diff(time_ms * 1000) < 60_000_000, "{result}");
        assert!(result["time_utc_us"].is_null() && result["utc_us"].is_null());
    }
}
