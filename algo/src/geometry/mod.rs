//! From absolute phase to height: models of camera and projector, the reference phase map,
//! triangulation.

mod lens;
mod pinhole;
mod rays;
mod reference;
mod root;
mod sight;
mod triangulate;
mod vector;

pub use lens::Lens;
pub use pinhole::{ModelError, Pinhole, PinholeModel};
pub use reference::{FittedMap, Reference, ReferenceError, TERMS, fit_map};
pub use sight::Sight;
pub use triangulate::{Expansion, HeightRange, RigError, Solution, Triangulator};
pub use vector::Vector;
