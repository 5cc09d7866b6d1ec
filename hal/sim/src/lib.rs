//! A simulated head: surfaces, optics and noise under the light of a projector.
//!
//! The crate models light and does not know how fringes are decoded, so it can judge the code that
//! decodes them. It implements a scene of hal's virtual head: it computes the camera's frames from
//! the rasters that the projector shows.

mod blur;
mod bounce;
pub mod controller;
mod footprint;
pub mod material;
pub mod optics;
pub mod parts;
pub mod placement;
mod random;
pub mod scenario;
mod scene;
mod sensor;
mod stage;
pub mod timing;
mod trace;
pub mod transport;
mod unfit;
mod unsteady;

pub use hal::virtual_head::Faults;
pub use material::{Material, Print};
pub use parts::Part;
pub use placement::{Clamp, Ground, Pin, Placement};
pub use scenario::Scenario;
pub use scene::Staged;
pub use stage::{Stage, head, head_with_progress};
pub use timing::Timing;
pub use transport::Truth;
pub use unfit::Unfit;
pub use unsteady::Unsteady;

#[cfg(test)]
mod tests;
