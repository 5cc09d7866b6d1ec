//! The doctor's check of the geometry: camera and projector stand to each other as when they were
//! calibrated.

use super::{Check, Checked, Subject};
use crate::head::examine::{CrossedFringes, DRIFT_REMEDY, MOST_DRIFT_PX, PATIENCE};
use serde_json::json;

pub(super) fn geometry(subject: &mut Subject<'_>) -> Checked {
    let calibration = subject.calibration;
    if !subject.calibrated {
        return Ok(Check::skipped(
            "cannot be judged before the head is calibrated",
        ));
    }
    let fringes = CrossedFringes::take(subject.head, calibration, PATIENCE, &|_| ())?;
    let Some(seen) = fringes.compare(calibration)? else {
        return Ok(Check::skipped(
            "cannot be judged: too little of the picture shows fringes; put a larger part into view",
        ));
    };
    let found = format!(
        "projector points are {:.2} px off their epipolar lines (limit {MOST_DRIFT_PX} px, noise of a point {:.2} px)",
        seen.rms, seen.noise
    );
    let measured = json!({
        "epipolar_px": seen.rms, "offset_px": seen.offset, "gradient_px": seen.gradient,
        "noise_px": seen.noise, "pixels": seen.pixels,
    });
    let moved = !(seen.rms <= MOST_DRIFT_PX);
    Ok(Check::new(found, moved.then_some(DRIFT_REMEDY), measured))
}
