//! The distance of two features.

use super::kind::*;

kind! {
    /// The distance of the middle of the second plane's region from the first plane, along the
    /// first plane's normal, mm.
    Distance {}
}

impl Kind for Distance {
    fn facts(&self) -> Facts {
        Facts {
            takes: PLANES,
            never_negative: true,
            ..Facts::new(Unit::Length, Basis::Geometry, "")
        }
    }

    fn value(&self, of: &[Geometry]) -> Option<f64> {
        let [from, to] = of else { return None };
        Some(libm::fabs(from.direction.dot(to.point - from.point)))
    }
}
