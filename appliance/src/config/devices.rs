//! What may be written for real devices: the ranges that the types do not hold.

use super::{Config, HeadConfig};
use hal::setup::{CameraSetup, ProjectorSetup, TriggerSetup};

/// Checks that a value of a key lies within its range.
pub(super) fn within(key: &str, value: u64, low: u64, high: u64) -> Result<(), String> {
    if (low..=high).contains(&value) {
        Ok(())
    } else {
        Err(format!("{key} = {value}: write {low} to {high}"))
    }
}

fn within_real(key: &str, value: f64, low: f64, high: f64) -> Result<(), String> {
    if (low..=high).contains(&value) {
        Ok(())
    } else {
        Err(format!("{key} = {value}: write {low} to {high}"))
    }
}

/// Both or neither, each of 16 bits.
fn size(section: &str, width: Option<u32>, height: Option<u32>) -> Result<(), String> {
    match (width, height) {
        (None, None) => Ok(()),
        (Some(width), Some(height)) => {
            within(&format!("{section}.width"), width.into(), 1, 65_535)?;
            within(&format!("{section}.height"), height.into(), 1, 65_535)
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
    let exposure = u64::from(*exposure_us);
    within("head.camera.exposure_us", exposure, 1, 1_000_000)?;
    let period = u64::from(*period_us);
    within("head.camera.period_us", period, exposure, 10_000_000)?;
    within_real("head.camera.gain", *gain, 1.0, 64.0)?;
    let delivery = u64::from(*delivery_us);
    within("head.camera.delivery_us", delivery, 0, 1_000_000)?;
    let ProjectorSetup {
        width,
        height,
        refresh_hz,
        ..
    } = projector;
    size("head.projector", *width, *height)?;
    if let Some(refresh) = refresh_hz {
        within_real("head.projector.refresh_hz", *refresh, 1.0, 1000.0)?;
    }
    let TriggerSetup { pulse_us, .. } = trigger;
    within("head.trigger.pulse_us", (*pulse_us).into(), 1, 1_000_000)?;
    if trigger.line.is_some() && pulse_us > exposure_us {
        // Such a frame may show two patterns, and nothing in it would tell.
        return Err(format!(
            "head.trigger.pulse_us = {pulse_us}: write at most head.camera.exposure_us = {exposure_us}: a camera that exposes while the pulse \
             lasts would expose longer than it is said to"
        ));
    }
    let lines = &config.lines;
    within("lines.debounce_ms", lines.debounce_ms.into(), 0, 1000)?;
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
