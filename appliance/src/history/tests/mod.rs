//! What is stored is read again, bit by bit; filters, bounds, damage.

mod log;

use super::*;
use crate::station::snapshot::warning;
use crate::station::{
    Counts, Effect, Identity, Inspection, Limits, Micros, Placement, ResultRecord, Settings, Stage,
    Stages, Station, StationHandle, Verdict,
};
use crate::storage::state::StateFolder;
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

const ENOUGH: u64 = 1000;

fn entry(seq: u32, recipe: u16, verdict: Verdict) -> Entry {
    // The second slot is empty.
    let gauge = |slot, name: &str, value: f64| GaugeEntry {
        slot,
        name: name.into(),
        unit: "mm".into(),
        value: Some(value),
        reason: None,
        sigma: None,
        uncertainty: Some(value / 7.0),
        expected: None,
        square: None,
        low: Some(-0.25),
        high: Some(0.1 + 0.2),
        decision: 3,
    };
    let mut stages = Stages::default();
    stages.add(Stage::Strips, 7);
    Entry {
        seq,
        time_utc_us: Some(1_000_000 * u64::from(seq)),
        recipe,
        fingerprint: "00c0ffee".into(),
        part_id: u32::MAX - seq,
        verdict,
        reason: Some("a, \"b\"".into()),
        height_noise_mm: Some(f64::from(seq) / 3.0),
        stages,
        gauges: vec![
            gauge(1, "deviation", f64::from(seq).sqrt()),
            gauge(3, "-step", f64::MIN_POSITIVE),
        ],
        ..Entry::default()
    }
}

fn some(count: u32) -> Vec<Entry> {
    let verdicts = [Verdict::Pass, Verdict::Fail, Verdict::Invalid];
    (1..=count)
        .map(|seq| entry(seq, (seq % 2) as u16 + 1, verdicts[seq as usize % 3]))
        .collect()
}

fn open_writer(state: &Path) -> Writer {
    bounded(state, ENOUGH)
}

fn bounded(state: &Path, limit: u64) -> Writer {
    let (writer, complaint) = Writer::open(&state.join(DATABASE), limit).unwrap();
    assert_eq!(complaint, None);
    writer
}

fn seqs(reader: &Reader, filter: &Filter) -> Vec<u32> {
    let found = reader.results(filter).unwrap();
    found.iter().map(|entry| entry.seq).collect()
}

#[test]
fn what_was_stored_is_read_again_bit_by_bit_and_while_the_writer_is_open() {
    let state = tempfile::tempdir().unwrap();
    let stored = some(3);
    let mut writer = bounded(state.path(), ENOUGH);
    writer.store(stored.iter()).unwrap();
    let reader = Reader::of(state.path());
    let mut read = reader.results(&Filter::default()).unwrap();
    read.reverse();
    assert_eq!(read, stored);
    assert_eq!(reader.result(2).unwrap().as_ref(), stored.get(1));
    assert_eq!(reader.result(9).unwrap(), None);
    assert_eq!(writer.last_seq().unwrap(), Some(3));
    drop(writer);
    assert_eq!(bounded(state.path(), ENOUGH).last_seq().unwrap(), Some(3));
}

#[test]
fn each_condition_of_a_filter_leaves_out_what_it_says() {
    let state = tempfile::tempdir().unwrap();
    bounded(state.path(), ENOUGH)
        .store(some(12).iter())
        .unwrap();
    let reader = Reader::of(state.path());
    let all = Filter::default();
    let filter = |change: &dyn Fn(&mut Filter)| {
        let mut filter = all.clone();
        change(&mut filter);
        seqs(&reader, &filter)
    };
    assert_eq!(filter(&|f| f.limit = 2), [12, 11]);
    assert_eq!(filter(&|f| f.recipe = Some(1)), [12, 10, 8, 6, 4, 2]);
    assert_eq!(filter(&|f| f.verdict = Some(Verdict::Fail)), [10, 7, 4, 1]);
    assert_eq!(filter(&|f| f.part_id = Some(u32::MAX - 5)), [5]);
    assert_eq!(filter(&|f| f.since_us = Some(11_000_000)), [12, 11]);
    assert_eq!(filter(&|f| f.until_us = Some(3_000_000)), [2, 1]);
    assert_eq!(filter(&|f| f.before_seq = Some(3)), [2, 1]);
    assert_eq!(
        reader.counts(&all).unwrap(),
        Counts {
            pass: 4,
            fail: 4,
            invalid: 4
        }
    );
}

