//! The promises that every head keeps, as checks that the tests of each back-end run.
//!
//! The checks use only the traits, so a new back-end is tested by one call.

use std::fmt::Display;
use std::time::{Duration, Instant};

use crate::camera::{Camera, Starts};
use crate::clock::Clock;
use crate::error::{Error, ErrorKind};
use crate::frame::{Frame, Samples};
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

/// The result of `call`, which must return without waiting.
fn prompt<T>(call: impl FnOnce() -> T) -> Result<T, Violation> {
    let begun = Instant::now();
    let answer = call();
    if begun.elapsed() > SLACK {
        return Err(violated(
            "devices are asked without waiting",
            format!("the call took {:?}", begun.elapsed()),
        ));
    }
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
        Err(error) if error.kind() != kind => Err(violated(
            promise,
            format!("{:?} error: {error}", error.kind()),
        )),
        Err(_) => Ok(()),
    }
}

/// The promises of a camera by itself.
///
/// # Errors
/// The first promise that is not kept.
pub fn check_camera(camera: &mut dyn Camera, clock: &mut dyn Clock) -> Result<(), Violation> {
    let timing = camera.timing();
    if timing.exposure.is_zero() || timing.period < timing.exposure {
        return Err(violated(
            "a camera exposes for some time, and never twice at a time",
            format!("{timing:?}"),
        ));
    }
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
    match (timing.starts, frames) {
        (Starts::OnTrigger, 1..) => Err(violated(
            "a camera without a trigger gives no frame",
            format!("{frames} frames within {patience:?}"),
        )),
        (Starts::ByItself, 0) => Err(violated(
            "a camera that runs by itself gives frames",
            format!("none within {patience:?}"),
        )),
        _ => must("a camera stops", camera.stop()),
    }
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
    let mut rasters = Vec::new();
    for index in 0..patterns {
        rasters.push(raster(
            width,
            height,
            u8::try_from(index % 256).unwrap_or(0),
        )?);
    }
    must(
        "rasters of the projector's size are loaded",
        projector.load(rasters),
    )?;
    must_fail(
        "a pattern that is not loaded is not shown",
        ErrorKind::Protocol,
        || projector.queue(patterns),
    )?;
    let nothing = must("a projector can be asked for flips", projector.poll_flip())?;
    if nothing.is_some() {
        return Err(violated(
            "no flip comes that was not queued",
            format!("{nothing:?}"),
        ));
    }
    let refresh = projector.refresh();
    let mut last: Option<Flip> = None;
    for index in (0..patterns).rev() {
        let asked = clock.now();
        must("queueing does not wait", prompt(|| projector.queue(index))?)?;
        must_fail("one flip waits at a time", ErrorKind::Protocol, || {
            projector.queue(index)
        })?;
        let flip = next_flip(projector, clock)?;
        if flip.timestamp + TOLERANCE < asked {
            return Err(violated(
                "no flip comes before it is queued",
                format!("queued at {asked}, {flip:?}"),
            ));
        }
        if let Some(last) = last {
            if flip.timestamp <= last.timestamp || flip.count <= last.count {
                return Err(violated(
                    "flips have increasing times and counts",
                    format!("{last:?}, then {flip:?}"),
                ));
            }
            let counts = u32::try_from(flip.count - last.count).unwrap_or(u32::MAX);
            let (by_time, by_count) = (flip.timestamp.since(last.timestamp), refresh * counts);
            if by_time.abs_diff(by_count) > refresh / 4 {
                return Err(violated(
                    "a flip's count is the count of refreshes",
                    format!("{counts} counts in {by_time:?} at a period of {refresh:?}"),
                ));
            }
        }
        last = Some(flip);
    }
    must("queueing does not wait", projector.queue(0))?;
    must("a projector goes blank", projector.blank())?;
    clock.wait(clock.now() + refresh * 3);
    let forgotten = must("a blank projector can be asked", projector.poll_flip())?;
    if forgotten.is_some() {
        return Err(violated(
            "blanking forgets the flip that waits",
            format!("{forgotten:?}"),
        ));
    }
    Ok(())
}

