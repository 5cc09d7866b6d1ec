//! The promises that every head keeps, as checks that each back-end's tests run.
//!
//! The checks use nothing but the traits, so a new back-end is tested by one call.

use std::fmt::Display;
use std::time::{Duration, Instant};

use crate::camera::Camera;
use crate::error::{Error, ErrorKind};
use crate::frame::{Frame, Samples};
use crate::head::Head;
use crate::projector::{Projector, Raster};
use crate::trigger::Trigger;
use crate::units::Timestamp;

/// Long enough for any device that works.
const PATIENT: Duration = Duration::from_secs(5);
/// What a call may take beyond its time-out.
const SLACK: Duration = Duration::from_secs(2);
/// A head is used all day.
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

/// `call` fails with an error of `kind` and returns within `timeout`.
fn must_fail<T>(
    promise: &'static str,
    kind: ErrorKind,
    timeout: Duration,
    call: impl FnOnce() -> Result<T, Error>,
) -> Result<(), Violation> {
    let begun = Instant::now();
    match call() {
        Ok(_) => return Err(violated(promise, "the call succeeded")),
        Err(error) if error.kind() != kind => {
            return Err(violated(
                promise,
                format!("{:?} error: {error}", error.kind()),
            ));
        }
        Err(_) => {}
    }
    if begun.elapsed() > timeout + SLACK {
        return Err(violated(
            promise,
            format!("the call took {:?}", begun.elapsed()),
        ));
    }
    Ok(())
}

/// The promises of a camera by itself.
///
/// # Errors
/// The first promise that is not kept.
pub fn check_camera(camera: &mut impl Camera) -> Result<(), Violation> {
    let short = Duration::from_millis(20);
    must_fail(
        "a stopped camera gives no frame",
        ErrorKind::Protocol,
        short,
        || camera.next_frame(short),
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
        PATIENT,
        || camera.start(),
    )?;
    must_fail(
        "a camera without a trigger times out",
        ErrorKind::Timeout,
        short,
        || camera.next_frame(short),
    )?;
    must("a camera stops", camera.stop())
}

/// The promises of a projector by itself, with `patterns` rasters loaded.
///
/// # Errors
/// The first promise that is not kept.
pub fn check_projector(projector: &mut impl Projector, patterns: usize) -> Result<(), Violation> {
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
        PATIENT,
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
        PATIENT,
        || projector.show(patterns, PATIENT),
    )?;
    must_fail(
        "showing without any time times out",
        ErrorKind::Timeout,
        Duration::ZERO,
        || projector.show(0, Duration::ZERO),
    )?;
    let promise = "flips have increasing times and counts";
    let mut last = must(promise, projector.show(0, PATIENT))?;
    for index in (0..patterns).rev() {
        let flip = must("a loaded pattern is shown", projector.show(index, PATIENT))?;
        if flip.timestamp <= last.timestamp || flip.sequence <= last.sequence {
            return Err(violated(promise, format!("{last:?}, then {flip:?}")));
        }
        last = flip;
    }
    must("a projector goes blank", projector.blank())
}

/// The promises of a trigger by itself.
///
/// # Errors
/// The first promise that is not kept.
pub fn check_trigger(trigger: &mut impl Trigger) -> Result<(), Violation> {
    let mut last = Timestamp(0);
    for _ in 0..3 {
        let fired = must("a trigger fires", trigger.fire(PATIENT))?;
        if fired < last {
            return Err(violated(
                "a trigger's times do not go back",
                format!("{last}, then {fired}"),
            ));
        }
        last = fired;
    }
    Ok(())
}

/// All promises of a head that takes sequences of `patterns` patterns, and those of its devices.
///
/// # Errors
/// The first promise that is not kept.
pub fn check_head<C: Camera, P: Projector, T: Trigger>(
    head: &mut Head<C, P, T>,
    patterns: usize,
) -> Result<(), Violation> {
    let (camera, projector, trigger) = head.devices();
    check_camera(camera)?;
    check_projector(projector, patterns)?;
    check_trigger(trigger)?;

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
                && (frame.timestamp() <= last.timestamp() || frame.sequence() <= last.sequence())
            {
                return Err(violated(
                    "timestamps and sequence numbers of frames increase",
                    format!(
                        "frame {} at {}, then {} at {}",
                        last.sequence(),
                        last.timestamp(),
                        frame.sequence(),
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
        "a sequence without any time times out",
        ErrorKind::Timeout,
        Duration::ZERO,
        || head.acquire(&indices, Duration::ZERO, &mut |_, _| ()),
    )?;
    must_fail(
        "a sequence of no patterns is refused",
        ErrorKind::Protocol,
        PATIENT,
        || head.acquire(&[], PATIENT, &mut |_, _| ()),
    )?;
    must(
        "a head works after errors",
        head.acquire(&indices, PATIENT, &mut |_, _| ()).map(|_| ()),
    )
}

/// A checksum of a frame's samples (FNV-1a).
fn digest(frame: &Frame) -> u64 {
    let step = |hash: u64, sample: u64| (hash ^ sample).wrapping_mul(0x0100_0000_01b3);
    let start = 0xcbf2_9ce4_8422_2325;
    match frame.samples() {
        Samples::Eight(samples) => samples.iter().fold(start, |h, s| step(h, u64::from(*s))),
        Samples::Sixteen(samples) => samples.iter().fold(start, |h, s| step(h, u64::from(*s))),
    }
}
