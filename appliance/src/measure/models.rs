//! Measuring a recording with the models of a `calibration.json` instead of its own.

use crate::error::{Exit, Failure, Result};
use crate::head::calibration::file::CalibrationFile;
use hal::replay::Recording;
use std::io::ErrorKind;
use std::path::Path;

/// Heights are looked for within this share of the lower device's height about z = 0: the
/// calibration's plane need not be near the part, because it was not taken for this recording.
const REACH: f64 = 0.5;

/// Replaces the models of a recording by those of a calibration, and its working range, which was
/// stated about another plane. Returns σ of a height by the uncertainty of these models, mm, if
/// they were made from a board.
///
/// # Errors
/// If there is no such file (66), or it cannot be used or is of a head with frames or a raster of
/// another size (65).
pub fn replace(recording: &mut Recording, path: &Path) -> Result<Option<f64>> {
    let place = path.display();
    let bytes = std::fs::read(path).map_err(|error| match error.kind() {
        ErrorKind::NotFound => {
            Failure::because(Exit::Missing, &place, "there is no such calibration")
        }
        _ => Failure::because(Exit::Content, &place, error),
    })?;
    let file = CalibrationFile::read(&bytes).map_err(Exit::Content.because(&place))?;
    let (camera, projector) = (&file.camera, &file.projector);
    let frames = [
        (camera.width, camera.height),
        (recording.width, recording.height),
    ];
    let raster = &recording.projector;
    let rasters = [
        (projector.width, projector.height),
        (raster.width, raster.height),
    ];
    for (of, [calibrated, recorded]) in [("frames", frames), ("a raster", rasters)] {
        if calibrated != recorded {
            let words = format!(
                "the calibration is of a head with {of} of {} × {} pixels, and the recording has {} × {}: name the calibration of the head that took it",
                calibrated.0, calibrated.1, recorded.0, recorded.1
            );
            return Err(Failure::because(Exit::Content, &place, words));
        }
    }
    let calibration = file.calibration();
    let calibration = calibration.map_err(Exit::Content.because(&place))?;
    let [camera, projector] = [&calibration.camera, &calibration.projector];
    let lowest = camera.centre().z.min(projector.centre().z);
    recording.range_mm = Some([-REACH * lowest, REACH * lowest]);
    recording.camera_model = Some(file.camera.model);
    recording.projector.model = Some(file.projector.model);
    recording.projector.plane = calibration.plane_by().cloned();
    Ok(file.geometry.map(|geometry| geometry.height_sigma_mm))
}
