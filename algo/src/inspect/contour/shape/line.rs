//! A straight edge.

use super::outline::{
    ContourKind, Dimensions, Foot, Marks, Outline, Parameters, PlanePlace, Shape, Trace, mean,
};
use crate::geometry::Vector;
use alloc::vec::Vec;

/// A straight edge with the material on its left, seen from the side that the camera is on; p =
/// distance to the left of where it was expected, mm, and angle to the left, rad, both at its
/// middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Where its middle was expected, mm.
    middle: PlanePlace,
    /// Its expected direction, a unit vector.
    direction: PlanePlace,
    /// Its length, mm.
    length: f64,
}

/// Its row among the kinds of features.
pub const KIND: ContourKind = ContourKind {
    about: "A straight edge of a face, where the face ends.",
    has_direction: true,
    sizes: 0,
    begin: |trace| Some(Outline::new(beside(trace)?, &[])),
};

impl Line {
    /// The edge from one place to another, as taught; `None` if they are one.
    pub fn between(from: PlanePlace, to: PlanePlace) -> Option<Self> {
        let way = (to.0 - from.0, to.1 - from.1);
        let length = libm::sqrt(way.0 * way.0 + way.1 * way.1);
        (length > 0.0).then(|| Self {
            middle: ((from.0 + to.0) / 2.0, (from.1 + to.1) / 2.0),
            direction: (way.0 / length, way.1 / length),
            length,
        })
    }

    /// Its direction, a unit vector.
    fn direction(&self, p: &Parameters) -> PlanePlace {
        let (sin, cos) = (libm::sin(p[1]), libm::cos(p[1]));
        let (x, y) = self.direction;
        (x * cos - y * sin, x * sin + y * cos)
    }
}

/// The straight edge between a face and what is none.
fn beside(trace: &Trace) -> Option<Line> {
    let mut edge = trace.places.clone();
    // What lies off by more than twice the mean is not of this edge.
    let (x, y, along, up) = straight(&edge)?;
    let away = |at: &PlanePlace| libm::fabs((at.1 - y) * along - (at.0 - x) * up);
    let scatter = edge.iter().map(away).sum::<f64>() / edge.len() as f64;
    edge.retain(|at| away(at) <= 2.0 * scatter + 1e-9);
    let (x, y, mut along, mut up) = straight(&edge)?;
    let face = trace.face;
    if (face.1 - y) * along - (face.0 - x) * up < 0.0 {
        (along, up) = (-along, -up);
    }
    let ways: Vec<f64> = edge
        .iter()
        .map(|at| (at.0 - x) * along + (at.1 - y) * up)
        .collect();
    let from = ways.iter().copied().fold(f64::INFINITY, f64::min);
    let to = ways.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    // Off the face, which lies on the left.
    let (x, y) = (x + up * trace.eroded, y - along * trace.eroded);
    let [from, to] = [from, to].map(|way| (x + way * along, y + way * up));
    Line::between(from, to)
}

/// The line through places that is nearest to them: a point and its direction.
fn straight(places: &[PlanePlace]) -> Option<(f64, f64, f64, f64)> {
    let middle = mean(places.iter().copied())?;
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for at in places {
        let (x, y) = (at.0 - middle.0, at.1 - middle.1);
        (xx, xy, yy) = (xx + x * x, xy + x * y, yy + y * y);
    }
    let angle = 0.5 * libm::atan2(2.0 * xy, xx - yy);
    (xx + yy > 0.0).then(|| (middle.0, middle.1, libm::cos(angle), libm::sin(angle)))
}

impl Shape for Line {
    fn count(&self) -> usize {
        2
    }

    fn distance(&self, p: &Parameters, x: f64, y: f64) -> f64 {
        let (direction, middle) = (self.direction(p), self.middle(p));
        direction.0 * (y - middle.1) - direction.1 * (x - middle.0)
    }

    fn length(&self, _: &Parameters) -> f64 {
        self.length
    }

    fn along(&self, p: &Parameters, x: f64, y: f64) -> Option<f64> {
        let (direction, middle) = (self.direction(p), self.middle(p));
        let along = direction.0 * (x - middle.0) + direction.1 * (y - middle.1);
        let along = along + self.length / 2.0;
        (0.0..self.length).contains(&along).then_some(along)
    }

    fn foot(&self, p: &Parameters, along: f64) -> Foot {
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

    fn middle(&self, p: &Parameters) -> PlanePlace {
        let (x, y) = self.direction;
        (self.middle.0 - y * p[0], self.middle.1 + x * p[0])
    }

    /// Its ends.
    fn marks(&self, p: &Parameters) -> Marks<PlanePlace> {
        let ends = [0.0, self.length].map(|along| self.foot(p, along));
        ends.map(|end| (end.x, end.y)).into_iter().collect()
    }

    fn dimensions(&self, marks: &[Vector]) -> Dimensions {
        let way = marks[1] - marks[0];
        Dimensions {
            middle: marks[0] + way * 0.5,
            direction: Some(way * (1.0 / way.length())),
            sizes: [None; 2],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::contour::shape::tests::agrees;

    #[test]
    fn an_edge_has_its_places_with_the_material_on_its_left() {
        let line = Line::between((1.0, 2.0), (7.0, 10.0)).unwrap();
        agrees(&Outline::new(line, &[0.3, 0.02]));
        // From below to above right: the material is the upper left corner.
        assert!(line.distance(&Parameters::default(), 0.0, 10.0) > 0.0);
        assert!(Line::between((1.0, 1.0), (1.0, 1.0)).is_none());
    }
}
