//! A straight edge.

use super::distance::{Foot, Shape};
use crate::math::solve::Distance;

/// A straight edge with the material on its left, seen from the side that the camera is on; p =
/// distance to the left of where it was expected, mm, and angle to the left, rad, both at its
/// middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Where its middle was expected, mm.
    pub middle: (f64, f64),
    /// Its expected direction, a unit vector.
    pub direction: (f64, f64),
    /// Its length, mm.
    pub length: f64,
}

impl Line {
    /// The edge from an outline's first to its last corner, as taught; `None` if they are one.
    pub fn of(outline: &[(f64, f64)]) -> Option<Self> {
        let (from, to) = (outline.first()?, outline.last()?);
        let way = (to.0 - from.0, to.1 - from.1);
        let length = libm::sqrt(way.0 * way.0 + way.1 * way.1);
        (length > 0.0).then(|| Self {
            middle: ((from.0 + to.0) / 2.0, (from.1 + to.1) / 2.0),
            direction: (way.0 / length, way.1 / length),
            length,
        })
    }

    /// Its direction, a unit vector.
    pub fn direction(&self, p: &[f64; 2]) -> (f64, f64) {
        let (sin, cos) = (libm::sin(p[1]), libm::cos(p[1]));
        let (x, y) = self.direction;
        (x * cos - y * sin, x * sin + y * cos)
    }

    /// Its middle, mm.
    pub fn middle(&self, p: &[f64; 2]) -> (f64, f64) {
        let (x, y) = self.direction;
        (self.middle.0 - y * p[0], self.middle.1 + x * p[0])
    }
}

impl Distance<2> for Line {
    fn distance(&self, p: &[f64; 2], x: f64, y: f64) -> f64 {
        let (direction, middle) = (self.direction(p), self.middle(p));
        direction.0 * (y - middle.1) - direction.1 * (x - middle.0)
    }
}

impl Shape<2> for Line {
    fn length(&self, _: &[f64; 2]) -> f64 {
        self.length
    }

    fn along(&self, p: &[f64; 2], x: f64, y: f64) -> Option<f64> {
        let (direction, middle) = (self.direction(p), self.middle(p));
        let along = direction.0 * (x - middle.0) + direction.1 * (y - middle.1);
        let along = along + self.length / 2.0;
        (0.0..self.length).contains(&along).then_some(along)
    }

    fn foot(&self, p: &[f64; 2], along: f64) -> Foot {
        let (direction, middle) = (self.direction(p), self.middle(p));
        let along = along - self.length / 2.0;
        Foot {
            x: middle.0 + direction.0 * along,
            y: middle.1 + direction.1 * along,
            normal: (-direction.1, direction.0),
            curvature: 0.0,
        }
    }

    fn is_closed(&self) -> bool {
        false
    }
}
