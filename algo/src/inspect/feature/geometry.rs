//! The geometry of a feature: what a characteristic is a function of.

use super::kind::FeatureKind;
use crate::geometry::Vector;
use alloc::vec::Vec;

/// The geometry of a feature, in the frame as taught or in that of a datum system; lengths in mm,
/// directions of length 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry {
    /// What it is of.
    pub kind: FeatureKind,
    /// Of a plane the point above the middle of its region, of an edge the middle of what is seen
    /// of it, of an opening its centre.
    pub point: Vector,
    /// The normal of its plane, on the side that the camera sees.
    pub normal: Vector,
    /// The direction that it has in its plane: of an edge with the material on the left as the
    /// camera sees it, of a slot that of its axis.
    pub direction: Option<Vector>,
    /// Of an opening its diameter, or its overall length and its width.
    pub sizes: [Option<f64>; 2],
}

impl Geometry {
    /// A plane through a point.
    pub fn plane(point: Vector, normal: Vector) -> Self {
        Self {
            kind: FeatureKind::Plane,
            point,
            normal,
            direction: None,
            sizes: [None; 2],
        }
    }

    /// The centre of an opening; `None` of what is none.
    pub fn centre(&self) -> Option<Vector> {
        self.kind.is_opening().then_some(self.point)
    }

    /// The same with its points and directions mapped.
    pub(in crate::inspect) fn mapped(
        &self,
        at: impl Fn(Vector) -> Vector,
        along: impl Fn(Vector) -> Vector,
    ) -> Self {
        Self {
            point: at(self.point),
            normal: along(self.normal),
            direction: self.direction.map(along),
            ..*self
        }
    }

    /// A geometry of each kind, to try what can be made of them: each lies and points elsewhere.
    /// `None` if one of the kinds has no geometry.
    pub(in crate::inspect) fn examples(kinds: &[FeatureKind]) -> Option<Vec<Self>> {
        let kinds = kinds.iter().enumerate();
        kinds.map(|(at, &kind)| Self::example(kind, at)).collect()
    }

    fn example(kind: FeatureKind, number: usize) -> Option<Self> {
        let turn = number as f64;
        let plane = Self::plane(
            Vector::new(10.0 * turn, 3.0 * turn * turn, 1.0 + turn),
            Vector::new(0.0, 0.0, 1.0),
        );
        let direction = Vector::new(libm::cos(turn), libm::sin(turn), 0.0);
        match kind.contour() {
            None => (kind == FeatureKind::Plane).then_some(plane),
            Some(contour) => Some(Self {
                kind,
                direction: contour.has_direction.then_some(direction),
                sizes: core::array::from_fn(|i| (i < contour.sizes).then_some(1.0 + i as f64)),
                ..plane
            }),
        }
    }
}