#[test]
fn a_trend_has_the_last_values_of_a_recipe_oldest_first() {
    let state = tempfile::tempdir().unwrap();
    bounded(state.path(), ENOUGH)
        .store(some(12).iter())
        .unwrap();
    let reader = Reader::of(state.path());
    let trends = reader.trends(2, 3).unwrap();
    assert_eq!(trends[0].name, "deviation");
    let points: Vec<_> = trends[0].points.iter().map(|p| (p.seq, p.value)).collect();
    let root = |seq: u32| (seq, Some(f64::from(seq).sqrt()));
    assert_eq!(points, [root(7), root(9), root(11)]);
    assert_eq!(reader.fitness(2, 2).unwrap(), [(9, 0), (11, 0)]);
}

#[test]
fn the_oldest_results_go_when_there_are_too_many() {
    let state = tempfile::tempdir().unwrap();
    let mut writer = bounded(state.path(), 5);
    for entry in some(12) {
        writer.store([entry].iter()).unwrap();
    }
    let reader = Reader::of(state.path());
    assert_eq!(seqs(&reader, &Filter::default()), [12, 11, 10, 9, 8]);
    // Nothing of those that went stays behind.
    let connection = reader.open().unwrap();
    let gauges: u64 = connection
        .query_row("SELECT count(*) FROM gauge", (), |row| row.get(0))
        .unwrap();
    assert_eq!(gauges, 10);
    drop(writer);
    bounded(state.path(), 2)
        .store([entry(13, 1, Verdict::Pass)].iter())
        .unwrap();
    assert_eq!(seqs(&reader, &Filter::default()), [13, 12]);
}

#[test]
fn recordings_are_linked_to_the_newest_result_of_their_seq() {
    let state = tempfile::tempdir().unwrap();
    let mut writer = bounded(state.path(), ENOUGH);
    writer.store(some(3).iter()).unwrap();
    writer.link(2, "two").unwrap();
    let reader = Reader::of(state.path());
    let place = state.path().join(RECORDINGS).join("two");
    assert_eq!(reader.recording(2).unwrap(), Some(place));
    assert_eq!(reader.recording(3).unwrap(), None);
    assert_eq!(writer.linked().unwrap(), ["two"]);
    writer.unlink("two", &Unkept::Quota).unwrap();
    assert_eq!(reader.recording(2).unwrap(), None);
    let entry = reader.result(2).unwrap().unwrap();
    assert_eq!(entry.unkept.as_deref(), Some("quota"));
    writer.link(2, "two").unwrap();
    let entry = reader.result(2).unwrap().unwrap();
    assert_eq!((entry.unkept.as_ref(), why_no_frames(&entry)), (None, None));
}

#[test]
fn each_part_without_frames_says_why() {
    use hal::replay::recorder::RecorderError;
    let state = tempfile::tempdir().unwrap();
    let mut writer = open_writer(state.path());
    writer.store(some(3).iter()).unwrap();
    let reader = Reader::of(state.path());
    let why = |seq| why_no_frames(&reader.result(seq).unwrap().unwrap()).unwrap();
    assert!(why(3).contains("passes"), "{}", why(3));
    assert!(why(1).contains("not known"), "{}", why(1));
    let create = |source| {
        let path = "frames/000.png".into();
        Unkept::from(&RecorderError::Create { path, source })
    };
    for (unkept, words) in [
        (Unkept::Off, "switched off"),
        (Unkept::Busy, "another part"),
        (Unkept::Quota, "recordings_mib"),
        (Unkept::Room, "no room left for results"),
        (Unkept::Gone, "not by the station"),
        (create(std::io::ErrorKind::StorageFull.into()), "free space"),
        (
            create(std::io::ErrorKind::PermissionDenied.into()),
            "could not be written: write recording: cannot create frames/000.png",
        ),
    ] {
        writer.leave_out(1, &unkept).unwrap();
        assert!(why(1).contains(words), "{}", why(1));
    }
    let nothing = Entry {
        stages: Stages::default(),
        ..entry(4, 1, Verdict::Invalid)
    };
    assert!(
        why_no_frames(&nothing)
            .unwrap()
            .contains("nothing was measured")
    );
}

