//! The doctor's checks of devices and time: devices answer, format and mode, flips, triggers, how long
//! frames need to this program, flip-to-light delay.

use super::{Check, CheckResult, Examination};
use crate::head::examine::{
    Delay, MOST_LATE, PATIENCE, Spaced, Stamps, load_black_and_white, pace,
};
use hal::camera::Starts;
use hal::head::{Head, Showing, TOLERANCE, Watched, WatchedFrame};
use hal::projector::Flip;
use hal::trigger::Spoiled;
use hal::units::Timestamp;
use serde_json::{Value, json};
use std::time::Duration;

/// Flips whose cadence is judged.
const FLIPS: u32 = 60;
/// Largest relative deviation of the period of flips from the mode's: a mode that says 60 Hz may
/// run at 59.94.
const PERIOD_TOLERANCE: f64 = 2e-3;
/// A start of the camera that takes longer is noticed in a cycle.
const SLOW_START: Duration = Duration::from_millis(100);
/// Refreshes over which the trigger is judged.
const TRIGGERED: u32 = 24;
/// The index of white among the patterns of [`load_black_and_white`].
const WHITE: usize = 1;
/// Least uncertainty of the measured delay, ms: that of one round with a camera of few pixels.
const LEAST_OFF_MS: f64 = 0.05;
/// Refreshes over which frames are timed.
const REFRESHES: u32 = 24;
/// How much later than stated a frame may come: a few turns of the scheduler.
const LATE: Duration = Duration::from_millis(5);

pub(super) fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

pub(super) fn devices(examination: &mut Examination<'_>) -> CheckResult {
    let head = &*examination.head;
    head.present()?;
    let ((columns, rows), camera) = (head.projector_size(), head.camera_format());
    Ok(Check::new(
        format!(
            "a camera of {} and a projector of {columns}×{rows}",
            camera.describe()
        ),
        None,
        json!({
            "camera": [camera.width, camera.height], "bit_depth": camera.bit_depth,
            "projector": [columns, rows],
        }),
    ))
}

pub(super) fn format(examination: &mut Examination<'_>) -> CheckResult {
    let encoding = examination.head.encoding();
    let measured = json!({ "encoding": encoding.name, "exact": encoding.exact });
    if encoding.exact {
        let found = format!("{}: samples are what the sensor counted", encoding.name);
        return Ok(Check::new(found, None, measured));
    }
    let found = format!(
        "the camera grants {} only: its samples are not what the sensor counted, but compressed or processed",
        encoding.name
    );
    let remedy =
        "ask for an uncompressed raw format (R16 on a Raspberry Pi 5, R10_CSI2P on a Pi 4)";
    Ok(Check::new(found, Some(remedy), measured))
}

pub(super) fn mode(examination: &mut Examination<'_>) -> CheckResult {
    let head = &*examination.head;
    let (camera, refresh) = (head.camera_timing(), head.refresh());
    let refreshes = camera.exposure.as_secs_f64() / refresh.as_secs_f64();
    let whole = refresh.mul_f64(refreshes.round().max(1.0));
    let off = camera.exposure.abs_diff(whole);
    let measured = json!({
        "refresh_hz": 1.0 / refresh.as_secs_f64(),
        "exposure_ms": ms(camera.exposure), "exposure_refreshes": refreshes,
        "camera_period_ms": ms(camera.period),
    });
    let found = format!(
        "{:.2} Hz; exposures of {:.3} ms, {refreshes:.2} refreshes, at most every {:.3} ms",
        1.0 / refresh.as_secs_f64(),
        ms(camera.exposure),
        ms(camera.period)
    );
    let remedy = format!(
        "set the exposure to {:.3} ms: a micromirror device makes grey levels over whole refreshes",
        ms(whole)
    );
    let wrong = off > TOLERANCE;
    Ok(Check::new(found, wrong.then_some(&*remedy), measured))
}

