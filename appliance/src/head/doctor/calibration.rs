//! The doctor's checks of the calibration: camera and projector stand to each other as when they were
//! calibrated, and heights by the measured reference plane agree with those by the models.

use super::{Check, CheckResult, Examination};
use crate::head::calibration::{Calibration, HeightsBy};
use crate::head::examine::{CrossedFringes, DRIFT_REMEDY, MOST_DRIFT_PX, PATIENCE, PLATE_PITCH};
use crate::head::seam;
use algo::geometry::Triangulator;
use serde_json::json;

/// Heights at which both are compared, as shares of the camera's distance from the reference plane.
const SHARES: [f64; 3] = [-0.05, 0.0, 0.05];
/// Largest RMS difference, mm.
const MOST_MM: f64 = 0.1;

pub(super) fn geometry(examination: &mut Examination<'_>) -> CheckResult {
    let calibration = examination.calibration;
    if !examination.calibrated {
        return Ok(Check::skipped(
            "cannot be judged before the head is calibrated",
        ));
    }
    let fringes = CrossedFringes::take(examination.head, calibration, PATIENCE, &|_| ())?;
    let Some(seen) = fringes.compare(calibration)? else {
        return Ok(Check::skipped(
            "cannot be judged: too little of the frame shows fringes; put a larger part into view",
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

pub(super) fn heights(examination: &mut Examination<'_>) -> CheckResult {
    let calibration = examination.calibration;
    let Some((rms, most)) = difference(calibration) else {
        return Ok(Check::skipped(
            "cannot be compared: no reference plane was measured",
        ));
    };
    let by = match calibration.heights_by {
        HeightsBy::Models => "by the models",
        HeightsBy::Measured => "by the measured plane",
    };
    let found = format!(
        "heights by the measured plane and by the models differ by {rms:.4} mm RMS, at most {most:.4} mm (limit {MOST_MM} mm); they go {by}"
    );
    let remedy = "the models are not those of this plane: calibrate the geometry anew, or let heights go by the plane (`fringed calibrate --heights-by measured`)";
    let off = calibration.heights_by == HeightsBy::Models && !(rms <= MOST_MM);
    let measured = json!({
        "heights_by": calibration.heights_by, "difference_rms_mm": rms, "difference_most_mm": most,
    });
    Ok(Check::new(found, off.then_some(remedy), measured))
}

/// RMS and largest difference of heights in mm, if a reference plane was measured.
fn difference(calibration: &Calibration) -> Option<(f64, f64)> {
    calibration.plane.as_ref()?;
    let by = |heights_by| -> Option<Triangulator> {
        let function = seam::fringes(true, calibration.raster(), PLATE_PITCH);
        let calibration = Calibration {
            heights_by,
            ..calibration.clone()
        };
        calibration.triangulator(function.ok()?, None).ok()
    };
    let (models, measured) = (by(HeightsBy::Models)?, by(HeightsBy::Measured)?);
    let camera = &calibration.camera;
    let distance = camera.centre().z / -camera.axis().z;
    let (mut squares, mut most, mut points) = (0.0_f64, 0.0_f64, 0_u32);
    for (u, v) in calibration.grid() {
        let Some(sight) = measured.sight(u, v) else {
            continue;
        };
        for z in SHARES.map(|share| share * distance) {
            let seen = sight.phase(z).and_then(|phase| models.solve(u, v, phase));
            let Some(seen) = seen else { continue };
            let off = (seen.point.z - z).abs();
            (squares, most, points) = (squares + off * off, most.max(off), points + 1);
        }
    }
    (points > 0).then(|| ((squares / f64::from(points)).sqrt(), most))
}
