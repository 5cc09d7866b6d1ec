//! Measures the reference phase maps: a flat plate in the plane z = 0 under vertical and horizontal
//! fringes.

use crate::error::{Exit, Failure, Result};
use crate::head::calibration::{Calibration, HeightsBy};
use crate::head::scan::{self, Scan};
use crate::head::seam;
use algo::geometry::Triangulator;
use algo::pattern::{Sequence, Shot};
use algo::pipeline::Plate;
use hal::head::Head;
use std::time::Duration;

/// Levels of the sequence.
const LEVELS: usize = 3;
/// Shifts of each level but the finest.
const SHIFTS: usize = 4;
/// Shifts of the finest level: many, so that noise and harmonics are small.
const FINEST_SHIFTS: usize = 16;
/// Pitch of both patterns, projector pixels.
pub const PITCH: f64 = 20.0;

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
    let function = seam::fringes(vertical, head.projector_size(), PITCH).map_err(unfit)?;
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
