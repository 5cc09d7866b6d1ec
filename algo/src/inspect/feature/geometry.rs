//! The geometry of a feature: what a characteristic is a function of.

use super::kind::FeatureKind;
use crate::geometry::Vector;

/// The geometry of a feature, in the frame as taught or in that of a datum system; lengths in mm,
/// directions of length 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Geometry {
    /// A plane.
    Plane {
        /// Its point above the middle of its region.
        point: Vector,
        /// Its normal on the side that the camera sees.
        normal: Vector,
    },
    /// A straight edge.
    Line {
        /// The middle of what is seen of it.
        middle: Vector,
        /// Its direction, with the material on the left as the camera sees it.
        direction: Vector,
        /// The normal of its plane.
        normal: Vector,
    },
    /// A round hole.
    Circle {
        /// Its centre.
        centre: Vector,
        /// The normal of its plane.
        normal: Vector,
        /// Its radius.
        radius: f64,
    },
    /// A slot with round ends.
    Slot {
        /// Its centre.
        centre: Vector,
        /// The direction of its axis.
        direction: Vector,
        /// The normal of its plane.
        normal: Vector,
        /// Overall length.
        length: f64,
        /// Distance of its sides.
        width: f64,
    },
}

impl Geometry {
    /// Where it is: its middle or centre.
    pub fn point(&self) -> Vector {
        match *self {
            Self::Plane { point, .. } => point,
            Self::Line { middle, .. } => middle,
            Self::Circle { centre, .. } | Self::Slot { centre, .. } => centre,
        }
    }

    /// The normal of its plane.
    pub fn normal(&self) -> Vector {
        match *self {
            Self::Plane { normal, .. }
            | Self::Line { normal, .. }
            | Self::Circle { normal, .. }
            | Self::Slot { normal, .. } => normal,
        }
    }

    /// Its direction, if it has one in its plane.
    pub fn direction(&self) -> Option<Vector> {
        match *self {
            Self::Line { direction, .. } | Self::Slot { direction, .. } => Some(direction),
            Self::Plane { .. } | Self::Circle { .. } => None,
        }
    }

    /// Its sizes in mm: diameter, or length and width; none where it has none.
    pub fn sizes(&self) -> [Option<f64>; 2] {
        match *self {
            Self::Plane { .. } | Self::Line { .. } => [None, None],
            Self::Circle { radius, .. } => [Some(2.0 * radius), None],
            Self::Slot { length, width, .. } => [Some(length), Some(width)],
        }
    }

    /// The centre of an opening; `None` of what is none.
    pub fn centre(&self) -> Option<Vector> {
        match *self {
            Self::Circle { centre, .. } | Self::Slot { centre, .. } => Some(centre),
            Self::Plane { .. } | Self::Line { .. } => None,
        }
    }

    /// The same with its points and directions mapped.
    pub(in crate::inspect) fn mapped(
        &self,
        at: impl Fn(Vector) -> Vector,
        along: impl Fn(Vector) -> Vector,
    ) -> Self {
        match *self {
            Self::Plane { point, normal } => Self::Plane {
                point: at(point),
                normal: along(normal),
            },
            Self::Line {
                middle,
                direction,
                normal,
            } => Self::Line {
                middle: at(middle),
                direction: along(direction),
                normal: along(normal),
            },
            Self::Circle {
                centre,
                normal,
                radius,
            } => Self::Circle {
                centre: at(centre),
                normal: along(normal),
                radius,
            },
            Self::Slot {
                centre,
                direction,
                normal,
                length,
                width,
            } => Self::Slot {
                centre: at(centre),
                direction: along(direction),
                normal: along(normal),
                length,
                width,
            },
        }
    }

    /// A geometry of a kind, to try what can be made of it: those with other numbers lie elsewhere
    /// and point elsewhere. `None` of a kind that has none.
    pub(in crate::inspect) fn example(kind: FeatureKind, number: usize) -> Option<Self> {
        let turn = number as f64;
        let point = Vector::new(10.0 * turn, 3.0 * turn * turn, 1.0 + turn);
        let normal = Vector::new(0.0, 0.0, 1.0);
        let direction = Vector::new(libm::cos(turn), libm::sin(turn), 0.0);
        Some(match kind {
            FeatureKind::Surface | FeatureKind::Section => return None,
            FeatureKind::Plane => Self::Plane { point, normal },
            FeatureKind::Line => Self::Line {
                middle: point,
                direction,
                normal,
            },
            FeatureKind::Circle => Self::Circle {
                centre: point,
                normal,
                radius: 1.0,
            },
            FeatureKind::Slot => Self::Slot {
                centre: point,
                direction,
                normal,
                length: 3.0,
                width: 1.0,
            },
        })
    }
}