/// How long a cycle waits for the camera to start.
pub(super) fn start(examination: &mut Examination<'_>) -> CheckResult {
    let head = &mut *examination.head;
    let (took, stays_on) = (head.start_up()?, head.stays_on());
    let triggered = head.camera_timing().starts == Starts::OnTrigger;
    let measured = json!({ "start_ms": ms(took), "stays_on_s": stays_on.as_secs_f64() });
    let then = match stays_on.is_zero() {
        true => "is stopped after each cycle".to_owned(),
        false => format!("stays on between cycles for up to {} s", stays_on.as_secs()),
    };
    let found = format!("the camera starts in {:.0} ms and {then}", ms(took));
    let remedy = if took <= SLOW_START || !stays_on.is_zero() {
        None
    } else if triggered {
        Some(
            "each cycle takes so much longer: set camera_timeout_value_ms to 60000 in the file that LIBCAMERA_RPI_CONFIG_FILE names, so that the \
             camera may stay on, and add always-on to its overlay in config.txt",
        )
    } else {
        Some("each cycle takes so much longer: add always-on to the camera's overlay in config.txt")
    };
    Ok(Check::new(found, remedy, measured))
}

pub(super) fn cadence(examination: &mut Examination<'_>) -> CheckResult {
    let head = &mut *examination.head;
    load_black_and_white(head)?;
    let showing = |index: u32| Showing {
        index: index as usize % 2,
        refreshes: 1,
        settle: FLIPS,
    };
    let showings: Vec<Showing> = (0..FLIPS).map(showing).collect();
    let flips = head.watch(&showings, PATIENCE, &mut |_| ())?.flips;
    let nominal = head.refresh();
    let (Some(first), Some(last)) = (flips.first(), flips.last()) else {
        let remedy = "check the projector's connection and that no other program holds the display";
        return Ok(Check::new(
            "no flip came",
            Some(remedy),
            json!({ "flips": 0 }),
        ));
    };
    let counted = last.count - first.count;
    let missed = counted.saturating_sub(u64::from(FLIPS) - 1);
    let period = last.timestamp.since(first.timestamp).as_secs_f64() / counted.max(1) as f64;
    let off_grid = |flip: &Flip| {
        let expected = period * (flip.count - first.count) as f64;
        (flip.timestamp.since(first.timestamp).as_secs_f64() - expected).abs()
    };
    let jitter = flips.iter().map(off_grid).fold(0.0, f64::max);
    let measured = json!({
        "flips": flips.len(), "missed": missed, "period_ms": period * 1e3, "jitter_us": jitter * 1e6,
    });
    let found = format!(
        "{} of {FLIPS} flips, {missed} refreshes missed, one per {:.3} ms, off by {:.0} µs at most",
        flips.len(),
        period * 1e3,
        jitter * 1e6
    );
    let remedy = if flips.len() < FLIPS as usize {
        Some("the projector stopped flipping: check its cable and the display driver's log")
    } else if missed > 0 {
        Some(
            "flips come late: stop what else loads the computer, and give fringed a real-time priority",
        )
    } else if (period / nominal.as_secs_f64() - 1.0).abs() > PERIOD_TOLERANCE {
        Some("the projector does not run in the mode that it says: set the mode anew")
    } else if jitter > TOLERANCE.as_secs_f64() {
        Some(
            "the display driver does not stamp flips at the refresh: use a driver with precise vblank times",
        )
    } else {
        None
    };
    Ok(Check::new(found, remedy, measured))
}

pub(super) fn trigger(examination: &mut Examination<'_>) -> CheckResult {
    let head = &mut *examination.head;
    load_black_and_white(head)?;
    let showing = Showing {
        index: WHITE,
        refreshes: TRIGGERED,
        settle: 0,
    };
    let mut seen = head.watch(&[showing], PATIENCE, &mut |_| ())?;
    if !examination.calibrated && !seen.frames.is_empty() {
        // The doctor runs before the head is calibrated, so it measures the stamps as calibrating
        // will.
        let stamps = Stamps::measure(head)?;
        head.set_timing(stamps.timing(head.timing()));
        load_black_and_white(head)?;
        seen = head.watch(&[showing], PATIENCE, &mut |_| ())?;
    }
    Ok(match head.camera_timing().starts {
        Starts::OnTrigger => triggered(head, &seen)?,
        Starts::ByProjector => by_projector(head, &seen)?,
        Starts::ByItself => by_itself(&seen, head.camera_timing().period),
    })
}

