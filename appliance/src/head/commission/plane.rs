//! The step `plane`: the reference plane is measured on a flat plate, and the calibration is made of
//! this and of what the other steps have found, and stored.

use super::kept::Commissioning;
use super::timing::Characteristics;
use super::{StepOutcome, Subject};
use crate::error::{Exit, Failure, Result};
use crate::head::calibration::file::CalibrationFile;
use crate::head::calibration::geometry::{GeometryFile, MapFile, PoseFile, ReferenceFile};
use crate::head::calibration::place::{CalibrationPlace, NamedMap};
use crate::head::calibration::{Calibration, HeightsBy};
use crate::head::direction::Sensitivity;
use crate::head::examine::{PLATE_PITCH, ReferencePlane, plate};
use crate::head::seam;
use algo::geometry::{FittedMap, Vector};
use algo::pattern::PhaseFunction;
use hal::model::{DeviceModel, PlaneModel};
use serde_json::json;
use std::time::Duration;

/// The origin of models that do not come from a file: those of a simulated head.
pub const OF_SCENARIO: &str = "scenario";
/// Longest wait for a flip or a frame beyond the plan.
const TIMEOUT: Duration = Duration::from_secs(5);
/// Largest RMS distance of the models from the measured plane, projector pixels: a millimetre of
/// height, with devices 27° apart 600 mm away.
const MOST_OFF_PX: f64 = 2.0;

/// Models of camera and projector that a calibration is made with.
#[derive(Clone, Debug)]
pub struct HeadModels {
    /// The camera.
    pub camera: DeviceModel,
    /// The projector.
    pub projector: DeviceModel,
    /// Where they come from.
    pub from: String,
    /// How they were made, where they come from poses of a board.
    pub geometry: Option<GeometryFile>,
}

impl HeadModels {
    /// A calibration of this head with these models: heights go by them, and the response is not
    /// known.
    ///
    /// # Errors
    /// One of them is absurd.
    pub fn calibration(&self, head: &Calibration) -> Result<Calibration> {
        let models = (&self.camera, &self.projector);
        Calibration::new(head.frames(), head.raster(), models, head.noise_counts)
    }
}

impl Subject<'_> {
    /// The models that the calibration is made with, if any are known: imported ones, else those
    /// that were made of poses, else the exact ones of a simulated head, else those of the
    /// calibration before.
    pub fn models(&self, kept: &Commissioning) -> Option<HeadModels> {
        if let Some(imported) = &self.choices.imported {
            return Some(imported.clone());
        }
        if let Some(made) = &kept.models {
            return Some(HeadModels {
                camera: made.camera.clone(),
                projector: made.projector.clone(),
                from: made.geometry.source(),
                geometry: Some(made.geometry.clone()),
            });
        }
        let before = self.before.as_ref();
        if self.exact && before.is_none_or(|file| file.models_from == OF_SCENARIO) {
            return Some(HeadModels {
                camera: seam::device_model(&self.calibration.camera),
                projector: seam::device_model(&self.calibration.projector),
                from: OF_SCENARIO.into(),
                geometry: None,
            });
        }
        before.map(|file| HeadModels {
            camera: file.camera.model.clone(),
            projector: file.projector.model.clone(),
            from: file.models_from.clone(),
            geometry: file.geometry.clone(),
        })
    }

    /// What was measured by the step timing, else what the calibration before has.
    fn characteristics(&self, kept: &Commissioning) -> Result<Characteristics> {
        let before = || Characteristics::of(self.before.as_ref()?);
        let measured = kept.measured.clone().or_else(before).ok_or_else(|| {
            missing("delay, response and noise are not measured: do the step timing first")
        })?;
        match measured.noise.exposing.zip(self.calibration.exposing) {
            Some((was, is)) if !was.agrees(&is) => Err(missing(format!(
                "noise was measured at {was}, and the camera is set to {is}: do the step timing first"
            ))),
            _ => Ok(measured),
        }
    }
}

fn missing(words: impl std::fmt::Display) -> Failure {
    Failure::because(Exit::Content, "complete the calibration", words)
}

