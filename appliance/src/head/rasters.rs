//! What the projector shows of a phase function: grey rasters through the inverse of the head's response.

use crate::head::calibration::Calibration;
use algo::pattern::{Encoder, PhaseFunction};
use hal::projector::Raster;
use rayon::prelude::*;

/// Grey rasters of frames (ratio, shift) of a phase function.
///
/// # Errors
/// Never for a phase function that could be made.
pub fn rasters(
    function: &PhaseFunction,
    frames: impl Iterator<Item = (f64, f64)>,
    calibration: &Calibration,
) -> Result<Vec<Raster>, hal::error::Error> {
    let frames: Vec<_> = frames.collect();
    let encoder = Encoder::new(calibration.response.as_ref());
    frames
        .into_par_iter()
        .map(|(ratio, shift)| {
            let grey = encoder.raster(function, ratio, shift);
            Raster::new(grey.width as u32, grey.height as u32, grey.pixels)
        })
        .collect()
}
