//! The display back-end with the kernel's virtual display; runs in the machine of `tests/vm` only.

#![allow(clippy::panic, clippy::print_stdout, clippy::unwrap_used)]

mod crc;
mod described;
#[path = "../machine/mod.rs"]
mod machine;
mod readback;

use crc::Checksums;
use machine::in_the_machine;
use readback::Client;
use std::time::Duration;

use hal::clock::{Clock, Monotonic};
use hal::contract::check_projector;
use hal::error::ErrorKind;
use hal::kms::{self, Display};
use hal::projector::{Flip, Projector, Raster};
use hal::setup::ProjectorSetup;

/// The virtual display stamps flips by an ideal clock, in whole microseconds.
const STAMP: Duration = Duration::from_micros(1);
/// Longer than any wait here lasts normally.
const PATIENT: Duration = Duration::from_secs(5);

fn setup(width: u32, height: u32, hertz: f64) -> ProjectorSetup {
    ProjectorSetup {
        connector: Some("Virtual-1".into()),
        width: Some(width),
        height: Some(height),
        refresh_hz: Some(hertz),
        ..ProjectorSetup::default()
    }
}

fn open(setup: &ProjectorSetup) -> (Display, Monotonic) {
    let display = kms::open(setup).unwrap();
    let clock = Monotonic::new(vec![display.descriptor().unwrap()]);
    (display, clock)
}

/// Rasters that differ from each other nearly everywhere.
fn rasters(display: &Display, count: u32) -> Vec<Raster> {
    let (width, height) = display.size();
    let raster = |k: u32| {
        let level = |at: u32| ((at % width) * (k + 1) + (at / width) * 7 + k * 31) as u8;
        Raster::new(width, height, (0..width * height).map(level).collect()).unwrap()
    };
    (0..count).map(raster).collect()
}

/// Queues a pattern and waits for its flip.
fn show(display: &mut Display, clock: &mut Monotonic, index: usize) -> Flip {
    display.queue(index).unwrap();
    next_flip(display, clock)
}

fn next_flip(display: &mut Display, clock: &mut Monotonic) -> Flip {
    let end = clock.now() + PATIENT;
    while clock.now() < end {
        if let Some(flip) = display.poll_flip().unwrap() {
            return flip;
        }
        clock.wait(end);
    }
    panic!("no flip within {PATIENT:?}");
}

/// Waits for `span`.
fn rest(clock: &mut Monotonic, span: Duration) {
    let until = clock.now() + span;
    while clock.now() < until {
        clock.wait(until);
    }
}

#[test]
fn a_display_keeps_the_promises_of_a_projector() {
    if !in_the_machine() {
        return;
    }
    for hertz in [60.0, 120.0] {
        let (mut display, mut clock) = open(&setup(800, 600, hertz));
        check_projector(&mut display, &mut clock, 12).unwrap();
    }
}

#[test]
fn a_pattern_is_shown_with_every_refresh_at_60_and_at_120_hertz() {
    if !in_the_machine() {
        return;
    }
    for hertz in [60.0, 120.0] {
        let (mut display, mut clock) = open(&setup(800, 600, hertz));
        let refresh = display.refresh();
        display.load(rasters(&display, 4)).unwrap();
        let flips: Vec<Flip> = (0..120)
            .map(|k| show(&mut display, &mut clock, k % 4))
            .collect();
        let mut late = Duration::ZERO;
        for pair in flips.windows(2) {
            assert_eq!(
                pair[1].count,
                pair[0].count + 1,
                "{hertz} Hz: a refresh was missed"
            );
            let step = pair[1].timestamp.since(pair[0].timestamp);
            late = late.max(step.abs_diff(refresh));
        }
        assert!(
            late <= STAMP * 2,
            "{hertz} Hz: a step is {late:?} off {refresh:?}"
        );
        assert_eq!(display.missed(), 0);
        let span = flips[119].timestamp.since(flips[0].timestamp);
        println!(
            "{hertz} Hz: {:.3} flips/s, steps within {late:?} of {refresh:?}",
            119.0 / span.as_secs_f64()
        );
    }
}

#[test]
fn a_stall_is_in_the_count_of_the_flips_as_so_many_missed_refreshes() {
    if !in_the_machine() {
        return;
    }
    let (mut display, mut clock) = open(&setup(1280, 720, 60.0));
    display.load(rasters(&display, 2)).unwrap();
    let mut last = show(&mut display, &mut clock, 0);
    // Time in ms from a flip until the next one is queued, and the refreshes that are missed by
    // that.
    for (stall, missed) in [(0, 0), (10, 0), (20, 1), (40, 2), (60, 3), (95, 5)] {
        let spent = clock.now().since(last.timestamp);
        rest(
            &mut clock,
            Duration::from_millis(stall).saturating_sub(spent),
        );
        let flip = show(&mut display, &mut clock, 1);
        assert_eq!(flip.count - last.count, missed + 1, "after {stall} ms");
        let steps = u32::try_from(missed + 1).unwrap();
        let off = flip
            .timestamp
            .since(last.timestamp)
            .abs_diff(display.refresh() * steps);
        assert!(
            off <= STAMP * 2 * steps,
            "after {stall} ms the stamp is {off:?} off"
        );
        last = flip;
    }
    assert_eq!(display.missed(), 0, "the driver itself missed none");
}