#[test]
fn results_without_a_clock_are_dated_by_a_browser_for_the_whole_of_that_start_and_for_no_other() {
    let state = tempfile::tempdir().unwrap();
    let mut writer = open_writer(state.path());
    let of = |seq: u32, boot: &str| Entry {
        time_utc_us: None,
        uptime_s: 10 * seq,
        boot_id: boot.into(),
        ..entry(seq, 1, Verdict::Pass)
    };
    let clocked = Entry {
        time_utc_us: Some(1_800_000_000_000_000),
        ..of(4, "0000b007")
    };
    let stored = [
        of(1, "0000b007"),
        of(2, "0000b007"),
        of(3, "deadbeef"),
        clocked,
    ];
    writer.store(stored.iter()).unwrap();
    let reader = Reader::of(state.path());
    const START: u64 = 1_790_000_000_000_000;
    let since = Filter {
        since_us: Some(START + 15_000_000),
        ..Filter::default()
    };
    assert_eq!(seqs(&reader, &since), [4]);
    assert_eq!(reader.undated(&since).unwrap(), 3);
    assert_eq!(reader.undated(&Filter::default()).unwrap(), 0);
    // The last sign-in of a start counts.
    writer.date("0000b007", START + 999).unwrap();
    writer.date("0000b007", START).unwrap();
    let times: Vec<_> = reader.results(&Filter::default()).unwrap();
    let times: Vec<_> = times.iter().map(|entry| entry.browser_utc_us).collect();
    let ten = 10_000_000;
    assert_eq!(
        times,
        [None, None, Some(START + 2 * ten), Some(START + ten)]
    );
    assert_eq!(seqs(&reader, &since), [4, 2]);
    let until = Filter {
        since_us: None,
        until_us: Some(START + 15_000_000),
        recipe: Some(1),
        ..since
    };
    assert_eq!(seqs(&reader, &until), [1]);
    assert_eq!(reader.counts(&until).unwrap().pass, 1);
    assert_eq!(reader.undated(&until).unwrap(), 1);
    let mut csv = Vec::new();
    reader.csv(&Filter::default(), &mut csv).unwrap();
    let csv = String::from_utf8(csv).unwrap();
    assert!(
        csv.lines()
            .next()
            .unwrap()
            .contains(",recording,time_source,"),
        "{csv}"
    );
    let sources = [",,clock,", ",,,", ",,browser,", ",,browser,"];
    for (line, source) in csv.lines().skip(1).zip(sources) {
        assert!(line.contains(&format!("strips 7{source}")), "{line}");
    }
    assert!(csv.contains("\r\n2,2026-09-21T14:13:40.000000Z,"), "{csv}");
    // A browser's time is no part of what was measured.
    let dated = reader.result(2).unwrap().unwrap();
    assert_eq!(difference(&dated, &stored[1]), None);
    let many =
        "WITH RECURSIVE number (i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM number WHERE i < 2000)
        INSERT INTO start SELECT printf('%08x', i), 1 FROM number";
    let other = rusqlite::Connection::open(state.path().join(DATABASE)).unwrap();
    other.execute_batch(many).unwrap();
    writer.date("ffffffff", START).unwrap();
    assert_eq!(reader.starts().unwrap().len(), 1000);
}

#[test]
fn a_damaged_database_is_set_aside_with_a_message_and_a_new_one_begun() {
    let state = tempfile::tempdir().unwrap();
    let path = state.path().join(DATABASE);
    let mut bytes = {
        let mut writer = bounded(state.path(), ENOUGH);
        writer.store(some(300).iter()).unwrap();
        drop(writer);
        std::fs::read(&path).unwrap()
    };
    let middle = bytes.len() / 2;
    bytes[middle..middle + 8192].fill(0x5A);
    for damaged in [
        bytes,
        b"no database at all, but long enough to be read".to_vec(),
    ] {
        std::fs::write(&path, &damaged).unwrap();
        let (mut writer, complaint) = Writer::open(&path, ENOUGH).unwrap();
        let complaint = complaint.unwrap();
        assert!(complaint.contains("history.damaged.db"), "{complaint}");
        assert_eq!(
            std::fs::read(state.path().join("history.damaged.db")).unwrap(),
            damaged
        );
        writer.store(some(2).iter()).unwrap();
        assert_eq!(seqs(&Reader::of(state.path()), &Filter::default()), [2, 1]);
    }
}

