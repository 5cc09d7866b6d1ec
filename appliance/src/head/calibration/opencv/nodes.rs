//! The nodes of lenses and poses: the names that programs give them, one table for each thing that is
//! looked for since OpenCV prescribes none, and how they are read.

use super::tree::{Matrix, Node};
use super::wrong;
use crate::error::{Exit, Failure, Result};
use algo::calibration::Pose;
use algo::geometry::Vector;
use hal::model::DeviceModel;

/// Largest element of R·Rᵀ − 1: a rotation matrix that was rounded to six digits has less.
const TOLERANCE: f64 = 1e-4;
/// Largest element of R less the nearest rotation, for R to be taken as that: rounding to three
/// digits leaves half of it.
const ROUNDED: f64 = 1e-3;
/// A pose of a device in its own frame.
pub const OWN: Pose = about_x(1.0);
/// Half a turn about the x axis: y and z point the other way.
pub const HALF_TURN: Pose = about_x(-1.0);

/// Where a device's nodes are in a file.
pub struct Device {
    /// For messages.
    pub name: &'static str,
    /// Names of its matrix, each with those of the distortion beside it. The first matrix that is
    /// there is read.
    pub rows: &'static [NamePair],
    /// Names of a node that holds all of the device's nodes, in lower case and without spaces,
    /// hyphens and underscores.
    pub nested: &'static [&'static str],
}

/// The name of a node, and names of another one that belongs to it.
pub type NamePair = (&'static str, &'static [&'static str]);

const DISTORTION: &[&str] = &[
    "distortion_coefficients",
    "distortion",
    "dist_coeffs",
    "distCoeffs",
    "dist_coeff",
    "dist",
    "D",
    "projector_distortion",
];

/// The nodes of one device by itself.
pub const ALONE: &[NamePair] = &[
    ("camera_matrix", DISTORTION),
    ("cameraMatrix", DISTORTION),
    ("K", DISTORTION),
    ("projector_matrix", DISTORTION),
    ("intrinsic_matrix", DISTORTION),
    ("intrinsics", DISTORTION),
    ("intrinsic", DISTORTION),
    ("mtx", DISTORTION),
];

/// The camera in a file of both.
pub const CAMERA: Device = Device {
    name: "camera",
    rows: &[
        ("cam_K", &["cam_kc"]),
        ("camInt", &["camDist"]),
        ("cam_int", &["cam_dist"]),
        (
            "camera_matrix",
            &["distortion_coefficients", "camera_distortion"],
        ),
        ("M1", &["D1"]),
        ("K1", &["D1"]),
        ("cameraMatrix1", &["distCoeffs1"]),
    ],
    nested: &["camera", "camera0", "cam", "cam0"],
};

/// The projector in a file of both. A file with four matrices is one of two cameras, a third one,
/// and the projector.
pub const PROJECTOR: Device = Device {
    name: "projector",
    rows: &[
        ("proj_K", &["proj_kc"]),
        ("projInt", &["projDist"]),
        ("proj_int", &["proj_dist"]),
        ("projector_matrix", &["projector_distortion"]),
        ("M4", &["D4"]),
        ("M2", &["D2"]),
        ("K2", &["D2"]),
        ("cameraMatrix2", &["distCoeffs2"]),
    ],
    nested: &[
        "projector",
        "projector0",
        "proj",
        "proj0",
        "camera1",
        "cam1",
    ],
};

const TRANSLATION: &[&str] = &["T", "t", "translation", "translation_vector", "tvec"];
/// Names of a rotation, each with those of the translation beside it. "roration" is what one of the
/// programs writes.
pub const POSE: &[NamePair] = &[
    ("Rlp", &["Tlp"]),
    ("R", TRANSLATION),
    ("rotation", TRANSLATION),
    ("roration", TRANSLATION),
    ("rotation_matrix", TRANSLATION),
    ("rvec", TRANSLATION),
];

const PLATE_TRANSLATION: &[&str] = &["plate_T", "plate_tvec"];
/// The pose of the plate in the reference plane.
pub const PLATE: &[NamePair] = &[
    ("plate_R", PLATE_TRANSLATION),
    ("plate_rvec", PLATE_TRANSLATION),
];

/// Words for models of distortion that are a pinhole camera's with the coefficients k1, k2, p1, p2, k3, in
/// letters and digits alone.
const OWN_DISTORTIONS: [&str; 11] = [
    "plumbbob",
    "radtan",
    "radialtangential",
    "brown",
    "brownconrady",
    "modifiedbrownconrady",
    "opencv",
    "pinhole",
    "standard",
    "rationalpolynomial",
    "none",
];
/// Parts of words for other models than a pinhole camera's.
const OTHER_MODELS: [&str; 17] = [
    "fisheye",
    "equidistant",
    "equisolid",
    "stereographic",
    "kannala",
    "omni",
    "eucm",
    "unified",
    "doublesphere",
    "fov",
    "atan",
    "mei",
    "ocam",
    "scaramuzza",
    "ftheta",
    "division",
    "spherical",
];
/// Whole words for some of them.
const OTHER_WORDS: [&str; 4] = ["ds", "kb", "kb4", "ucm"];

/// Refuses a file that names another model than a pinhole camera's, anywhere in it: its coefficients would be read
/// as k1, k2, p1, p2.
///
/// # Errors
/// In words, with the node and the model.
pub fn refuse_other_models(tree: &Node) -> Result<()> {
    let all = match tree {
        Node::Map(all) => all,
        Node::List(all) => return all.iter().try_for_each(refuse_other_models),
        Node::Value(_) => return Ok(()),
    };
    for (name, node) in all {
        let key = plain(name);
        let word = match node {
            Node::Value(word) => plain(word),
            _ => String::new(),
        };
        let is_off = ["0", "false", "no", "off"].contains(&&*word);
        let is_other = |word: &str| {
            OTHER_WORDS.contains(&word) || OTHER_MODELS.iter().any(|model| word.contains(model))
        };
        let names_a_model = ["model", "type", "projection"]
            .iter()
            .any(|word| key.contains(word));
        let of_distortion = names_a_model && key.contains("distortion");
        let is_wrong = key == "xi"
            || (OTHER_MODELS[..6].iter().any(|model| key.contains(model)) && !is_off)
            || (names_a_model && !is_off && is_other(&word))
            || (of_distortion && !word.is_empty() && !OWN_DISTORTIONS.contains(&&*word));
        if is_wrong {
            let value = match node {
                Node::Value(word) => format!(": {word}"),
                _ => String::new(),
            };
            return Exit::Content.fail(format!(
                "{name}{value} is not the model of a pinhole camera with k1, k2, p1, p2, k3, the only one that is read: calibrate \
                 the device with cv2.calibrateCamera"
            ));
        }
        refuse_other_models(node)?;
    }
    Ok(())
}

/// Letters and digits of a name, in lower case.
fn plain(name: &str) -> String {
    let letters = name.chars().filter(|letter| letter.is_alphanumeric());
    letters.collect::<String>().to_lowercase()
}

/// Whether the tree has any of the rows' first nodes.
pub fn has(tree: &Node, rows: &[NamePair]) -> bool {
    rows.iter().any(|(name, _)| tree.get(name).is_some())
}

/// The first of the rows' nodes that the tree has, and the names of the one beside it.
///
/// # Errors
/// The tree has none of them.
pub fn first<'a>(
    tree: &'a Node,
    rows: &[NamePair],
) -> Result<(&'static str, &'a Node, &'static [&'static str])> {
    let found = rows
        .iter()
        .find_map(|(name, beside)| Some((*name, tree.get(name)?, *beside)));
    found.ok_or_else(|| {
        let names: Vec<&str> = rows.iter().map(|(name, _)| *name).collect();
        none_of(&names)
    })
}

