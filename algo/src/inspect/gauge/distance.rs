//! The distance of two features.

use super::kind::*;
use crate::geometry::Vector;

kind! {
    /// The distance of two features, mm. Holes and slots: of their centres. Two planes: of the
    /// middle of the second one's region from the first plane, along its normal. A line and a hole
    /// or slot, or two lines: of the centre, or of the middle of the second line, from the first
    /// line in its plane.
    Distance {}
}

impl Kind for Distance {
    fn facts(&self) -> Facts {
        Facts {
            never_negative: true,
            ..Facts::new(Basis::Geometry, FEATURES)
        }
    }

    fn value(&self, of: &[Geometry]) -> Option<f64> {
        let [from, to] = of else { return None };
        let way = to.point - from.point;
        Some(match (from.kind, to.kind) {
            (Plane, Plane) => libm::fabs(from.normal.dot(way)),
            (Plane, _) | (_, Plane) => return None,
            (Line, _) => across(from, way)?,
            (_, Line) => across(to, way)?,
            _ => way.length(),
        })
    }
}

/// How far a way leads across a line, in its plane.
fn across(line: &Geometry, way: Vector) -> Option<f64> {
    Some(libm::fabs(line.normal.cross(line.direction?).dot(way)))
}
