//! The times of a camera that data sheets and drivers do not state reliably: which moment its time
//! stamps mark, and how many refreshes it needs for each pattern.
//!
//! The stamps mark the start of the exposure, its end, or the end of the readout. For a triggered
//! camera it follows from the time between trigger and stamp. Drivers stamp in an interrupt, so
//! stamps are later than the moment that they mark by a constant time and some jitter: the median
//! of that time is measured, too, and subtracted from then on. For a free-running camera only the
//! time from the stamp to the delivery of its frame is known: exposure and readout, the readout, or
//! zero. The length of a readout is then taken as configured, and a time that fits none of the
//! three is an error.
//!
//! A camera that is still being read out loses a trigger without a sign, and its data sheet leaves
//! out its own delays. So triggers are fired at the spacing of a sequence and their frames are
//! counted; the pace is the fewest refreshes at which no trigger is lost. They are fired a little
//! closer than the refreshes, because in a sequence a trigger may come late and the next one on
//! time.

use super::{PATIENCE, load_black_and_white, refreshes};
use hal::camera::{CameraTiming, Starts};
use hal::error::Error;
use hal::head::{Head, Showing, Stamp, TOLERANCE, Timing, WatchedFrame};
use hal::projector::Raster;
use hal::units::Timestamp;
use std::collections::BTreeSet;
use std::time::Duration;

/// Showings over which frames are taken.
const SHOWINGS: usize = 6;
/// How late stamps may be; a longer time after the exposure is a readout.
pub const MOST_LATE: Duration = Duration::from_micros(500);
/// Triggers that are fired at each spacing. If one in twenty is lost, that remains unnoticed once
/// in twenty measurements (0.95⁶⁰ = 0.046).
const TRIGGERS: u32 = 60;
/// By how much triggers are fired closer than the refreshes: as late as one may be in a plan of the
/// sequencer.
const CLOSER: Duration = Duration::from_nanos(TOLERANCE.as_nanos() as u64 / 2);
/// Spacings that are tried beyond the shortest that the camera states, refreshes.
const MORE: u32 = 3;

/// What the time stamps mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamps {
    /// The moment.
    pub stamp: Stamp,
    /// How much later than that moment the stamps are, the median. Unknown of a camera that runs by
    /// itself, where the flip-to-light delay contains it.
    pub late: Option<Duration>,
    /// From the end of an exposure to the end of its readout, or to the delivery of its frame.
    pub readout: Duration,
}

impl Stamps {
    /// A head's timing with these stamps.
    #[must_use]
    pub fn timing(&self, before: Timing) -> Timing {
        Timing {
            stamp: self.stamp,
            stamp_late: self.late.unwrap_or_default(),
            readout: self.readout,
            ..before
        }
    }

    /// Takes frames of any scene. The head's timing is not used, and is as before afterwards.
    ///
    /// # Errors
    /// The error of a device; `Protocol` if no frame comes or no meaning explains the stamps.
    pub fn measure(head: &mut Head) -> Result<Self, Error> {
        let (columns, rows) = head.projector_size();
        head.load(vec![Raster::uniform(columns, rows, u8::MAX)?])?;
        let before = head.timing();
        // With this, `start` of a frame is its stamp.
        head.set_timing(Timing {
            stamp: Stamp::ExposureStart,
            stamp_late: Duration::ZERO,
            ..before
        });
        let camera = head.camera_timing();
        let seen = head.watch(&showings(head), PATIENCE, &mut |_| ());
        head.set_timing(before);
        let seen = seen?;
        if seen.frames.is_empty() {
            return Err(Error::protocol(
                "looking at the camera's stamps when no frame comes",
                "check the wire of the trigger; `fringed doctor` says more",
            ));
        }
        match camera.starts {
            Starts::OnTrigger => by_triggers(&camera, &seen.triggers, &seen.frames),
            Starts::ByProjector | Starts::ByItself => by_waiting(&camera, &seen.frames),
        }
    }
}

