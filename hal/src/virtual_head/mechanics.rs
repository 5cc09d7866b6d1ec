//! The mechanics of a virtual head: its times, the delay that its calibration states, its faults, and
//! the random numbers that decide when these happen.

use std::time::Duration;

use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

use crate::bounded;
use crate::camera::{CameraTiming, Encoding, Starts};
use crate::head::{Stamp, Timing};

/// How long a triggered camera of a replay head stays on between sequences.
const STAYS_ON: Duration = Duration::from_secs(30);

/// The true times of a virtual head, and its faults.
#[derive(Clone, Debug)]
pub struct Mechanics {
    /// Time from one refresh of the projector to the next.
    pub refresh: Duration,
    /// From a flip to its pattern's light.
    pub flip_to_light: Duration,
    /// From opening the projector, which sets its mode, to its first light.
    pub first_light: Duration,
    /// The flip-to-light delay according to the head's calibration.
    pub calibrated_flip_to_light: Duration,
    /// Planned exposure.
    pub exposure: Duration,
    /// From the end of an exposure until its frame can be fetched.
    pub readout: Duration,
    /// How long it takes to copy a frame out of the camera's buffer. A thread of its own copies one
    /// after the other.
    pub copy: Duration,
    /// For how long after its readout a triggered camera still loses triggers, which it does not
    /// say.
    pub dead: Duration,
    /// Refreshes per pattern according to the head's calibration.
    pub calibrated_hold: u32,
    /// From the camera's start until it can be triggered.
    pub start_up: Duration,
    /// How long a triggered camera may stay on without an exposure.
    pub stays_on: Duration,
    /// Whether the projector triggers the camera, with the light of each refresh for which the
    /// camera is ready.
    pub by_projector: bool,
    /// The times of a camera that runs by itself.
    pub free_running: Option<FreeRunning>,
    /// What the camera's stamps mark.
    pub stamp: Stamp,
    /// From the moment that they mark to the stamps.
    pub stamp_late: Duration,
    /// From the moment that they mark to the stamps, according to the head's calibration.
    pub calibrated_stamp_late: Duration,
    /// What goes wrong.
    pub faults: Faults,
}

/// The times of a camera that runs by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FreeRunning {
    /// From the start of one exposure to the start of the next.
    pub period: Duration,
    /// From the camera's start to its first exposure.
    pub phase: Duration,
}

impl Mechanics {
    /// A triggered camera that exposes for `refreshes` whole refreshes, as a digital micromirror
    /// device requires, and needs no time for its readout.
    pub(crate) fn plain(refresh: Duration, refreshes: u32) -> Self {
        Self {
            refresh,
            flip_to_light: Duration::ZERO,
            first_light: Duration::ZERO,
            calibrated_flip_to_light: Duration::ZERO,
            exposure: refresh * refreshes,
            readout: Duration::ZERO,
            copy: Duration::ZERO,
            dead: Duration::ZERO,
            calibrated_hold: 1,
            start_up: Duration::ZERO,
            stays_on: STAYS_ON,
            by_projector: false,
            free_running: None,
            stamp: Stamp::default(),
            stamp_late: Duration::ZERO,
            calibrated_stamp_late: Duration::ZERO,
            faults: Faults::default(),
        }
    }

    pub(super) fn calibrated(&self) -> Timing {
        Timing {
            flip_to_light: self.calibrated_flip_to_light,
            stamp: self.stamp,
            stamp_late: self.calibrated_stamp_late,
            readout: self.readout,
            hold: self.calibrated_hold,
            ..Timing::default()
        }
    }

    pub(super) fn camera(&self) -> CameraTiming {
        let (starts, period) = match self.free_running {
            Some(FreeRunning { period, .. }) => (Starts::ByItself, period),
            None if self.by_projector => (Starts::ByProjector, self.exposure + self.readout),
            // Exposure and readout of a triggered camera do not overlap.
            None => (Starts::OnTrigger, self.exposure + self.readout),
        };
        CameraTiming {
            starts,
            exposure: self.exposure,
            period,
            delivery: self.readout,
        }
    }

    pub(super) fn encoding(&self, raw: &str) -> Encoding {
        let exact = !self.faults.compressed;
        Encoding {
            name: if exact { raw } else { "COMPRESSED" }.into(),
            exact,
        }
    }
}

