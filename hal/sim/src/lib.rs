//! A simulated head: surfaces, optics and noise under the light of a projector.
//!
//! The crate models light and does not know how fringes are decoded, so it can judge the code that
//! decodes them. It implements a scene of hal's virtual head: it computes the camera's frames from
//! the rasters that the projector shows.

mod blur;
mod body;
pub mod controller;
mod footprint;
mod ground;
mod limits;
pub mod material;
mod mechanics;
pub mod optics;
pub mod parts;
pub mod placement;
mod reflection;
pub mod scenario;
mod scene;
mod sensor;
mod spread;
mod stage;
mod staged;
pub mod timing;
mod trace;
pub mod transport;

pub use ground::{Clamp, Ground, Pin};
pub use hal::virtual_head::Faults;
pub use material::Material;
pub use parts::Part;
pub use placement::Placement;
pub use scenario::Scenario;
pub use stage::{Stage, head, head_with_progress};
pub use staged::Staged;
pub use timing::Timing;
pub use transport::Truth;

#[cfg(test)]
mod tests;