/// Showings with one or two triggers each, and then a pause longer than the camera's period, which
/// a free-running camera does not keep.
fn showings(head: &Head) -> [Showing; SHOWINGS] {
    let whole = refreshes(head, head.camera_timing().period).clamp(1, 1000);
    [Showing {
        index: 0,
        refreshes: 2 * whole + 1,
        settle: whole + 1,
    }; SHOWINGS]
}

/// What the stamps mark, by the times between triggers and stamps.
fn by_triggers(
    camera: &CameraTiming,
    triggers: &[Timestamp],
    frames: &[WatchedFrame<()>],
) -> Result<Stamps, Error> {
    let tolerance = TOLERANCE.min(camera.exposure / 4);
    // The latest trigger before the stamp whose exposure had ended when the frame was delivered.
    let trigger_of = |frame: &WatchedFrame<()>| {
        let own = triggers.iter().rev().find(|at| {
            **at <= frame.start + tolerance && **at + camera.exposure <= frame.arrived + tolerance
        });
        own.map(|at| i128::from(frame.start.0) - i128::from(at.0))
    };
    let wrong = |found: String| {
        Err(Error::protocol(
            found,
            "check that the camera is in trigger mode, and that its exposure is what it says",
        ))
    };
    let Some(mut after) = frames.iter().map(trigger_of).collect::<Option<Vec<_>>>() else {
        return wrong("a camera with frames that no trigger explains".into());
    };
    after.sort_unstable();
    let middle = after[after.len() / 2];
    let off = (middle - after[0]).max(after[after.len() - 1] - middle);
    let ms = |nanoseconds: i128| nanoseconds as f64 * 1e-6;
    let (slack, exposure) = (nanoseconds(tolerance), nanoseconds(camera.exposure));
    if off > slack {
        return wrong(format!(
            "a camera whose stamps are {:.3} to {:.3} ms off its triggers",
            ms(after[0]),
            ms(after[after.len() - 1])
        ));
    }
    let fetched = |stamp: Stamp, late: i128, before: Duration| {
        let waits = frames.iter().map(|frame| frame.arrived.since(frame.start));
        // No stamp is early: a negative time is that of reading the clock after the trigger.
        let late = Duration::from_nanos(u64::try_from(late).unwrap_or(0));
        let waited = waits.min().unwrap_or_default() + late;
        Ok(Stamps {
            stamp,
            late: Some(late),
            readout: waited.saturating_sub(before),
        })
    };
    let late = -slack..=nanoseconds(MOST_LATE.min(camera.exposure / 4));
    if late.contains(&middle) {
        return fetched(Stamp::ExposureStart, middle, camera.exposure);
    }
    if late.contains(&(middle - exposure)) {
        return fetched(Stamp::ExposureEnd, middle - exposure, Duration::ZERO);
    }
    match u64::try_from(middle - exposure) {
        Ok(readout) if readout <= camera.delivery.as_nanos() as u64 + slack as u64 => Ok(Stamps {
            stamp: Stamp::ReadoutEnd,
            // The readout contains how late the stamps are.
            late: Some(Duration::ZERO),
            readout: Duration::from_nanos(readout),
        }),
        _ => wrong(format!(
            "a camera that exposes for {:.3} ms and stamps {:.3} ms after its triggers",
            ms(exposure),
            ms(middle)
        )),
    }
}

fn nanoseconds(time: Duration) -> i128 {
    i128::try_from(time.as_nanos()).unwrap_or(i128::MAX)
}

