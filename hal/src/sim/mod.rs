//! The simulated back-end: surfaces, optics and noise under the light of a projector.
//!
//! It models light and knows nothing of how fringes are decoded, so that it can judge the code that decodes
//! them. What the camera sees follows from what the projector shows.

mod blur;
mod limits;
pub mod optics;
pub mod parts;
pub mod scenario;
mod scene;
mod stage;
mod trace;
pub mod transport;

pub use parts::Part;
pub use scenario::{Placement, Scenario};
pub use stage::{Stage, head, head_with_progress};
pub use transport::Truth;

#[cfg(test)]
mod study_tests;
#[cfg(test)]
mod tests;