#[test]
fn a_database_without_a_table_or_a_column_is_set_aside_when_it_is_opened_and_while_it_is_used() {
    for change in [
        "ALTER TABLE result DROP COLUMN fitness_permille",
        "ALTER TABLE gauge RENAME COLUMN sigma TO spread",
        "DROP TABLE gauge",
    ] {
        let state = tempfile::tempdir().unwrap();
        let path = state.path().join(DATABASE);
        bounded(state.path(), ENOUGH).store(some(3).iter()).unwrap();
        let alter = |path| {
            let other = rusqlite::Connection::open(path).unwrap();
            other.execute_batch(change).unwrap();
        };
        alter(&path);
        let (mut writer, complaint) = Writer::open(&path, ENOUGH).unwrap();
        let complaint = complaint.unwrap();
        assert!(
            complaint.contains("history.damaged.db"),
            "{change}: {complaint}"
        );
        writer.store(some(2).iter()).unwrap();
        alter(&path);
        let error = writer.store(some(1).iter()).unwrap_err();
        assert!(error.aside.is_some(), "{change}: {error}");
        writer.begin_anew(&error).unwrap();
        writer.store(some(2).iter()).unwrap();
        assert_eq!(seqs(&Reader::of(state.path()), &Filter::default()), [2, 1]);
    }
}

#[test]
fn csv_has_a_line_per_result_and_a_column_per_gauge() {
    let state = tempfile::tempdir().unwrap();
    bounded(state.path(), ENOUGH).store(some(2).iter()).unwrap();
    let mut bytes = Vec::new();
    let reader = Reader::of(state.path());
    reader.csv(&Filter::default(), &mut bytes).unwrap();
    let text = String::from_utf8(bytes).unwrap();
    let lines: Vec<_> = text.split("\r\n").collect();
    assert_eq!(lines.len(), 4, "{text}");
    assert!(
        lines[0].contains(",recording,time_source,deviation [mm],deviation sigma,deviation low")
    );
    assert!(lines[0].contains("\"'-step [mm]\""), "{text}");
    assert!(
        lines[2].starts_with("1,1970-01-01T00:00:01.000000Z,2,00c0ffee,4294967294,0,0,FAIL,0,")
    );
    assert!(lines[2].contains("\"a, \"\"b\"\"\""), "{text}");
    assert!(
        lines[2].contains(",strips 7,,clock,1,,-0.25,0.30000000000000004,3,"),
        "{text}"
    );
}

#[test]
fn without_a_history_reading_says_so() {
    let state = tempfile::tempdir().unwrap();
    let error = Reader::of(state.path())
        .results(&Filter::default())
        .unwrap_err();
    assert!(error.to_string().contains("does not exist"), "{error}");
    assert!(!state.path().join(DATABASE).exists());
}

#[test]
fn a_replay_compares_what_the_frames_show_to_the_last_bit_and_not_how_the_cycle_went() {
    use crate::station::result::flag::{SIMULATED, STEPPED_UP};
    let stored = Entry {
        flags: STEPPED_UP | SIMULATED,
        ..entry(7, 1, Verdict::Fail)
    };
    let mut replayed = Entry {
        seq: 0,
        total_us: 5,
        flags: SIMULATED,
        ..stored.clone()
    };
    assert_eq!(difference(&stored, &replayed), None);
    let value = replayed.gauges[0].value.unwrap();
    replayed.gauges[0].value = Some(f64::from_bits(value.to_bits() + 1));
    assert!(
        difference(&stored, &replayed)
            .unwrap()
            .contains("deviation")
    );
    replayed.gauges[0].value = Some(value);
    replayed.flags = 0;
    assert!(difference(&stored, &replayed).is_some());
}