#[test]
fn each_flip_shows_its_own_pattern_from_the_refresh_that_it_names() {
    if !in_the_machine() {
        return;
    }
    let (mut display, mut clock) = open(&setup(640, 480, 60.0));
    let patterns = rasters(&display, 4);
    let sums: Vec<u32> = patterns.iter().map(crc::of).collect();
    display.load(patterns).unwrap();
    let mut checksums = Checksums::record();
    let mut flips = Vec::new();
    for k in [0, 1, 2, 3, 1, 3, 0, 2, 2, 0] {
        flips.push((show(&mut display, &mut clock, k).count, k));
        checksums.take();
    }
    // The last checksum is computed some time after its flip.
    rest(&mut clock, PATIENT / 5);
    checksums.take();
    let (mut right, mut until) = (0, u64::MAX);
    for (from, pattern) in flips.iter().rev() {
        for (count, sum) in checksums
            .seen
            .iter()
            .filter(|(count, _)| (*from..until).contains(count))
        {
            assert_eq!(
                *sum, sums[*pattern],
                "refresh {count} is to show pattern {pattern}"
            );
            right += 1;
        }
        until = *from;
    }
    let each = flips
        .iter()
        .filter(|(from, _)| checksums.seen.contains_key(from))
        .count();
    println!(
        "{right} refreshes checked by their checksums, {each} of {} flips at the very refresh",
        flips.len()
    );
    assert!(
        right >= flips.len() && each * 2 > flips.len(),
        "too few to prove anything"
    );
}

#[test]
fn what_is_shown_is_the_loaded_raster_pixel_by_pixel() {
    if !in_the_machine() {
        return;
    }
    for (width, height) in [(640, 480), (1366, 768)] {
        let (mut display, mut clock) = open(&setup(width, height, 60.0));
        let patterns = rasters(&display, 3);
        display.load(patterns.clone()).unwrap();
        let client = Client::of(display.descriptor().unwrap());
        for (index, pattern) in patterns.iter().enumerate() {
            show(&mut display, &mut clock, index);
            let seen = client.picture((width, height));
            let wrong = seen
                .iter()
                .zip(pattern.pixels())
                .filter(|(a, b)| a != b)
                .count();
            assert_eq!(
                (seen.len(), wrong),
                (pattern.pixels().len(), 0),
                "pattern {index} of {width}×{height}"
            );
        }
        display.blank().unwrap();
        rest(&mut clock, PATIENT / 5);
        assert!(
            client
                .picture((width, height))
                .iter()
                .all(|grey| *grey == 0),
            "blank is black"
        );
        println!(
            "{width}×{height}: {} patterns and black read back, no pixel differs",
            patterns.len()
        );
    }
}

#[test]
fn whatever_would_change_grey_levels_is_switched_off_where_the_driver_has_it() {
    if !in_the_machine() {
        return;
    }
    const FULL: u64 = 1;
    // The kernel's bits for rotations by 0° and by 180°.
    const UPRIGHT: u64 = 1;
    const UPSIDE_DOWN: u64 = 4;
    let margins = ["left margin", "right margin", "top margin", "bottom margin"];
    let (display, _) = open(&setup(1280, 720, 60.0));
    let client = Client::of(display.descriptor().unwrap());
    assert_eq!(
        client.property("Broadcast RGB"),
        FULL,
        "it is 0, automatic, at first"
    );
    // Settings of another program must not persist.
    client.set("Broadcast RGB", 2);
    for margin in margins {
        client.set(margin, 24);
    }
    client.set("rotation", UPSIDE_DOWN);
    // The card stays open, so that the console does not come back and reset the properties.
    drop(display);
    let before = client;
    let (display, _) = open(&setup(1280, 720, 60.0));
    let client = Client::of(display.descriptor().unwrap());
    drop(before);
    assert_eq!(client.property("rotation"), UPRIGHT);
    assert_eq!(client.property("Broadcast RGB"), FULL);
    assert_eq!(margins.map(|margin| client.property(margin)), [0; 4]);
}

