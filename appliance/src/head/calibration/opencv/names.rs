//! The names of nodes: one table for each thing that is looked for. OpenCV prescribes none, so
//! programs differ.

use super::tree::Node;

/// Where a device's nodes are in a file.
pub struct Device {
    /// For messages.
    pub name: &'static str,
    /// Names of its matrix, each with those of the distortion beside it. The first matrix that is
    /// there is read.
    pub rows: &'static [Row],
    /// Names of a node that holds all of the device's nodes, in lower case and without spaces,
    /// hyphens and underscores.
    pub nested: &'static [&'static str],
}

/// The name of a node, and names of another one that belongs to it.
pub type Row = (&'static str, &'static [&'static str]);

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
pub const ALONE: &[Row] = &[
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
pub const POSE: &[Row] = &[
    ("Rlp", &["Tlp"]),
    ("R", TRANSLATION),
    ("rotation", TRANSLATION),
    ("roration", TRANSLATION),
    ("rotation_matrix", TRANSLATION),
    ("rvec", TRANSLATION),
];

const PLATE_TRANSLATION: &[&str] = &["plate_T", "plate_tvec"];
/// The pose of the plate in the reference plane.
pub const PLATE: &[Row] = &[
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
pub fn refuse_other_models(tree: &Node) -> Result<(), String> {
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
            OTHER_WORDS.contains(&word) || OTHER_MODELS.iter().any(|other| word.contains(other))
        };
        let names_a_model = ["model", "type", "projection"]
            .iter()
            .any(|of| key.contains(of));
        let of_distortion = names_a_model && key.contains("distortion");
        let is_wrong = key == "xi"
            || (OTHER_MODELS[..6].iter().any(|other| key.contains(other)) && !is_off)
            || (names_a_model && !is_off && is_other(&word))
            || (of_distortion && !word.is_empty() && !OWN_DISTORTIONS.contains(&&*word));
        if is_wrong {
            let value = match node {
                Node::Value(word) => format!(": {word}"),
                _ => String::new(),
            };
            return Err(format!(
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
pub fn has(tree: &Node, rows: &[Row]) -> bool {
    rows.iter().any(|(name, _)| tree.get(name).is_some())
}

/// The first of the rows' nodes that the tree has, and the names of the one beside it.
///
/// # Errors
/// In words: there is none.
pub fn first<'a>(
    tree: &'a Node,
    rows: &[Row],
) -> Result<(&'static str, &'a Node, &'static [&'static str]), String> {
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
/// In words: there is none.
pub fn one<'a>(tree: &'a Node, names: &[&'static str]) -> Result<(&'static str, &'a Node), String> {
    let found = names.iter().find_map(|name| Some((*name, tree.get(name)?)));
    found.ok_or_else(|| none_of(names))
}

fn none_of(names: &[&str]) -> String {
    format!("it has no node {}", names.join(" or "))
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
