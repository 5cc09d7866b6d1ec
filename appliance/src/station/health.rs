//! Health: measured values of system, head and clients for the HEALTH registers, with the limits of
//! storage and temperature.

use std::sync::Arc;

use serde::Serialize;

/// Less free storage than this is a warning, MiB: a day of results and some recordings.
pub const LOW_STORAGE_MIB: u64 = 256;
/// Less free storage than this is a fault, MiB: a recipe is written whole beside its two
/// generations, each up to 8 MiB.
pub const FULL_STORAGE_MIB: u64 = 24;
/// From here on the processor is a warning, °C: small computers slow themselves down at 80 to 85.
pub const HOT_PROCESSOR_C: f64 = 80.0;
/// From here on the projector is a warning, °C: the long-term limit of the micromirror array (data
/// sheet of the DLP3010, recommended operating conditions).
pub const HOT_PROJECTOR_C: f64 = 70.0;

/// Bits of [`Power`], register 630.
pub mod power {
    bits! {
        /// The supply's voltage is too low.
        UNDER_VOLTAGE = 0, "under-voltage";
        /// The processor's frequency is capped.
        CAPPED = 1, "frequency capped";
        /// The processor is throttled.
        THROTTLED = 2, "throttled";
        /// The soft limit of the temperature is reached.
        SOFT_LIMIT = 3, "soft temperature limit";
        /// The same at any time since the computer's start.
        UNDER_VOLTAGE_SINCE_START = 4, "under-voltage before";
        /// The same at any time since the computer's start.
        CAPPED_SINCE_START = 5, "frequency capped before";
        /// The same at any time since the computer's start.
        THROTTLED_SINCE_START = 6, "throttled before";
        /// The same at any time since the computer's start.
        SOFT_LIMIT_SINCE_START = 7, "soft temperature limit before";
    }
}

/// What the firmware of a Raspberry Pi says of power and throttling.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Power(u16);

impl Power {
    /// Power from the bits of `get_throttled`: 0–3 now, 16–19 the same since the computer's start
    /// (Raspberry Pi documentation, *vcgencmd*, get_throttled). Reading may reset the latter, so
    /// those of the reading `before` stay.
    pub fn of(firmware: u32, before: Option<Self>) -> Self {
        let nibble = |at: u32| ((firmware >> at) & 0xF) as u16;
        let seen = before.unwrap_or_default().0 & 0xF0;
        Self(nibble(0) | (nibble(0) | nibble(16)) << 4 | seen)
    }

    /// Bits 0–3 as in [`Power::of`]; 4–7 the same since the computer's start.
    pub fn bits(self) -> u16 {
        self.0
    }

    /// The conditions that hold now, in words.
    pub fn now(self) -> Vec<&'static str> {
        power::words(self.0 & 0xF).collect()
    }

    /// The conditions that have held since the computer's start, in words.
    pub fn since_start(self) -> Vec<&'static str> {
        power::words(self.0 >> 4).collect()
    }
}

/// What the controller of the projector reports; everything is `None` without a controller.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ProjectorHealth {
    /// Its temperature, °C.
    #[serde(rename = "projector_temperature_c")]
    pub temperature_c: Option<f64>,
    /// The current of the LED that is on, in steps of its driver.
    #[serde(rename = "led_current_steps")]
    pub led_current: Option<u16>,
    /// Its faults, as bits.
    #[serde(skip)]
    pub faults: Option<u16>,
    /// The faults in words.
    #[serde(rename = "projector_faults")]
    pub fault_words: Option<Vec<&'static str>>,
}

/// One survey of the system; about one a second.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct System {
    /// Load of all processors since the last survey, %.
    pub cpu_percent: Option<u8>,
    /// Memory that a program could still get, MiB.
    pub free_memory_mib: Option<u64>,
    /// Room in the state folder, MiB.
    pub free_storage_mib: Option<u64>,
    /// Processor temperature, °C.
    pub cpu_temperature_c: Option<f64>,
    /// Power and throttling.
    #[serde(skip)]
    pub power: Option<Power>,
    /// The kernel's version: its first two numbers.
    #[serde(skip)]
    pub kernel: Option<[u16; 2]>,
    /// The version of libcamera: its first two numbers.
    #[serde(skip)]
    pub libcamera: Option<[u16; 2]>,
    /// Starts of the daemon with this state folder, this one included.
    pub boots: u32,
    /// Starts that followed an end without a stop: a crash, a kill, a loss of power.
    pub unclean_boots: u32,
    /// Of the unclean starts, those that followed a daemon whose measuring task hung.
    pub watchdog_restarts: u32,
    /// Open Modbus connections.
    #[serde(rename = "modbus_clients")]
    pub clients: u16,
    /// Whether one of the connections may write.
    pub writer_connected: bool,
    /// Numbers of the stored recipes, ascending.
    #[serde(skip)]
    pub recipes: Arc<[u16]>,
}