fn triggered(head: &mut Head, seen: &Watched<()>) -> CheckResult {
    let (pulses, frames) = (seen.triggers.len(), seen.frames.len());
    let after = |frame: &WatchedFrame<()>| {
        let after = |at: &Timestamp| (i128::from(frame.start.0) - i128::from(at.0)) / 1000;
        seen.triggers.iter().map(after).min_by_key(|us| us.abs())
    };
    let mut after_us: Vec<_> = seen.frames.iter().filter_map(after).collect();
    after_us.sort_unstable();
    let late_us = after_us.get(after_us.len() / 2).copied().unwrap_or(0);
    let off_us = after_us
        .iter()
        .map(|us| us.unsigned_abs())
        .max()
        .unwrap_or(0);
    let spoiled = seen.spoiled.len();
    let pulse_off = seen.spoiled.iter().map(Spoiled::off).max();
    let measured = json!({
        "triggers": pulses, "frames": frames, "off_us": off_us as u64, "late_us": late_us as i64, "spoiled": spoiled,
    });
    let found =
        format!("{frames} frames for {pulses} triggers, exposed {off_us} µs from them at most");
    if frames == 0 {
        let found = format!("no frame for {pulses} triggers");
        let remedy = "check the wire from the trigger output to the camera's trigger input, and that the camera is in trigger mode";
        return Ok(Check::new(found, Some(remedy), measured));
    }
    if let Some(off) = pulse_off {
        return Ok(Check::new(
            format!(
                "{spoiled} of {pulses} pulses were too long or too short, by up to {:.2} ms, and so was the exposure",
                ms(off)
            ),
            Some(
                "stop what else loads the computer, and see the check pulses; or let the projector's trigger output start the exposures \
                 (head.trigger.by_projector)",
            ),
            measured,
        ));
    }
    if frames < pulses {
        return Ok(lost(head.timing().hold, &pace(head)?, found, measured));
    }
    let tolerance = TOLERANCE.as_micros();
    let remedy = if late_us.unsigned_abs() > MOST_LATE.as_micros() {
        Some(
            "the camera's stamps mark another moment of the exposure than the calibration says: calibrate anew".to_owned(),
        )
    } else if late_us.unsigned_abs() > tolerance / 2 {
        Some(format!(
            "the camera's stamps are {late_us} µs later than the calibration says, of {tolerance} µs that are tolerated: calibrate anew"
        ))
    } else if off_us > tolerance {
        Some(format!(
            "the camera's stamps are not regular (off by {late_us} µs in the middle, {off_us} µs at most): the driver must stamp frames in its interrupt"
        ))
    } else {
        None
    };
    Ok(Check::new(found, remedy.as_deref(), measured))
}

/// Triggers were lost with so many refreshes per pattern: because the camera was not ready for
/// them, or by a bad contact.
fn lost(refreshes: u32, tried: &[Spaced], found: String, mut measured: Value) -> Check {
    let words = tried.iter().map(|spaced| format!("; {}", spaced.words()));
    let found = found + &words.collect::<String>();
    let needed = tried.last().filter(|spaced| spaced.none_lost());
    measured["refreshes"] = json!(refreshes);
    measured["refreshes_needed"] = json!(needed.map(|spaced| spaced.refreshes));
    let remedy = match needed {
        Some(needed) if needed.refreshes > refreshes => format!(
            "the camera's readout and dead time need {} refreshes per pattern instead of {refreshes}: calibrate anew, or use a slower mode of \
             the projector (58 Hz or less for an IMX296)",
            needed.refreshes
        ),
        _ => "triggers are lost: check the wire's contact and level".into(),
    };
    Check::new(found, Some(&*remedy), measured)
}

/// A camera that the projector triggers has a frame in every so many refreshes.
fn by_projector(head: &mut Head, seen: &Watched<()>) -> CheckResult {
    let (hold, refresh) = (head.timing().hold, head.refresh());
    let Some(needed) = pace(head)?.pop() else {
        return Ok(Check::new(
            format!(
                "{} frames of a camera that the projector triggers",
                seen.frames.len()
            ),
            Some(
                "check the wire from the projector's trigger output to the camera's trigger input and its level, that the output is enabled \
                 (head.projector.controller), and that the camera is in trigger mode",
            ),
            json!({ "frames": seen.frames.len() }),
        ));
    };
    if needed.refreshes > hold {
        return Ok(lost(
            hold,
            &[needed],
            "the projector triggers the camera".into(),
            json!({}),
        ));
    }
    // The period of the camera must be so many refreshes, or something else triggers it.
    Ok(by_itself(seen, refresh * needed.refreshes))
}