fn next_flip(projector: &mut dyn Projector, clock: &mut dyn Clock) -> Result<Flip, Violation> {
    let end = clock.now() + PATIENT;
    loop {
        if let Some(flip) = must("a flip comes", prompt(|| projector.poll_flip())?)? {
            return Ok(flip);
        }
        if clock.now() >= end {
            return Err(violated(
                "each queued pattern flips",
                format!("none within {PATIENT:?}"),
            ));
        }
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
        if fired < last || fired < asked || fired > clock.now() {
            return Err(violated(
                "a trigger's times are those of the head's clock and do not go back",
                format!("{last}, then {fired}, asked at {asked}"),
            ));
        }
        last = fired;
        clock.wait(clock.now() + Duration::from_millis(1));
    }
    let mut earliest = begun;
    while let Some(spoiled) = prompt(|| trigger.poll_spoiled())? {
        if spoiled.fired < earliest || spoiled.fired > last {
            return Err(violated(
                "a trigger reports spoiled pulses that it fired, in order and once",
                format!("{spoiled:?} after {earliest}, the last one fired at {last}"),
            ));
        }
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
        if clock.now() < until || clock.now() < begun {
            return Err(violated(
                "a wait ends when its time has come",
                format!("{} after waiting from {begun} until {until}", clock.now()),
            ));
        }
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
    let mut last: Option<Frame> = None;
    let mut kept: Vec<(Frame, u64)> = Vec::new();
    for _ in 0..RESTARTS {
        let mut frames: Vec<(usize, Frame)> = Vec::new();
        let exposure = must(
            "a sequence is acquired again and again",
            head.acquire(&indices, PATIENT, &mut |index, frame| {
                frames.push((index, frame))
            }),
        )?;
        let order: Vec<usize> = frames.iter().map(|(index, _)| *index).collect();
        if order != indices {
            return Err(violated(
                "each pattern gives one frame, in order",
                format!("{order:?}"),
            ));
        }
        for (_, frame) in frames {
            if frame.format() != format {
                return Err(violated(
                    "every frame has the camera's format",
                    format!("{:?} instead of {format:?}", frame.format()),
                ));
            }
            if frame.timestamp() < exposure.started || frame.timestamp() > exposure.done {
                return Err(violated(
                    "frames are exposed while their sequence lasts",
                    format!("{} outside {exposure:?}", frame.timestamp()),
                ));
            }
            if let Some(last) = &last
                && (frame.timestamp() <= last.timestamp() || frame.count() <= last.count())
            {
                return Err(violated(
                    "timestamps and counts of frames increase",
                    format!(
                        "frame {} at {}, then {} at {}",
                        last.count(),
                        last.timestamp(),
                        frame.count(),
                        frame.timestamp()
                    ),
                ));
            }
            if kept.len() < 3 {
                kept.push((frame.clone(), digest(&frame)));
            }
            last = Some(frame);
        }
        if kept.iter().any(|(frame, before)| digest(frame) != *before) {
            return Err(violated(
                "a kept frame survives later ones unchanged",
                "its samples changed",
            ));
        }
    }

    must_fail(
        "a sequence of no patterns is refused",
        ErrorKind::Protocol,
        || head.acquire(&[], PATIENT, &mut |_, _| ()),
    )?;
    must(
        "a head works after errors",
        head.acquire(&indices, PATIENT, &mut |_, _| ()).map(|_| ()),
    )
}

/// A checksum of a frame's samples (FNV-1a).
fn digest(frame: &Frame) -> u64 {
    let mix = |hash: u64, sample: u64| (hash ^ sample).wrapping_mul(0x0100_0000_01b3);
    let start = 0xcbf2_9ce4_8422_2325;
    match frame.samples() {
        Samples::Eight(samples) => samples.iter().fold(start, |h, s| mix(h, u64::from(*s))),
        Samples::Sixteen(samples) => samples.iter().fold(start, |h, s| mix(h, u64::from(*s))),
    }
}