bounded! {
    /// Faults of a simulated head. Chances are 0…1 per event, times are upper limits; all are 0 by
    /// default.
    pub struct Faults: Default {
        /// Seed of all random faults.
        pub seed: u64,
        /// Chance that a flip comes 1…`late_refreshes` refreshes late.
        pub late_flip: f64 = 0.0..=1.0,
        /// Refreshes that a late flip misses, at most.
        pub late_refreshes: u32 = 0..=1000,
        /// Jitter of the flips' stamps, ± µs.
        pub flip_jitter_us: u64 = 0..=1_000_000,
        /// Chance that a flip is reported late, by up to `late_news_us`. Its stamp stays true.
        pub late_news: f64 = 0.0..=1.0,
        /// How late, at most, µs.
        pub late_news_us: u64 = 0..=10_000_000,
        /// Chance that the projector's driver stamps a flip one refresh late; never two in a row,
        /// which could not be distinguished from a longer flip-to-light delay.
        pub wrong_stamp: f64 = 0.0..=1.0,
        /// Chance that a frame is lost on its way.
        pub dropped: f64 = 0.0..=1.0,
        /// Chance that a frame arrives twice.
        pub duplicated: f64 = 0.0..=1.0,
        /// Chance that a frame arrives after the next one.
        pub swapped: f64 = 0.0..=1.0,
        /// Chance that a frame arrives late, by up to `late_frame_us`.
        pub late_frame: f64 = 0.0..=1.0,
        /// How late, at most, µs.
        pub late_frame_us: u64 = 0..=10_000_000,
        /// Jitter of the frames' stamps, ± µs.
        pub stamp_jitter_us: u64 = 0..=1_000_000,
        /// Chance that a trigger is lost.
        pub lost_trigger: f64 = 0.0..=1.0,
        /// Longest delay of an exposure after its trigger, or after its time by the camera's
        /// period, µs.
        pub trigger_jitter_us: u64 = 0..=1_000_000,
        /// Chance that a trigger's pulse, and so the exposure, lasts too long, by up to
        /// `long_pulse_us`: the computer was busy.
        pub long_pulse: f64 = 0.0..=1.0,
        /// How much too long, at most, µs.
        pub long_pulse_us: u64 = 0..=1_000_000,
        /// By how much the period of a camera that runs by itself is longer than stated, parts per
        /// million.
        pub drift_ppm: i32 = -100_000..=100_000,
        /// Chance that a wait lasts too long, by up to `stall_us`: the computer was busy.
        pub stall: f64 = 0.0..=1.0,
        /// How long, at most, µs.
        pub stall_us: u64 = 0..=10_000_000,
        /// The trigger's wire is open: no pulse arrives.
        pub wire_open: bool,
        /// After how many flips the projector stops flipping; 0 = never.
        pub flips_until_stuck: u64,
        /// After how many exposures the camera stops exposing; 0 = never.
        pub frames_until_stuck: u64,
        /// The camera offers only a compressed format.
        pub compressed: bool,
    }
}

/// A random event; each has random numbers of its own.
#[derive(Clone, Copy, Debug)]
pub(super) enum Mishap {
    LateFlip = 1,
    FlipJitter,
    LateNews,
    WrongStamp,
    Dropped,
    Duplicated,
    Swapped,
    LateFrame,
    StampJitter,
    LostTrigger,
    TriggerJitter,
    Stall,
    LongPulse,
}

/// Random numbers: the n-th of a kind depends only on the seed, the kind and n.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dice {
    seed: u64,
}

impl Dice {
    pub fn new(seed: u64) -> Self {
        Self { seed }
    }

    /// Two independent numbers, 0 ≤ x < 1.
    fn throw(self, kind: Mishap, n: u64) -> (f64, f64) {
        let seed = self
            .seed
            .wrapping_add((kind as u64) << 56)
            .wrapping_add(n.wrapping_mul(0x2545_f491_4f6c_dd1d));
        let mut random = SplitMix64::seed_from_u64(seed);
        let mut share = || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
        (share(), share())
    }

    /// Whether the n-th event of a kind happens.
    pub fn happens(self, kind: Mishap, n: u64, chance: f64) -> bool {
        chance > 0.0 && self.throw(kind, n).0 < chance
    }

    /// A random time up to `most` if the n-th event of a kind happens, else zero.
    pub fn up_to(self, kind: Mishap, n: u64, chance: f64, most: Duration) -> Duration {
        if chance <= 0.0 || most.is_zero() {
            return Duration::ZERO;
        }
        let (happens, share) = self.throw(kind, n);
        if happens < chance {
            most.mul_f64(share)
        } else {
            Duration::ZERO
        }
    }
}
