//! The grey rasters that the projector shows for a phase function, corrected by the inverse of its measured grey response.

use crate::head::calibration::Calibration;
use algo::pattern::{Encoder, PhaseFunction, Shot};
use hal::projector::Raster;
use rayon::prelude::*;

/// The grey raster of each shot of a phase function.
///
/// # Errors
/// Never for a phase function that could be made.
pub fn rasters(
    function: &PhaseFunction,
    shots: &[Shot],
    calibration: &Calibration,
) -> Result<Vec<Raster>, hal::error::Error> {
    let encoder = Encoder::new(calibration.response.as_ref(), shots);
    shots
        .par_iter()
        .map(|&shot| {
            let grey = encoder.raster(function, shot);
            Raster::new(grey.width as u32, grey.height as u32, grey.pixels)
        })
        .collect()
}