/// The first of the nodes that the tree has.
///
/// # Errors
/// The tree has none of them.
pub fn one<'a>(tree: &'a Node, names: &[&'static str]) -> Result<(&'static str, &'a Node)> {
    let found = names.iter().find_map(|name| Some((*name, tree.get(name)?)));
    found.ok_or_else(|| none_of(names))
}

fn none_of(names: &[&str]) -> Failure {
    wrong(format!("it has no node {}", names.join(" or ")))
}

/// The node that holds all of a device's nodes, if there is one.
pub fn nested<'a>(tree: &'a Node, device: &Device) -> Option<&'a Node> {
    let Node::Map(all) = tree else { return None };
    device.nested.iter().find_map(|known| {
        let mut maps = all.iter().filter(|(_, node)| matches!(node, Node::Map(_)));
        maps.find(|(name, _)| plain(name) == *known)
            .map(|(_, node)| node)
    })
}

const fn about_x(cos: f64) -> Pose {
    Pose {
        rows: [
            Vector::new(1.0, 0.0, 0.0),
            Vector::new(0.0, cos, 0.0),
            Vector::new(0.0, 0.0, cos),
        ],
        shift: Vector::new(0.0, 0.0, 0.0),
    }
}

/// Reads the lens of a device, whose pose is not known yet: matrix and distortion.
pub fn lens(tree: &Node, device: &str, rows: &[NamePair]) -> Result<DeviceModel> {
    let (name, found, distortions) =
        first(tree, rows).map_err(|error| wrong(format!("{error}: the {device}'s matrix, 3×3")))?;
    let k: [f64; 9] = Matrix::read(name, found)?.expect(name, (3, 3))?;
    let [fx, skew, cx, below, fy, cy, ..] = k;
    if below != 0.0 || k[6..] != [0.0, 0.0, 1.0] {
        return Exit::Content.fail(format!(
            "{name} is not a camera matrix: its rows are fx 0 cx, 0 fy cy, 0 0 1"
        ));
    }
    if skew != 0.0 {
        return Exit::Content.fail(format!(
            "{name} has a skew of {skew}, which no device has: calibrate without it"
        ));
    }
    let (name, found) = one(tree, distortions).map_err(|error| {
        wrong(format!(
            "{error}: the {device}'s distortion, k1 k2 p1 p2 k3"
        ))
    })?;
    let all = Matrix::read(name, found)?;
    let mut distortion = [0.0; 5];
    if !all.is_vector() || ![4, 5, 8, 12, 14].contains(&all.numbers.len()) {
        return Exit::Content.fail(format!(
            "{name} is {}×{}: it must be a row of 4 or 5, k1 k2 p1 p2 k3",
            all.shape.0, all.shape.1
        ));
    }
    if all.numbers.iter().skip(5).any(|number| *number != 0.0) {
        return Exit::Content.fail(format!(
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

/// Reads a pose; `rows` are the accepted names of the nodes of the rotation, each with those of the
/// translation. A unit of length in the file is `mm_per_unit` millimetres. `notes` gets what was
/// corrected.
///
/// # Errors
/// In words: a node is missing or has another shape, R is not a rotation, or it mirrors.
pub fn pose(
    tree: &Node,
    rows: &[NamePair],
    mm_per_unit: f64,
    notes: &mut Vec<String>,
) -> Result<Pose> {
    let (name, found, translations) = first(tree, rows)
        .map_err(|error| wrong(format!("{error}: a rotation, 3×3 or a vector of 3")))?;
    let matrix = Matrix::read(name, found)?;
    let stated = if matrix.is_vector() && matrix.numbers.len() == 3 {
        // The rotation about a vector by its length in radians, as OpenCV's `rvec`.
        let [x, y, z] = matrix.expect(name, (3, 1))?;
        OWN.moved(&[x, y, z, 0.0, 0.0, 0.0])
    } else {
        let [a, b, c, d, e, f, g, h, i] = matrix.expect(name, (3, 3))?;
        Pose {
            rows: [
                Vector::new(a, b, c),
                Vector::new(d, e, f),
                Vector::new(g, h, i),
            ],
            ..OWN
        }
    };
    let rotation = checked(name, stated, notes)?;
    let (name, found) =
        one(tree, translations).map_err(|error| wrong(format!("{error}: a translation, 3×1")))?;
    let [x, y, z] = Matrix::read(name, found)?.expect(name, (3, 1))?;
    Ok(Pose {
        shift: Vector::new(x, y, z) * mm_per_unit,
        ..rotation
    })
}

/// Largest element by which two matrices differ.
fn apart(a: &Pose, b: &Pose) -> f64 {
    let rows = a.rows.into_iter().zip(b.rows).map(|(a, b)| a - b);
    let apart = rows.flat_map(|row| [row.x, row.y, row.z].map(f64::abs));
    // A NaN stays one, so that it is refused.
    apart.fold(0.0, |most, apart| if most > apart { most } else { apart })
}

/// The rotation that a file states: as it is, or the nearest one where it was rounded to few
/// digits.
fn checked(name: &str, stated: Pose, notes: &mut Vec<String>) -> Result<Pose> {
    let off = apart(&stated.after(&stated.inverse()), &OWN);
    let nearest = match off <= TOLERANCE {
        true => stated,
        false => nearest(stated),
    };
    let rounded = apart(&nearest, &stated);
    if !(rounded <= ROUNDED) {
        return Exit::Content.fail(format!(
            "{name} is not a rotation matrix: R·Rᵀ differs from the unit matrix by {off:.1e}; write R as OpenCV gives it, with all its digits"
        ));
    }
    if determinant(stated) < 0.0 {
        return Exit::Content.fail(format!(
            "{name} mirrors (det R = −1): its world is left-handed, or an axis was flipped by hand; calibrate with \
             right-handed coordinates, and turn a plate's z with --z-away"
        ));
    }
    if rounded > 0.0 {
        notes.push(format!(
            "{name} is a rotation to few digits only (R·Rᵀ differs from the unit matrix by {off:.1e}), and the nearest rotation was \
             taken: points are off by up to {rounded:.0e} of their distance, write R with all its digits"
        ));
    }
    Ok(nearest)
}

fn determinant(
    Pose {
        rows: [a, b, c], ..
    }: Pose,
) -> f64 {
    a.dot(b.cross(c))
}

/// The orthogonal matrix nearest to that of a pose: the mean of a matrix and its transposed inverse
/// converges to it (Higham 1986).
fn nearest(mut pose: Pose) -> Pose {
    for _ in 0..20 {
        // The cofactors over the determinant are the transposed inverse.
        let ([a, b, c], over) = (pose.rows, 1.0 / determinant(pose));
        let mean = |row: Vector, cofactors: Vector| (row + cofactors * over) * 0.5;
        pose.rows = [
            mean(a, b.cross(c)),
            mean(b, c.cross(a)),
            mean(c, a.cross(b)),
        ];
    }
    pose
}
