//! The models of an imported recording: whether heights can be measured with them, and whether they
//! fit what was measured.

use super::content;
use super::plane::{self, absolute};
use crate::Failed;
use algo::geometry::{Pinhole, RigError};
use algo::phase::Trust;
use algo::pipeline::{Epipolar, PhaseMap};
use appliance::error::Result;
use appliance::head::calibration::opencv::ImportedModels;
use appliance::head::seam;
use appliance::measure::RecordedRig;
use hal::model::DeviceModel;
use hal::replay::Recording;
use hal::replay::recording::PatternSpec;
use std::path::Path;

/// Largest RMS distance of projector points from their epipolar lines that nothing is said about,
/// projector pixels.
const OFF: f64 = 1.0;
/// Another reading of the models is named if it leaves less than this share of the distance.
const BETTER: f64 = 0.3;
/// Shares of the projector's columns and rows at each end that are not compared: the phase of what
/// is lit from beyond the raster, as in rendered pictures, is that of its other end.
const EDGE: f64 = 0.125;
/// Where a camera's principal point lies, as shares of its frame.
const MIDDLE: std::ops::Range<f64> = 0.3..0.7;

/// Adds models to a recording; returns what looks wrong with them, in words with remedies.
///
/// # Errors
/// If heights could not be measured with them.
pub(super) fn add(
    recording: &mut Recording,
    models: ImportedModels,
    folder: &Path,
) -> Result<Vec<String>> {
    let mut notes = models.notes;
    recording.camera_model = Some(models.camera);
    recording.projector.model = Some(models.projector);
    let contradiction = epipolar(recording).map_err(|error| content(folder, error))?;
    let before = recording.clone();
    notes.extend(placed(recording, models.has_plane).map_err(|error| {
        // What is wrong with the models is said rather than what follows from it.
        let words = contradiction.clone();
        let words = words.unwrap_or_else(|| match working(before, models.has_plane) {
            Some(words) => format!("{error}: {words}"),
            None => error.to_string(),
        });
        content(folder, words)
    })?);
    notes.extend(aside(recording));
    notes.extend(contradiction);
    Ok(notes)
}

/// Gives the models the plane z = 0 unless they have it, and checks that `measure` can use them.
fn placed(recording: &mut Recording, has_plane: bool) -> Result<Option<String>, Failed> {
    let note = if has_plane {
        None
    } else {
        Some(plane::fit(recording)?)
    };
    works(recording)?;
    Ok(note)
}

/// Another reading of models that cannot be used, with which they can.
fn working(mut recording: Recording, has_plane: bool) -> Option<String> {
    let camera = recording.camera_model.clone()?;
    let projector = recording.projector.model.clone()?;
    let readings = readings(&(camera, projector)).into_iter();
    let mut works = readings.filter(|(_, (camera, projector))| {
        recording.camera_model = Some(camera.clone());
        recording.projector.model = Some(projector.clone());
        placed(&mut recording, has_plane).is_ok()
            && epipolar(&recording).is_ok_and(|wrong| wrong.is_none())
    });
    works.next().map(|(words, _)| words)
}

/// Checks that `measure` can use the models.
fn works(recording: &Recording) -> Result<(), Failed> {
    let error = match rig(recording)? {
        Ok(()) => return Ok(()),
        Err(error) => error,
    };
    let mut turned = recording.clone();
    let models = [&mut turned.camera_model, &mut turned.projector.model];
    for model in models.into_iter().flatten() {
        // Half a turn about x: y and z point the other way.
        for row in model.rotation.chunks_mut(3) {
            row[1..].iter_mut().for_each(|element| *element *= -1.0);
        }
    }
    let words = match (&error, rig(&turned)?) {
        (RigError::NotAbove(_), Ok(())) => format!(
            "{error}: the plate's z points away, add --z-away (or leave it out if it is given)"
        ),
        _ => error.to_string(),
    };
    Err(words.into())
}

/// The outer error says that a model is absurd.
fn rig(recording: &Recording) -> Result<Result<(), RigError>, Failed> {
    let projector = &recording.projector;
    let (columns, rows) = (projector.width as usize, projector.height as usize);
    let geometry = RecordedRig::of(recording, None)?;
    for pattern in &recording.patterns {
        let function = seam::phase_function(pattern, columns, rows);
        let function = function.map_err(|error| error.to_string())?;
        if let Err(error) = geometry.triangulator(&function) {
            return Ok(Err(error));
        }
    }
    Ok(Ok(()))
}