/// Longest wait for the history's threads.
pub(super) const PATIENCE: Duration = Duration::from_secs(20);
/// Room for the tables and some results, in pages of 4 KiB.
const FEW_PAGES: u32 = 24;

/// What a station has logged.
pub(super) type Log = Arc<Mutex<Vec<String>>>;

pub(super) fn station() -> (StationHandle, Log) {
    let settings = Settings {
        next_seq: 1,
        buffered: Default::default(),
        boot_id: 1,
        teach_allowed: false,
        identity: Arc::new(Identity {
            vendor: String::new(),
            product: String::new(),
            serial: String::new(),
            version: String::new(),
        }),
        limits: Limits::default(),
    };
    let log = Log::default();
    let lines = log.clone();
    let sink = move |effect| {
        if let Effect::Log(line) = effect {
            lines.lock().unwrap().push(line.to_string());
        }
        None
    };
    let station = Station::new(settings, Micros(0));
    (StationHandle::new(station, Instant::now(), sink), log)
}

pub(super) fn record(seq: u32) -> Arc<ResultRecord> {
    Arc::new(ResultRecord {
        seq,
        verdict: Verdict::Invalid,
        inspection: Arc::new(Inspection {
            reason: Some("x".repeat(2000).into()),
            ..Inspection::default()
        }),
        ..ResultRecord::default()
    })
}

pub(super) fn wait(what: &str, done: impl Fn() -> bool) {
    let began = Instant::now();
    while !done() {
        assert!(began.elapsed() < PATIENCE, "no {what}");
        std::thread::yield_now();
    }
}

/// Opens the history of a state folder that keeps no recordings, for a run.
fn begun(state: &StateFolder, run: u32) -> OpenedHistory {
    begun_at(state, run, None)
}

fn begun_at(state: &StateFolder, run: u32, utc_s: Option<u64>) -> OpenedHistory {
    let bounds = Bounds {
        results: ENOUGH,
        recordings: 0,
        good_every: 0,
    };
    let numbering = Numbering {
        counted: state.counted(),
        counter: state.counter(),
        serial: state.serial().unwrap(),
        run,
        utc_s,
    };
    open(state.path(), numbering, bounds).unwrap()
}

/// The same, without what was acknowledged.
pub(super) fn opened(state: &StateFolder, run: u32) -> (History, Task, u32, Option<String>) {
    let OpenedHistory {
        history,
        task,
        next_seq,
        complaint,
        ..
    } = begun(state, run);
    (history, task, next_seq, complaint)
}

#[test]
fn a_copy_of_a_state_folder_goes_on_far_behind_and_the_folder_itself_does_not() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let state = StateFolder::open(&at("first")).unwrap();
    let begin = |state: &StateFolder, run| {
        let (history, task, next, complaint) = opened(state, run);
        history.stop(next.wrapping_sub(1));
        task.run(&station().0);
        (next, complaint)
    };
    assert_eq!(begin(&state, 1), (1, None));
    assert_eq!(begin(&state, 2), (1, None));
    std::fs::create_dir(at("copy")).unwrap();
    for name in [DATABASE, "result-seq", "serial"] {
        std::fs::copy(at("first").join(name), at("copy").join(name)).unwrap();
    }
    assert_eq!(begin(&state, 3), (1, None));
    let copy = StateFolder::open(&at("copy")).unwrap();
    if copy.counted().unwrap().copied {
        let (next, complaint) = begin(&copy, 4);
        // At random behind it: here by the run.
        assert_eq!(next, (1 << 24) + 4 + 1);
        assert!(complaint.unwrap().contains("is a copy"));
        assert_eq!(begin(&copy, 5), ((1 << 24) + 4 + 1, None));
    } else {
        println!("skipped: this file system does not say when files are made");
    }
}

/// Kills, stops and backups that come back, in any order: no result is shown under a number of its
/// history that another had, and none is lost but those that the backup did not have.
#[test]
fn a_hundred_kills_and_restores_use_no_number_twice() {
    for is_time_known in [false, true] {
        kills_and_restores(is_time_known);
    }
}

