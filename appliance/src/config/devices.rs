//! Checks the configuration of real devices: the ranges that the types do not express.

use super::{Config, HeadConfig};
use crate::head::exposing::MOST_GAIN;
use hal::bounds::{MAX_SIDE, text, within};
use hal::setup::{CameraSetup, ProjectorSetup, TriggerSetup};

/// Least gain of a real camera: the amplifier of a sensor does not make less of its samples.
pub(super) const NO_GAIN: f64 = 1.0;
/// Longest name of a device or a line, characters.
const LONGEST_NAME: usize = 255;

/// Checks a width and a height, of which both or neither must be written.
fn size(section: &str, width: Option<u32>, height: Option<u32>) -> Result<(), String> {
    match (width, height) {
        (None, None) => Ok(()),
        (Some(width), Some(height)) => {
            within(&format!("{section}.width"), width, 1, MAX_SIDE)?;
            within(&format!("{section}.height"), height, 1, MAX_SIDE)
        }
        _ => Err(format!(
            "{section}.width and {section}.height: write both or neither"
        )),
    }
}

/// Checks the devices of the head and the lines.
///
/// # Errors
/// Naming the key and its range.
pub(super) fn check(config: &Config) -> Result<(), String> {
    let HeadConfig {
        camera,
        projector,
        trigger,
        ..
    } = &config.head;
    let CameraSetup {
        exposure_us,
        period_us,
        gain,
        delivery_us,
        ..
    } = camera;
    size("head.camera", camera.width, camera.height)?;
    within("head.camera.exposure_us", *exposure_us, 1, 1_000_000)?;
    within(
        "head.camera.period_us",
        *period_us,
        *exposure_us,
        10_000_000,
    )?;
    within("head.camera.gain", *gain, NO_GAIN, MOST_GAIN)?;
    within("head.camera.delivery_us", *delivery_us, 0, 1_000_000)?;
    let ProjectorSetup {
        width,
        height,
        refresh_hz,
        controller_address,
        led_current,
        ..
    } = projector;
    size("head.projector", *width, *height)?;
    if let Some(refresh) = refresh_hz {
        within("head.projector.refresh_hz", *refresh, 1.0, 1000.0)?;
    }
    // The others are reserved (I²C-bus specification, UM10204, section 3.1.12).
    within(
        "head.projector.controller_address",
        *controller_address,
        8,
        119,
    )?;
    if let Some(current) = led_current {
        within("head.projector.led_current", *current, 0, 1023)?;
    }
    let TriggerSetup { pulse_us, .. } = trigger;
    within("head.trigger.pulse_us", *pulse_us, 1, 1_000_000)?;
    if trigger.line.is_some() && pulse_us > exposure_us {
        // Such a frame may show two patterns, which could not be seen in it.
        return Err(format!(
            "head.trigger.pulse_us = {pulse_us}: write at most head.camera.exposure_us = {exposure_us}: a camera that exposes while the pulse \
             lasts would expose longer than it is said to"
        ));
    }
    if trigger.line.is_some() && trigger.by_projector {
        return Err(
            "head.trigger.line and head.trigger.by_projector: write one of them: a camera has one trigger input".into(),
        );
    }
    let lines = &config.lines;
    for (key, name) in [
        ("head.camera.id", camera.id.as_deref()),
        ("head.projector.connector", projector.connector.as_deref()),
        ("head.trigger.chip", Some(&*trigger.chip)),
        ("head.trigger.line", trigger.line.as_deref()),
        ("lines.chip", Some(&*lines.chip)),
        ("lines.start", lines.start.as_deref()),
        ("lines.busy", lines.busy.as_deref()),
        ("lines.ok", lines.ok.as_deref()),
        ("lines.fault", lines.fault.as_deref()),
    ] {
        text(key, name.unwrap_or(""), LONGEST_NAME)?;
    }
    within("lines.debounce_ms", lines.debounce_ms, 0, 1000)?;
    let mut named: Vec<(&str, &str, &str)> = Vec::new();
    for (key, chip, line) in [
        ("head.trigger.line", &trigger.chip, &trigger.line),
        ("lines.start", &lines.chip, &lines.start),
        ("lines.busy", &lines.chip, &lines.busy),
        ("lines.ok", &lines.chip, &lines.ok),
        ("lines.fault", &lines.chip, &lines.fault),
    ] {
        let Some(line) = line else { continue };
        if let Some((other, ..)) = named.iter().find(|(_, c, l)| c == chip && l == line) {
            return Err(format!(
                "{other} and {key} are both \"{line}\": give each its own line"
            ));
        }
        named.push((key, chip, line));
    }
    Ok(())
}
