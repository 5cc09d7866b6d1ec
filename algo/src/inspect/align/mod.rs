//! How a part lies against how it was taught: a small rigid motion, by least squares of measured
//! points to the golden surface.

mod directions;
mod equations;
mod fit;
mod motion;
mod plan;
mod spots;
mod surface;
mod weight;

pub use directions::form;
pub use fit::{FitBuffers, Placed, Sample};
pub use motion::Motion;
pub use spots::{Alignment, Spot};
pub use surface::{Facet, GoldenSurface};

#[cfg(test)]
mod tests;
