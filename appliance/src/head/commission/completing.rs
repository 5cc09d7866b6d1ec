//! The step `plane`: the reference plane is measured, and the calibration is complete.

use super::file::Commissioning;
use super::outcome::Outcome;
use super::step::Subject;
use crate::error::{Exit, Failure};
use crate::head::calibrate::{Basis, Characteristics, Made, complete};
use crate::head::calibration::place::Place;
use crate::head::calibration::{Calibration, HeightsBy};
use crate::head::seam;
use serde_json::json;

impl Commissioning {
    /// Measures the plate in the plane z = 0, makes the calibration of what the steps have found,
    /// and stores it.
    ///
    /// # Errors
    /// Of a device; something is still to be measured, there is no flat plate, or the calibration
    /// cannot be written.
    pub(super) fn complete(&self, subject: &mut Subject<'_>) -> Result<Outcome, Failure> {
        let (basis, measured) = self.basis(subject)?;
        let before = subject.head.timing();
        subject.head.set_timing(measured.timing.over(before));
        let made = complete(subject.head, &measured, basis, subject.progress)?;
        Place::at(subject.place).save(&made.bytes, &made.maps, "free space")?;
        Ok(found(&made))
    }

    /// What the calibration is made of: what the steps have found, else what the calibration before
    /// has.
    fn basis(&self, subject: &Subject<'_>) -> Result<(Basis, Characteristics), Failure> {
        let missing =
            |words: &str| Failure::new(Exit::Content, format!("complete the calibration: {words}"));
        let before = subject.before.as_ref();
        let measured = self.measured.clone();
        let measured = measured
            .or_else(|| Characteristics::of(before?))
            .ok_or_else(|| {
                missing("delay, response and noise are not measured: do the step timing first")
            })?;
        let (was, is) = (measured.noise.exposing, subject.calibration.exposing);
        if let Some((was, is)) = was.zip(is)
            && !was.agrees(&is)
        {
            return Err(missing(&format!(
                "noise was measured at {was}, and the camera is set to {is}: do the step timing first"
            )));
        }
        let (models, models_from, geometry) = match (&self.models, before) {
            (Some(models), _) => {
                let board = self.board.as_deref().unwrap_or_default();
                let from = format!("{} poses of {board}", models.geometry.poses.len());
                let both = (models.camera.clone(), models.projector.clone());
                (both, from, Some(models.geometry.clone()))
            }
            (None, Some(file)) => {
                let both = (file.camera.model.clone(), file.projector.model.clone());
                (both, file.models_from.clone(), file.geometry.clone())
            }
            (None, None) if subject.exact => {
                let known = &*subject.calibration;
                let both = (
                    seam::device_model(&known.camera),
                    seam::device_model(&known.projector),
                );
                (both, "scenario".into(), None)
            }
            (None, None) => {
                return Err(missing(
                    "the models of camera and projector are not known: do the step geometry first",
                ));
            }
        };
        let known = &*subject.calibration;
        let noise = measured.noise.counts;
        let calibration = Calibration::new(
            known.frames(),
            known.raster(),
            (&models.0, &models.1),
            noise,
        );
        let basis = Basis {
            calibration: calibration.map_err(|error| missing(&error))?,
            models_from,
            response: None,
            geometry,
            temperature_c: None,
            plate: true,
            heights_by: before.map_or(HeightsBy::Models, |file| file.heights_by),
        };
        Ok((basis, measured))
    }
}

fn found(made: &Made) -> Outcome {
    let file = &made.file;
    let plane = file.reference.as_ref();
    let off = plane.map_or(0.0, |plane| plane.models_off_px);
    let residual = plane.map_or(0.0, |plane| plane.vertical.residual_turns);
    let print = &file.fingerprint[..8];
    let mut said = vec![format!(
        "the models are off the plate by {off:.3} px; calibration {print} is stored and in use"
    )];
    said.extend(made.notes.iter().cloned());
    let figures = json!({
        "models_off_px": off, "residual_turns": residual, "fingerprint": file.fingerprint,
    });
    Outcome {
        said,
        ..Outcome::passed("", figures)
    }
}
