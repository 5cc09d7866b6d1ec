//! A rig for which the scene's phase is that of heights near the plane.

use super::Outcome;
use super::cases::FRINGES;
use algo::geometry::{Pinhole, PinholeModel, Reference, Triangulator};
use algo::pattern::PhaseFunction;

/// Height of both devices above the plane, and their distance from each other, mm.
const DISTANCE: f64 = 600.0;
const BASELINE: f64 = 120.0;
/// Width of the plane that both see, mm.
const WIDTH: f64 = 200.0;
const PROJECTOR: (usize, usize) = (1024, 768);

/// For a camera of `width` × `height` pixels.
///
/// Both look straight down, with principal points shifted so that they see the same area: but for
/// the lenses' distortion the phase on the plane is then linear along the camera's rows.
pub fn triangulator(width: usize, height: usize) -> Outcome<Triangulator> {
    let camera = device(
        (width, height),
        -BASELINE / 2.0,
        [-0.12, 0.15, 2e-4, -3e-4, 0.0],
    )?;
    let projector = device(PROJECTOR, BASELINE / 2.0, [-0.05, 0.03, -3e-4, 2e-4, 0.0])?;
    let function = PhaseFunction::vertical(PROJECTOR.0, PROJECTOR.1, FRINGES as f64)?;
    Ok(Triangulator::new(
        camera,
        projector,
        Reference::Models,
        function,
        None,
    )?)
}

fn device((width, height): (usize, usize), x: f64, distortion: [f64; 5]) -> Outcome<Pinhole> {
    let focal = width as f64 * DISTANCE / WIDTH;
    let model = PinholeModel {
        fx: focal,
        fy: focal,
        cx: (width - 1) as f64 / 2.0 + focal * x / DISTANCE,
        cy: (height - 1) as f64 / 2.0,
        distortion,
        rotation: [1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0],
        translation: [-x, 0.0, DISTANCE],
    };
    Ok(Pinhole::new(model, width, height)?)
}
