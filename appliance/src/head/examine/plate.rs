//! Measures the reference phase maps: a flat plate in the plane z = 0 under vertical and horizontal fringes.

use crate::error::{Exit, Failure};
use crate::head::calibration::Calibration;
use crate::head::scan::{self, Scan};
use algo::pattern::{PhaseFunction, Sequence, Shot};
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

/// Measures the reference phase map under vertical or under horizontal fringes. The head's timing must be calibrated.
///
/// # Errors
/// Of a device, or if too little of the frame shows a plate.
pub fn plate(
    head: &mut Head,
    calibration: &Calibration,
    vertical: bool,
    timeout: Duration,
) -> Result<Plate, Failure> {
    let (columns, rows) = head.projector_size();
    let (columns, rows) = (columns as usize, rows as usize);
    let function = if vertical {
        PhaseFunction::vertical(columns, rows, columns as f64 / PITCH)
    } else {
        PhaseFunction::horizontal(columns, rows, rows as f64 / PITCH)
    };
    let function = function.map_err(unfit)?;
    let mut shots = Sequence::geometric(function.range(), LEVELS, SHIFTS);
    shots.truncate((LEVELS - 1) * SHIFTS);
    shots.extend(Shot::level(1.0, FINEST_SHIFTS));
    let taken = scan::take(head, calibration, &function, &shots, timeout, &|_| ())?;
    let scan = Scan::new(function.range(), &shots, &taken).map_err(unfit)?;
    Plate::fit(&scan.phases(None).map_err(unfit)?).map_err(unfit)
}
