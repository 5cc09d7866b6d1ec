//! A camera through libcamera, such as the Raspberry Pi's: chosen by its id, configured before it
//! starts, each frame verified.
//!
//! One thread owns all objects of the library ([`LibCamera::open`] starts it, dropping the camera
//! ends it); frames arrive from it through a channel. It copies the samples of each frame out of
//! the camera's buffer, so that neither a kept frame nor slow memory can delay the camera or the
//! next trigger.
//!
//! The choice of the format does not depend on the library, nor does what is here: the settings, the
//! check of a request's metadata (exposure, gain and frame period must be as set), and the conversion
//! of its stamp to the head's clock.

#[cfg(feature = "libcamera")]
mod device;
mod layout;
#[cfg(feature = "libcamera")]
mod open;
#[cfg(feature = "libcamera")]
mod owner;

use std::time::Duration;

use crate::camera::Starts;
use crate::error::Error;
use crate::setup::CameraSetup;
use crate::units::Timestamp;
#[cfg(feature = "libcamera")]
pub use device::{LibCamera, Listed};
pub use layout::Reading;

/// Buffers to ask for: one that is copied, one being written, one queued in the driver, and five
/// that wait to be fetched when the computer is busy.
const BUFFERS: u32 = 8;
/// Sensors quantise their gain; the coarsest common increment is 0.3 dB, 3.5 %, and drivers round
/// to the next value.
const GAIN_INCREMENT: f32 = 0.035;
/// Metadata has whole microseconds.
const MICROSECOND: Duration = Duration::from_micros(1);
/// No frame can be older than this when it is fetched: libcamera would have given the camera up
/// before.
const OLDEST: Duration = Duration::from_secs(60);

/// Which camera, and how it takes its frames.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The library's id of the camera, which names its connection. Never an index: the order of
    /// cameras changes with the library's version. None selects the only camera.
    pub id: Option<String>,
    /// Which samples of its images are used.
    pub reading: Reading,
    /// Columns and rows; none selects the largest size.
    pub size: Option<(u32, u32)>,
    /// Who starts an exposure. The sensor's trigger mode is set in its driver, not here.
    pub starts: Starts,
    /// Exposure, gain and frame period.
    pub exposing: Exposing,
    /// Whether `exposing` is set, and verified in each frame's metadata. False only for trials with
    /// a camera that has no such controls.
    pub controlled: bool,
    /// From the end of an exposure until its frame can be fetched, without any delay.
    pub delivery: Duration,
    /// How long a triggered camera may stay on without an exposure: less than the time after which
    /// the library gives it up.
    pub stays_on: Duration,
    /// Buffers to ask for. A camera may grant fewer.
    pub buffers: u32,
}

impl Settings {
    /// Settings as configured, with each frame verified.
    #[must_use]
    pub fn new(setup: &CameraSetup, starts: Starts) -> Self {
        let microseconds = |us: u32| Duration::from_micros(us.into());
        Self {
            id: setup.id.clone(),
            reading: if setup.luma {
                Reading::Luma
            } else {
                Reading::Raw
            },
            size: setup.width.zip(setup.height),
            starts,
            exposing: Exposing {
                exposure: microseconds(setup.exposure_us),
                gain: setup.gain as f32,
                period: microseconds(setup.period_us),
            },
            controlled: true,
            delivery: microseconds(setup.delivery_us),
            stays_on: Duration::ZERO,
            buffers: BUFFERS,
        }
    }
}

/// The exposure settings of a camera. They are set before it starts and do not change until it
/// stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposing {
    /// How long a frame is exposed.
    pub exposure: Duration,
    /// Gain of the sensor's amplifier, 1 without amplification.
    pub gain: f32,
    /// From the start of one exposure to the start of the next.
    pub period: Duration,
}

/// The metadata of a request, in libcamera's units; `None` where a value is missing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Reported {
    /// µs.
    pub exposure: Option<i32>,
    pub gain: Option<f32>,
    /// µs.
    pub period: Option<i64>,
}

impl Exposing {
    /// Checks that the sensor of the camera `id` has the gain, from the `least` to the `most` that
    /// it has.
    ///
    /// # Errors
    /// `Unsupported`, naming the limits.
    pub(crate) fn check_gain(&self, id: &str, least: f32, most: f32) -> Result<(), Error> {
        let increment = 1.0 + GAIN_INCREMENT;
        if (least / increment..=most * increment).contains(&self.gain) {
            return Ok(());
        }
        Err(Error::unsupported(
            format!("a gain of {} of the camera `{id}`", self.gain),
            format!("set a gain (head.camera.gain) of {least} to {most}, which its sensor has"),
        ))
    }

