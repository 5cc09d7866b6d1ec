//! The distance of two features.

use super::kind::*;

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
            takes: FEATURES,
            never_negative: true,
            ..Facts::new(Unit::Length, Basis::Geometry, "")
        }
    }

    fn value(&self, of: &[Geometry]) -> Option<f64> {
        use Geometry::{Circle, Line, Plane, Slot};
        let [from, to] = of else { return None };
        let way = to.point() - from.point();
        Some(match (from, to) {
            (Plane { normal, .. }, Plane { .. }) => libm::fabs(normal.dot(way)),
            (Circle { .. } | Slot { .. }, Circle { .. } | Slot { .. }) => way.length(),
            (
                Line {
                    direction, normal, ..
                },
                Circle { .. } | Slot { .. } | Line { .. },
            )
            | (
                Circle { .. } | Slot { .. },
                Line {
                    direction, normal, ..
                },
            ) => libm::fabs(normal.cross(*direction).dot(way)),
            _ => return None,
        })
    }
}
