//! The x coordinate of an opening.

use super::kind::*;

kind! {
    /// x of the centre of a hole or slot in a datum system, or else in the frame as taught, mm.
    X {}
}

impl Kind for X {
    fn facts(&self) -> Facts {
        Facts {
            datum: true,
            ..Facts::new(Basis::Geometry, OPENING)
        }
    }

    fn value(&self, of: &[Geometry]) -> Option<f64> {
        of.first()?.centre().map(|centre| centre.x)
    }
}
