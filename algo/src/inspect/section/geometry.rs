//! The geometry of a section, and what is measured of it.

use super::request::Side;

/// A point or direction in the section's plane: s and z, mm.
pub type Pair = (f64, f64);

/// A side's line and circle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Round {
    /// The line's point at the middle of the stretch.
    pub point: Pair,
    /// The line's direction towards larger s, of length 1.
    pub direction: Pair,
    /// Where the circle leaves the line.
    pub tangent: Pair,
    /// The circle's centre.
    pub centre: Pair,
    /// The circle's radius, mm.
    pub radius: f64,
    /// The circle's farthest point along the mean direction of both lines.
    pub extreme: Pair,
}

/// Both sides of a section, as they are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// The left side.
    pub left: Round,
    /// The right side.
    pub right: Round,
    /// The mean direction of both lines, of length 1.
    pub along: Pair,
}

fn dot(a: Pair, b: Pair) -> f64 {
    a.0 * b.0 + a.1 * b.1
}

fn unit(a: Pair) -> Pair {
    let length = libm::sqrt(dot(a, a));
    (a.0 / length, a.1 / length)
}

fn moved(from: Pair, along: Pair, way: f64) -> Pair {
    (from.0 + along.0 * way, from.1 + along.1 * way)
}

impl Joint {
    /// Of the parameters c, a, t, r of both sides, and where the middles of their stretches are,
    /// mm along the section.
    pub fn new(parameters: &[f64; 8], middles: [f64; 2]) -> Self {
        let [c, a, t, r, other @ ..] = *parameters;
        let mut left = round([c, a, t, r], middles[0], 1.0);
        let mut right = round(other, middles[1], -1.0);
        let along = unit(moved(left.direction, right.direction, 1.0));
        left.extreme = moved(left.centre, along, left.radius);
        right.extreme = moved(right.centre, along, -right.radius);
        Self { left, right, along }
    }
}

/// A side whose joint lies towards larger s (1) or smaller (−1), without its extreme point.
fn round([c, a, t, r]: [f64; 4], middle: f64, sign: f64) -> Round {
    let point = (middle, c);
    // The slope is towards the joint.
    let direction = unit((1.0, sign * a));
    let tangent = moved(point, direction, sign * t);
    let centre = moved(tangent, (-direction.1, direction.0), -r);
    Round {
        point,
        direction,
        tangent,
        centre,
        radius: r,
        extreme: centre,
    }
}

/// The distance of the extreme points of both circles along the mean direction of the lines, mm;
/// less than 0 where the sides overlap.
pub fn gap(geometry: &Joint) -> f64 {
    let (from, to) = (geometry.left.extreme, geometry.right.extreme);
    dot((to.0 - from.0, to.1 - from.1), geometry.along)
}

/// The distance of the right tangent point from the left line, mm: more than 0 where the right side
/// is higher.
pub fn flush(geometry: &Joint) -> f64 {
    let (from, to) = (geometry.left.point, geometry.right.tangent);
    let (s, z) = geometry.left.direction;
    dot((to.0 - from.0, to.1 - from.1), (-z, s))
}

/// The radius of a side's edge, mm.
pub fn radius(geometry: &Joint, side: Side) -> f64 {
    match side {
        Side::Left => geometry.left.radius,
        Side::Right => geometry.right.radius,
    }
}
