//! The times of a simulated head: exposure, readout and delays, and the delay that its calibration
//! states.

use hal::bounded;
use hal::head::Stamp;

bounded! {
    /// Times of a simulated head. By default the camera is triggered, exposes for two refreshes and
    /// needs no time for its readout, and a pattern's light comes with its flip.
    pub struct Timing: Default {
        /// Exposure, refreshes of the projector, 0.01…100. A micromirror device makes grey levels
        /// over whole refreshes.
        pub exposure_refreshes: f64 = 0.01..=100.0 => 2.0,
        /// From the end of an exposure until its frame can be fetched, 0…1 000 000 µs.
        pub readout_us: u64 = 0..=1_000_000,
        /// How long it takes to copy a frame out of the camera's buffer, in a thread of its own,
        /// 0…1 000 000 µs.
        pub copy_us: u64 = 0..=1_000_000,
        /// From the camera's start until it can be triggered or runs, 0…10 000 000 µs.
        pub start_up_us: u64 = 0..=10_000_000,
        /// How long a triggered camera may stay on without an exposure, 0…1000 s; 0: it is stopped
        /// after each sequence.
        pub stays_on_s: u64 = 0..=1000 => 30,
        /// For how long after its readout a triggered camera still loses triggers, which its stated
        /// times do not contain, 0…1 000 000 µs.
        pub dead_us: u64 = 0..=1_000_000,
        /// Refreshes per pattern according to the head's calibration, 1…100; if left out, as many
        /// as the camera needs.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub calibrated_refreshes: Option<u32> = 1..=100,
        /// From a flip to its pattern's light, 0…1 000 000 µs.
        pub flip_to_light_us: u64 = 0..=1_000_000,
        /// From opening the head, which sets the projector's mode, to its first light, 0…60 000 000
        /// µs.
        pub first_light_us: u64 = 0..=60_000_000,
        /// The flip-to-light delay according to the head's calibration; if left out, the true one.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub calibrated_flip_to_light_us: Option<u64> = 0..=1_000_000,
        /// Whether the projector triggers the camera, with the light of each refresh for which the
        /// camera is ready.
        pub by_projector: bool,
        /// Period of a camera that runs by itself, at least exposure or readout, up to 10 000 000
        /// µs; 0: the camera is triggered.
        pub camera_period_us: u64 = 0..=10_000_000,
        /// From the start of a camera that runs by itself to its first exposure, 0…10 000 000 µs.
        pub camera_phase_us: u64 = 0..=10_000_000,
        /// What the camera's stamps mark: "exposure_start", "exposure_end" or "readout_end".
        pub stamp: Stamp,
        /// From the moment that they mark to the stamps, 0…1 000 000 µs.
        pub stamp_late_us: u64 = 0..=1_000_000,
        /// From that moment to the stamps according to the head's calibration; if left out, the
        /// true time.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub calibrated_stamp_late_us: Option<u64> = 0..=1_000_000,
    }
}