    /// Checks that a frame of `rows` rows was taken as set.
    ///
    /// A sensor's exposure and period are whole numbers of lines, and a line lasts at most the
    /// period divided by the number of rows (a frame also has blank lines), so each may differ from
    /// its setting by that time.
    ///
    /// # Errors
    /// `Protocol` if a value in the metadata differs or is missing.
    pub(crate) fn verify(&self, rows: u32, reported: &Reported) -> Result<(), Error> {
        let tolerance = self.period / rows.max(1) + MICROSECOND;
        let time = |us: i64| Duration::from_micros(u64::try_from(us).unwrap_or(0));
        let exposure = reported.exposure.map(|us| time(us.into()));
        let period = reported.period.map(time);
        let near = |set: Duration, found: Option<Duration>| {
            found.is_some_and(|found| set.abs_diff(found) <= tolerance)
        };
        let gain_off = reported.gain.map(|gain| (gain / self.gain - 1.0).abs());
        let wrong = |what: &str, set: String, found: Option<String>| {
            let found = found.map_or("says nothing of it".into(), |found| format!("says {found}"));
            Err(Error::protocol(
                format!("a frame whose {what} was set to {set} and whose metadata {found}"),
                "set head.camera.exposure_us, gain and period_us to what the sensor can do",
            ))
        };
        if !near(self.exposure, exposure) {
            let found = exposure.map(|found| format!("{found:?}"));
            return wrong("exposure", format!("{:?}", self.exposure), found);
        }
        if !near(self.period, period) {
            let found = period.map(|found| format!("{found:?}"));
            return wrong("frame period", format!("{:?}", self.period), found);
        }
        // NaN is refused, too.
        if !gain_off.is_some_and(|off| off <= GAIN_INCREMENT) {
            let found = reported.gain.map(|found| found.to_string());
            return wrong("gain", self.gain.to_string(), found);
        }
        Ok(())
    }
}

/// The time on `CLOCK_MONOTONIC`, and how far `CLOCK_BOOTTIME` is ahead of it: the time for which
/// the computer was suspended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Clocks {
    pub monotonic: Timestamp,
    pub suspended: Duration,
}

/// Times that were read one after the other.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ClockReading {
    /// On `CLOCK_MONOTONIC`.
    pub before: Timestamp,
    /// On `CLOCK_BOOTTIME`.
    pub boot: Timestamp,
    /// On `CLOCK_MONOTONIC` again.
    pub after: Timestamp,
}

impl Clocks {
    /// The clocks from several readings. The reading thread may be interrupted in between, so
    /// `suspended` is from the reading with the shortest time between its two monotonic times, and
    /// too long by at most that time. `monotonic` is the very last time that was read.
    pub fn of(readings: &[ClockReading]) -> Self {
        let spread = |reading: &&ClockReading| reading.after.since(reading.before);
        let closest = readings.iter().min_by_key(spread);
        let suspended =
            closest.map_or(Duration::ZERO, |reading| reading.boot.since(reading.before));
        let latest = readings
            .last()
            .map_or(Timestamp(0), |reading| reading.after);
        Self {
            monotonic: latest,
            suspended,
        }
    }
}

/// Converts a frame's stamp in ns to the head's clock. Libcamera documents `CLOCK_BOOTTIME`; most
/// drivers stamp with `CLOCK_MONOTONIC`.
///
/// A frame is stamped before it is fetched, so a stamp later than the monotonic clock must be from
/// the boot-time clock. A stamp of the boot-time clock is later than that only if the computer was
/// suspended for longer than the frame is old; after a shorter suspension it would be taken as
/// monotonic, and be late by the time of suspension. `clocks` is read when the frame is fetched.
///
/// # Errors
/// `Protocol` if the stamp fits neither.
pub(crate) fn on_the_heads_clock(stamp: u64, clocks: Clocks) -> Result<Timestamp, Error> {
    let Clocks {
        monotonic,
        suspended,
    } = clocks;
    let stamp = Timestamp(stamp);
    [stamp, stamp - suspended]
        .into_iter()
        .find(|stamp| *stamp <= monotonic && monotonic.since(*stamp) <= OLDEST)
        .ok_or_else(|| {
            Error::protocol(
                format!("a frame stamped {stamp}, fetched at {monotonic} of CLOCK_MONOTONIC and {} of CLOCK_BOOTTIME", monotonic + suspended),
                "the camera's driver stamps with another clock: use a camera whose driver stamps with one of these",
            )
        })
}

/// The count of a camera that begins at 0 with each start, continued over all starts.
#[derive(Debug, Default)]
pub(crate) struct ContinuedCount {
    base: u64,
    next: u64,
}

impl ContinuedCount {
    /// The camera is started again.
    pub fn restart(&mut self) {
        self.base = self.next;
    }

