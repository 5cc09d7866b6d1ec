//! How a part lies against how it was taught: a small rigid motion, by least squares of measured
//! points to the golden surface.

mod coarse;
mod directions;
mod equations;
mod fit;
mod motion;
mod picture;
mod plan;
mod spots;
mod surface;
mod weight;

pub use coarse::Coarse;
pub use directions::{Matrix6, form};
pub use fit::{FitBuffers, Fitting, HeightSample, Placed};
pub use motion::Motion;
pub use picture::{Found, Picture};
pub use spots::{Alignment, Spot};
pub use surface::{Facet, GoldenSurface};

#[cfg(test)]
mod tests;
