//! Rigs for triangulation.

use algo::geometry::{HeightRange, Pinhole, PinholeModel, Reference, RigError, Triangulator};
use algo::pattern::PhaseFunction;
use appliance::head::seam;
use hal::model::DeviceModel;

/// Projector columns and rows.
pub const PROJECTOR: (usize, usize) = (256, 192);

/// Checks a device model.
pub fn pinhole(model: &DeviceModel, (width, height): (usize, usize)) -> Pinhole {
    Pinhole::new(seam::pinhole_model(model), width, height).expect("a camera")
}

/// The study's rig with a camera of `side` × `side` pixels and vertical fringes.
pub fn study(side: usize, fringes: f64) -> Triangulator {
    let camera = pinhole(&tests::rig::camera(side as u32), (side, side));
    let range = HeightRange {
        low: -60.0,
        high: 60.0,
    };
    join(camera, projector(), fringes, Some(range)).expect("the study's rig")
}

/// The study's projector.
pub fn projector() -> Pinhole {
    let (columns, rows) = PROJECTOR;
    let model = tests::rig::projector(columns as u32, rows as u32);
    pinhole(&model, PROJECTOR)
}

/// A rig with vertical fringes.
pub fn join(
    camera: Pinhole,
    projector: Pinhole,
    fringes: f64,
    range: Option<HeightRange>,
) -> Result<Triangulator, RigError> {
    let function = PhaseFunction::vertical(projector.width(), projector.height(), fringes);
    let function = function.expect("fringes that can be shown");
    Triangulator::new(camera, projector, Reference::Models, function, range)
}

/// A device without distortion at `centre` that looks along −z with its image x along +x, then
/// tilted by `degrees` about the image's y towards +x; half the width of its frame of `size` is
/// `half` times the focal length.
pub fn looking_down(
    centre: [f64; 3],
    degrees: f64,
    (width, height): (usize, usize),
    half: f64,
) -> PinholeModel {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let rotation = [cos, 0.0, sin, 0.0, -1.0, 0.0, sin, 0.0, -cos];
    let [x, y, z] = centre;
    let row = |i: usize| rotation[i] * x + rotation[i + 1] * y + rotation[i + 2] * z;
    let focal = width as f64 / 2.0 / half;
    PinholeModel {
        fx: focal,
        fy: focal,
        cx: (width - 1) as f64 / 2.0,
        cy: (height - 1) as f64 / 2.0,
        distortion: [0.0; 5],
        rotation,
        translation: [-row(0), -row(3), -row(6)],
    }
}