fn kills_and_restores(is_time_known: bool) {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mut random = SplitMix64::seed_from_u64(5);
    let mut below = |count: u64| random.next_u64() % count;
    let mut path = at("0");
    let mut shown = std::collections::BTreeSet::new();
    let mut backup: Option<PathBuf> = None;
    let [mut restores, mut kills] = [0; 2];
    for round in 1..=100 {
        let state = StateFolder::open(&path).unwrap();
        // Ten seconds later each time.
        let utc_s = is_time_known.then_some(1_790_000_000 + 10 * round);
        let opened = begun_at(&state, below(1 << 32).max(1) as u32, utc_s);
        let (history, task, next) = (opened.history, opened.task, opened.next_seq);
        let id = Reader::of(&path).id().unwrap();
        let last = next + below(5) as u32;
        for seq in next..last {
            history.take(seq).unwrap();
            history.record(&record(seq));
            assert!(
                shown.insert((id.clone(), seq)),
                "round {round}: {id} {seq} is used twice"
            );
        }
        if below(2) == 0 {
            // Killed: nothing is settled.
            kills += 1;
            drop((history, task));
        } else {
            history.stop(last.wrapping_sub(1));
            task.run(&station().0);
            let all = seqs(&Reader::of(&path), &Filter::default());
            assert!((next..last).all(|seq| all.contains(&seq)), "round {round}");
        }
        drop(state);
        match below(6) {
            0 => {
                let copy = at(&format!("backup {round}"));
                copied(&path, &copy);
                backup = Some(copy);
            }
            1 => {
                if let Some(backup) = &backup {
                    // As tar and rsync do: the files are made anew.
                    let next = at(&round.to_string());
                    copied(backup, &next);
                    path = next;
                    let again = StateFolder::open(&path).unwrap();
                    if again
                        .counted()
                        .is_ok_and(|counted| counted.last > 0 && !counted.copied)
                    {
                        println!("skipped: this file system does not say when files are made");
                        return;
                    }
                    restores += 1;
                }
            }
            _ => {}
        }
    }
    println!(
        "{} results, {kills} kills, {restores} restores",
        shown.len()
    );
    assert!(restores > 5 && kills > 20);
}

fn copied(from: &Path, to: &Path) {
    std::fs::create_dir(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        if entry.file_type().unwrap().is_file() {
            std::fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
        }
    }
}

#[test]
fn what_is_acknowledged_is_remembered_over_a_kill() {
    let folder = tempfile::tempdir().unwrap();
    let state = StateFolder::open(folder.path()).unwrap();
    let (history, ..) = opened(&state, 1);
    for seq in 1..=5 {
        history.take(seq).unwrap();
        history.record(&record(seq));
    }
    history.buffer(Some(0));
    history.buffer(Some(2));
    // Killed: nothing is settled.
    drop(history);
    let again = begun(&state, 2);
    assert_eq!((again.next_seq, again.buffered), (6, Some(2)));
    let page = Reader::of(state.path())
        .after(2, 32)
        .unwrap()
        .page()
        .unwrap();
    let seqs: Vec<u32> = page.results.iter().map(|entry| entry.seq).collect();
    assert_eq!(seqs, [3, 4, 5]);
    for entry in page.results {
        assert_eq!(Entry::of(&entry.record()), entry);
    }
}

#[test]
fn a_storage_that_refuses_is_a_warning_and_what_waited_is_stored_when_it_takes_it_again() {
    let folder = tempfile::tempdir().unwrap();
    let state = StateFolder::open(folder.path()).unwrap();
    let (history, task, next, complaint) = opened(&state, 1);
    assert_eq!((next, complaint), (1, None));
    let (station, log) = station();
    let warned = || station.snapshot().warnings & warning::STORAGE != 0;
    // Somebody else holds the database for longer than anybody waits.
    let other = rusqlite::Connection::open(folder.path().join(DATABASE)).unwrap();
    other.execute_batch("BEGIN IMMEDIATE").unwrap();
    let running = {
        let station = station.clone();
        std::thread::spawn(move || task.run(&station))
    };
    for seq in 1..=60 {
        history.record(&record(seq));
    }
    wait("warning", warned);
    assert!(log.lock().unwrap()[0].contains("locked"));
    let reader = Reader::of(folder.path());
    assert_eq!(seqs(&reader, &Filter::default()), [0; 0]);
    other.execute_batch("COMMIT").unwrap();
    wait("recovery", || !warned());
    assert_eq!(history.lost(), 0);
    assert_eq!(log.lock().unwrap().len(), 2, "locked, and written again");
    let expected: Vec<u32> = (1..=60).rev().collect();
    assert_eq!(seqs(&reader, &Filter::default()), expected);
    assert!(history.stop(60));
    running.join().unwrap();
    assert_eq!(state.counted().unwrap().last, 60);
}