/// What the stamps mark, by the time between the stamp of a frame and its delivery.
fn by_waiting(camera: &CameraTiming, frames: &[WatchedFrame<()>]) -> Result<Stamps, Error> {
    let (exposure, delivery) = (camera.exposure, camera.delivery);
    let waits = frames.iter().map(|frame| frame.arrived.since(frame.start));
    let wait = waits.min().unwrap_or_default();
    // Of meanings that fit equally well the first is taken: with a readout of zero, the stamp marks
    // the end of the exposure.
    let all = [
        (Stamp::ExposureStart, exposure + delivery, exposure),
        (Stamp::ExposureEnd, delivery, Duration::ZERO),
        (Stamp::ReadoutEnd, Duration::ZERO, Duration::ZERO),
    ];
    let best = all
        .into_iter()
        .min_by_key(|(_, expected, _)| wait.abs_diff(*expected));
    match best {
        Some((stamp, expected, before)) if wait.abs_diff(expected) <= exposure / 3 => Ok(Stamps {
            stamp,
            late: None,
            readout: match stamp {
                Stamp::ReadoutEnd => delivery,
                _ => wait.saturating_sub(before),
            },
        }),
        _ => Err(Error::protocol(
            format!(
                "a free-running camera whose frames come {:.1} ms after their stamps, which fits neither start nor end of an exposure of \
                 {:.1} ms nor the end of a readout of {:.1} ms,",
                wait.as_secs_f64() * 1e3,
                exposure.as_secs_f64() * 1e3,
                delivery.as_secs_f64() * 1e3
            ),
            "set head.camera.delivery_us to the time of its readout (where stamps mark the end of the exposure, as on a Raspberry Pi, to the first number)",
        )),
    }
}

/// What became of triggers that were so many refreshes apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Spaced {
    /// Refreshes from trigger to trigger.
    pub refreshes: u32,
    /// Triggers.
    pub triggers: usize,
    /// Frames.
    pub frames: usize,
}

impl Spaced {
    /// Whether each trigger gave a frame.
    pub fn none_lost(&self) -> bool {
        self.frames >= self.triggers
    }

    /// What was found, for people.
    pub fn words(&self) -> String {
        let Self {
            refreshes,
            triggers,
            frames,
        } = self;
        format!("{frames} frames for {triggers} triggers {refreshes} refreshes apart")
    }
}

/// Tries spacings from the shortest that the camera states on, until none of the triggers is lost.
/// The last one tried is the last of the result, which is empty for a camera that runs by itself. A
/// camera that the projector triggers takes one refresh in so many by itself.
///
/// # Errors
/// The error of a device.
pub fn pace(head: &mut Head) -> Result<Vec<Spaced>, Error> {
    let (camera, refresh) = (head.camera_timing(), head.refresh());
    let mut tried = Vec::new();
    if camera.starts == Starts::ByItself {
        return Ok(tried);
    }
    load_black_and_white(head)?;
    if camera.starts == Starts::ByProjector {
        return by_projector(head);
    }
    let least = refreshes(head, camera.period).clamp(1, 1000);
    for refreshes in least..=least + MORE {
        let showing = Showing {
            index: 0,
            refreshes: refreshes * TRIGGERS,
            settle: 0,
        };
        let spacing = (refresh * refreshes).saturating_sub(CLOSER);
        let seen = head.watch_spaced(&[showing], spacing, PATIENCE, &mut |_| ())?;
        // A frame that arrives twice is one frame.
        let frames: BTreeSet<u64> = seen.frames.iter().map(|frame| frame.count).collect();
        tried.push(Spaced {
            refreshes,
            triggers: seen.triggers.len(),
            frames: frames.len(),
        });
        if tried.last().is_some_and(Spaced::none_lost) {
            break;
        }
    }
    Ok(tried)
}

