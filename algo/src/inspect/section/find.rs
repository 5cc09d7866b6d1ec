//! A section from its points: sorted to stretches and joint in one pass, then a line and an edge of
//! each side.

use super::bins::{Beyond, Zone};
use super::edge::{Edge, edge};
use super::geometry::Geometry;
use super::line::{Line, Moments};
use super::profile::Directions;
use super::reason::{Side, Unseen, Why};
use super::request::{Optics, Point, Request};
use alloc::vec::Vec;

/// A section as it was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// The left side and the right one.
    pub edges: [Edge; 2],
}

impl Section {
    /// Finds the sides of a joint in the points of a section, in any order.
    ///
    /// Points that are not finite, or whose variance is not a positive number, do not count. The
    /// variances are those of independent points: where neighbours share noise, as after
    /// interpolation or smoothing over n points, the caller states n times the variance.
    ///
    /// # Errors
    /// Which side is not seen, and why.
    pub fn new(points: &[Point], request: &Request, optics: &Optics) -> Result<Self, Unseen> {
        let sides = [
            (Side::Left, request.left, 1.0, request.edge_mm[0]),
            (Side::Right, request.right, -1.0, request.edge_mm[1]),
        ];
        let (left, right) = (request.left, request.right);
        let is_ordered = |[from, to]: [f64; 2]| from < to && from.is_finite() && to.is_finite();
        for (side, stretch, _, edge_mm) in sides {
            let refuse = |why| Err(Unseen { side, why });
            if !(is_ordered(stretch) && left[1] <= right[0]) {
                return refuse(Why::Order);
            }
            if edge_mm.is_some_and(|r| !(r > 0.0 && r.is_finite())) {
                return refuse(Why::Radius);
            }
        }
        let (moments, beyond) = sorted(points, request);
        let find = |(side, stretch, sign, edge_mm): (Side, [f64; 2], f64, _), moments: Moments| {
            let found = moments.line().and_then(|line| {
                let zone = Zone {
                    points: &beyond,
                    sign,
                    line: &line,
                    from: line.stretch() * (stretch[1] - stretch[0]) / 2.0,
                    width: Zone::width(optics),
                };
                edge(&zone, directions(&line, sign, optics), optics, edge_mm)
            });
            found.map_err(|why| Unseen { side, why })
        };
        Ok(Self {
            edges: [find(sides[0], moments[0])?, find(sides[1], moments[1])?],
        })
    }

    /// c, a, t, r of the left side, then of the right.
    pub fn parameters(&self) -> [f64; 8] {
        core::array::from_fn(|i| self.edges[i / 4].parameters[i % 4])
    }

    /// The geometry of the section with these parameters.
    pub fn geometry(&self, parameters: &[f64; 8]) -> Geometry {
        let [left, right] = &self.edges;
        Geometry::new(parameters, [left.middle, -right.middle])
    }
}

/// The sums of both stretches, and the points between them. Seen from its own side, towards the
/// joint, a point of the right one is at x = −s.
fn sorted(points: &[Point], request: &Request) -> ([Moments; 2], Vec<Beyond>) {
    let (left, right) = (request.left, request.right);
    let mut moments = [Moments::new(left), Moments::new([-right[1], -right[0]])];
    let mut beyond = Vec::new();
    for &Point { s, z, variance } in points {
        let weight = 1.0 / variance;
        // Not a number fails, too.
        if !(weight > 0.0 && weight < f64::MAX && libm::fabs(z) < f64::MAX) {
            continue;
        }
        if moments[0].holds(s) {
            moments[0].add(s, z, weight);
        } else if moments[1].holds(-s) {
            moments[1].add(-s, z, weight);
        } else if left[1] < s && s < right[0] {
            beyond.push(Beyond { s, z, weight });
        }
    }
    (moments, beyond)
}

/// The directions to camera and projector in the frame of a line.
fn directions(line: &Line, sign: f64, optics: &Optics) -> Directions {
    let unit = |slope: f64| {
        let slope = if slope.is_finite() { slope } else { 0.0 };
        let (along, depth) = line.turned(sign * slope, 1.0);
        let length = libm::sqrt(along * along + depth * depth);
        (along / length, -depth / length)
    };
    Directions {
        sight: unit(optics.sight),
        light: unit(optics.light),
    }
}
