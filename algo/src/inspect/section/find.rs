//! A section from its points: one pass sorts them to stretches and joint, for a line and a rough
//! circle of each side; a second leaves out those that are off both circles, for the edges.

use super::bins::Bins;
use super::edge::RoundEdge;
use super::geometry::Joint;
use super::line::Moments;
use super::request::{Optics, Request, SectionPoint, Side, Unseen, Why};
use super::rough::Rough;

/// A section as it was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// The left side and the right one.
    pub edges: [RoundEdge; 2],
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
    pub fn new(
        points: &[SectionPoint],
        request: &Request,
        optics: &Optics,
    ) -> Result<Self, Unseen> {
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
        let (moments, mut bins) = sorted(points, request, optics);
        let rough = |(side, stretch, sign, edge_mm): (Side, [f64; 2], f64, _), of: Moments| {
            let found = of.line().and_then(|line| {
                let end = line.stretch() * (stretch[1] - stretch[0]) / 2.0;
                Rough::new(&bins, line, sign, end, optics, edge_mm)
            });
            found.map_err(|why| Unseen { side, why })
        };
        let rough = [rough(sides[0], moments[0])?, rough(sides[1], moments[1])?];
        bins.clear();
        for &SectionPoint { s, z, variance } in points {
            let is_between = left[1] < s && s < right[0] && is_point(z, variance);
            if is_between && rough.iter().any(|side| side.is_near(s, z, variance)) {
                bins.add(s, z, 1.0 / variance);
            }
        }
        let edge = |side, rough: &Rough| rough.edge(&bins).map_err(|why| Unseen { side, why });
        Ok(Self {
            edges: [edge(Side::Left, &rough[0])?, edge(Side::Right, &rough[1])?],
        })
    }

    /// c, a, t, r of the left side, then of the right.
    pub fn parameters(&self) -> [f64; 8] {
        core::array::from_fn(|i| self.edges[i / 4].parameters[i % 4])
    }

    /// The geometry of the section with these parameters.
    pub fn geometry(&self, parameters: &[f64; 8]) -> Joint {
        let [left, right] = &self.edges;
        Joint::new(parameters, [left.middle, -right.middle])
    }
}

/// Whether a height and its variance say something; not a number does not.
fn is_point(z: f64, variance: f64) -> bool {
    variance > 1.0 / f64::MAX && variance < f64::INFINITY && libm::fabs(z) < f64::MAX
}

/// The sums of both stretches, and the points between them. Seen from its own side, towards the
/// joint, a point of the right one is at x = −s.
fn sorted(points: &[SectionPoint], request: &Request, optics: &Optics) -> ([Moments; 2], Bins) {
    let (left, right) = (request.left, request.right);
    let mut moments = [Moments::new(left), Moments::new([-right[1], -right[0]])];
    let mut bins = Bins::new(left[1], right[0], optics);
    for &SectionPoint { s, z, variance } in points {
        if !is_point(z, variance) {
            continue;
        }
        let weight = 1.0 / variance;
        if moments[0].holds(s) {
            moments[0].add(s, z, weight);
        } else if moments[1].holds(-s) {
            moments[1].add(-s, z, weight);
        } else if left[1] < s && s < right[0] {
            bins.add(s, z, weight);
        }
    }
    (moments, bins)
}