/// Measures the plate in the plane z = 0, unless the user chose none, makes the calibration of what
/// the steps have found, and stores it.
pub(super) fn measure(
    subject: &mut Subject<'_>,
    kept: &mut Commissioning,
) -> Result<Option<StepOutcome>> {
    let measured = subject.characteristics(kept)?;
    let models = subject.models(kept).ok_or_else(|| {
        missing("the models of camera and projector are not known: do the step geometry first")
    })?;
    let mut calibration = models.calibration(subject.calibration).map_err(missing)?;
    measured.adopt(&mut calibration)?;
    let head = &mut *subject.head;
    head.set_timing(measured.timing.over(head.timing()));
    head.set_clipping(measured.noise.clips_from);
    let (progress, choices) = (subject.progress, &subject.choices);
    let mut maps = Vec::new();
    let reference = if choices.no_plate {
        let words = "no plate was measured: the reference plane is that of the models";
        subject.notes.push(words.into());
        None
    } else {
        progress(0.0, "reference plane, vertical fringes");
        let vertical = plate(head, &calibration, true, TIMEOUT)?;
        progress(0.5, "reference plane, horizontal fringes");
        let horizontal = plate(head, &calibration, false, TIMEOUT)?;
        let ground = models.geometry.as_ref().and_then(|made| made.poses.last());
        let planes = [&vertical, &horizontal];
        Some(reference(&calibration, planes, ground, &mut maps)?)
    };
    subject.notes.extend(fringes_along(&calibration));
    progress(1.0, "calibrated");
    let before = subject.before.as_ref();
    let file = CalibrationFile {
        temperature_c: choices.temperature_c,
        timing: Some(measured.timing),
        noise: Some(measured.noise),
        response: Some(measured.response),
        contrast: Some(measured.contrast),
        heights_by: choices
            .heights_by
            .or(before.map(|file| file.heights_by))
            .unwrap_or(HeightsBy::Models),
        reference,
        geometry: models.geometry,
        ..CalibrationFile::of_models(
            calibration.bit_depth,
            &calibration.camera,
            &calibration.projector,
            models.from,
        )
    };
    let (file, bytes) = file.sealed().map_err(Exit::Unavailable.failure())?;
    let remedy = choices.if_full.unwrap_or("free space");
    CalibrationPlace::at(subject.place).save(&bytes, &maps, remedy)?;
    let (plane, print) = (file.reference.as_ref(), &file.fingerprint);
    let figures = json!({
        "models_off_px": plane.map(|plane| plane.models_off_px),
        "residual_turns": plane.map(|plane| plane.vertical.residual_turns), "fingerprint": print,
    });
    let stored = format!("calibration {} is stored and in use", &print[..8]);
    let said = plane.map(ReferenceFile::words).into_iter().chain([stored]);
    let outcome = StepOutcome::passed(said, figures);
    subject.stored = Some(file);
    Ok(Some(outcome))
}

/// A note that parts cannot be measured well on this head, if the fringes that teaching projects,
/// which follow the columns, run along its epipolar lines.
fn fringes_along(calibration: &Calibration) -> Option<String> {
    let (columns, rows) = calibration.raster();
    let function = PhaseFunction::vertical(columns as usize, rows as usize, 1.0).ok()?;
    let triangulator = calibration.triangulator(function, None).ok()?;
    let poor = Sensitivity::of(&triangulator)?.poor()?;
    Some(format!(
        "parts are measured by fringes along the projector's columns, and {poor}: stand the projector beside the camera, as its rows run, or turn it by 90° about its axis"
    ))
}

/// The description of the reference phase maps; their bytes go to `maps`. `ground` is the pose that
/// z = 0 of the models goes by, if they were made from poses.
fn reference(
    calibration: &Calibration,
    [vertical, horizontal]: [&ReferencePlane; 2],
    ground: Option<&PoseFile>,
    maps: &mut Vec<NamedMap>,
) -> Result<ReferenceFile> {
    let corrections = [&vertical.plate.correction, &horizontal.plate.correction];
    let models_off_px = PLATE_PITCH * rms(corrections, calibration);
    if !(models_off_px <= MOST_OFF_PX) {
        let laid = LaidPlate::of(calibration, corrections);
        let (problem, remedy) = match laid.filter(|laid| laid.apart_px <= MOST_OFF_PX) {
            Some(laid) => laid.elsewhere(ground),
            None => (
                format!(
                    "the models are off the measured plate by {models_off_px:.1} projector pixels, more than {MOST_OFF_PX}"
                ),
                "put the plate into the plane z = 0 of the models, or import the models of this head"
                    .into(),
            ),
        };
        return Err(Failure::because(Exit::Content, problem, remedy));
    }
    let mut map = |name: &str, plane: &ReferencePlane| {
        let bytes = hal::npy::write(calibration.camera.width(), &plane.map());
        let plate = &plane.plate;
        let named = NamedMap::new(name, bytes);
        let (file, sha256) = (named.file.clone(), named.sha256.clone());
        maps.push(named);
        MapFile {
            file,
            sha256,
            residual_turns: plate.residual_turns,
            noise_turns: plate.noise_turns,
            filled: plate.filled,
        }
    };
    let [xi, eta] = corrections.map(|map| map.coefficients().map(|turns| turns * PLATE_PITCH));
    Ok(ReferenceFile {
        pitch_px: PLATE_PITCH,
        models_off_px,
        plane: PlaneModel { xi, eta },
        vertical: map("reference_vertical", vertical),
        horizontal: map("reference_horizontal", horizontal),
    })
}