fn by_itself(seen: &Watched<()>, nominal: Duration) -> Check {
    let frames = seen.frames.len();
    let (first, last) = (seen.frames.first(), seen.frames.last());
    let (Some(first), Some(last)) = (first, last.filter(|_| frames > 1)) else {
        return Check::new(
            format!("{frames} frames of a camera that runs by itself"),
            Some("check the camera's cable and that no other program holds it"),
            json!({ "frames": frames }),
        );
    };
    let counted = last.count.saturating_sub(first.count).max(1);
    let lost = (counted + 1).saturating_sub(frames as u64);
    let period = last.start.since(first.start).as_secs_f64() / counted as f64;
    let measured = json!({ "frames": frames, "lost": lost, "period_ms": period * 1e3 });
    let found = format!(
        "{frames} frames by itself, {lost} lost, one per {:.3} ms",
        period * 1e3
    );
    let remedy = if lost > 0 {
        Some("frames are lost: check the camera's cable and the load of the computer")
    } else if (period / nominal.as_secs_f64() - 1.0).abs() > PERIOD_TOLERANCE {
        Some("the camera does not keep its frame period: set it before the start and not again")
    } else {
        None
    };
    Check::new(found, remedy, measured)
}

/// The time from a flip to its light, from the brightness of the frames around many flips.
pub(super) fn delay(examination: &mut Examination<'_>) -> CheckResult {
    let (head, lit) = examination.lit()?;
    let believed = head.timing().flip_to_light.as_secs_f64();
    let refresh = head.refresh().as_secs_f64();
    let Some(measured) = Delay::measure(head, lit, 1, &|_| ())? else {
        return Ok(Check::new(
            "no light follows the flips from black to white",
            Some("check the projector's input: it may show another source"),
            json!({ "calibrated_ms": believed * 1e3 }),
        ));
    };
    let delay = measured.seconds;
    let off_ms = (3.0 * measured.error * 1e3).max(LEAST_OFF_MS);
    let numbers = json!({
        "delay_ms": delay * 1e3, "off_ms": off_ms, "calibrated_ms": believed * 1e3,
        "off_refreshes": (delay - believed) / refresh,
    });
    let found = format!(
        "light comes {:.2} ± {off_ms:.2} ms after its flip, the calibration says {:.2} ms",
        delay * 1e3,
        believed * 1e3
    );
    // The calibration measures the delay with more flips, so a difference below an eighth of a
    // refresh does not show an error of it.
    let wrong = (delay - believed).abs() > (off_ms * 1e-3).max(refresh / 8.0);
    let remedy = format!(
        "the calibration is off by {:.1} refreshes: switch off the projector's picture processing, or calibrate anew",
        (delay - believed) / refresh
    );
    Ok(Check::new(found, wrong.then_some(&*remedy), numbers))
}

/// The median time from the end of an exposure until its frame can be used.
pub(super) fn delivery(examination: &mut Examination<'_>) -> CheckResult {
    let head = &mut *examination.head;
    load_black_and_white(head)?;
    let camera = head.camera_timing();
    let showing = Showing {
        index: 0,
        refreshes: REFRESHES,
        settle: 0,
    };
    let seen = head.watch(&[showing], PATIENCE, &mut |_| ())?;
    let needed = |frame: &WatchedFrame<()>| frame.arrived.since(frame.start + camera.exposure);
    let mut times: Vec<Duration> = seen.frames.iter().map(needed).collect();
    times.sort_unstable();
    let median = times.get(times.len() / 2).copied().unwrap_or_default();
    let stated = camera.delivery;
    let found = format!(
        "a frame can be used {:.1} ms after its exposure, {:.1} ms are stated",
        ms(median),
        ms(stated)
    );
    let measured = json!({ "delivered_ms": ms(median), "stated_ms": ms(stated) });
    let remedy = format!(
        "frames are read slowly: see that /dev/dma_heap/vidbuf_cached exists and this user may open it (group \"video\"), and that nothing else loads the computer; \
         if it cannot be faster, set head.camera.delivery_us to {:.0}",
        ms(median).ceil() * 1e3
    );
    Ok(Check::new(
        found,
        (median > stated + LATE).then_some(&*remedy),
        measured,
    ))
}
