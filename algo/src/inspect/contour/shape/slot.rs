//! A slot with round ends.

use super::outline::{
    ContourKind, Dimensions, Foot, Marks, Outline, Parameters, PlanePlace, Shape, axes_of,
    axis_marks,
};
use crate::geometry::Vector;
use core::f64::consts::PI;

/// A slot with the material around it; p = centre x, centre y, half the distance of the centres of
/// its ends, radius of the ends (all mm), angle of its axis (rad).
#[derive(Clone, Copy, Debug, Default)]
pub struct Slot;

/// Its row among the kinds of features.
pub const KIND: ContourKind = ContourKind {
    about: "A slot with round ends in a face: where the face ends, by least squares.",
    has_direction: true,
    sizes: 2,
    begin: |trace| {
        let [x, y, half, radius, angle] = about(&trace.places)?;
        let own = [x, y, half, trace.shrunk(radius), angle];
        Some(Outline::new(Slot, &own))
    },
};

/// The slot about an outline's corners: along the direction in which they reach farthest.
/// `None` if they enclose nothing.
fn about(outline: &[PlanePlace]) -> Option<[f64; 5]> {
    let mut farthest = (0.0, (1.0, 0.0));
    for (i, a) in outline.iter().enumerate() {
        for b in &outline[..i] {
            let way = (a.0 - b.0, a.1 - b.1);
            let square = way.0 * way.0 + way.1 * way.1;
            if square > farthest.0 {
                farthest = (square, way);
            }
        }
    }
    // The farthest corners of a rounded end may lie beside the axis: the axis of the least
    // second moment is symmetric.
    let (cx, cy, angle) = axis(outline, farthest.1)?;
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    let extent = |x: f64, y: f64| {
        let at = outline
            .iter()
            .map(|p| (p.0 - cx) * x + (p.1 - cy) * y)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| {
                (low.min(at), high.max(at))
            });
        (at.1 - at.0, (at.0 + at.1) / 2.0)
    };
    let ((length, along), (width, across)) = (extent(cos, sin), extent(-sin, cos));
    let r = width / 2.0;
    (r > 0.0 && length > width).then(|| {
        let (x, y) = (
            cx + along * cos - across * sin,
            cy + along * sin + across * cos,
        );
        [x, y, length / 2.0 - r, r, angle]
    })
}

/// Centroid of a polygon's area and the angle of its long axis, near a direction.
fn axis(outline: &[(f64, f64)], near: (f64, f64)) -> Option<(f64, f64, f64)> {
    let first = outline.first()?;
    let (mut area, mut x, mut y) = (0.0, 0.0, 0.0);
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    let next = outline.iter().cycle().skip(1);
    for (a, b) in outline.iter().zip(next) {
        let (a, b) = (
            (a.0 - first.0, a.1 - first.1),
            (b.0 - first.0, b.1 - first.1),
        );
        let cross = a.0 * b.1 - b.0 * a.1;
        area += cross / 2.0;
        x += cross * (a.0 + b.0) / 6.0;
        y += cross * (a.1 + b.1) / 6.0;
        xx += cross * (a.0 * a.0 + a.0 * b.0 + b.0 * b.0) / 12.0;
        yy += cross * (a.1 * a.1 + a.1 * b.1 + b.1 * b.1) / 12.0;
        xy += cross * (a.0 * b.1 + 2.0 * a.0 * a.1 + 2.0 * b.0 * b.1 + b.0 * a.1) / 24.0;
    }
    if area == 0.0 {
        return None;
    }
    let (x, y) = (x / area, y / area);
    let (xx, xy, yy) = (xx / area - x * x, xy / area - x * y, yy / area - y * y);
    let mut angle = 0.5 * libm::atan2(2.0 * xy, xx - yy);
    if libm::cos(angle) * near.0 + libm::sin(angle) * near.1 < 0.0 {
        angle += PI;
    }
    Some((first.0 + x, first.1 + y, angle))
}

