//! Exposure and gain that were kept on the page: they take the place of the configured ones.

use super::{Backend, HeadConfig};
use crate::head::exposing::{Exposing, LEAST_GAIN};
use hal::setup::NO_GAIN;

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
