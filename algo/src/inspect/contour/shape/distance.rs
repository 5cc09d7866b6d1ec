//! What a contour's shape is: a signed distance with N parameters, and its places.

use crate::math::solve::Distance;

/// A place of a contour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    /// x, mm.
    pub x: f64,
    /// y, mm.
    pub y: f64,
    /// The unit vector across the contour, into the material.
    pub normal: (f64, f64),
    /// Curvature per mm, positive where the centre of curvature lies off the material.
    pub curvature: f64,
}

/// A contour in a plane, with N parameters p in mm and rad.
pub trait Shape<const N: usize>: Distance<N> {
    /// Length of the contour, mm.
    fn length(&self, p: &[f64; N]) -> f64;

    /// How far along the contour, mm, the nearest of its places is; `None` beyond its ends.
    fn along(&self, p: &[f64; N], x: f64, y: f64) -> Option<f64>;

    /// The place so far along.
    fn foot(&self, p: &[f64; N], along: f64) -> Foot;

    /// Whether the contour ends where it begins.
    fn is_closed(&self) -> bool;

    /// The largest share of the contour that may be missing in one stretch.
    fn largest_gap(&self) -> f64 {
        1.0
    }
}
