//! Measures a calibration: time stamps, pace, light, flip-to-light delay, grey response, noise,
//! contrast and reference plane, in this order, since each measurement uses the results of those
//! before it.

mod characteristics;
mod laid_plate;
mod words;

pub use characteristics::{Characteristics, characterise, off_proportion, settled};

use super::calibration::file::{CalibrationFile, MapFile, ReferenceFile};
use super::calibration::geometry::{GeometryFile, PoseFile};
use super::calibration::place::Place;
use super::calibration::{Calibration, HeightsBy};
use super::direction::Sensitivity;
use super::examine::{PLATE_PITCH, ReferencePlane, plate};
use crate::error::{Exit, Failure, Result};
use algo::geometry::FittedMap;
use algo::pattern::PhaseFunction;
use hal::head::Head;
use hal::model::PlaneModel;
use laid_plate::LaidPlate;
use std::time::Duration;

/// Longest wait for a flip or a frame beyond the plan.
const TIMEOUT: Duration = Duration::from_secs(5);
/// Largest RMS distance of the models from the measured plane, projector pixels: a millimetre of
/// height, with devices 27° apart 600 mm away.
const MOST_OFF_PX: f64 = 2.0;

/// What a calibration starts from.
#[derive(Debug)]
pub struct Basis {
    /// Sizes and models; noise and response are measured.
    pub calibration: Calibration,
    /// Where the models come from.
    pub models_from: String,
    /// How the models were made, where they come from poses of a board.
    pub geometry: Option<GeometryFile>,
    /// Temperature of the head.
    pub temperature_c: Option<f64>,
    /// Whether a flat plate lies in the plane z = 0.
    pub plate: bool,
    /// What heights will go by; without a plate by the models.
    pub heights_by: HeightsBy,
}

/// A calibration, ready to be written.
#[derive(Debug)]
pub struct Made {
    /// The file.
    pub file: CalibrationFile,
    /// Its bytes.
    pub bytes: Vec<u8>,
    /// Names and bytes of the reference phase maps.
    pub maps: Vec<(String, Vec<u8>)>,
    /// Remarks for the user.
    pub notes: Vec<String>,
}

/// Measures a calibration; `response` is that of the previous one. `progress` gets the share done
/// and what is measured next. Afterwards the head's timing is the calibrated one.
///
/// # Errors
/// The error of a device; if too little light comes back, or too much, or there is no flat plate
/// (69); if the models do not fit it (65).
pub fn make(
    head: &mut Head,
    mut basis: Basis,
    response: Option<Vec<f64>>,
    progress: &dyn Fn(f64, &str),
) -> Result<Made> {
    let mut notes = Vec::new();
    let early = |share: f64, words: &str| progress(0.75 * share, words);
    let calibration = &mut basis.calibration;
    let measured = characterise(head, calibration, response, &mut notes, &early)?;
    let late = |share: f64, words: &str| progress(0.75 + 0.25 * share, words);
    let mut made = complete(head, &measured, basis, &late)?;
    notes.append(&mut made.notes);
    made.notes = notes;
    Ok(made)
}

/// Measures the reference plane, if the basis has a plate, and makes the calibration of models and
/// characteristics, to which the head's timing must be set. `progress` is that of [`make`].
///
/// # Errors
/// The error of a device; if there is no flat plate (69); if the models do not fit it (65).
pub fn complete(
    head: &mut Head,
    measured: &Characteristics,
    basis: Basis,
    progress: &dyn Fn(f64, &str),
) -> Result<Made> {
    let mut calibration = basis.calibration;
    measured
        .adopt(&mut calibration)
        .map_err(Exit::Content.failure())?;
    let mut notes = Vec::new();
    let mut maps = Vec::new();
    let reference = if basis.plate {
        progress(0.0, "reference plane, vertical fringes");
        let vertical = plate(head, &calibration, true, TIMEOUT)?;
        progress(0.5, "reference plane, horizontal fringes");
        let horizontal = plate(head, &calibration, false, TIMEOUT)?;
        let ground = basis.geometry.as_ref().and_then(|of| of.poses.last());
        let planes = [&vertical, &horizontal];
        Some(reference(&calibration, planes, ground, &mut maps)?)
    } else {
        notes.push("no plate was measured: the reference plane is that of the models".into());
        None
    };
    notes.extend(fringes_along(&calibration));
    progress(1.0, "calibrated");
    let file = CalibrationFile {
        temperature_c: basis.temperature_c,
        timing: Some(measured.timing.clone()),
        noise: Some(measured.noise.clone()),
        response: Some(measured.response.clone()),
        contrast: Some(measured.contrast.clone()),
        heights_by: basis.heights_by,
        reference,
        geometry: basis.geometry,
        ..CalibrationFile::of_models(
            calibration.bit_depth,
            &calibration.camera,
            &calibration.projector,
            basis.models_from,
        )
    };
    let (file, bytes) = file.sealed().map_err(Exit::Unavailable.failure())?;
    Ok(Made {
        file,
        bytes,
        maps,
        notes,
    })
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
    maps: &mut Vec<(String, Vec<u8>)>,
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
        let (file, sha256) = Place::name_of_map(name, &bytes);
        maps.push((file.clone(), bytes));
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
        let square = |of: &FittedMap| of.at(u, v).powi(2);
        corrections.into_iter().map(square).sum::<f64>()
    });
    (squares.sum::<f64>() / f64::from(Calibration::GRID.pow(2))).sqrt()
}