/// RMS of the corrections of projector points over the frame, in their unit.
fn rms(corrections: [&FittedMap; 2], calibration: &Calibration) -> f64 {
    let squares = calibration.grid().map(|(u, v)| {
        let square = |map: &FittedMap| map.at(u, v).powi(2);
        corrections.into_iter().map(square).sum::<f64>()
    });
    (squares.sum::<f64>() / f64::from(Calibration::GRID.pow(2))).sqrt()
}

/// A plate by triangulation.
struct LaidPlate {
    /// Angle between the plate and z = 0, degrees.
    tilt_degrees: f64,
    /// Mean height of the plate where the camera sees it, mm.
    height_mm: f64,
    /// RMS distance of the rays of camera and projector that should meet on it, projector pixels.
    apart_px: f64,
}

impl LaidPlate {
    /// Where the plate lies, by how far the projector points on it are off those of z = 0, in
    /// fringes along ξ and along η. `None` where the rays do not meet in front of the head.
    fn of(calibration: &Calibration, corrections: [&FittedMap; 2]) -> Option<Self> {
        let (camera, projector) = (&calibration.camera, &calibration.projector);
        let (mut points, mut squares) = (Vec::new(), 0.0);
        for (u, v) in calibration.grid() {
            let ray = camera.ray(u, v)?;
            let eye = camera.centre();
            let on_plane = projector.project(eye + ray * (-eye.z / ray.z))?;
            let [xi, eta] = corrections.map(|map| PLATE_PITCH * map.at(u, v));
            let lit_by = (on_plane.0 + xi, on_plane.1 + eta);
            let point = nearest(
                (eye, ray),
                (projector.centre(), projector.ray(lit_by.0, lit_by.1)?),
            )?;
            let seen = projector.project(point)?;
            squares += (seen.0 - lit_by.0).powi(2) + (seen.1 - lit_by.1).powi(2);
            points.push(point);
        }
        let (slope, height_mm) = plane(&points)?;
        Some(Self {
            tilt_degrees: slope.atan().to_degrees(),
            height_mm,
            apart_px: (squares / points.len() as f64).sqrt(),
        })
    }

    /// What is wrong, and what to do about it; `ground` is the pose of the board that z = 0 goes
    /// by.
    fn elsewhere(&self, ground: Option<&PoseFile>) -> (String, String) {
        let Self {
            tilt_degrees,
            height_mm,
            ..
        } = self;
        let remedy = match ground {
            Some(pose) => format!(
                "z = 0 is the board as it lay in {0}: lay the plate like that, or, if the board did not lie flat in {0}, take this pose again as the last one, with the board where the plate lies now, and make the models anew",
                pose.recording
            ),
            None => "lay it into z = 0 of the models; if it lies there, the imported models are off the measured plate: import those of this camera and this projector, with the pose of this plate"
                .into(),
        };
        let side = if *height_mm < 0.0 { "below" } else { "above" };
        let problem = format!(
            "the plate does not lie in the plane z = 0, it is tilted by {tilt_degrees:.1}° against it and on average {:.1} mm {side} it",
            height_mm.abs()
        );
        (problem, remedy)
    }
}

/// The point of the first line that is nearest to the second one; lines are points and directions.
fn nearest((a, along): (Vector, Vector), (b, other): (Vector, Vector)) -> Option<Vector> {
    let between = b - a;
    let (aa, ab, bb) = (along.dot(along), along.dot(other), other.dot(other));
    let far = (between.dot(along) * bb - between.dot(other) * ab) / (aa * bb - ab * ab);
    (far.is_finite() && far > 0.0).then(|| a + along * far)
}

/// Slope and mean height of the plane of least squares through points.
fn plane(points: &[Vector]) -> Option<(f64, f64)> {
    let share = 1.0 / points.len() as f64;
    let sum = |term: &dyn Fn(Vector) -> f64| points.iter().map(|point| term(*point)).sum::<f64>();
    let mean = points
        .iter()
        .fold(Vector::default(), |sum, point| sum + *point * share);
    let off = |point: Vector| point - mean;
    let (xx, xy, yy) = (
        sum(&|point| off(point).x.powi(2)),
        sum(&|point| off(point).x * off(point).y),
        sum(&|point| off(point).y.powi(2)),
    );
    let (xz, yz) = (
        sum(&|point| off(point).x * off(point).z),
        sum(&|point| off(point).y * off(point).z),
    );
    let all = xx * yy - xy * xy;
    let slope = ((xz * yy - yz * xy) / all).hypot((yz * xx - xz * xy) / all);
    slope.is_finite().then_some((slope, mean.z))
}
