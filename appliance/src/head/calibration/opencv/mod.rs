//! Imports camera and projector models that were made with OpenCV.
//!
//! Two layouts are read. Either each device has a file of its own with its pose in the world (X_device = R·X_world + t); or
//! one file has both, with R and T from the camera to the projector as `stereoCalibrate` gives them, and the pose of the plate that
//! lies in the reference plane as `solvePnP` gives it. docs/calibration.md lists the names.

mod matrix;
mod pose;
mod tree;

use clap::ValueEnum as _;
use hal::bounds::shortened;
use hal::model::DeviceModel;
use matrix::Matrix;
use pose::Pose;
use std::fs;
use std::path::Path;
use tree::Node;

/// Names of a device's nodes: the first one of each list that is there is read.
struct Names {
    device: &'static str,
    matrix: &'static [&'static str],
    distortion: &'static [&'static str],
}

/// The nodes in a file of one device.
const ALONE: Names = Names {
    device: "device",
    matrix: &["camera_matrix", "cameraMatrix", "K", "projector_matrix"],
    distortion: &[
        "distortion_coefficients",
        "dist_coeffs",
        "distCoeffs",
        "D",
        "projector_distortion",
    ],
};
/// The camera's nodes in a file of both devices.
const CAMERA: Names = Names {
    device: "camera",
    matrix: &["cam_K", "camInt", "camera_matrix", "M1", "K1"],
    distortion: &["cam_kc", "camDist", "distortion_coefficients", "D1"],
};
/// The projector's nodes in a file of both devices.
const PROJECTOR: Names = Names {
    device: "projector",
    matrix: &["proj_K", "projInt", "projector_matrix", "M2", "K2"],
    distortion: &["proj_kc", "projDist", "projector_distortion", "D2"],
};
const ROTATION: &[&str] = &["R", "rotation", "rotation_matrix", "rvec"];
const TRANSLATION: &[&str] = &["T", "t", "translation", "tvec"];
const PLATE_ROTATION: &[&str] = &["plate_R", "plate_rvec"];
const PLATE_TRANSLATION: &[&str] = &["plate_T", "plate_tvec"];

/// What the user says about the files.
#[derive(Clone, Copy, Debug, Default)]
pub struct Declared {
    /// The unit of lengths; none: a node `unit` says it.
    pub unit: Option<Unit>,
    /// Whether the world's z points away from the head, as on OpenCV's boards: then it is turned round.
    pub z_away: bool,
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
    /// Of the camera.
    pub camera: (u32, u32),
    /// Of the projector.
    pub projector: (u32, u32),
}

/// The models of camera and projector.
pub type Models = (DeviceModel, DeviceModel);

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
    let one = |path: &Path, device: &'static str, size| {
        read(path, |tree| {
            let names = Names { device, ..ALONE };
            right_size(tree, size)?;
            let mm_per_unit = millimetres(tree, declared)?;
            let pose = Pose::read(tree, (ROTATION, TRANSLATION), mm_per_unit)?;
            model(tree, &names, turned(pose, declared))
        })
    };
    Ok((
        one(camera, "camera", sizes.camera)?,
        one(projector, "projector", sizes.projector)?,
    ))
}

/// Reads both models from one file.
///
/// # Errors
/// In words, with the file, the node and the remedy.
pub fn from_one(path: &Path, sizes: Sizes, declared: Declared) -> Result<Models, String> {
    read(path, |tree| {
        right_size(tree, sizes.camera)?;
        let mm_per_unit = millimetres(tree, declared)?;
        let between = Pose::read(tree, (ROTATION, TRANSLATION), mm_per_unit)?;
        let plate = Pose::read(tree, (PLATE_ROTATION, PLATE_TRANSLATION), mm_per_unit).map_err(|error| {
            format!(
                "{error} (the pose of the plate that lies in the reference plane, as cv2.solvePnP gives it)"
            )
        })?;
        let camera = turned(plate, declared);
        let projector = between.after(&camera);
        Ok((
            model(tree, &CAMERA, camera)?,
            model(tree, &PROJECTOR, projector)?,
        ))
    })
}

fn read<T>(path: &Path, find: impl Fn(&Node) -> Result<T, String>) -> Result<T, String> {
    let place = path.display();
    let failed = |error: String| format!("import {place}: {}", shortened(&error));
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
        .and_then(|tree| find(&tree))
        .map_err(failed)
}

/// The first of the names that the tree has.
fn node<'a>(tree: &'a Node, names: &[&'static str]) -> Result<(&'static str, &'a Node), String> {
    let found = names.iter().find_map(|name| Some((*name, tree.get(name)?)));
    found.ok_or_else(|| format!("it has no node {}", names.join(" or ")))
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
    if declared.z_away {
        pose.about_x()
    } else {
        pose
    }
}

fn model(tree: &Node, names: &Names, pose: Pose) -> Result<DeviceModel, String> {
    let (name, found) = node(tree, names.matrix)
        .map_err(|error| format!("{error}: the {}'s matrix, 3×3", names.device))?;
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
    let (name, found) = node(tree, names.distortion)
        .map_err(|error| format!("{error}: the {}'s distortion, k1 k2 p1 p2 k3", names.device))?;
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
        rotation: pose.rotation,
        translation_mm: pose.translation_mm,
    })
}

#[cfg(test)]
mod tests;
