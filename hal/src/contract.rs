//! The promises that every head keeps, as checks that the tests of each back-end run.
//!
//! The checks use only the traits, so a new back-end is tested by one call.

use std::fmt::Display;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::time::{Duration, Instant};

use crate::camera::{Camera, Starts};
use crate::clock::Clock;
use crate::error::{Error, ErrorKind};
use crate::frame::Frame;
use crate::head::{Head, TOLERANCE};
use crate::projector::{Flip, Projector, Raster};
use crate::trigger::Trigger;
use crate::units::Timestamp;

/// Long enough for any device that works.
const PATIENT: Duration = Duration::from_secs(5);
/// Longest time of a call that does not wait, on a busy computer.
const SLACK: Duration = Duration::from_secs(2);
/// Repetitions of starts and of sequences: a head is used all day.
const RESTARTS: usize = 20;

/// A promise that was not kept.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{promise}: {found}")]
pub struct Violation {
    /// The promise, as a sentence.
    pub promise: &'static str,
    /// What was found instead.
    pub found: String,
}

fn violated(promise: &'static str, found: impl Display) -> Violation {
    Violation {
        promise,
        found: found.to_string(),
    }
}

fn must<T>(promise: &'static str, result: Result<T, Error>) -> Result<T, Violation> {
    result.map_err(|error| violated(promise, error))
}

/// Checks that a promise holds; `found` says what was found instead.
fn ensure(
    promise: &'static str,
    holds: bool,
    found: impl FnOnce() -> String,
) -> Result<(), Violation> {
    match holds {
        true => Ok(()),
        false => Err(violated(promise, found())),
    }
}

/// The result of `call`, which must return without waiting.
fn prompt<T>(call: impl FnOnce() -> T) -> Result<T, Violation> {
    let begun = Instant::now();
    let answer = call();
    let took = begun.elapsed();
    ensure("devices are asked without waiting", took <= SLACK, || {
        format!("the call took {took:?}")
    })?;
    Ok(answer)
}

/// Checks that `call` fails with an error of `kind`, without waiting.
fn must_fail<T>(
    promise: &'static str,
    kind: ErrorKind,
    call: impl FnOnce() -> Result<T, Error>,
) -> Result<(), Violation> {
    match prompt(call)? {
        Ok(_) => Err(violated(promise, "the call succeeded")),
        Err(error) => ensure(promise, error.kind() == kind, || {
            format!("{:?} error: {error}", error.kind())
        }),
    }
}

/// The promises of a camera by itself.
///
/// # Errors
/// The first promise that is not kept.
pub fn check_camera(camera: &mut dyn Camera, clock: &mut dyn Clock) -> Result<(), Violation> {
    let timing = camera.timing();
    ensure(
        "a camera exposes for some time, and never twice at a time",
        !timing.exposure.is_zero() && timing.period >= timing.exposure,
        || format!("{timing:?}"),
    )?;
    must_fail(
        "a stopped camera gives no frame",
        ErrorKind::Protocol,
        || camera.poll_frame(),
    )?;
    must("stopping a stopped camera is fine", camera.stop())?;
    for _ in 0..RESTARTS {
        must("a camera starts again and again", camera.start())?;
        must("a camera stops again and again", camera.stop())?;
    }
    must("a camera starts", camera.start())?;
    must_fail(
        "a running camera is not started twice",
        ErrorKind::Protocol,
        || camera.start(),
    )?;
    let patience = (timing.period + timing.exposure + timing.delivery) * 3;
    let end = clock.now() + patience;
    let mut frames = 0;
    while clock.now() < end {
        clock.wait(end);
        while must(
            "a running camera can be asked",
            prompt(|| camera.poll_frame())?,
        )?
        .is_some()
        {
            frames += 1;
        }
    }
    let (promise, holds) = match timing.starts {
        Starts::OnTrigger => ("a camera without a trigger gives no frame", frames == 0),
        Starts::ByProjector | Starts::ByItself => {
            ("a camera that runs by itself gives frames", frames > 0)
        }
    };
    ensure(promise, holds, || {
        format!("{frames} frames within {patience:?}")
    })?;
    must("a camera stops", camera.stop())
}