/// Whether the camera's principal point lies far from the middle of its frames.
fn aside(recording: &Recording) -> Option<String> {
    let model = recording.camera_model.as_ref()?;
    let shares = [
        model.cx / f64::from(recording.width),
        model.cy / f64::from(recording.height),
    ];
    (!shares.iter().all(|share| MIDDLE.contains(share))).then(|| {
        format!(
            "the camera's principal point ({:.0}, {:.0}) lies far from the middle of its frames of {}×{} pixels: the model is of \
             another resolution or section of the sensor",
            model.cx, model.cy, recording.width, recording.height
        )
    })
}

/// Camera and projector.
type Pair = (DeviceModel, DeviceModel);

/// Compares ξ and η with the models, where fringes of both directions have absolute phases.
fn epipolar(recording: &Recording) -> Result<Option<String>, Failed> {
    let [Some(vertical), Some(horizontal)] = [true, false].map(|vertical| {
        let mut patterns = recording.patterns.iter().enumerate();
        patterns.find_map(|(at, spec)| match spec {
            PatternSpec::Vertical { fringes } if vertical => Some((at, *fringes)),
            PatternSpec::Horizontal { fringes } if !vertical => Some((at, *fringes)),
            _ => None,
        })
    }) else {
        return Ok(None);
    };
    // Levels without an absolute phase are named elsewhere.
    let maps = (
        absolute(recording, vertical.0),
        absolute(recording, horizontal.0),
    );
    let (Ok(mut xi), Ok(mut eta)) = maps else {
        return Ok(None);
    };
    leave_out_edges(&mut xi, vertical.1);
    leave_out_edges(&mut eta, horizontal.1);
    let Some(models) = recording
        .camera_model
        .clone()
        .zip(recording.projector.model.clone())
    else {
        return Ok(None);
    };
    let raster = [recording.projector.width, recording.projector.height].map(f64::from);
    let off = |pair: &Pair, exchanged: bool| {
        let (maps, fringes) = match exchanged {
            false => ([&xi, &eta], [vertical.1, horizontal.1]),
            true => ([&eta, &xi], [horizontal.1, vertical.1]),
        };
        distance(
            recording,
            pair,
            maps,
            [0, 1].map(|at| raster[at] / fringes[at]),
        )
    };
    let Some(own) = off(&models, false).filter(|own| *own > OFF) else {
        return Ok(None);
    };
    let mut others: Vec<(f64, String)> = readings(&models)
        .into_iter()
        .filter_map(|(words, pair)| Some((off(&pair, false)?, words)))
        .collect();
    let exchanged = "vertical and horizontal fringes are exchanged: see --direction";
    others.extend(off(&models, true).map(|off| (off, exchanged.to_owned())));
    let best = others.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
    let remedy = match best {
        Some((off, words)) if off < BETTER * own => format!("{words} (then {off:.2})"),
        _ => "they are of another head, another resolution, or their R and T of another direction: check them".into(),
    };
    Ok(Some(format!(
        "the models contradict the fringes: measured projector points lie {own:.1} projector pixels RMS off their epipolar lines: {remedy}"
    )))
}

/// Marks pixels near the ends of a raster of `fringes` fringes as out of range.
fn leave_out_edges(map: &mut PhaseMap, fringes: f64) {
    for (phase, trust) in map.phase.iter().zip(&mut map.trust) {
        let share = phase.turns() / fringes;
        if *trust == Trust::Resolved && !(EDGE..=1.0 - EDGE).contains(&share) {
            *trust = Trust::OutOfRange;
        }
    }
}

/// RMS distance of the measured points from their epipolar lines.
fn distance(
    recording: &Recording,
    (camera, projector): &Pair,
    maps: [&PhaseMap; 2],
    pitch: [f64; 2],
) -> Option<f64> {
    let raster = (recording.projector.width, recording.projector.height);
    let camera: Pinhole =
        seam::pinhole("camera", camera, (recording.width, recording.height)).ok()?;
    let projector = seam::pinhole("projector", projector, raster).ok()?;
    let found = Epipolar::of(&camera, &projector, maps, pitch)?;
    let rms = found.rms.hypot(found.noise);
    rms.is_finite().then_some(rms)
}

