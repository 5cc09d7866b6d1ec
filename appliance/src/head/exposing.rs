//! Exposure and gain of the camera. The noise of a sample belongs to both: what was measured or
//! taught at one setting is not true of another.

use hal::bounds::{Bound, Fields, MAX_EXPOSURE_US, OutOfBounds, within};
use hal::setup::MOST_GAIN;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::time::Duration;

/// Least gain of any camera: a simulated one may be darker than its light.
pub const LEAST_GAIN: f64 = 0.01;
/// Largest gain in files: that of a scenario.
const MAX_GAIN: f64 = 100.0;
/// Longest exposure, µs.
pub const MOST_US: u32 = 1_000_000;
/// Exposures are the same up to the rounding of a refresh to whole µs, µs.
const ROUNDING_US: u32 = 2;

/// Exposure and gain of the camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Exposing {
    /// Exposure, µs.
    pub exposure_us: u32,
    /// Gain, 1 = none.
    pub gain: f64,
}

impl Bound<Exposing> for Fields {
    fn check(&self, key: &str, exposing: &Exposing) -> Result<(), OutOfBounds> {
        let exposure = f64::from(exposing.exposure_us);
        within(
            &format!("{key}.exposure_us"),
            exposure,
            0.0,
            MAX_EXPOSURE_US,
        )?;
        within(&format!("{key}.gain"), exposing.gain, 0.0, MAX_GAIN)
    }
}

impl Exposing {
    /// The exposure.
    pub fn exposure(&self) -> Duration {
        Duration::from_micros(u64::from(self.exposure_us))
    }

    /// Checks the ranges; `least_gain` is that of the camera.
    ///
    /// # Errors
    /// In words that name the key and its range.
    pub fn check(&self, least_gain: f64) -> Result<(), OutOfBounds> {
        within("exposure_us", self.exposure_us, 1, MOST_US)?;
        within("gain", self.gain, least_gain, MOST_GAIN)
    }

    /// Checks that the exposure is a whole number of refreshes of the projector, to a hundredth of
    /// one.
    ///
    /// # Errors
    /// In words that name the key and the nearest whole number.
    pub fn check_refreshes(&self, refresh: Duration) -> Result<(), String> {
        let exposure = self.exposure();
        let refreshes = (exposure.as_secs_f64() / refresh.as_secs_f64())
            .round()
            .max(1.0);
        let whole = refresh.mul_f64(refreshes);
        if exposure.abs_diff(whole) <= refresh / 100 {
            return Ok(());
        }
        Err(format!(
            "exposure_us is {}: a micromirror device makes grey levels over whole refreshes: write {} for {refreshes} of them",
            self.exposure_us,
            whole.as_micros(),
        ))
    }

    /// Whether noise at the other setting is noise at this one.
    pub fn agrees(&self, other: &Self) -> bool {
        self.exposure_us.abs_diff(other.exposure_us) <= ROUNDING_US
            && (self.gain - other.gain).abs() <= 1e-6 * self.gain
    }
}

impl fmt::Display for Exposing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} µs at gain {}", self.exposure_us, self.gain)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exposure_is_a_whole_number_of_refreshes_and_a_setting_agrees_with_itself_only() {
        let refresh = Duration::from_secs(1) / 480;
        let at = |exposure_us, gain| Exposing { exposure_us, gain };
        for whole in [2083, 2084, 4166, 33_333, 24_996] {
            assert_eq!(at(whole, 1.0).check_refreshes(refresh), Ok(()), "{whole}");
        }
        for other in [1, 1000, 2200, 3125, 33_400] {
            let words = at(other, 1.0).check_refreshes(refresh).unwrap_err();
            assert!(words.contains("whole refreshes: write "), "{words}");
        }
        assert!(at(2083, 4.0).agrees(&at(2084, 4.0)));
        assert!(!at(2083, 4.0).agrees(&at(2083, 4.001)));
        assert!(!at(2083, 4.0).agrees(&at(4166, 4.0)));
    }
}
