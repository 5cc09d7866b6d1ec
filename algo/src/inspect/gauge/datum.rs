//! Datum systems: frames of a part that its own features make (ISO 5459:2011).

use crate::geometry::Vector;
use crate::inspect::feature::{FeatureKind, Geometry};

/// A frame in space, right-handed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DatumFrame {
    origin: Vector,
    axes: [Vector; 3],
}

impl DatumFrame {
    /// The frame of the features of a datum system, in their order: a plane, which is the xy plane
    /// with z to the side that the camera sees; then what places it in the plane:
    ///
    /// - a circle or slot: the origin, then a circle or slot that the x axis points to, or a line
    ///   that it is parallel to;
    /// - or a line: the x axis, then a circle or slot whose centre has x = 0, or a line that crosses
    ///   the axis at x = 0.
    ///
    /// What the features leave open stays as taught. `None` where they make no frame.
    pub fn of(features: &[Geometry]) -> Option<Self> {
        let (plane, rest) = features.split_first()?;
        if plane.kind != FeatureKind::Plane {
            return None;
        }
        let Geometry { point, normal, .. } = *plane;
        let along = |way: Vector| unit(way - normal * normal.dot(way));
        let ahead = || along(Vector::new(1.0, 0.0, 0.0));
        let taught = Vector::default();
        let (on_axis, x) = match *rest {
            [] => (taught, ahead()?),
            [one] => match (one.centre(), one.direction) {
                (Some(from), _) => (from, ahead()?),
                (None, direction) => {
                    let (from, x) = (one.point, along(direction?)?);
                    (from + x * x.dot(taught - from), x)
                }
            },
            [one, two] => match (one.centre(), two.centre()) {
                (Some(from), Some(to)) => (from, along(to - from)?),
                (Some(from), None) => (from, along(two.direction?)?),
                (None, to) => {
                    let (from, x) = (one.point, along(one.direction?)?);
                    let way = match to {
                        Some(to) => x.dot(to - from),
                        None => crossing((from, x), (two.point, along(two.direction?)?))?,
                    };
                    (from + x * way, x)
                }
            },
            _ => return None,
        };
        Some(Self {
            origin: on_axis - normal * normal.dot(on_axis - point),
            axes: [x, normal.cross(x), normal],
        })
    }

    /// A geometry in this frame.
    pub fn coordinates(&self, of: &Geometry) -> Geometry {
        let along = |way: Vector| {
            let [x, y, z] = self.axes.map(|axis| axis.dot(way));
            Vector::new(x, y, z)
        };
        of.mapped(|at| along(at - self.origin), along)
    }
}

/// Whether features of these kinds make a datum system.
pub fn makes_datum(kinds: &[FeatureKind]) -> bool {
    Geometry::examples(kinds).is_some_and(|of| DatumFrame::of(&of).is_some())
}

/// The way of length 1; `None` if it has no length.
fn unit(way: Vector) -> Option<Vector> {
    let length = way.length();
    (length > 1e-9).then(|| way * (1.0 / length))
}

/// How far along the first of two lines, given by a point and a direction each, the other comes
/// nearest; `None` where they are nearly parallel.
fn crossing((from, x): (Vector, Vector), (to, other): (Vector, Vector)) -> Option<f64> {
    let way = to - from;
    let cosine = x.dot(other);
    let sine = 1.0 - cosine * cosine;
    (sine > 1e-6).then(|| (x.dot(way) - cosine * other.dot(way)) / sine)
}

#[cfg(test)]
mod tests {
    use super::*;

    const UP: Vector = Vector::new(0.0, 0.0, 1.0);

    fn plane(z: f64) -> Geometry {
        Geometry::plane(Vector::new(50.0, -20.0, z), UP)
    }

    fn hole(x: f64, y: f64) -> Geometry {
        Geometry {
            kind: FeatureKind::Circle,
            ..Geometry::plane(Vector::new(x, y, 5.0), UP)
        }
    }

    fn line(x: f64, y: f64, degrees: f64) -> Geometry {
        let turn = degrees.to_radians();
        Geometry {
            kind: FeatureKind::Line,
            direction: Some(Vector::new(libm::cos(turn), libm::sin(turn), 0.0)),
            ..Geometry::plane(Vector::new(x, y, 5.0), UP)
        }
    }

    fn at(frame: &[Geometry], x: f64, y: f64) -> [f64; 3] {
        let frame = DatumFrame::of(frame).unwrap();
        let Vector { x, y, z } = frame.coordinates(&hole(x, y)).point;
        [x, y, z]
    }

    fn close(found: [f64; 3], expected: [f64; 3]) {
        let far = found
            .iter()
            .zip(expected)
            .any(|(a, b)| (a - b).abs() > 1e-9);
        assert!(!far, "{found:?} is not {expected:?}");
    }

    #[test]
    fn two_holes_in_a_plane_make_the_frame_of_a_drawing() {
        let of = [plane(4.0), hole(10.0, 10.0), hole(10.0, 30.0)];
        close(at(&of, 10.0, 10.0), [0.0, 0.0, 1.0]);
        close(at(&of, 10.0, 30.0), [20.0, 0.0, 1.0]);
        close(at(&of, 7.0, 15.0), [5.0, 3.0, 1.0]);
    }

    #[test]
    fn lines_give_the_axis_and_a_third_feature_where_it_is_zero() {
        let by_hole = [plane(5.0), line(0.0, 2.0, 0.0), hole(30.0, 9.0)];
        close(at(&by_hole, 31.0, 4.0), [1.0, 2.0, 0.0]);
        let by_line = [plane(5.0), line(0.0, 2.0, 0.0), line(20.0, 12.0, 45.0)];
        close(at(&by_line, 10.0, 3.0), [0.0, 1.0, 0.0]);
        let parallel = [plane(5.0), hole(1.0, 1.0), line(90.0, 90.0, 90.0)];
        close(at(&parallel, 1.0, 4.0), [3.0, 0.0, 0.0]);
    }

    #[test]
    fn what_is_left_open_stays_as_taught() {
        close(at(&[plane(4.0)], 7.0, 15.0), [7.0, 15.0, 1.0]);
        let hole_alone = [plane(4.0), hole(1.0, 1.0)];
        close(at(&hole_alone, 7.0, 15.0), [6.0, 14.0, 1.0]);
        let line_alone = [plane(4.0), line(3.0, 2.0, 90.0)];
        close(at(&line_alone, 7.0, 15.0), [15.0, -4.0, 1.0]);
    }

    #[test]
    fn what_makes_no_frame_is_none() {
        for of in [
            &[][..],
            &[hole(0.0, 0.0)],
            &[plane(0.0), hole(1.0, 1.0), hole(1.0, 1.0)],
            &[plane(0.0), plane(1.0), hole(1.0, 1.0)],
            &[plane(0.0), line(0.0, 0.0, 0.0), line(0.0, 9.0, 180.0)],
        ] {
            assert_eq!(DatumFrame::of(of), None, "{of:?}");
        }
    }
}
