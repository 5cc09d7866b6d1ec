//! Imports camera and projector models that were made with OpenCV.
//!
//! Two layouts are read. Either each device has a file of its own with its pose in the world
//! (X_device = R·X_world + t); or one file has both, with R and T from the camera to the projector
//! as `stereoCalibrate` gives them, and perhaps the pose of the plate that lies in the reference
//! plane as `solvePnP` gives it. docs/setup.md lists the names.

mod matrix;
mod names;
mod pose;
mod tree;

use algo::calibration::Pose;
use algo::geometry::Vector;
use clap::ValueEnum as _;
use hal::bounds::shortened;
use hal::model::DeviceModel;
use matrix::Matrix;
use names::{ALONE, CAMERA, Device, PLATE, POSE, PROJECTOR, Row};
use pose::{HALF_TURN, OWN};
use std::fs;
use std::path::Path;
use tree::Node;

/// What the user says about the files.
#[derive(Clone, Copy, Debug, Default)]
pub struct Declared {
    /// The unit of lengths; none: a node `unit` says it.
    pub unit: Option<Unit>,
    /// Whether the world's z points away from the head, as on OpenCV's boards: then it is turned
    /// round.
    pub z_away: bool,
    /// Distance of the plane z = 0 from the camera along its axis, mm, where the files state no
    /// plane.
    pub plane_at: Option<f64>,
}

/// A unit of length.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Unit {
    /// Millimetres.
    Mm,
    /// Centimetres.
    Cm,
    /// Metres.
    M,
    /// Inches.
    Inch,
}

impl Unit {
    fn millimetres(self) -> f64 {
        match self {
            Self::Mm => 1.0,
            Self::Cm => 10.0,
            Self::M => 1000.0,
            Self::Inch => 25.4,
        }
    }
}

/// Columns and rows of camera and projector; a size that a file states must be the same.
#[derive(Clone, Copy, Debug)]
pub struct Sizes {
    /// Size of the camera's frames.
    pub camera: (u32, u32),
    /// Size of the projector's raster.
    pub projector: (u32, u32),
}

/// The models of camera and projector.
#[derive(Clone, Debug, PartialEq)]
pub struct Models {
    /// The camera.
    pub camera: DeviceModel,
    /// The projector.
    pub projector: DeviceModel,
    /// Whether the plane z = 0 is known. If not, the camera stands at the origin and looks along
    /// −z.
    pub has_plane: bool,
    /// What was corrected, in words.
    pub notes: Vec<String>,
}

/// Reads the models from a file of each device.
///
/// # Errors
/// In words, with the file, the node and the remedy.
pub fn from_two(
    camera: &Path,
    projector: &Path,
    sizes: Sizes,
    declared: Declared,
) -> Result<Models, String> {
    let mut notes = Vec::new();
    let mut one = |path: &Path, device: &Device, size, pose_needed: bool| {
        read(path, |tree| {
            let own = names::nested(tree, device).unwrap_or(tree);
            right_size(own, size)?;
            let lens = lens(own, device.name, ALONE)?;
            if !pose_needed && !names::has(own, POSE) {
                return Ok((lens, None));
            }
            let mm_per_unit = millimetres(tree, declared)?;
            Ok((lens, Some(pose::read(own, POSE, mm_per_unit, &mut notes)?)))
        })
    };
    // A camera without a pose is the world that the projector's is in.
    let (camera_lens, own_pose) = one(camera, &CAMERA, sizes.camera, false)?;
    // One that is the world's origin says no more.
    let own_pose = own_pose.filter(|pose| *pose != OWN);
    let (projector_lens, pose) = one(projector, &PROJECTOR, sizes.projector, true)?;
    let pose = pose.unwrap_or(OWN);
    let world = World::of(own_pose, declared).map_err(|error| failed(camera, &error))?;
    let projector_pose = match world.is_stated {
        true => turned(pose, declared),
        false => pose.after(&world.camera),
    };
    Ok(Models {
        camera: at(camera_lens, &world.camera),
        projector: at(projector_lens, &projector_pose),
        has_plane: world.has_plane,
        notes,
    })
}

