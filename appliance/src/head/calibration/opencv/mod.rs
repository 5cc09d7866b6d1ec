//! Imports camera and projector models that were made with OpenCV.
//!
//! Two layouts are read. Either each device has a file of its own with its pose in the world
//! (X_device = R·X_world + t); or one file has both, with R and T from the camera to the projector
//! as `stereoCalibrate` gives them, and perhaps the pose of the plate that lies in the reference
//! plane as `solvePnP` gives it. docs/setup.md lists the names.

mod nodes;
mod tree;

use crate::error::{Exit, Failure, Result};
use algo::calibration::Pose;
use algo::geometry::Vector;
use clap::ValueEnum as _;
use hal::bounds::shortened;
use hal::model::DeviceModel;
use nodes::{ALONE, CAMERA, Device, HALF_TURN, OWN, PLATE, POSE, PROJECTOR};
use std::fmt::Display;
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
pub struct ImportedModels {
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
) -> Result<ImportedModels> {
    let mut notes = Vec::new();
    let mut imported = |path: &Path, device: &Device, size, pose_needed: bool| {
        read(path, |tree| {
            let own = nodes::nested(tree, device).unwrap_or(tree);
            right_size(own, size)?;
            let lens = nodes::lens(own, device.name, ALONE)?;
            if !pose_needed && !nodes::has(own, POSE) {
                return Ok((lens, None));
            }
            let mm_per_unit = millimetres(tree, declared)?;
            Ok((lens, Some(nodes::pose(own, POSE, mm_per_unit, &mut notes)?)))
        })
    };
    // A camera without a pose is the world that the projector's is in.
    let (camera_lens, own_pose) = imported(camera, &CAMERA, sizes.camera, false)?;
    // One that is the world's origin says no more.
    let own_pose = own_pose.filter(|pose| *pose != OWN);
    let (projector_lens, pose) = imported(projector, &PROJECTOR, sizes.projector, true)?;
    let pose = pose.unwrap_or(OWN);
    let world = World::of(own_pose, declared).map_err(failed(camera))?;
    let projector_pose = match world.is_stated {
        true => turned(pose, declared),
        false => pose.after(&world.camera),
    };
    Ok(ImportedModels {
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
pub fn from_one(path: &Path, sizes: Sizes, declared: Declared) -> Result<ImportedModels> {
    read(path, |tree| {
        let mut notes = Vec::new();
        right_size(tree, sizes.camera)?;
        let nested = (
            nodes::nested(tree, &CAMERA),
            nodes::nested(tree, &PROJECTOR),
        );
        let (camera, projector) = match nested {
            (Some(camera), Some(projector)) => {
                right_size(camera, sizes.camera)?;
                right_size(projector, sizes.projector)?;
                (
                    nodes::lens(camera, CAMERA.name, ALONE)?,
                    nodes::lens(projector, PROJECTOR.name, ALONE)?,
                )
            }
            _ => (
                nodes::lens(tree, CAMERA.name, CAMERA.rows)?,
                nodes::lens(tree, PROJECTOR.name, PROJECTOR.rows)?,
            ),
        };
        let mm_per_unit = millimetres(tree, declared)?;
        let between = match nested.1 {
            Some(projector) if !nodes::has(tree, POSE) => projector,
            _ => tree,
        };
        let between = nodes::pose(between, POSE, mm_per_unit, &mut notes)?;
        let plate = nodes::has(tree, PLATE)
            .then(|| nodes::pose(tree, PLATE, mm_per_unit, &mut notes))
            .transpose()
            .map_err(|error| {
                wrong(format!(
                    "{error} (the pose of the plate that lies in the reference plane, as cv2.solvePnP gives it)"
                ))
            })?;
        let world = World::of(plate, declared)?;
        Ok(ImportedModels {
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
    fn of(stated: Option<Pose>, declared: Declared) -> Result<Self> {
        let across = |distance| Pose {
            shift: Vector::new(0.0, 0.0, distance),
            ..HALF_TURN
        };
        match (stated, declared.plane_at) {
            (Some(_), Some(_)) => {
                Exit::Content.fail("it states the pose of the plane z = 0: leave out --plane-at")
            }
            (Some(pose), None) => Ok(Self {
                camera: turned(pose, declared),
                has_plane: true,
                is_stated: true,
            }),
            (None, _) if declared.z_away => {
                Exit::Content.fail("it states no plane whose z could be turned: leave out --z-away")
            }
            (None, distance) => Ok(Self {
                camera: across(distance.unwrap_or(0.0)),
                has_plane: distance.is_some(),
                is_stated: false,
            }),
        }
    }
}

fn wrong(words: impl Display) -> Failure {
    Failure::new(Exit::Content, words)
}

/// The failure of a file; what is wrong with it may quote it.
fn failed(path: &Path) -> impl Fn(Failure) -> Failure {
    move |failure| {
        let what = format!("import {}", path.display());
        Failure::because(Exit::Content, what, shortened(&failure.to_string()))
    }
}

fn read<T>(path: &Path, find: impl FnOnce(&Node) -> Result<T>) -> Result<T> {
    let content = || {
        let bytes = fs::metadata(path).map_err(wrong)?.len();
        if bytes > tree::MAX_BYTES {
            return Exit::Content.fail(format!(
                "it has {bytes} bytes: leave only matrices in it, no pictures or corners"
            ));
        }
        let tree = tree::read(&fs::read(path).map_err(wrong)?)?;
        nodes::refuse_other_models(&tree)?;
        find(&tree)
    };
    content().map_err(failed(path))
}

fn millimetres(tree: &Node, declared: Declared) -> Result<f64> {
    let written = match tree.get("unit") {
        None => None,
        Some(Node::Value(word)) => Some(
            Unit::from_str(word, false)
                .map_err(|_| wrong(format!("unit is {word:?}: write mm, cm, m or inch")))?,
        ),
        Some(_) => return Exit::Content.fail("unit is not a word: write mm, cm, m or inch"),
    };
    match (declared.unit, written) {
        (Some(said), Some(written)) if said != written => Exit::Content.fail(format!(
            "its unit is {written:?}, --unit says {said:?}: one of them is wrong"
        )),
        (Some(unit), _) | (None, Some(unit)) => Ok(unit.millimetres()),
        (None, None) => Exit::Content.fail("it does not say its unit of length, which is that of the board's squares: add --unit mm, cm, m or inch"),
    }
}

/// Checks the size that the file states, if it does, against the device's.
fn right_size(tree: &Node, size: (u32, u32)) -> Result<()> {
    for (name, expected) in [("image_width", size.0), ("image_height", size.1)] {
        if let Some(Node::Value(word)) = tree.get(name)
            && word.parse() != Ok(f64::from(expected))
        {
            return Exit::Content.fail(format!(
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
