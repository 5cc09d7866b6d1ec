//! What the error of a height is made of (`fringed-lab accuracy`): noise, what remains without
//! noise, and how fine a structure is seen.

mod budget;
mod resolution;

pub use budget::{Budget, Share, budget};
pub use resolution::{Resolution, resolution};

use crate::experiment::{BetterSequence, Method, OpticsKind, Run, Runner, Scene};
use appliance::head::calibrated::MeasureError;

/// Measures a scene with the pattern made for it and 12 frames. Without noise only the camera's
/// rounding is left.
fn measure(scene: &Scene, optics: OpticsKind, seed: u64) -> Result<(Runner, Run), MeasureError> {
    let mut runner = Runner::new(scene, optics)?;
    let run = runner.run(Method::Better(BetterSequence::TWELVE), seed)?;
    Ok((runner, run))
}