#[test]
fn a_history_that_was_begun_before_light_was_kept_gets_the_column_and_stays_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(DATABASE);
    open_writer(folder.path()).store(some(2).iter()).unwrap();
    let other = rusqlite::Connection::open(&path).unwrap();
    other
        .execute_batch("ALTER TABLE result DROP COLUMN light")
        .unwrap();
    drop(other);
    let (mut writer, complaint) = Writer::open(&path, ENOUGH).unwrap();
    assert_eq!(complaint, None);
    let reader = Reader::of(folder.path());
    assert_eq!(seqs(&reader, &Filter::default()).len(), 2);
    writer.store(some(3).iter().skip(2)).unwrap();
    assert_eq!(seqs(&reader, &Filter::default()).len(), 3);
}

#[test]
fn a_history_of_another_version_is_set_aside_whole_and_a_new_one_with_an_id_of_its_own_begins() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(DATABASE);
    let reader = Reader::of(folder.path());
    open_writer(folder.path()).store(some(2).iter()).unwrap();
    let mut ids = vec![reader.id().unwrap()];
    for (version, name) in [
        (1, "history.version-1.db"),
        (1, "history.version-1-2.db"),
        (2, "history.version-2.db"),
    ] {
        let other = rusqlite::Connection::open(&path).unwrap();
        other.pragma_update(None, "user_version", version).unwrap();
        drop(other);
        let words = reader.results(&Filter::default()).unwrap_err().to_string();
        let expected =
            format!("version {version}, this program reads 3: the station sets it aside");
        assert!(words.contains(&expected), "{words}");
        let (mut writer, complaint) = Writer::open(&path, ENOUGH).unwrap();
        let complaint = complaint.unwrap();
        assert!(
            complaint.contains(&expected) && complaint.contains(name),
            "{complaint}"
        );
        assert_eq!(seqs(&reader, &Filter::default()), [0; 0]);
        writer.store(some(2).iter()).unwrap();
        ids.push(reader.id().unwrap());
        let aside = rusqlite::Connection::open(folder.path().join(name)).unwrap();
        let count = aside.query_row("SELECT count(*) FROM result", (), |row| row.get(0));
        assert_eq!(count, Ok(2));
        let id = aside.query_row("SELECT id FROM history", (), |row| row.get(0));
        assert_eq!(id.as_ref(), Ok(&ids[ids.len() - 2]));
    }
    let digits =
        |id: &String| id.len() == 32 && id.bytes().all(|b| b"0123456789abcdef".contains(&b));
    assert!(ids.iter().all(digits), "{ids:?}");
    // A database keeps its id at every start, and no two databases have the same id.
    drop(open_writer(folder.path()));
    assert_eq!(&reader.id().unwrap(), ids.last().unwrap());
    ids.sort();
    ids.dedup();
    assert_eq!(ids.len(), 4);
}

#[test]
fn all_that_may_be_unknown_of_a_result_is_stored_and_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let new = Entry {
        uptime_s: 61,
        boot_id: "0000b007".into(),
        placement: Some(Placement {
            values: [Some(0.1), None, Some(-1.0 / 3.0), None, None, Some(1e-9)],
            reach_mm: 0.1 + 0.2,
            outliers: 0.01,
        }),
        unkept: Some("off".into()),
        ..entry(3, 1, Verdict::Pass)
    };
    let mut writer = open_writer(folder.path());
    writer.store(std::iter::once(&new)).unwrap();
    let reader = Reader::of(folder.path());
    assert_eq!(reader.results(&Filter::default()).unwrap(), [new]);
}

