//! A whole head in the machine of `tests/vm`: display, trigger line, and a camera that knows which
//! pattern was in view.

#![allow(clippy::panic, clippy::print_stdout, clippy::unwrap_used)]

mod chip;
#[path = "../kms/crc.rs"]
mod crc;
mod eye;
#[path = "../machine/mod.rs"]
mod machine;

use std::collections::HashMap;
use std::time::{Duration, Instant};

use chip::{Chip, Wire};
use eye::{Eye, MIXED, NO_PATTERN, View};
use hal::clock::Monotonic;
use hal::contract::check_head;
use hal::error::{Error, ErrorKind};
use hal::gpio::Pulse;
use hal::head::{Exposure, Head, Timing};
use hal::kms::{self, Display};
use hal::projector::{Flip, Projector, Raster};
use hal::setup::{ProjectorSetup, TriggerSetup};
use machine::in_the_machine;

const PATTERNS: usize = 8;
const PATIENT: Duration = Duration::from_secs(5);

/// A display whose flips are sometimes queued late, as on a busy computer.
struct Late {
    display: Display,
    /// Every how many flips; 0 = never.
    every: u32,
    by: Duration,
    queued: u32,
}

impl Projector for Late {
    fn size(&self) -> (u32, u32) {
        self.display.size()
    }

    fn refresh(&self) -> Duration {
        self.display.refresh()
    }

    fn load_behind(&mut self, kept: usize, rasters: Vec<Raster>) -> Result<(), Error> {
        self.display.load_behind(kept, rasters)
    }

    fn queue(&mut self, index: usize) -> Result<(), Error> {
        self.queued += 1;
        if self.every > 0 && self.queued.is_multiple_of(self.every) {
            std::thread::sleep(self.by);
        }
        self.display.queue(index)
    }

    fn present(&self) -> Result<(), Error> {
        self.display.present()
    }

    fn poll_flip(&mut self) -> Result<Option<Flip>, Error> {
        self.display.poll_flip()
    }

    fn blank(&mut self) -> Result<(), Error> {
        self.display.blank()
    }
}

/// How a rig differs from one without faults.
#[derive(Clone, Copy, Default)]
struct Kind {
    by_itself: bool,
    /// Refreshes from a flip to its light.
    lag: u32,
    late_every: u32,
}

fn rig(_: &Chip, kind: Kind, knows_patterns: bool) -> Head {
    let setup = ProjectorSetup {
        width: Some(64),
        height: Some(48),
        ..ProjectorSetup::default()
    };
    let mut display = kms::open(&setup).unwrap();
    let raster = |k: u32| {
        let level = |at: u32| ((at % 64) * (k + 1) + at / 64 * 7 + k * 31) as u8;
        Raster::new(64, 48, (0..64 * 48).map(level).collect()).unwrap()
    };
    let rasters: Vec<Raster> = (0..PATTERNS as u32).map(raster).collect();
    let patterns: HashMap<u32, u8> = rasters.iter().map(crc::of).zip(0..).collect();
    assert_eq!(patterns.len(), PATTERNS);
    display.load(rasters).unwrap();
    let camera = Eye::new(View {
        display: display.descriptor().unwrap(),
        patterns: if knows_patterns {
            patterns
        } else {
            HashMap::new()
        },
        refresh: display.refresh(),
        lag: kind.lag.into(),
        wire: (!kind.by_itself).then(Wire::new),
    });
    let trigger = TriggerSetup {
        chip: chip::LABEL.into(),
        line: Some(chip::LINE.into()),
        pulse_us: 2_000,
        ..TriggerSetup::default()
    };
    let clock = Monotonic::new(vec![display.descriptor().unwrap(), camera.descriptor()]);
    let timing = Timing {
        flip_to_light: display.refresh() * kind.lag,
        ..Timing::default()
    };
    let by = display.refresh() * 3 / 2;
    let projector = Late {
        display,
        every: kind.late_every,
        by,
        queued: 0,
    };
    Head::new(
        Box::new(camera),
        Box::new(projector),
        Box::new(Pulse::open(&trigger, chip::LINE, || ()).unwrap()),
        Box::new(clock),
        timing,
    )
}

