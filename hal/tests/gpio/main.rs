//! Lines of GPIO chips that the kernel simulates; these tests run in the virtual machine of
//! `tests/vm` and are skipped elsewhere.

#![allow(clippy::panic, clippy::print_stdout, clippy::unwrap_used)]

mod chip;
mod killed;
#[path = "../machine/mod.rs"]
mod machine;

use chip::{Chip, QUIET_MS, Trace};
use hal::clock::{Clock, Monotonic, monotonic};
use hal::contract::{check_clock, check_trigger};
use hal::error::ErrorKind;
use hal::gpio::{LineError, Output, Pulse, Start};
use hal::lines::{OutputLine, StartLine};
use hal::trigger::Trigger;
use hal::units::Timestamp;
use machine::in_the_machine;
use std::fs;
use std::os::fd::AsFd;
use std::thread;
use std::time::Duration;

/// How far a pulse may be off by the kernel's record: a system call of some 10 000 instructions of
/// 2 ns, and the record's resolution of 1 µs.
const PULSE_TOLERANCE: Duration = Duration::from_micros(21);
/// From this width on, half a percent of a pulse is much longer than its edges take.
const MEASURED: Duration = Duration::from_millis(10);
/// Longer than a start takes that comes; how long to wait for one that must not come.
const PATIENCE: Duration = Duration::from_millis(200);

/// Waits as a station does, for the descriptor and for the line to settle; returns the start that
/// comes within `patience`.
fn next_start(start: &mut Start, patience: Duration) -> Option<Timestamp> {
    let descriptor = start.as_fd().try_clone_to_owned().unwrap();
    let mut clock = Monotonic::new(vec![descriptor]);
    let end = clock.now() + patience;
    while clock.now() < end {
        if let Some(at) = start.poll_start().unwrap() {
            return Some(at);
        }
        clock.wait(start.settles().unwrap_or(end).min(end));
    }
    None
}

#[test]
fn each_reason_why_a_line_cannot_be_used_is_an_error_of_its_own() {
    if !in_the_machine() {
        return;
    }
    let chip = Chip::new("errors", &["busy", "twice", "twice", "spare"]);
    let open = |chip: &str, line: &str| Output::open(chip, line, false, false).unwrap_err();
    match open("nowhere", "busy") {
        LineError::NoChip { found, .. } => assert!(found.contains(&chip.label.to_owned())),
        other => panic!("{other:?}"),
    }
    match open(chip.label, "missing") {
        LineError::NoLine { found, .. } => assert_eq!(found, ["busy", "twice", "twice", "spare"]),
        other => panic!("{other:?}"),
    }
    assert!(matches!(
        open(chip.label, "twice"),
        LineError::Ambiguous { lines: 2, .. }
    ));
    let held = Output::open(chip.label, "busy", false, false).unwrap();
    match open(chip.label, "busy") {
        LineError::Busy { user, .. } => assert_eq!(user.as_deref(), Some("fringed")),
        other => panic!("{other:?}"),
    }
    drop(held);
    Output::open(chip.label, "busy", false, false).unwrap();
    chip.unplug();
    assert!(matches!(open(chip.label, "busy"), LineError::NoChip { .. }));
}

#[test]
fn a_trigger_and_the_clock_keep_their_promises() {
    if !in_the_machine() {
        return;
    }
    let chip = Chip::new("promises", &["trigger"]);
    let mut pulse = Pulse::open(&chip.trigger(100, false), "trigger", || ()).unwrap();
    let mut clock = Monotonic::default();
    check_clock(&mut clock).unwrap();
    check_trigger(&mut pulse, &mut clock).unwrap();
}

