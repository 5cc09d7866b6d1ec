//! What moment of the exposure the camera's stamps mark: its start, its end, or the end of the readout.
//!
//! A frame can be fetched once its exposure and its readout have ended, so the time from its stamp until then tells which: exposure
//! and readout, the readout, or nothing. Where the camera is triggered, its triggers must confirm it.

use super::PATIENCE;
use hal::camera::{CameraTiming, Starts};
use hal::error::Error;
use hal::head::{DynHead, Showing, Stamp, TOLERANCE, Timing};
use hal::projector::Raster;
use std::time::Duration;

/// Refreshes over which frames are taken.
const REFRESHES: u32 = 24;

/// What the stamps mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamps {
    /// The moment.
    pub stamp: Stamp,
    /// From the end of an exposure to the end of its readout.
    pub readout: Duration,
    /// How far an exposure started from its trigger, at most; zero for a camera that runs by itself.
    pub off: Duration,
}

impl Stamps {
    /// Takes frames of whatever stands there. What the head is told of its time is not used, and is the same afterwards.
    ///
    /// # Errors
    /// Of a device; `Protocol` if no frame comes or the triggers contradict every meaning.
    pub fn measure(head: &mut DynHead) -> Result<Self, Error> {
        let (columns, rows) = head.projector_size();
        head.load(vec![Raster::uniform(columns, rows, u8::MAX)?])?;
        let told = head.timing();
        // So that the start of an exposure is its stamp.
        head.set_timing(Timing {
            stamp: Stamp::ExposureStart,
            ..told
        });
        let showing = Showing {
            index: 0,
            refreshes: REFRESHES,
            settle: 0,
        };
        let seen = head.watch(&[showing], PATIENCE, &mut |_| ());
        head.set_timing(told);
        let seen = seen?;
        let camera = head.camera_timing();
        let waits = seen.frames.iter();
        let wait = waits.map(|frame| frame.arrived.since(frame.start)).min();
        let wait = wait.ok_or_else(|| {
            Error::protocol(
                "looking at the camera's stamps when no frame comes",
                "check the wire of the trigger; `fringed doctor` says more",
            )
        })?;
        let (stamp, before) = meaning(&camera, wait);
        let mut stamps = Self {
            stamp,
            readout: camera.delivery,
            off: Duration::ZERO,
        };
        if camera.starts == Starts::OnTrigger {
            for frame in &seen.frames {
                let start = frame.start - before;
                let off = |at: &hal::units::Timestamp| Duration::from_nanos(at.0.abs_diff(start.0));
                let off = seen.triggers.iter().map(off).min().unwrap_or(Duration::MAX);
                stamps.off = stamps.off.max(off);
            }
            if stamps.off > TOLERANCE {
                return Err(Error::protocol(
                    format!(
                        "a camera whose stamps are off its triggers by {:.3} ms, be they starts or ends of exposures,",
                        stamps.off.as_secs_f64() * 1e3
                    ),
                    "check that the camera is in trigger mode, and that its exposure is what it says",
                ));
            }
        }
        Ok(stamps)
    }
}

/// The meaning that explains the time from stamp to frame best, and how long before its stamp an exposure starts then.
fn meaning(camera: &CameraTiming, wait: Duration) -> (Stamp, Duration) {
    let (exposure, readout) = (camera.exposure, camera.delivery);
    let all = [
        (Stamp::ExposureStart, Duration::ZERO),
        (Stamp::ExposureEnd, exposure),
        (Stamp::ReadoutEnd, exposure + readout),
    ];
    // The first of equals: a readout in no time ends with the exposure.
    let off = |before: Duration| wait.abs_diff((exposure + readout).saturating_sub(before));
    let best = all.into_iter().min_by_key(|(_, before)| off(*before));
    best.unwrap_or((Stamp::ExposureStart, Duration::ZERO))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wait_from_stamp_to_frame_tells_what_the_stamp_marks() {
        let ms = Duration::from_millis;
        let camera = |exposure, delivery| CameraTiming {
            starts: Starts::ByItself,
            exposure: ms(exposure),
            period: ms(40),
            delivery: ms(delivery),
        };
        let slow = camera(33, 16);
        for (wait, stamp, before) in [
            (49, Stamp::ExposureStart, 0),
            (53, Stamp::ExposureStart, 0),
            (16, Stamp::ExposureEnd, 33),
            (12, Stamp::ExposureEnd, 33),
            (0, Stamp::ReadoutEnd, 49),
            (3, Stamp::ReadoutEnd, 49),
        ] {
            assert_eq!(meaning(&slow, ms(wait)), (stamp, ms(before)), "{wait}");
        }
        assert_eq!(meaning(&camera(33, 0), ms(0)).0, Stamp::ExposureEnd);
    }
}
