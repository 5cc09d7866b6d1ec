//! Where every part is measured to find its motion.

use super::surface::Facet;
use crate::geometry::Vector;
use alloc::vec::Vec;
use core::ops::Range;

/// A place of the taught part at which every part is measured to find its motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// The pixel that sees it.
    pub u: usize,
    /// Its row.
    pub v: usize,
    /// Its place, mm.
    pub point: Vector,
    /// The plane through it.
    pub facet: Facet,
}

/// The plan of an alignment: which pixels are used, and which components of a motion the part's
/// shape determines.
#[derive(Clone, Debug, PartialEq)]
pub struct Alignment {
    /// The point that is turned about: the mean of the surface's points, mm.
    pub centre: Vector,
    /// RMS distance of the points from it, mm.
    pub radius: f64,
    /// Components of the motion that the shape does not determine.
    pub left_out: [bool; 6],
    /// Corners of a box around the part.
    pub(super) corners: Vec<Vector>,
    /// From the top row down.
    pub(super) spots: Vec<Spot>,
    pub(super) pixels_per_spot: f64,
}

impl Alignment {
    /// Corners of a box around the part.
    pub fn corners(&self) -> &[Vector] {
        &self.corners
    }

    /// About how many pixels there are to each spot.
    pub fn pixels_per_spot(&self) -> f64 {
        self.pixels_per_spot
    }

    /// The index of the first spot in some rows, and the spots in them.
    pub fn spots(&self, rows: Range<usize>) -> (usize, &[Spot]) {
        let first = self.spots.partition_point(|spot| spot.v < rows.start);
        let end = self.spots.partition_point(|spot| spot.v < rows.end);
        (first, &self.spots[first..end])
    }
}