#[test]
fn a_display_is_left_dark_and_without_a_buffer_and_opens_again() {
    if !in_the_machine() {
        return;
    }
    let files = || std::fs::read_dir("/proc/self/fd").unwrap().count();
    let before = files();
    let (mut display, mut clock) = open(&setup(1280, 720, 60.0));
    let client = Client::of(display.descriptor().unwrap());
    for count in [4, 12, 1, 0, 3] {
        display.load(rasters(&display, count)).unwrap();
        assert_eq!(
            client.framebuffers(),
            count as usize + 1,
            "{count} patterns and black"
        );
    }
    show(&mut display, &mut clock, 2);
    // Also with a flip on its way.
    display.queue(1).unwrap();
    drop(display);
    assert!(!client.is_on());
    assert_eq!(client.framebuffers(), 0);
    drop((client, clock));
    for _ in 0..20 {
        let (mut display, mut clock) = open(&setup(1280, 720, 60.0));
        display.load(rasters(&display, 1)).unwrap();
        show(&mut display, &mut clock, 0);
    }
    assert_eq!(files(), before, "descriptors were leaked");
}

#[test]
fn what_is_not_there_is_said_with_what_there_is() {
    if !in_the_machine() {
        return;
    }
    let refused = |setup: &ProjectorSetup, kind: ErrorKind, words: &[&str]| {
        let error = kms::open(setup).unwrap_err();
        assert_eq!(error.kind(), kind, "{error}");
        for word in words {
            assert!(error.to_string().contains(word), "no {word:?} in: {error}");
        }
        println!("{error}");
    };
    let any = ProjectorSetup::default();
    let named = |name: &str| ProjectorSetup {
        connector: Some(name.into()),
        ..any.clone()
    };
    refused(
        &named("HDMI-A-3"),
        ErrorKind::Unsupported,
        &["HDMI-A-3", "Virtual-1"],
    );
    refused(
        &setup(800, 600, 75.0),
        ErrorKind::Unsupported,
        &["800×600 at 75 Hz", "1280×720 at 60.00 Hz", "video="],
    );
    let card = ProjectorSetup {
        card: Some("/dev/dri/card7".into()),
        ..any.clone()
    };
    refused(&card, ErrorKind::Unsupported, &["card7", "card0"]);
    let (mut display, _) = open(&any);
    refused(&any, ErrorKind::Unsupported, &["another program"]);
    assert_eq!(display.load(Vec::new()), Ok(()), "the first one goes on");
}

#[test]
fn a_projector_that_is_unplugged_is_an_error_at_once_and_is_found_again() {
    if !in_the_machine() {
        return;
    }
    // The cable: the card continues without it, and shows it only in its status.
    let cable =
        |state: &str| std::fs::write("/sys/class/drm/card0-Virtual-1/status", state).unwrap();
    let (mut display, mut clock) = open(&setup(1280, 720, 60.0));
    display.load(rasters(&display, 2)).unwrap();
    show(&mut display, &mut clock, 0);
    cable("off");
    for gone in [
        display.present(),
        display.queue(1),
        display.load(Vec::new()).and(display.present()),
    ] {
        assert_eq!(gone.unwrap_err().kind(), ErrorKind::Disconnected);
    }
    assert_eq!(
        kms::open(&setup(1280, 720, 60.0)).unwrap_err().kind(),
        ErrorKind::Disconnected
    );
    drop((display, clock));
    assert_eq!(
        kms::open(&ProjectorSetup::default()).unwrap_err().kind(),
        ErrorKind::Disconnected
    );
    cable("detect");
    let (mut display, mut clock) = open(&setup(1280, 720, 60.0));
    display.load(rasters(&display, 2)).unwrap();
    show(&mut display, &mut clock, 0);

    // The whole card, while a flip is pending.
    let card = |state: &str| std::fs::write("/sys/module/vkms/parameters/plugged", state).unwrap();
    display.queue(1).unwrap();
    card("0");
    let begun = clock.now();
    let gone = loop {
        // The flip itself may still come.
        match display.poll_flip().and_then(|_| display.queue(0)) {
            Err(error) if error.kind() == ErrorKind::Disconnected => break error,
            _ => clock.wait(clock.now() + display.refresh()),
        }
        assert!(clock.now() < begun + PATIENT, "nobody said that it is gone");
    };
    println!("{gone}");
    assert_eq!(display.blank().unwrap_err().kind(), ErrorKind::Disconnected);
    assert_eq!(
        display.load(Vec::new()).unwrap_err().kind(),
        ErrorKind::Disconnected
    );
    drop(display);
    let took = clock.now().since(begun);
    drop(clock);
    assert!(took < Duration::from_secs(1), "it took {took:?}");
    assert_eq!(
        kms::open(&ProjectorSetup::default()).unwrap_err().kind(),
        ErrorKind::Unsupported,
        "no card"
    );
    card("1");
    let (mut display, mut clock) = open(&setup(1280, 720, 60.0));
    display.load(rasters(&display, 1)).unwrap();
    show(&mut display, &mut clock, 0);
}