/// Takes sequences of all patterns, each in another order, checks that every frame shows its
/// pattern, and sums the counts up.
fn take(rig: &mut Head, sequences: usize) -> Exposure {
    let mut sum = Exposure::default();
    for start in 0..sequences {
        // 3 and 8 have no common divisor, so each pattern is shown once.
        let wanted: Vec<usize> = (0..PATTERNS).map(|k| (start + 3 * k) % PATTERNS).collect();
        let mut got = Vec::new();
        let exposure = rig.acquire(&wanted, PATIENT, &mut |index, frame| {
            let hal::frame::Samples::Eight(samples) = frame.samples() else {
                panic!("the camera has 8 bits");
            };
            let seen = samples[0];
            assert_ne!(
                seen, MIXED,
                "pattern {index} of sequence {start} is mixed with another"
            );
            assert_ne!(
                seen, NO_PATTERN,
                "nothing known was in view of pattern {index} of sequence {start}"
            );
            assert_eq!(
                usize::from(seen),
                index,
                "a frame of sequence {start} is mislabelled"
            );
            got.push(index);
        });
        let exposure = exposure.unwrap();
        assert_eq!(got, wanted);
        sum.missed_flips += exposure.missed_flips;
        sum.retaken += exposure.retaken;
        sum.straddled += exposure.straddled;
        sum.stale += exposure.stale;
        sum.surplus += exposure.surplus;
        sum.spoiled += exposure.spoiled;
        sum.pulse_error = sum.pulse_error.max(exposure.pulse_error);
        sum.sync_error = sum.sync_error.max(exposure.sync_error);
    }
    sum
}

#[test]
fn a_head_of_display_trigger_and_camera_keeps_the_promises_of_a_head() {
    if !in_the_machine() {
        return;
    }
    let chip = Chip::new();
    check_head(&mut rig(&chip, Kind::default(), false), 4).unwrap();
}

#[test]
fn each_frame_is_of_the_pattern_that_was_in_view_and_nothing_is_taken_twice() {
    if !in_the_machine() {
        return;
    }
    let chip = Chip::new();
    for lag in [0, 1] {
        let sum = take(
            &mut rig(
                &chip,
                Kind {
                    lag,
                    ..Kind::default()
                },
                true,
            ),
            5,
        );
        println!("light {lag} refreshes after the flip: {sum:?}");
        assert_eq!((sum.missed_flips, sum.retaken), (0, 0));
    }
}

#[test]
fn a_pattern_whose_flip_came_late_is_taken_again_and_never_mislabelled() {
    if !in_the_machine() {
        return;
    }
    let chip = Chip::new();
    let mut again = 0;
    let late = Kind {
        late_every: 3,
        ..Kind::default()
    };
    for (what, kind) in [
        ("triggered", late),
        ("triggered, light a refresh later", Kind { lag: 1, ..late }),
        (
            "by itself",
            Kind {
                by_itself: true,
                ..late
            },
        ),
        (
            "by itself, light a refresh later",
            Kind {
                by_itself: true,
                lag: 1,
                ..late
            },
        ),
    ] {
        let sum = take(&mut rig(&chip, kind, true), 5);
        println!("{what}: {sum:?}");
        assert!(
            sum.missed_flips > 0,
            "{what}: nobody noticed that flips were late"
        );
        again += sum.retaken + sum.straddled;
    }
    assert!(
        again > 0,
        "late flips cost no attempt, so nothing was proved"
    );
}

#[test]
fn a_projector_that_goes_in_the_middle_of_a_sequence_ends_it_at_once() {
    if !in_the_machine() {
        return;
    }
    let chip = Chip::new();
    let mut rig = rig(&chip, Kind::default(), false);
    let unplug = || std::fs::write("/sys/module/vkms/parameters/plugged", "0").unwrap();
    let (begun, mut taken) = (Instant::now(), 0);
    let gone = rig.acquire(&[0; 64], PATIENT, &mut |_, _| {
        taken += 1;
        if taken == 3 {
            unplug();
        }
    });
    let gone = gone.unwrap_err();
    println!(
        "{gone}, said after {:?} and {taken} frames",
        begun.elapsed()
    );
    assert_eq!((gone.kind(), taken < 64), (ErrorKind::Disconnected, true));
    assert!(begun.elapsed() < Duration::from_secs(1));
    drop(rig);
    std::fs::write("/sys/module/vkms/parameters/plugged", "1").unwrap();
}
