//! Checks that the settings of real devices fit each other; the bounds of each stand beside it in
//! [`hal::setup`].

use super::Config;
use hal::bounds::within;

/// Checks the devices of the head and the lines.
///
/// # Errors
/// Naming the key and its range.
pub(super) fn check(config: &Config) -> Result<(), String> {
    let head = &config.head;
    let (camera, projector, trigger) = (&head.camera, &head.projector, &head.trigger);
    for (section, one, other) in [
        ("head.camera", camera.width, camera.height),
        ("head.projector", projector.width, projector.height),
    ] {
        if one.is_some() != other.is_some() {
            return Err(format!(
                "{section}.width and {section}.height: write both or neither"
            ));
        }
    }
    let (exposure_us, pulse_us) = (camera.exposure_us, trigger.pulse_us);
    within(
        "head.camera.period_us",
        camera.period_us,
        exposure_us,
        10_000_000,
    )?;
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
