//! What is measured with vertical and horizontal fringes: the reference phase maps of a flat plate in
//! the plane z = 0, and whether camera and projector still stand to each other as their models say.

use crate::error::{Exit, Failure, Result};
use crate::head::calibration::{Calibration, HeightsBy};
use crate::head::scan::{self, Scan};
use crate::head::seam;
use algo::geometry::Triangulator;
use algo::pattern::{PhaseRange, Sequence, Shot};
use algo::pipeline::{Epipolar, PhaseMap, Plate};
use hal::error::Error;
use hal::frame::Frame;
use hal::head::Head;
use std::time::Duration;

/// Levels of the sequence.
const LEVELS: usize = 3;
/// Shifts of each level but the finest.
const SHIFTS: usize = 4;
/// Shifts of the finest level: many, so that noise and harmonics are small.
const FINEST_SHIFTS: usize = 16;
/// Pitch of both patterns, projector pixels.
pub const PLATE_PITCH: f64 = 20.0;
/// Pitch of both patterns, projector pixels.
const DRIFT_PITCH: f64 = 16.0;
/// Beyond this RMS distance of projector points from their epipolar lines, projector pixels, the
/// models are not those of the head any more: a real board in poses that were not used for the
/// calibration left 0.08 to 0.43, a camera that was turned by 0.05° leaves 1.
pub const MOST_DRIFT_PX: f64 = 0.5;
/// What to do about a head beyond that limit.
pub const DRIFT_REMEDY: &str = "camera or projector was knocked or refocused since the calibration: calibrate the geometry anew";

fn unfit(error: impl std::fmt::Display) -> Failure {
    Failure::because(Exit::Unavailable, "measure the reference plane", error)
}

/// A reference phase map, and how the models predict it.
pub struct ReferencePlane {
    /// What was measured.
    pub plate: Plate,
    predicted: Triangulator,
}

impl ReferencePlane {
    /// Φ_R of the whole frame, row-major, turns; NaN where a pixel does not look at the plane.
    pub fn map(&self) -> Vec<f64> {
        let camera = self.predicted.camera();
        let (width, height) = (camera.width(), camera.height());
        let places = (0..height).flat_map(|v| (0..width).map(move |u| (u as f64, v as f64)));
        let turns = |(u, v)| {
            let predicted = self.predicted.reference_phase(u, v).unwrap_or(f64::NAN);
            predicted + self.plate.correction.at(u, v)
        };
        places.map(turns).collect()
    }
}

/// Measures the reference phase map under vertical or under horizontal fringes. The head's timing
/// must be calibrated.
///
/// # Errors
/// The error of a device; if too little of the frame shows a plate (69); if the models do not look
/// down at it (65).
pub fn plate(
    head: &mut Head,
    calibration: &Calibration,
    vertical: bool,
    timeout: Duration,
) -> Result<ReferencePlane> {
    let function = seam::fringes(vertical, head.projector_size(), PLATE_PITCH).map_err(unfit)?;
    let mut shots = Sequence::geometric(function.range(), LEVELS, SHIFTS);
    shots.truncate((LEVELS - 1) * SHIFTS);
    shots.extend(Shot::level(1.0, FINEST_SHIFTS));
    let taken = scan::take(head, calibration, &function, &shots, timeout, &|_| ())?;
    let scan = Scan::new(function.range(), &shots, &taken).map_err(unfit)?;
    let phases = scan.phases(None).map_err(unfit)?;
    let by_models = Calibration {
        heights_by: HeightsBy::Models,
        ..calibration.clone()
    };
    let predicted = by_models.triangulator(function, None);
    let predicted = predicted.map_err(Exit::Content.failure())?;
    let plate = Plate::fit(&phases, |u, v| predicted.reference_phase(u, v)).map_err(unfit)?;
    Ok(ReferencePlane { plate, predicted })
}

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
            let function = seam::fringes(vertical, head.projector_size(), DRIFT_PITCH)?;
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
            map.map_err(|error| seam::small(DRIFT_PITCH, &error))
        };
        let (camera, projector) = (&calibration.camera, &calibration.projector);
        let (vertical, horizontal) = (phases(0)?, phases(1)?);
        let maps = [&vertical, &horizontal];
        Ok(Epipolar::of(camera, projector, maps, [DRIFT_PITCH; 2]))
    }
}
