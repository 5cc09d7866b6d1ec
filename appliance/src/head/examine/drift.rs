//! Measures whether camera and projector still stand to each other as their models say: any part
//! under vertical and horizontal fringes.

use crate::head::calibration::Calibration;
use crate::head::scan::{self, Scan};
use crate::head::seam;
use algo::pattern::{PhaseRange, Sequence, Shot};
use algo::pipeline::{Epipolar, PhaseMap};
use hal::error::Error;
use hal::frame::Frame;
use hal::head::Head;
use std::time::Duration;

/// Levels of each sequence.
const LEVELS: usize = 3;
/// Shifts of each level.
const SHIFTS: usize = 4;
/// Pitch of both patterns, projector pixels.
const PITCH: f64 = 16.0;
/// Beyond this RMS distance of projector points from their epipolar lines, projector pixels, the
/// models are not those of the head any more: a real board in poses that were not used for the
/// calibration left 0.08 to 0.43, a camera that was turned by 0.05° leaves 1.
pub const MOST_DRIFT_PX: f64 = 0.5;
/// What to do about a head beyond that limit.
pub const DRIFT_REMEDY: &str = "camera or projector was knocked or refocused since the calibration: calibrate the geometry anew";

/// Frames of a part under vertical and then under horizontal fringes.
pub struct CrossedFringes([(PhaseRange, Vec<Shot>, Vec<Frame>); 2]);

impl CrossedFringes {
    /// Takes the frames. The head's timing must be calibrated. `progress` gets the share that is
    /// taken.
    ///
    /// # Errors
    /// The error of a device, or if the projector is too small for the fringes.
    pub fn take(
        head: &mut Head,
        calibration: &Calibration,
        timeout: Duration,
        progress: &dyn Fn(f64),
    ) -> Result<Self, Error> {
        let mut take = |vertical: bool| {
            let function = seam::fringes(vertical, head.projector_size(), PITCH)?;
            let shots = Sequence::geometric(function.range(), LEVELS, SHIFTS);
            let before = if vertical { 0.0 } else { 0.5 };
            let said = |share: f64| progress(before + share / 2.0);
            let taken = scan::take(head, calibration, &function, &shots, timeout, &said)?;
            Ok::<_, Error>((function.range(), shots, taken))
        };
        Ok(Self([take(true)?, take(false)?]))
    }

    /// Compares what the frames show with the models of the head; `None` if too little of the frame
    /// shows fringes.
    ///
    /// # Errors
    /// If the projector is too small for the fringes.
    pub fn compare(&self, calibration: &Calibration) -> Result<Option<Epipolar>, Error> {
        let phases = |at: usize| -> Result<PhaseMap, Error> {
            let (range, shots, taken) = &self.0[at];
            let map = Scan::new(*range, shots, taken).and_then(|scan| scan.phases(None));
            map.map_err(|error| seam::small(PITCH, &error))
        };
        let (camera, projector) = (&calibration.camera, &calibration.projector);
        let (vertical, horizontal) = (phases(0)?, phases(1)?);
        let maps = [&vertical, &horizontal];
        Ok(Epipolar::of(camera, projector, maps, [PITCH; 2]))
    }
}
