//! Settings of real devices: whether they fit each other (the bounds of each stand beside it in
//! [`hal::setup`]), and exposure and gain that were kept on the page, which take the place of the
//! configured ones.

use super::{Backend, Config, ConfigError, HeadConfig};
use crate::head::exposing::{Exposing, LEAST_GAIN};
use hal::bounds::within;
use hal::setup::NO_GAIN;

/// Checks the devices of the head and the lines.
///
/// # Errors
/// Naming the key and its range.
pub(super) fn check(config: &Config) -> Result<(), ConfigError> {
    let head = &config.head;
    let (camera, projector, trigger) = (&head.camera, &head.projector, &head.trigger);
    for (section, one, other) in [
        ("head.camera", camera.width, camera.height),
        ("head.projector", projector.width, projector.height),
    ] {
        if one.is_some() != other.is_some() {
            return Err(ConfigError::HalfSize { section });
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
        return Err(ConfigError::LongPulse {
            pulse_us,
            exposure_us,
        });
    }
    if trigger.line.is_some() && trigger.by_projector {
        return Err(ConfigError::TwoTriggers);
    }
    let lines = &config.lines;
    let mut named: Vec<(&'static str, &str, &str)> = Vec::new();
    for (key, chip, line) in [
        ("head.trigger.line", &trigger.chip, &trigger.line),
        ("lines.start", &lines.chip, &lines.start),
        ("lines.busy", &lines.chip, &lines.busy),
        ("lines.ok", &lines.chip, &lines.ok),
        ("lines.fault", &lines.chip, &lines.fault),
    ] {
        let Some(line) = line else { continue };
        if let Some((other, ..)) = named.iter().find(|(_, c, l)| c == chip && l == line) {
            return Err(ConfigError::SharedLine {
                keys: [other, key],
                line: line.clone(),
            });
        }
        named.push((key, chip, line));
    }
    Ok(())
}

impl HeadConfig {
    /// The least gain that the camera can be set to.
    pub fn least_gain(&self) -> f64 {
        match self.backend {
            Backend::Rpi => NO_GAIN,
            Backend::Sim | Backend::Replay => LEAST_GAIN,
        }
    }

    /// Sets exposure and gain. What follows from the exposure changes with it: the camera's period
    /// keeps its time between two exposures, and a pulse that sets the exposure keeps its
    /// difference from it.
    pub fn expose(&mut self, exposing: Exposing) {
        let (camera, trigger) = (&mut self.camera, &mut self.trigger);
        let before = camera.exposure_us;
        let between = camera.period_us.saturating_sub(before);
        let shorter = before.saturating_sub(trigger.pulse_us);
        // A shorter pulse only starts the exposure.
        if trigger.pulse_us >= before / 2 {
            trigger.pulse_us = exposing.exposure_us.saturating_sub(shorter).max(1);
        }
        camera.exposure_us = exposing.exposure_us;
        camera.period_us = exposing.exposure_us.saturating_add(between);
        camera.gain = exposing.gain;
        self.exposing = Some(exposing);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_simulated_camera_can_have_less_gain_than_none() {
        let exposing = Exposing {
            exposure_us: 16_667,
            gain: 0.5,
        };
        let of = |backend| HeadConfig {
            backend,
            ..HeadConfig::default()
        };
        exposing.check(of(Backend::Sim).least_gain()).unwrap();
        let words = exposing.check(of(Backend::Rpi).least_gain()).unwrap_err();
        assert!(
            words.to_string().contains("gain is") && words.to_string().contains("1.0 to 64.0"),
            "{words}"
        );
    }

    #[test]
    fn period_and_pulse_follow_the_exposure() {
        let mut head = HeadConfig::default();
        let exposing = Exposing {
            exposure_us: 33_333,
            gain: 2.0,
        };
        head.expose(exposing);
        assert_eq!((head.camera.exposure_us, head.camera.gain), (33_333, 2.0));
        assert_eq!(
            (head.camera.period_us, head.trigger.pulse_us),
            (49_999, 33_319)
        );
        head.trigger.pulse_us = 100;
        head.expose(Exposing {
            exposure_us: 16_667,
            gain: 1.0,
        });
        assert_eq!(
            (head.camera.period_us, head.trigger.pulse_us),
            (33_333, 100)
        );
    }
}