/// Reads both models from one file.
///
/// # Errors
/// In words, with the file, the node and the remedy.
pub fn from_one(path: &Path, sizes: Sizes, declared: Declared) -> Result<Models, String> {
    read(path, |tree| {
        let mut notes = Vec::new();
        right_size(tree, sizes.camera)?;
        let nested = (
            names::nested(tree, &CAMERA),
            names::nested(tree, &PROJECTOR),
        );
        let (camera, projector) = match nested {
            (Some(camera), Some(projector)) => {
                right_size(camera, sizes.camera)?;
                right_size(projector, sizes.projector)?;
                (
                    lens(camera, CAMERA.name, ALONE)?,
                    lens(projector, PROJECTOR.name, ALONE)?,
                )
            }
            _ => (
                lens(tree, CAMERA.name, CAMERA.rows)?,
                lens(tree, PROJECTOR.name, PROJECTOR.rows)?,
            ),
        };
        let mm_per_unit = millimetres(tree, declared)?;
        let between = match nested.1 {
            Some(projector) if !names::has(tree, POSE) => projector,
            _ => tree,
        };
        let between = pose::read(between, POSE, mm_per_unit, &mut notes)?;
        let plate = names::has(tree, PLATE)
            .then(|| pose::read(tree, PLATE, mm_per_unit, &mut notes))
            .transpose()
            .map_err(|error| {
                format!(
                    "{error} (the pose of the plate that lies in the reference plane, as cv2.solvePnP gives it)"
                )
            })?;
        let world = World::of(plate, declared)?;
        Ok(Models {
            camera: at(camera, &world.camera),
            projector: at(projector, &between.after(&world.camera)),
            has_plane: world.has_plane,
            notes,
        })
    })
}

/// The world of the models.
struct World {
    /// The camera's pose in it.
    camera: Pose,
    /// Whether the plane z = 0 is known.
    has_plane: bool,
    /// Whether the files state the plane.
    is_stated: bool,
}

impl World {
    /// The world of the stated pose of the camera; without a pose, one whose plane z = 0 stands
    /// across the camera's axis, at the declared distance or nowhere yet.
    fn of(stated: Option<Pose>, declared: Declared) -> Result<Self, String> {
        let across = |distance| Pose {
            shift: Vector::new(0.0, 0.0, distance),
            ..HALF_TURN
        };
        match (stated, declared.plane_at) {
            (Some(_), Some(_)) => {
                Err("it states the pose of the plane z = 0: leave out --plane-at".into())
            }
            (Some(pose), None) => Ok(Self {
                camera: turned(pose, declared),
                has_plane: true,
                is_stated: true,
            }),
            (None, _) if declared.z_away => {
                Err("it states no plane whose z could be turned: leave out --z-away".into())
            }
            (None, distance) => Ok(Self {
                camera: across(distance.unwrap_or(0.0)),
                has_plane: distance.is_some(),
                is_stated: false,
            }),
        }
    }
}

fn failed(path: &Path, error: &str) -> String {
    format!("import {}: {}", path.display(), shortened(error))
}

fn read<T>(path: &Path, find: impl FnOnce(&Node) -> Result<T, String>) -> Result<T, String> {
    let failed = |error: String| failed(path, &error);
    let bytes = fs::metadata(path)
        .map_err(|error| failed(error.to_string()))?
        .len();
    if bytes > tree::MAX_BYTES {
        return Err(failed(format!(
            "it has {bytes} bytes: leave only matrices in it, no pictures or corners"
        )));
    }
    let bytes = fs::read(path).map_err(|error| failed(error.to_string()))?;
    tree::read(&bytes)
        .and_then(|tree| names::refuse_other_models(&tree).and_then(|()| find(&tree)))
        .map_err(failed)
}

