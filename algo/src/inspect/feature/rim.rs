//! The rim of a contour that was found, in space.
//!
//! A contour is found in its plane. Its geometry is worked out from a few points of the rim in
//! space, its *marks*: with the part's motion they move, with the plane they slide along the
//! camera's lines of sight, so that every error that the geometry has follows by changing one thing
//! at a time ([`propagate`](crate::inspect::gauge)).

use super::geometry::Geometry;
use super::kind::FeatureKind;
use super::plane::FittedPlane;
use crate::geometry::Vector;
use crate::inspect::contour::Source;
use alloc::vec::Vec;

/// Most parameters of a shape.
pub const MAX_PARAMETERS: usize = 5;
/// Most marks of a rim.
const MAX_MARKS: usize = 4;

/// A frame in a plane: right-handed, z to the side that the camera is on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlaneFrame {
    /// Its origin, mm.
    pub origin: Vector,
    /// Direction of its x axis.
    pub x: Vector,
    /// Direction of its y axis.
    pub y: Vector,
}

impl PlaneFrame {
    /// About a point of a plane with this normal; its x axis lies above x.
    pub fn new(origin: Vector, normal: Vector) -> Self {
        let ahead = Vector::new(1.0, 0.0, 0.0);
        let x = ahead - normal * normal.dot(ahead);
        let x = x * (1.0 / x.length());
        Self {
            origin,
            x,
            y: normal.cross(x),
        }
    }

    /// Direction of its z axis.
    pub fn normal(&self) -> Vector {
        self.x.cross(self.y)
    }

    /// The point of space with these coordinates.
    pub fn point(&self, x: f64, y: f64) -> Vector {
        self.origin + self.x * x + self.y * y
    }

    /// A point of space in this frame.
    pub fn coordinates(&self, point: Vector) -> Vector {
        let from = point - self.origin;
        Vector::new(from.dot(self.x), from.dot(self.y), from.dot(self.normal()))
    }
}

/// The parameters of a contour, in the order of its shape (`contour/shape`);
/// those behind its own are 0.
pub type Parameters = [f64; MAX_PARAMETERS];

/// A contour that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Rim {
    /// [`FeatureKind::Line`], [`Circle`](FeatureKind::Circle) or [`Slot`](FeatureKind::Slot).
    pub kind: FeatureKind,
    /// The frame of its parameters, in the frame as taught.
    pub frame: PlaneFrame,
    /// The camera's centre, in the frame as taught.
    pub eye: Vector,
    /// Of a line: where its ends were expected, in its frame.
    pub ends: [(f64, f64); 2],
    /// The parameters of its shape.
    pub parameters: Parameters,
    /// How many there are.
    pub count: usize,
    /// Their covariance by noise.
    pub covariance: [Parameters; MAX_PARAMETERS],
    /// By how much the parameters are off for one standard uncertainty of each input.
    pub inputs: Vec<(Source, Parameters)>,
    /// The share of its rim that is seen.
    pub found: f64,
    /// Of each point of the rim its distance from the shape and the σ of that by noise, mm.
    pub residuals: Vec<(f64, f64)>,
}

impl Rim {
    /// Points of the rim with these parameters.
    fn marks(&self, p: &Parameters) -> heapless::Vec<Vector, MAX_MARKS> {
        let marks: heapless::Vec<(f64, f64), MAX_MARKS> = match self.kind {
            FeatureKind::Line => {
                let [from, to] = self.ends;
                let (x, y) = (to.0 - from.0, to.1 - from.1);
                let (middle, half) = ((from.0 + x / 2.0, from.1 + y / 2.0), (x / 2.0, y / 2.0));
                let length = 2.0 * libm::hypot(half.0, half.1);
                let off = (-y / length * p[0], x / length * p[0]);
                let (sin, cos) = (libm::sin(p[1]), libm::cos(p[1]));
                let half = (half.0 * cos - half.1 * sin, half.0 * sin + half.1 * cos);
                [-1.0, 1.0]
                    .map(|side| {
                        (
                            middle.0 + off.0 + side * half.0,
                            middle.1 + off.1 + side * half.1,
                        )
                    })
                    .into_iter()
                    .collect()
            }
            _ => {
                let ([long, short], angle) = match self.kind {
                    FeatureKind::Slot => ([p[2] + p[3], p[3]], p[4]),
                    _ => ([p[2]; 2], 0.0),
                };
                let (sin, cos) = (libm::sin(angle), libm::cos(angle));
                [(-long, 0.0), (long, 0.0), (0.0, -short), (0.0, short)]
                    .map(|(x, y)| (p[0] + x * cos - y * sin, p[1] + x * sin + y * cos))
                    .into_iter()
                    .collect()
            }
        };
        marks.iter().map(|&(x, y)| self.frame.point(x, y)).collect()
    }

    /// Its geometry with these parameters in a plane with this normal, where each of its marks is
    /// moved by `place`.
    pub fn geometry(
        &self,
        p: &Parameters,
        normal: Vector,
        place: impl Fn(Vector) -> Vector,
    ) -> Geometry {
        let mut marks = self.marks(p);
        for mark in &mut marks {
            *mark = place(*mark);
        }
        let way = marks[1] - marks[0];
        let direction = way * (1.0 / way.length());
        let middle = marks[0] + way * 0.5;
        if marks.len() == 2 {
            return Geometry::Line {
                middle,
                direction,
                normal,
            };
        }
        let across = marks[3] - marks[2];
        let centre = (middle + marks[2] + across * 0.5) * 0.5;
        match self.kind {
            FeatureKind::Slot => Geometry::Slot {
                centre,
                direction,
                normal,
                length: way.length(),
                width: across.length(),
            },
            _ => Geometry::Circle {
                centre,
                normal,
                radius: (way.length() + across.length()) / 4.0,
            },
        }
    }

    /// Where the line of sight through a point of its plane meets another plane.
    pub fn seen_on(&self, point: Vector, plane: &FittedPlane, parameters: [f64; 3]) -> Vector {
        let of = plane.geometry(parameters);
        let ray = point - self.eye;
        let (below, fall) = (of.normal().dot(of.point() - self.eye), of.normal().dot(ray));
        self.eye + ray * (below / fall)
    }
}
