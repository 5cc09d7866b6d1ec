//! A round hole.

use super::outline::{
    ContourKind, Dimensions, Foot, Marks, Outline, Parameters, PlanePlace, Shape, axes_of,
    axis_marks, mean, padded,
};
use crate::geometry::Vector;
use crate::math::solve::Normal;
use core::f64::consts::{PI, TAU};

/// A circle with the material around it; p = centre x, centre y, radius.
#[derive(Clone, Copy, Debug, Default)]
pub struct Circle;

/// Its row among the kinds of features.
pub const KIND: ContourKind = ContourKind {
    about: "A round hole in a face: where the face ends, by least squares.",
    has_direction: false,
    sizes: 1,
    begin: |trace| {
        let [x, y, radius] = through(&trace.places)?;
        Some(Outline::new(Circle, &[x, y, trace.shrunk(radius)]))
    },
};

/// The least-squares circle of an outline's corners (I. Kåsa, IEEE Trans. Instrum. Meas. 25,
/// 1976: x² + y² = 2ax + 2by + c is linear); `None` if they do not determine one.
fn through(outline: &[PlanePlace]) -> Option<[f64; 3]> {
    // About their mean, so that nothing cancels.
    let (x0, y0) = mean(outline.iter().copied())?;
    let normal = Normal::of(outline.iter().map(|&(x, y)| {
        let (x, y) = (x - x0, y - y0);
        ([2.0 * x, 2.0 * y, 1.0], x * x + y * y)
    }));
    let [a, b, c] = normal.solve()?;
    let square = a * a + b * b + c;
    (square > 0.0).then(|| [x0 + a, y0 + b, libm::sqrt(square)])
}

impl Shape for Circle {
    fn count(&self) -> usize {
        3
    }

    fn distance(&self, &[cx, cy, r, ..]: &Parameters, x: f64, y: f64) -> f64 {
        let (x, y) = (x - cx, y - cy);
        libm::sqrt(x * x + y * y) - r
    }

    fn derivative(&self, &[cx, cy, ..]: &Parameters, x: f64, y: f64) -> Parameters {
        let (x, y) = (x - cx, y - cy);
        let away = libm::sqrt(x * x + y * y);
        padded(&[-x / away, -y / away, -1.0])
    }

    fn length(&self, &[_, _, r, ..]: &Parameters) -> f64 {
        TAU * r
    }

    fn along(&self, &[cx, cy, r, ..]: &Parameters, x: f64, y: f64) -> Option<f64> {
        Some((libm::atan2(y - cy, x - cx) + PI) * r)
    }

    fn foot(&self, &[cx, cy, r, ..]: &Parameters, along: f64) -> Foot {
        let angle = along / r - PI;
        let normal = (libm::cos(angle), libm::sin(angle));
        Foot {
            x: cx + r * normal.0,
            y: cy + r * normal.1,
            normal,
            curvature: 1.0 / r,
        }
    }

    /// 190°: a rim of which less than half is seen hardly tells where its centre is.
    fn largest_gap(&self) -> f64 {
        190.0 / 360.0
    }

    fn middle(&self, p: &Parameters) -> PlanePlace {
        (p[0], p[1])
    }

    fn marks(&self, p: &Parameters) -> Marks<PlanePlace> {
        axis_marks(self.middle(p), [p[2]; 2], 0.0)
    }

    fn dimensions(&self, marks: &[Vector]) -> Dimensions {
        let (middle, [along, across]) = axes_of(marks);
        Dimensions {
            middle,
            direction: None,
            sizes: [Some((along.length() + across.length()) / 2.0), None],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::contour::shape::tests::{agrees, corners};

    #[test]
    fn a_circle_has_its_places_and_starts_from_its_corners() {
        let circle = Outline::new(Circle, &[30.0, -20.0, 5.0]);
        agrees(&circle);
        let found = through(&corners(&circle, 24)).unwrap();
        for (found, is) in found.iter().zip(circle.parameters) {
            assert!((found - is).abs() < 1e-9);
        }
        assert!(through(&[(0.0, 0.0), (1.0, 1.0)]).is_none());
    }
}
