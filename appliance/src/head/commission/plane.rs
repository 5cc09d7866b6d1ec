//! The step `plane`: the reference plane is measured, and the calibration is complete.

use super::Subject;
use super::file::Commissioning;
use super::outcome::Outcome;
use crate::error::{Exit, Failure, Result};
use crate::head::calibrate::{Basis, Characteristics, complete};
use crate::head::calibration::file::ReferenceFile;
use crate::head::calibration::place::Place;
use crate::head::calibration::{Calibration, HeightsBy};
use crate::head::seam;
use serde_json::json;

/// Measures the plate in the plane z = 0, makes the calibration of what the steps have found, and
/// stores it.
pub(super) fn measure(
    subject: &mut Subject<'_>,
    kept: &mut Commissioning,
) -> Result<Option<Outcome>> {
    let (basis, measured) = kept.basis(subject)?;
    let before = subject.head.timing();
    subject.head.set_timing(measured.timing.over(before));
    let made = complete(subject.head, &measured, basis, subject.progress)?;
    Place::at(subject.place).save(&made.bytes, &made.maps, "free space")?;
    let (plane, print) = (made.file.reference.as_ref(), &made.file.fingerprint);
    let figures = json!({
        "models_off_px": plane.map(|plane| plane.models_off_px),
        "residual_turns": plane.map(|plane| plane.vertical.residual_turns), "fingerprint": print,
    });
    let stored = format!("calibration {} is stored and in use", &print[..8]);
    let said = plane.map(ReferenceFile::words).into_iter().chain([stored]);
    Ok(Some(Outcome::passed(said.chain(made.notes), figures)))
}

impl Commissioning {
    /// What the calibration is made of: what the steps have found, else what the calibration before
    /// has.
    ///
    /// # Errors
    /// Something is still to be measured.
    fn basis(&self, subject: &Subject<'_>) -> Result<(Basis, Characteristics)> {
        let missing =
            |words: &str| Failure::because(Exit::Content, "complete the calibration", words);
        let (known, before) = (&*subject.calibration, subject.before.as_ref());
        let measured = self.measured.clone();
        let measured = measured
            .or_else(|| Characteristics::of(before?))
            .ok_or_else(|| {
                missing("delay, response and noise are not measured: do the step timing first")
            })?;
        if let Some((was, is)) = measured.noise.exposing.zip(known.exposing)
            && !was.agrees(&is)
        {
            return Err(missing(&format!(
                "noise was measured at {was}, and the camera is set to {is}: do the step timing first"
            )));
        }
        let (camera, projector, models_from, geometry) = match (&self.models, before) {
            (Some(models), _) => (
                models.camera.clone(),
                models.projector.clone(),
                format!(
                    "{} poses of {}",
                    models.geometry.poses.len(),
                    self.board.as_deref().unwrap_or_default()
                ),
                Some(models.geometry.clone()),
            ),
            (None, Some(file)) => (
                file.camera.model.clone(),
                file.projector.model.clone(),
                file.models_from.clone(),
                file.geometry.clone(),
            ),
            (None, None) if subject.exact => (
                seam::device_model(&known.camera),
                seam::device_model(&known.projector),
                "scenario".into(),
                None,
            ),
            (None, None) => {
                return Err(missing(
                    "the models of camera and projector are not known: do the step geometry first",
                ));
            }
        };
        let noise = measured.noise.counts;
        let models = (&camera, &projector);
        let calibration = Calibration::new(known.frames(), known.raster(), models, noise);
        let basis = Basis {
            calibration: calibration.map_err(|error| missing(&error))?,
            models_from,
            geometry,
            temperature_c: None,
            plate: true,
            heights_by: before.map_or(HeightsBy::Models, |file| file.heights_by),
        };
        Ok((basis, measured))
    }
}