/// The models as they would be if they had been written down in another way, with the words that
/// say how to mend that.
fn readings((camera, projector): &Pair) -> Vec<(String, Pair)> {
    let (r, t) = between(camera, projector);
    let transposed: Rotation = std::array::from_fn(|at| r[at % 3 * 3 + at / 3]);
    let away = |r: &Rotation| turned(r, t).map(|length| -length);
    let pair = |r: Rotation, t| (camera.clone(), led(camera, projector, &r, t));
    let mut readings = vec![(
        "R and T are from the projector to the camera: give the inverse, R transposed and −Rᵀ T"
            .to_owned(),
        pair(transposed, away(&transposed)),
    )];
    readings.extend([
        (
            "R is transposed: exchange its rows and columns".to_owned(),
            pair(transposed, t),
        ),
        (
            "T is the place of the projector's centre: give −R T".to_owned(),
            pair(r, away(&r)),
        ),
    ]);
    for (factor, words) in [(2.0, "half"), (0.5, "twice")] {
        for (device, pair) in [
            ("camera", (scaled(camera, factor), projector.clone())),
            ("projector", (camera.clone(), scaled(projector, factor))),
        ] {
            readings.push((
                format!("the {device}'s model is of {words} the resolution: calibrate with that of the pictures"),
                pair,
            ));
        }
    }
    let (from_one, to_one) = (moved(camera, -1.0), moved(projector, -1.0));
    let words = |counted: &str| {
        format!("{counted} from 1: take 1 off cx and cy, the first pixel's middle is 0")
    };
    readings.push((
        words("the camera's pixels are counted"),
        (from_one.clone(), projector.clone()),
    ));
    readings.push((
        words("the projector's pixels are counted"),
        (camera.clone(), to_one.clone()),
    ));
    readings.push((
        words("the pixels of camera and projector are counted"),
        (from_one, to_one),
    ));
    readings
}

type Rotation = [f64; 9];

/// R and T that lead from the camera to the projector: R = P Cᵀ and T = t_p − R t_c.
fn between(camera: &DeviceModel, projector: &DeviceModel) -> (Rotation, [f64; 3]) {
    let (c, p) = (&camera.rotation, &projector.rotation);
    let r: Rotation = std::array::from_fn(|at| {
        let (row, column) = (at / 3 * 3, at % 3 * 3);
        (0..3).map(|k| p[row + k] * c[column + k]).sum()
    });
    let turned = turned(&r, camera.translation_mm);
    let t = std::array::from_fn(|row| projector.translation_mm[row] - turned[row]);
    (r, t)
}

/// The projector to which R and T lead from the camera.
fn led(camera: &DeviceModel, projector: &DeviceModel, r: &Rotation, t: [f64; 3]) -> DeviceModel {
    let c = &camera.rotation;
    let moved = turned(r, camera.translation_mm);
    DeviceModel {
        rotation: std::array::from_fn(|at| {
            (0..3).map(|k| r[at / 3 * 3 + k] * c[3 * k + at % 3]).sum()
        }),
        translation_mm: std::array::from_fn(|row| moved[row] + t[row]),
        ..projector.clone()
    }
}

fn turned(r: &Rotation, x: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|row| (0..3).map(|k| r[3 * row + k] * x[k]).sum())
}

/// The model for pictures with `factor` times the pixels each way.
fn scaled(model: &DeviceModel, factor: f64) -> DeviceModel {
    DeviceModel {
        fx: model.fx * factor,
        fy: model.fy * factor,
        cx: (model.cx + 0.5) * factor - 0.5,
        cy: (model.cy + 0.5) * factor - 0.5,
        ..model.clone()
    }
}

/// The model with its principal point moved by `by` pixels each way.
fn moved(model: &DeviceModel, by: f64) -> DeviceModel {
    DeviceModel {
        cx: model.cx + by,
        cy: model.cy + by,
        ..model.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use algo::units::AbsolutePhase;

    #[test]
    fn places_at_the_ends_of_the_raster_are_not_compared_with_the_models() {
        let turns = [-0.3, 4.0, 8.5, 32.0, 55.5, 60.0, 63.9, 32.0];
        let mut map = PhaseMap::new(turns.len(), 1);
        map.phase = turns.map(AbsolutePhase::from_turns).to_vec();
        map.trust = vec![Trust::Resolved; turns.len()];
        map.trust[7] = Trust::Residual;
        leave_out_edges(&mut map, 64.0);
        let (inside, beyond) = (Trust::Resolved, Trust::OutOfRange);
        assert_eq!(
            map.trust,
            [
                beyond,
                beyond,
                inside,
                inside,
                inside,
                beyond,
                beyond,
                Trust::Residual
            ]
        );
    }
}
