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
use crate::inspect::contour::ContourInput;
use crate::inspect::contour::shape::{Covariance, Dimensions, Marks, Outline, Parameters, Shape};
use alloc::vec::Vec;

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

    /// The geometry of a contour with these parameters, whose marks are moved by `place` into a
    /// plane with this normal.
    pub fn geometry(
        &self,
        (kind, shape, p): (FeatureKind, &dyn Shape, &Parameters),
        normal: Vector,
        place: impl Fn(Vector) -> Vector,
    ) -> Geometry {
        let marks = shape.marks(p);
        let marks = marks.iter().map(|&(x, y)| place(self.point(x, y)));
        let Dimensions {
            middle,
            direction,
            sizes,
        } = shape.dimensions(&marks.collect::<Marks<Vector>>());
        Geometry {
            kind,
            point: middle,
            normal,
            direction,
            sizes,
        }
    }

    /// A point of space in this frame.
    pub fn coordinates(&self, point: Vector) -> Vector {
        let from = point - self.origin;
        Vector::new(from.dot(self.x), from.dot(self.y), from.dot(self.normal()))
    }
}

/// A contour that was found.
#[derive(Clone, Debug)]
pub struct Rim {
    /// What it is the contour of.
    pub kind: FeatureKind,
    /// The frame of its parameters, in the frame as taught.
    pub frame: PlaneFrame,
    /// The camera's centre, in the frame as taught.
    pub eye: Vector,
    /// Its shape with its parameters.
    pub outline: Outline,
    /// The covariance of these by noise.
    pub covariance: Covariance,
    /// By how much the parameters are off for one standard uncertainty of each input.
    pub inputs: Vec<ContourInput>,
    /// The share of its rim that is seen.
    pub found: f64,
    /// Of each point of the rim its distance from the shape and the σ of that by noise, mm.
    pub residuals: Vec<(f64, f64)>,
}

impl Rim {
    /// Its geometry with these parameters in a plane with this normal, where each of its marks is
    /// moved by `place`.
    pub fn geometry(
        &self,
        p: &Parameters,
        normal: Vector,
        place: impl Fn(Vector) -> Vector,
    ) -> Geometry {
        let contour = (self.kind, &*self.outline.shape, p);
        self.frame.geometry(contour, normal, place)
    }

    /// Its geometry as it was found.
    pub fn as_found(&self) -> Geometry {
        self.geometry(&self.outline.parameters, self.frame.normal(), |at| at)
    }

    /// Where the line of sight through a point of its plane meets another plane.
    pub fn seen_on(&self, point: Vector, plane: &FittedPlane, parameters: [f64; 3]) -> Vector {
        let of = plane.geometry(parameters);
        let ray = point - self.eye;
        let (below, fall) = (of.normal.dot(of.point - self.eye), of.normal.dot(ray));
        self.eye + ray * (below / fall)
    }
}