/// The promises of a projector by itself, with `patterns` rasters loaded.
///
/// # Errors
/// The first promise that is not kept.
pub fn check_projector(
    projector: &mut dyn Projector,
    clock: &mut dyn Clock,
    patterns: usize,
) -> Result<(), Violation> {
    let (width, height) = projector.size();
    let raster = |width, height, level| {
        must(
            "a raster of the projector's size can be made",
            Raster::uniform(width, height, level),
        )
    };
    let wrong = raster(width + 1, height, 0)?;
    must_fail(
        "a raster of another size is refused",
        ErrorKind::Unsupported,
        || projector.load(vec![wrong; patterns]),
    )?;
    let rasters: Result<_, _> = (0..=u8::MAX)
        .cycle()
        .take(patterns)
        .map(|grey| raster(width, height, grey))
        .collect();
    must(
        "rasters of the projector's size are loaded",
        projector.load(rasters?),
    )?;
    must_fail(
        "patterns that are not there are not kept",
        ErrorKind::Protocol,
        || projector.load_behind(patterns + 1, Vec::new()),
    )?;
    let behind = projector.load_behind(patterns, vec![raster(width, height, 0)?]);
    // Recordings hold no other patterns than their own.
    if !matches!(behind, Err(Error::Unsupported { .. })) {
        must("a pattern is loaded behind others", behind)?;
    }
    must(
        "patterns behind others are dropped",
        projector.load_behind(patterns, Vec::new()),
    )?;
    must_fail(
        "a pattern that is not loaded is not shown",
        ErrorKind::Protocol,
        || projector.queue(patterns),
    )?;
    let nothing = must("a projector can be asked for flips", projector.poll_flip())?;
    ensure(
        "no flip comes that was not queued",
        nothing.is_none(),
        || format!("{nothing:?}"),
    )?;
    let refresh = projector.refresh();
    let mut last: Option<Flip> = None;
    for index in (0..patterns).rev() {
        let asked = clock.now();
        must("queueing does not wait", prompt(|| projector.queue(index))?)?;
        must_fail("one flip waits at a time", ErrorKind::Protocol, || {
            projector.queue(index)
        })?;
        let flip = next_flip(projector, clock)?;
        ensure(
            "no flip comes before it is queued",
            flip.timestamp + TOLERANCE >= asked,
            || format!("queued at {asked}, {flip:?}"),
        )?;
        if let Some(last) = last {
            ensure(
                "flips have increasing times and counts",
                flip.timestamp > last.timestamp && flip.count > last.count,
                || format!("{last:?}, then {flip:?}"),
            )?;
            let counts = u32::try_from(flip.count - last.count).unwrap_or(u32::MAX);
            let (by_time, by_count) = (flip.timestamp.since(last.timestamp), refresh * counts);
            ensure(
                "a flip's count is the count of refreshes",
                by_time.abs_diff(by_count) <= refresh / 4,
                || format!("{counts} counts in {by_time:?} at a period of {refresh:?}"),
            )?;
        }
        last = Some(flip);
    }
    must("queueing does not wait", projector.queue(0))?;
    must("a projector goes blank", projector.blank())?;
    clock.wait(clock.now() + refresh * 3);
    let forgotten = must("a blank projector can be asked", projector.poll_flip())?;
    ensure(
        "blanking forgets the flip that waits",
        forgotten.is_none(),
        || format!("{forgotten:?}"),
    )
}

fn next_flip(projector: &mut dyn Projector, clock: &mut dyn Clock) -> Result<Flip, Violation> {
    let end = clock.now() + PATIENT;
    loop {
        if let Some(flip) = must("a flip comes", prompt(|| projector.poll_flip())?)? {
            return Ok(flip);
        }
        ensure("each queued pattern flips", clock.now() < end, || {
            format!("none within {PATIENT:?}")
        })?;
        clock.wait(end);
    }
}

/// The promises of a trigger by itself.
///
/// # Errors
/// The first promise that is not kept.
pub fn check_trigger(trigger: &mut dyn Trigger, clock: &mut dyn Clock) -> Result<(), Violation> {
    while trigger.poll_spoiled().is_some() {}
    let (begun, mut last) = (clock.now(), Timestamp(0));
    for _ in 0..3 {
        let asked = clock.now();
        let fired = must("a trigger fires", prompt(|| trigger.fire())?)?;
        ensure(
            "a trigger's times are those of the head's clock and do not go back",
            fired >= last && (asked..=clock.now()).contains(&fired),
            || format!("{last}, then {fired}, asked at {asked}"),
        )?;
        last = fired;
        clock.wait(clock.now() + Duration::from_millis(1));
    }
    let mut earliest = begun;
    while let Some(spoiled) = prompt(|| trigger.poll_spoiled())? {
        ensure(
            "a trigger reports spoiled pulses that it fired, in order and once",
            (earliest..=last).contains(&spoiled.fired),
            || format!("{spoiled:?} after {earliest}, the last one fired at {last}"),
        )?;
        earliest = spoiled.fired + Duration::from_nanos(1);
    }
    Ok(())
}

