//! Health: measured values of system, head and clients for the HEALTH registers, with the limits of storage and temperature.

use std::sync::Arc;

use serde::Serialize;

/// Less free storage than this is a warning, MiB: a day of results and some recordings.
pub const LOW_STORAGE_MIB: u64 = 256;
/// Less free storage than this is a fault, MiB: a recipe is written whole beside its two generations, each up to 8 MiB.
pub const FULL_STORAGE_MIB: u64 = 24;
/// From here on the processor is a warning, °C: small computers slow themselves down at 80 to 85.
pub const HOT_PROCESSOR_C: f64 = 80.0;

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
    /// Starts of the daemon with this state folder, this one included.
    pub boots: u32,
    /// Starts that followed an end without a stop: a crash, a kill, a loss of power.
    pub unclean_boots: u32,
    /// Of the unclean starts, those that followed a daemon whose measuring task hung.
    pub watchdog_restarts: u32,
    /// Open Modbus connections.
    #[serde(rename = "modbus_clients")]
    pub clients: u16,
    /// Whether one of them may write.
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
    /// Patterns that were shown again because no frame was exposed to them alone, or their frame was spoiled.
    #[serde(rename = "retaken_patterns")]
    pub retaken: u32,
    /// Largest deviation of a flip from its expected time and of an exposure from its trigger, µs.
    pub sync_error_us: u32,
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
    /// Processing of the last cycle that was measured, µs: all stages but waiting and exposure.
    pub processing_us: u32,
    /// The longest of them since the start, µs.
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

    pub(super) fn processor_is_hot(&self) -> bool {
        self.system
            .cpu_temperature_c
            .is_some_and(|celsius| celsius >= HOT_PROCESSOR_C)
    }
}