#[test]
fn a_pulse_has_its_width_and_begins_when_it_says() {
    if !in_the_machine() {
        return;
    }
    let chip = Chip::new("pulses", &["trigger"]);
    let count = 20;
    for width_us in [100_u32, 1_000, 16_653] {
        let width = Duration::from_micros(u64::from(width_us));
        let mut pulse = Pulse::open(&chip.trigger(width_us, false), "trigger", || ()).unwrap();
        let trace = Trace::begin();
        let (mut fired, mut spoiled) = (Vec::new(), Vec::new());
        for _ in 0..count {
            fired.push(pulse.fire().unwrap());
            thread::sleep(width * 2);
            spoiled.extend(std::iter::from_fn(|| pulse.poll_spoiled()));
        }
        let settings = trace.settings();
        assert_eq!(settings.len(), 2 * count, "{settings:?}");
        let (mut begun, mut off) = (Duration::ZERO, Duration::ZERO);
        for (fired, setting) in fired.iter().zip(settings.chunks_exact(2)) {
            let [(rise, true), (fall, false)] = setting else {
                panic!("no pulse: {setting:?}");
            };
            begun = begun.max(rise.since(*fired)).max(fired.since(*rise));
            off = off.max(fall.since(*rise).abs_diff(width));
        }
        println!("{count} pulses of {width:?}: begun within {begun:?}, width within {off:?}");
        assert!(begun < PULSE_TOLERANCE && off < PULSE_TOLERANCE);
        println!("{} of them spoiled: {spoiled:?}", spoiled.len());
        // Shorter pulses may be reported: their edges take a larger share of them here.
        assert!(spoiled.is_empty() || width < MEASURED, "{spoiled:?}");
    }
}

#[test]
fn a_pulse_while_one_is_on_is_lost_and_makes_it_no_longer() {
    if !in_the_machine() {
        return;
    }
    let chip = Chip::new("overlap", &["trigger"]);
    let mut pulse = Pulse::open(&chip.trigger(20_000, false), "trigger", || ()).unwrap();
    pulse.fire().unwrap();
    thread::sleep(Duration::from_millis(15));
    pulse.fire().unwrap();
    assert!(chip.level(0));
    thread::sleep(Duration::from_millis(10));
    assert!(!chip.level(0), "the pulse was made longer");
}

#[test]
fn a_trigger_is_idle_after_it_is_dropped_and_after_a_panic_also_in_a_pulse() {
    if !in_the_machine() {
        return;
    }
    let chip = Chip::new("idle", &["trigger"]);
    for active_low in [false, true] {
        // The resistor of the wiring table.
        chip.pull(0, active_low);
        let long = chip.trigger(60_000_000, active_low);
        let trace = Trace::begin();
        let mut pulse = Pulse::open(&long, "trigger", || ()).unwrap();
        assert_eq!(chip.level(0), active_low, "idle when opened");
        pulse.fire().unwrap();
        assert_eq!(chip.level(0), !active_low, "a pulse is on");
        drop(pulse);
        assert_eq!(trace.left_at(), active_low, "idle after a drop");
        let panicked = thread::spawn(move || {
            let mut pulse = Pulse::open(&long, "trigger", || ()).unwrap();
            pulse.fire().unwrap();
            panic!("on purpose");
        });
        assert!(panicked.join().is_err());
        assert_eq!(trace.left_at(), active_low, "idle after a panic");
    }
}

#[test]
fn a_line_out_is_set_and_is_idle_before_and_after() {
    if !in_the_machine() {
        return;
    }
    let chip = Chip::new("outputs", &["fault"]);
    for (active_low, idle) in [(false, false), (false, true), (true, false), (true, true)] {
        let wire = |on: bool| on != active_low;
        // The resistor of the wiring table.
        chip.pull(0, wire(idle));
        let trace = Trace::begin();
        let mut fault = Output::open(chip.label, "fault", active_low, idle).unwrap();
        assert_eq!(chip.level(0), wire(idle));
        for on in [!idle, idle, !idle] {
            fault.set(on).unwrap();
            assert_eq!(chip.level(0), wire(on), "{active_low} {idle} {on}");
        }
        drop(fault);
        assert_eq!(trace.left_at(), wire(idle));
    }
}

#[test]
fn a_start_has_the_kernels_stamp_on_the_clock_of_the_head() {
    if !in_the_machine() {
        return;
    }
    let chip = Chip::new("start", &["start"]);
    let mut start = chip.start();
    let (mut edge, mut told) = (Duration::ZERO, Duration::ZERO);
    for _ in 0..20 {
        let before = monotonic();
        chip.pull(0, true);
        let pulled = monotonic();
        let at = next_start(&mut start, PATIENCE).expect("a start");
        assert!(
            at >= before && at <= pulled,
            "{at} outside {before} to {pulled}"
        );
        edge = edge.max(at.since(before));
        told = told.max(monotonic().since(at));
        chip.pull(0, false);
        assert_eq!(next_start(&mut start, Duration::from_millis(20)), None);
    }
    let quiet = Duration::from_millis(u64::from(QUIET_MS));
    println!("20 starts: stamped within {edge:?} of the pull, told within {told:?}");
    assert!(told >= quiet && told < quiet * 2);
}

