//! What is found on a part before it is measured: cells of a region, and the geometry that is
//! fitted to them.
//!
//! A region is divided into square cells of pixels in golden's frame. A strip adds each measured
//! pixel to the cell that holds its taught coordinates. The height of a cell is its taught height
//! plus its pixels' mean deviation, so on a slope too it does not depend on which of them were
//! measured.

mod cells;
mod face;
mod geometry;
mod kind;
mod plane;
mod rim;
mod taught;

pub use cells::{Cell, LevelPlane, Sum, cells, mean, weight};
pub use face::keep_face;
pub use geometry::Geometry;
pub use kind::{Cut, Feature, FeatureKind};
pub use plane::{FittedPlane, Middle};
pub use rim::{PlaneFrame, Rim};
pub use taught::{Grid, TaughtCell, TooFine, taught_cells};

#[cfg(test)]
mod tests;
