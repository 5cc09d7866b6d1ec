//! What `fringed idle` does for a station that was killed.

use crate::chip::{Chip, Trace};
use crate::machine::in_the_machine;
use hal::gpio::{LineError, Output, leave_idle};
use hal::lines::OutputLine;
use hal::setup::{LinesSetup, TriggerSetup};
use std::collections::BTreeMap;
use std::process::{Command, Stdio};
use std::thread;
use std::time::Duration;

const LABEL: &str = "killed";
const LINES: [&str; 4] = ["trigger", "busy", "ok", "fault"];

fn setups(active_low: bool) -> (TriggerSetup, LinesSetup) {
    let name = |at: usize| Some(LINES[at].to_owned());
    let trigger = TriggerSetup {
        chip: LABEL.into(),
        line: name(0),
        active_low,
        ..TriggerSetup::default()
    };
    let lines = LinesSetup {
        chip: LABEL.into(),
        busy: name(1),
        ok: name(2),
        fault: name(3),
        outputs_active_low: active_low,
        ..LinesSetup::default()
    };
    (trigger, lines)
}

#[test]
#[ignore = "run by the test below, as the process that it kills"]
fn holds_the_lines_as_in_a_cycle_until_it_is_killed() {
    // A pulse is on, the station is busy, the last part passed, there is no fault. The trigger is
    // the last line to be taken: when it is high, all are held.
    let _held: Vec<Output> = LINES
        .iter()
        .rev()
        .map(|line| {
            let mut output = Output::open(LABEL, line, false, *line == "fault").unwrap();
            output.set(*line != "fault").unwrap();
            output
        })
        .collect();
    thread::sleep(Duration::from_secs(600));
}

#[test]
fn lines_of_a_killed_process_are_left_idle_and_those_that_are_held_are_named() {
    if !in_the_machine() {
        return;
    }
    let chip = Chip::new(LABEL, &LINES);
    let child = "killed::holds_the_lines_as_in_a_cycle_until_it_is_killed";
    let mut station = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", child, "--ignored"])
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    while !chip.level(0) {
        assert!(station.try_wait().unwrap().is_none(), "the station ended");
        thread::sleep(Duration::from_millis(10));
    }
    let (trigger, lines) = setups(false);
    let held = leave_idle(&trigger, &lines);
    assert!(held.len() == 4, "{held:?}");
    let busy = |error: &LineError| matches!(error, LineError::Busy { .. });
    assert!(held.iter().all(busy), "{held:?}");

    // SIGKILL: nothing of the process can set a line any more.
    station.kill().unwrap();
    station.wait().unwrap();
    for active_low in [false, true] {
        let trace = Trace::begin();
        let (trigger, lines) = setups(active_low);
        assert_eq!(leave_idle(&trigger, &lines), []);
        let set = trace.by_line().into_iter();
        let left: BTreeMap<u32, bool> = set.map(|(_, line, high)| (line, high)).collect();
        let wire = |on: bool| on != active_low;
        let levels: Vec<bool> = left.into_values().collect();
        assert_eq!(levels, [wire(false), wire(false), wire(false), wire(true)]);
    }
}
