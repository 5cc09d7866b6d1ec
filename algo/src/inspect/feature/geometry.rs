//! The geometry of a feature: what a characteristic is a function of.

use crate::geometry::Vector;

/// The geometry of a feature, in the frame as taught.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Geometry {
    /// Where it is, mm: of a plane, its point above the middle of its region.
    pub point: Vector,
    /// Its direction, of length 1: of a plane, the normal of the side that the camera sees.
    pub direction: Vector,
}