    /// The continued count of the frame with this count since the camera's start.
    pub fn of(&mut self, since_start: u64) -> u64 {
        let count = self.base + since_start;
        self.next = self.next.max(count + 1);
        count
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::ErrorKind;

    /// The reference head: exposed for one refresh of the projector at 60 Hz, one frame in two
    /// refreshes.
    const SET: Exposing = Exposing {
        exposure: Duration::from_micros(16_667),
        gain: 2.0,
        period: Duration::from_micros(33_333),
    };
    const ROWS: u32 = 1088;

    fn reported(exposure: i32, gain: f32, period: i64) -> Reported {
        Reported {
            exposure: Some(exposure),
            gain: Some(gain),
            period: Some(period),
        }
    }

    #[test]
    fn a_gain_that_the_sensor_does_not_have_is_refused_with_its_limits() {
        let of = |gain| Exposing { gain, ..SET };
        for gain in [0.99, 1.0, 15.9, 16.3] {
            of(gain).check_gain("imx", 1.0, 16.0).unwrap();
        }
        for gain in [0.0, 0.5, 17.0, f32::NAN] {
            let words = of(gain).check_gain("imx", 1.0, 16.0).unwrap_err();
            assert!(words.to_string().contains("1 to 16"), "{words}");
        }
    }

    #[test]
    fn a_frame_counts_as_taken_as_set_within_a_line_and_an_increment_of_gain() {
        for (exposure, gain, period) in [
            (16_667, 2.0, 33_333),
            (16_652, 1.98, 33_318), // A line of the IMX296 less: 14.8 µs; 0.1 dB.
            (16_682, 2.06, 33_348),
        ] {
            SET.verify(ROWS, &reported(exposure, gain, period)).unwrap();
        }
    }

    #[test]
    fn a_frame_taken_otherwise_is_refused_with_both_values() {
        for (word, found, reported) in [
            ("exposure", "16.6ms", reported(16_600, 2.0, 33_333)),
            ("exposure", "5ms", reported(5_000, 2.0, 33_333)),
            ("gain", "2.1", reported(16_667, 2.1, 33_333)),
            ("gain", "NaN", reported(16_667, f32::NAN, 33_333)),
            ("frame period", "16.667ms", reported(16_667, 2.0, 16_667)),
            ("exposure", "0ns", reported(-5, 2.0, 33_333)),
        ] {
            let error = SET.verify(ROWS, &reported).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Protocol);
            let words = error.to_string();
            assert!(words.contains(word) && words.contains(found), "{words}");
        }
    }

    #[test]
    fn metadata_that_says_nothing_proves_nothing() {
        let all = reported(16_667, 2.0, 33_333);
        for silent in [
            Reported {
                exposure: None,
                ..all
            },
            Reported { gain: None, ..all },
            Reported {
                period: None,
                ..all
            },
        ] {
            let error = SET.verify(ROWS, &silent).unwrap_err();
            assert!(error.to_string().contains("says nothing"), "{error}");
        }
    }

    #[test]
    fn a_stamp_is_understood_on_either_clock_and_refused_on_any_other() {
        let s = |seconds: u64| Timestamp(seconds * 1_000_000_000);
        let monotonic = s(100_000);
        let suspended_for = |seconds| Clocks {
            monotonic,
            suspended: Duration::from_secs(seconds),
        };
        for clocks in [3600, 0, 3].map(suspended_for) {
            let exposed = monotonic - Duration::from_millis(40);
            for stamp in [exposed, exposed + clocks.suspended] {
                assert_eq!(on_the_heads_clock(stamp.0, clocks).unwrap(), exposed);
            }
        }
        let clocks = suspended_for(3600);
        // A device's own clock, the time of day, nothing, and the future.
        for stamp in [s(500), s(1_700_000_000), s(0), s(103_601)] {
            let error = on_the_heads_clock(stamp.0, clocks).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Protocol);
        }
    }

    #[test]
    fn the_difference_of_two_clocks_is_found_although_readings_are_interrupted() {
        let reading = |before, boot, after| ClockReading {
            before: Timestamp(before),
            boot: Timestamp(boot),
            after: Timestamp(after),
        };
        // Suspended for 5000; interrupted for 900 before and after the other clock was read, and
        // not at all.
        let readings = [
            reading(1000, 6905, 1910),
            reading(2000, 7005, 2910),
            reading(3000, 8005, 3010),
        ];
        let clocks = Clocks::of(&readings);
        assert_eq!(clocks.monotonic, Timestamp(3010));
        assert_eq!(clocks.suspended, Duration::from_nanos(5005));
        assert_eq!(Clocks::of(&readings[2..]), clocks);
    }

    #[test]
    fn counts_go_on_over_a_restart_and_keep_their_gaps() {
        let mut count = ContinuedCount::default();
        let first: Vec<u64> = [0, 1, 4, 3].map(|n| count.of(n)).into();
        count.restart();
        let second: Vec<u64> = [2, 3].map(|n| count.of(n)).into();
        count.restart();
        count.restart();
        assert_eq!((first, second), (vec![0, 1, 4, 3], vec![7, 8]));
        assert_eq!(count.of(0), 9);
    }
}