impl Slot {
    /// A point in the slot's own frame: along its axis and across.
    fn own(p: &Parameters, x: f64, y: f64) -> (f64, f64) {
        let (sin, cos) = (libm::sin(p[4]), libm::cos(p[4]));
        let (x, y) = (x - p[0], y - p[1]);
        (x * cos + y * sin, y * cos - x * sin)
    }
}

impl Shape for Slot {
    fn count(&self) -> usize {
        5
    }

    fn distance(&self, p: &Parameters, x: f64, y: f64) -> f64 {
        let (along, across) = Self::own(p, x, y);
        let beyond = (libm::fabs(along) - p[2]).max(0.0);
        libm::sqrt(beyond * beyond + across * across) - p[3]
    }

    fn length(&self, p: &Parameters) -> f64 {
        4.0 * p[2] + 2.0 * PI * p[3]
    }

    /// From the lower side's left end, round the right end, back, and round the left end.
    fn along(&self, p: &Parameters, x: f64, y: f64) -> Option<f64> {
        let (half, r) = (p[2], p[3]);
        let (along, across) = Self::own(p, x, y);
        let (side, end) = (2.0 * half, PI * r);
        Some(if along > half {
            side + (libm::atan2(across, along - half) + PI / 2.0) * r
        } else if along < -half {
            2.0 * side + end + (libm::atan2(-across, -half - along) + PI / 2.0) * r
        } else if across < 0.0 {
            along + half
        } else {
            side + end + half - along
        })
    }

    fn foot(&self, p: &Parameters, along: f64) -> Foot {
        let (half, r) = (p[2], p[3]);
        let (side, end) = (2.0 * half, PI * r);
        let arc = |middle: f64, at: f64| {
            let angle = at / r - PI / 2.0;
            let normal = (libm::cos(angle), libm::sin(angle));
            let turn = if middle < 0.0 { -1.0 } else { 1.0 };
            let normal = (normal.0 * turn, normal.1 * turn);
            ((middle + r * normal.0, r * normal.1), normal, 1.0 / r)
        };
        let (at, normal, curvature) = if along < side {
            ((along - half, -r), (0.0, -1.0), 0.0)
        } else if along < side + end {
            arc(half, along - side)
        } else if along < 2.0 * side + end {
            ((half - (along - side - end), r), (0.0, 1.0), 0.0)
        } else {
            arc(-half, along - 2.0 * side - end)
        };
        let (sin, cos) = (libm::sin(p[4]), libm::cos(p[4]));
        let turned = |(x, y): (f64, f64)| (x * cos - y * sin, x * sin + y * cos);
        let at = turned(at);
        Foot {
            x: p[0] + at.0,
            y: p[1] + at.1,
            normal: turned(normal),
            curvature,
        }
    }

    fn middle(&self, p: &Parameters) -> PlanePlace {
        (p[0], p[1])
    }

    fn marks(&self, p: &Parameters) -> Marks<PlanePlace> {
        axis_marks(self.middle(p), [p[2] + p[3], p[3]], p[4])
    }

    fn dimensions(&self, marks: &[Vector]) -> Dimensions {
        let (middle, [along, across]) = axes_of(marks);
        Dimensions {
            middle,
            direction: Some(along * (1.0 / along.length())),
            sizes: [Some(along.length()), Some(across.length())],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::contour::shape::tests::{agrees, corners};

    #[test]
    fn a_slot_has_its_places_and_starts_from_its_corners() {
        let slot = Outline::new(Slot, &[3.0, -2.0, 4.0, 2.5, 0.6]);
        agrees(&slot);
        let found = about(&corners(&slot, 200)).unwrap();
        // The angle is one of two.
        let turn = (found[4] - slot.parameters[4]) / PI;
        assert!((turn - turn.round()).abs() < 1e-3, "{found:?}");
        for i in 0..4 {
            assert!((found[i] - slot.parameters[i]).abs() < 0.01, "{found:?}");
        }
        assert!(about(&[(0.0, 0.0), (1.0, 1.0)]).is_none());
    }
}