#[test]
fn bounces_and_spikes_start_nothing_more() {
    if !in_the_machine() {
        return;
    }
    let chip = Chip::new("bounces", &["start"]);
    let mut start = chip.start();
    // The line is polled after each edge; only the last edge may count.
    let bounce = |start: &mut Start, levels: &[bool]| {
        for level in levels {
            chip.pull(0, *level);
            assert_eq!(start.poll_start().unwrap(), None, "a bounce to {level}");
        }
    };
    bounce(&mut start, &[true, false, true, false, true]);
    assert!(next_start(&mut start, PATIENCE).is_some());
    bounce(&mut start, &[false, true, false]);
    assert_eq!(next_start(&mut start, PATIENCE), None, "a bouncing release");
    bounce(&mut start, &[true, false]);
    assert_eq!(next_start(&mut start, PATIENCE), None, "a spike");
}

#[test]
fn edges_that_the_kernel_dropped_are_made_up_for_by_the_level() {
    if !in_the_machine() {
        return;
    }
    let chip = Chip::new("burst", &["start"]);
    let mut start = chip.start();
    // Edges that are not fetched: the kernel keeps 16, and the last of these is a falling edge.
    for edge in 0..41 {
        chip.pull(0, edge % 2 == 0);
    }
    assert!(
        next_start(&mut start, PATIENCE).is_some(),
        "the line stayed active"
    );
    // Here the last edge that is kept is a rising edge.
    for edge in 0..41 {
        chip.pull(0, edge % 2 == 1);
    }
    assert_eq!(next_start(&mut start, PATIENCE), None, "it stayed idle");
    chip.pull(0, true);
    assert!(
        next_start(&mut start, PATIENCE).is_some(),
        "it starts again"
    );
}

#[test]
fn a_line_that_is_active_when_it_is_opened_has_started_nothing() {
    if !in_the_machine() {
        return;
    }
    let chip = Chip::new("held", &["start"]);
    chip.pull(0, true);
    let mut start = chip.start();
    assert_eq!(next_start(&mut start, PATIENCE), None);
}

#[test]
fn a_chip_that_goes_is_said_by_every_line_of_it_and_ends_a_wait() {
    if !in_the_machine() {
        return;
    }
    let chip = Chip::new("removed", &["trigger", "busy", "start"]);
    let mut pulse = Pulse::open(&chip.trigger(1000, false), "trigger", || ()).unwrap();
    let mut busy = Output::open(chip.label, "busy", false, false).unwrap();
    let mut start = chip.start();
    let mut clock = Monotonic::new(vec![start.as_fd().try_clone_to_owned().unwrap()]);
    let begun = clock.now();
    let gone = thread::scope(|scope| {
        scope.spawn(|| {
            thread::sleep(Duration::from_millis(50));
            chip.unplug();
        });
        clock.wait(begun + Duration::from_secs(60));
        clock.now().since(begun)
    });
    println!("a wait ended {gone:?} after it began; the chip went after 50 ms");
    assert!(gone < Duration::from_secs(1));
    let kinds = [
        start.poll_start().unwrap_err().kind(),
        busy.set(true).unwrap_err().kind(),
        pulse.fire().unwrap_err().kind(),
    ];
    assert_eq!(kinds, [ErrorKind::Disconnected; 3]);
}

#[test]
fn a_line_is_opened_all_day_without_a_descriptor_left_behind() {
    if !in_the_machine() {
        return;
    }
    let chip = Chip::new("reopened", &["trigger", "start"]);
    let open = || fs::read_dir("/proc/self/fd").unwrap().count();
    let before = open();
    for _ in 0..20 {
        let mut pulse = Pulse::open(&chip.trigger(100, false), "trigger", || ()).unwrap();
        let mut start = chip.start();
        pulse.fire().unwrap();
        assert_eq!(start.poll_start().unwrap(), None);
    }
    assert_eq!(open(), before);
}