fn millimetres(tree: &Node, declared: Declared) -> Result<f64, String> {
    let written = match tree.get("unit") {
        None => None,
        Some(Node::Value(word)) => Some(
            Unit::from_str(word, false)
                .map_err(|_| format!("unit is {word:?}: write mm, cm, m or inch"))?,
        ),
        Some(_) => return Err("unit is not a word: write mm, cm, m or inch".into()),
    };
    match (declared.unit, written) {
        (Some(said), Some(written)) if said != written => Err(format!(
            "its unit is {written:?}, --unit says {said:?}: one of them is wrong"
        )),
        (Some(unit), _) | (None, Some(unit)) => Ok(unit.millimetres()),
        (None, None) => Err(
            "it does not say its unit of length, which is that of the board's squares: add --unit mm, cm, m or inch"
                .into(),
        ),
    }
}

/// Checks the size that the file states, if it does, against the device's.
fn right_size(tree: &Node, size: (u32, u32)) -> Result<(), String> {
    for (name, expected) in [("image_width", size.0), ("image_height", size.1)] {
        if let Some(Node::Value(word)) = tree.get(name)
            && word.parse() != Ok(f64::from(expected))
        {
            return Err(format!(
                "{name} is {word}, the device has {expected}: calibrate with its own resolution"
            ));
        }
    }
    Ok(())
}

/// The same pose, with the world turned round where its z points away from the head.
fn turned(pose: Pose, declared: Declared) -> Pose {
    match declared.z_away {
        true => pose.after(&HALF_TURN),
        false => pose,
    }
}

/// A device whose pose is not known yet.
fn lens(tree: &Node, device: &str, rows: &[Row]) -> Result<DeviceModel, String> {
    let (name, found, distortions) =
        names::first(tree, rows).map_err(|error| format!("{error}: the {device}'s matrix, 3×3"))?;
    let k: [f64; 9] = Matrix::read(name, found)?.expect(name, (3, 3))?;
    let [fx, skew, cx, below, fy, cy, ..] = k;
    if below != 0.0 || k[6..] != [0.0, 0.0, 1.0] {
        return Err(format!(
            "{name} is not a camera matrix: its rows are fx 0 cx, 0 fy cy, 0 0 1"
        ));
    }
    if skew != 0.0 {
        return Err(format!(
            "{name} has a skew of {skew}, which no device has: calibrate without it"
        ));
    }
    let (name, found) = names::one(tree, distortions)
        .map_err(|error| format!("{error}: the {device}'s distortion, k1 k2 p1 p2 k3"))?;
    let all = Matrix::read(name, found)?;
    let mut distortion = [0.0; 5];
    if !all.is_vector() || ![4, 5, 8, 12, 14].contains(&all.numbers.len()) {
        return Err(format!(
            "{name} is {}×{}: it must be a row of 4 or 5, k1 k2 p1 p2 k3",
            all.shape.0, all.shape.1
        ));
    }
    if all.numbers.iter().skip(5).any(|number| *number != 0.0) {
        return Err(format!(
            "{name} has {} coefficients: calibrate with k1 k2 p1 p2 k3 only (without CALIB_RATIONAL_MODEL, \
             CALIB_THIN_PRISM_MODEL and CALIB_TILTED_MODEL)",
            all.numbers.len()
        ));
    }
    for (to, from) in distortion.iter_mut().zip(&all.numbers) {
        *to = *from;
    }
    Ok(DeviceModel {
        fx,
        fy,
        cx,
        cy,
        distortion,
        rotation: [0.0; 9],
        translation_mm: [0.0; 3],
    })
}

/// The same device in this pose.
fn at(device: DeviceModel, pose: &Pose) -> DeviceModel {
    let ([a, b, c], shift) = (pose.rows, pose.shift);
    DeviceModel {
        rotation: [a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z],
        translation_mm: [shift.x, shift.y, shift.z],
        ..device
    }
}

#[cfg(test)]
mod tests;