/// Timing of camera and projector in one sequence.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Pace {
    /// Frames per second × 100.
    #[serde(skip)]
    pub camera_centihertz: u32,
    /// Refreshes of the projector, mHz.
    #[serde(skip)]
    pub refresh_millihertz: u32,
    /// Longest time from a pattern in view to its exposure, µs.
    pub lag_us: u32,
    /// Frames that the camera did not deliver.
    #[serde(rename = "dropped_frames")]
    pub dropped: u32,
    /// Refreshes that the projector missed.
    pub missed_flips: u32,
    /// Patterns that were shown again because no frame was exposed to them alone, or their frame
    /// was spoiled.
    #[serde(rename = "retaken_patterns")]
    pub retaken: u32,
    /// Largest deviation of a flip from its expected time and of an exposure from its trigger, µs.
    pub sync_error_us: u32,
}

/// What the last check of the geometry has found.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Drift {
    /// RMS distance of projector points from their epipolar lines, projector pixels.
    pub rms_px: f64,
    /// Whether camera and projector no longer stand to each other as they were calibrated.
    pub drifted: bool,
}

/// Everything that the HEALTH registers show. The page shows it as JSON; null is what is not known.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Health {
    /// The last survey.
    #[serde(flatten)]
    pub system: System,
    /// The last sequence; its counts are sums since the start.
    #[serde(flatten)]
    pub pace: Pace,
    /// The projector's controller.
    #[serde(flatten)]
    pub projector: ProjectorHealth,
    /// Temperature of the camera's sensor, °C.
    pub camera_temperature_c: Option<f64>,
    /// The last check of the geometry with this calibration.
    #[serde(skip)]
    pub drift: Option<Drift>,
    /// Processing of the last cycle that was measured, µs: all stages but waiting and exposure.
    pub processing_us: u32,
    /// The longest processing of a cycle since the start, µs.
    pub processing_max_us: u32,
    /// Writes that failed since the start.
    pub storage_errors: u32,
}

impl Health {
    pub(super) fn paced(&mut self, pace: Pace) {
        let before = self.pace;
        self.pace = Pace {
            dropped: before.dropped.saturating_add(pace.dropped),
            missed_flips: before.missed_flips.saturating_add(pace.missed_flips),
            retaken: before.retaken.saturating_add(pace.retaken),
            ..pace
        };
    }

    pub(super) fn processed(&mut self, us: u32) {
        self.processing_us = us;
        self.processing_max_us = self.processing_max_us.max(us);
    }

    pub(super) fn storage_failed(&mut self) {
        self.storage_errors = self.storage_errors.saturating_add(1);
    }

    pub(super) fn storage_is_low(&self) -> bool {
        self.room_is_below(LOW_STORAGE_MIB)
    }

    pub(super) fn storage_is_full(&self) -> bool {
        self.room_is_below(FULL_STORAGE_MIB)
    }

    fn room_is_below(&self, mib: u64) -> bool {
        self.system.free_storage_mib.is_some_and(|free| free < mib)
    }

    pub(super) fn is_hot(&self) -> bool {
        let above = |celsius: Option<f64>, limit: f64| celsius.is_some_and(|is| is >= limit);
        above(self.system.cpu_temperature_c, HOT_PROCESSOR_C)
            || above(self.projector.temperature_c, HOT_PROJECTOR_C)
    }

    /// Whether the head is not as it was calibrated.
    pub(super) fn has_drifted(&self) -> bool {
        self.drift.is_some_and(|drift| drift.drifted)
    }

    /// Whether the supply is too weak or the computer slows itself down.
    pub(super) fn lacks_power(&self) -> bool {
        self.system
            .power
            .is_some_and(|power| !power.now().is_empty())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_reported_once_stays_reported_for_the_time_since_the_start() {
        let first = Power::of(0x5_0005, None);
        assert_eq!(first.now(), ["under-voltage", "throttled"]);
        // The firmware has forgotten it, and something else began.
        let later = Power::of(0x8, Some(first));
        assert_eq!(later.now(), ["soft temperature limit"]);
        let since = ["under-voltage", "throttled", "soft temperature limit"];
        assert_eq!(later.since_start(), since);
        assert_eq!(later.bits(), 0b1101_1000);
    }
}
