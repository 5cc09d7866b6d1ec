//! The y coordinate of an opening.

use super::kind::*;

kind! {
    /// y of the centre of a hole or slot in a datum system, or else in the frame as taught, mm.
    Y {}
}

impl Kind for Y {
    fn facts(&self) -> Facts {
        Facts {
            datum: true,
            ..Facts::new(Basis::Geometry, OPENING)
        }
    }

    fn value(&self, of: &[Geometry]) -> Option<f64> {
        of.first()?.centre().map(|centre| centre.y)
    }
}