#[test]
fn a_full_card_stores_nothing_by_halves_and_everything_when_there_is_room() {
    let folder = tempfile::tempdir().unwrap();
    let mut writer = open_writer(folder.path());
    // SQLite's own answer of a full card: the database may not grow.
    writer.bound_pages(FEW_PAGES);
    let many = some(500);
    let error = writer.store(many.iter()).unwrap_err();
    assert!(
        error.to_string().contains("full") && error.aside.is_none(),
        "{error}"
    );
    let reader = Reader::of(folder.path());
    assert_eq!(seqs(&reader, &Filter::default()), [0; 0]);
    writer.store(many[..3].iter()).unwrap();
    writer.bound_pages(1 << 30);
    writer.store(many[3..].iter()).unwrap();
    let all = Filter {
        limit: usize::MAX,
        ..Filter::default()
    };
    assert_eq!(seqs(&reader, &all).len(), many.len());
}

#[test]
fn a_database_that_is_damaged_while_it_is_used_is_set_aside_and_nothing_stops() {
    let folder = tempfile::tempdir().unwrap();
    let mut writer = open_writer(folder.path());
    writer.store(some(300).iter()).unwrap();
    drop(writer);
    let mut writer = open_writer(folder.path());
    let error = HistoryError {
        path: folder.path().join(DATABASE),
        reason: "database disk image is malformed".into(),
        aside: Some(schema::DAMAGED.into()),
    };
    let said = writer.begin_anew(&error).unwrap();
    assert!(said.contains("history.damaged.db"), "{said}");
    writer.store(some(2).iter()).unwrap();
    assert_eq!(seqs(&Reader::of(folder.path()), &Filter::default()), [2, 1]);
}

#[test]
fn what_was_shown_and_not_stored_before_a_kill_is_stored_once_by_the_next_start() {
    let folder = tempfile::tempdir().unwrap();
    let state = StateFolder::open(folder.path()).unwrap();
    let stored = || seqs(&Reader::of(state.path()), &Filter::default());
    // Its thread never comes to write, as where the card is busy.
    let (killed, never, next, _) = opened(&state, 1);
    for seq in next..next + 3 {
        killed.take(seq).unwrap();
        killed.record(&record(seq));
    }
    drop((killed, never));
    assert_eq!(stored(), [0; 0]);
    let (killed, never, next, _) = opened(&state, 2);
    assert_eq!((stored(), next), (vec![3, 2, 1], 4));
    killed.take(next).unwrap();
    killed.record(&record(next));
    drop((killed, never));
    let (history, task, next, _) = opened(&state, 3);
    assert_eq!((stored(), next), (vec![4, 3, 2, 1], 5));
    assert!(history.stop(4));
    task.run(&station().0);
    let (_, _, next, _) = opened(&state, 4);
    assert_eq!((stored(), next), (vec![4, 3, 2, 1], 5));
}

#[test]
fn a_result_that_does_not_go_into_shared_memory_does_not_bring_its_number_back() {
    let folder = tempfile::tempdir().unwrap();
    let state = StateFolder::open(folder.path()).unwrap();
    let (killed, never, next, _) = opened(&state, 1);
    let mut long = (*record(next + 1)).clone();
    let inspection = Inspection {
        reason: Some("x".repeat(80_000).into()),
        ..Inspection::default()
    };
    long.inspection = Arc::new(inspection);
    for record in [record(next), Arc::new(long)] {
        killed.take(record.seq).unwrap();
        killed.record(&record);
    }
    drop((killed, never));
    let (_, _, next, _) = opened(&state, 2);
    assert_eq!(next, 1 + AHEAD);
}

#[test]
fn a_part_whose_frames_are_not_wanted_says_so_and_a_start_is_dated_while_the_history_runs() {
    let folder = tempfile::tempdir().unwrap();
    let state = StateFolder::open(folder.path()).unwrap();
    let (history, task, ..) = opened(&state, 1);
    let (station, _) = station();
    let running = std::thread::spawn(move || task.run(&station));
    let record = record(1);
    history.record(&record);
    history.keep(&record, || unreachable!());
    assert!(history.date(0xB007, 1));
    assert!(history.stop(1));
    running.join().unwrap();
    let reader = Reader::of(folder.path());
    let entry = reader.result(1).unwrap().unwrap();
    assert_eq!(entry.unkept.as_deref(), Some("off"));
    assert_eq!(reader.starts().unwrap().get("0000b007"), Some(&1));
}
