//! How a part lies against how it was taught: a small rigid motion, by least squares of measured
//! points to the golden surface.

mod coarse;
mod directions;
mod equations;
mod fit;
mod motion;
mod picture;
mod plan;
mod surface;

pub use coarse::Coarse;
pub use directions::{Matrix6, form};
pub use equations::Equations;
pub use fit::{Fitting, HeightSample, Placed};
pub use motion::Motion;
pub use picture::{Found, Picture};
pub use surface::{Alignment, Facet, GoldenSurface, Spot};

#[cfg(test)]
mod tests;