/// The largest distance of two frames of a camera that the projector triggers.
fn by_projector(head: &mut Head) -> Result<Vec<Spaced>, Error> {
    let refresh = head.refresh();
    let showing = Showing {
        index: 0,
        refreshes: MORE * TRIGGERS,
        settle: 0,
    };
    let frames = head.watch(&[showing], PATIENCE, &mut |_| ())?.frames;
    let apart = frames.windows(2).filter_map(|pair| {
        let [before, after] = pair else { return None };
        // A frame that was lost on its way says nothing of the camera.
        let next = after.count == before.count + 1;
        next.then(|| after.start.since(before.start).as_secs_f64() / refresh.as_secs_f64())
    });
    let largest = apart.fold(0.0, f64::max).round() as u32;
    Ok((largest > 0)
        .then_some(Spaced {
            refreshes: largest,
            triggers: frames.len(),
            frames: frames.len(),
        })
        .into_iter()
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    fn camera(exposure: u64, delivery: u64) -> CameraTiming {
        CameraTiming {
            starts: Starts::ByItself,
            exposure: ms(exposure),
            period: ms(exposure + delivery),
            delivery: ms(delivery),
        }
    }

    /// Frames stamped and delivered at these times, ms.
    fn frames(times: &[(u64, u64)]) -> Vec<WatchedFrame<()>> {
        let frame = |(start, arrived): &(u64, u64)| WatchedFrame {
            start: Timestamp(0) + ms(*start),
            arrived: Timestamp(0) + ms(*arrived),
            count: 0,
            measured: (),
        };
        times.iter().map(frame).collect()
    }

    fn at(times: &[u64]) -> Vec<Timestamp> {
        times.iter().map(|at| Timestamp(0) + ms(*at)).collect()
    }

    #[test]
    fn the_wait_from_stamp_to_frame_tells_what_the_stamp_marks() {
        for (wait, stamp) in [
            (49, Stamp::ExposureStart),
            (53, Stamp::ExposureStart),
            (16, Stamp::ExposureEnd),
            (12, Stamp::ExposureEnd),
            (0, Stamp::ReadoutEnd),
            (3, Stamp::ReadoutEnd),
        ] {
            let found = by_waiting(&camera(33, 16), &frames(&[(100, 100 + wait)]));
            assert_eq!(found.unwrap().stamp, stamp, "{wait}");
        }
        let found = by_waiting(&camera(33, 0), &frames(&[(100, 100)])).unwrap();
        assert_eq!(found.stamp, Stamp::ExposureEnd);
    }

    #[test]
    fn a_wait_that_nothing_explains_is_told_and_not_guessed_at() {
        // A frame takes 20 ms where a readout of 50 ms is configured.
        let error = by_waiting(&camera(17, 50), &frames(&[(100, 120), (133, 154)])).unwrap_err();
        let words = error.to_string();
        assert!(
            words.contains("20.0 ms") && words.contains("delivery_us"),
            "{words}"
        );
    }

    #[test]
    fn triggers_tell_what_the_stamps_mark_however_soon_the_frames_are_there() {
        // Exposed for 17 ms and read out for 16, with a configured delivery of 50 ms.
        let (camera, triggers) = (camera(17, 50), at(&[100, 133, 183, 216]));
        for (mark, readout, stamp) in [
            (0, 18, Stamp::ExposureStart),
            (17, 18, Stamp::ExposureEnd),
            (33, 16, Stamp::ReadoutEnd),
            (18, 1, Stamp::ReadoutEnd),
        ] {
            // The second was lost.
            let seen: Vec<_> = [100, 183, 216].map(|at| (at + mark, at + 35)).into();
            let found = by_triggers(&camera, &triggers, &frames(&seen)).unwrap();
            assert_eq!(
                found,
                Stamps {
                    stamp,
                    late: Some(Duration::ZERO),
                    readout: ms(readout)
                },
                "{mark} ms after the trigger"
            );
        }
    }

    #[test]
    fn stamps_that_no_trigger_explains_are_refused() {
        let (camera, triggers) = (camera(17, 50), at(&[100, 133, 183, 216]));
        for seen in [
            // By itself, every 33 ms.
            &[(117, 135), (150, 168), (183, 201), (216, 234)][..],
            // In the middle of the exposure.
            &[(108, 135), (141, 168)],
            // Before any trigger.
            &[(50, 90)],
            // Too long after any trigger.
            &[(220, 240), (303, 310)],
        ] {
            let error = by_triggers(&camera, &triggers, &frames(seen)).unwrap_err();
            assert!(error.to_string().contains("trigger mode"), "{error}");
        }
    }
}