/// The promises of a clock.
///
/// # Errors
/// The first promise that is not kept.
pub fn check_clock(clock: &mut dyn Clock) -> Result<(), Violation> {
    for ms in [0, 1, 20] {
        let (begun, until) = (clock.now(), clock.now() + Duration::from_millis(ms));
        // A wait may return early without a reason, but not for ever.
        for _ in 0..1000 {
            clock.wait(until);
        }
        let now = clock.now();
        ensure(
            "a wait ends when its time has come",
            now >= until && now >= begun,
            || format!("{now} after waiting from {begun} until {until}"),
        )?;
    }
    Ok(())
}

/// The promises of a head that takes sequences of `patterns` patterns, and those of its devices.
///
/// # Errors
/// The first promise that is not kept.
pub fn check_head(head: &mut Head, patterns: usize) -> Result<(), Violation> {
    let devices = head.devices();
    let clock = &mut *devices.clock;
    check_clock(clock)?;
    check_camera(&mut *devices.camera, clock)?;
    check_projector(&mut *devices.projector, clock, patterns)?;
    check_trigger(&mut *devices.trigger, clock)?;

    let format = head.camera_format();
    let indices: Vec<usize> = (0..patterns).collect();
    let mut last: Option<(Timestamp, u64)> = None;
    let mut kept: Vec<(u64, Frame)> = Vec::new();
    for _ in 0..RESTARTS {
        let mut frames: Vec<(usize, Frame)> = Vec::new();
        let exposure = must(
            "a sequence is acquired again and again",
            head.acquire(&indices, PATIENT, &mut |index, frame| {
                frames.push((index, frame))
            }),
        )?;
        let order: Vec<usize> = frames.iter().map(|(index, _)| *index).collect();
        ensure(
            "each pattern gives one frame, in order",
            order == indices,
            || format!("{order:?}"),
        )?;
        for (_, frame) in frames {
            ensure(
                "every frame has the camera's format",
                frame.format() == format,
                || format!("{:?} instead of {format:?}", frame.format()),
            )?;
            let (at, count) = (frame.timestamp(), frame.count());
            ensure(
                "frames are exposed while their sequence lasts",
                (exposure.started..=exposure.done).contains(&at),
                || format!("{at} outside {exposure:?}"),
            )?;
            ensure(
                "timestamps and counts of frames increase",
                last.is_none_or(|(before, fewer)| at > before && count > fewer),
                || format!("{last:?}, then frame {count} at {at}"),
            )?;
            last = Some((at, count));
            if kept.len() < 3 {
                kept.push((digest(&frame), frame));
            }
        }
        ensure(
            "a kept frame survives later ones unchanged",
            kept.iter().all(|(before, frame)| digest(frame) == *before),
            || "its samples changed".into(),
        )?;
    }

    must_fail(
        "a sequence of no patterns is refused",
        ErrorKind::Protocol,
        || head.acquire(&[], PATIENT, &mut |_, _| ()),
    )?;
    must(
        "a head works after errors",
        head.acquire(&indices, PATIENT, &mut |_, _| ()).map(|_| ()),
    )?;

    let set = head.camera_timing();
    for times in [2, 1] {
        match head.expose(times) {
            Err(Error::Unsupported { .. }) => return Ok(()),
            exposed => must("a head exposes longer, and as it is set again", exposed)?,
        }
        let timing = head.camera_timing();
        ensure(
            "a head says how long it exposes",
            timing == set.exposed(times) && head.exposures() == times,
            || format!("{timing:?} at {times} times {set:?}"),
        )?;
        must(
            "sequences are acquired with exposures of any length",
            head.acquire(&indices, PATIENT, &mut |_, _| ()),
        )?;
    }
    Ok(())
}

/// A checksum of a frame's samples.
fn digest(frame: &Frame) -> u64 {
    let mut hasher = DefaultHasher::new();
    frame.samples().hash(&mut hasher);
    hasher.finish()
}
