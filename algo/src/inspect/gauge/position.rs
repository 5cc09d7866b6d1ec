//! The position of an opening.

use super::kind::*;

kind! {
    /// The diameter of the zone about the nominal place that the centre of a hole or slot lies in,
    /// mm: twice its distance from there in the xy plane of a datum system (position of ISO
    /// 1101:2017).
    Position {
        /// Nominal x and y of the centre in the datum system.
        nominal: [f64; 2] = Domain::Place,
    }
}

impl Kind for Position {
    fn facts(&self) -> Facts {
        Facts {
            words: "from {nominal}",
            datum: true,
            never_negative: true,
            ..Facts::new(Basis::Geometry, OPENING)
        }
    }

    fn value(&self, of: &[Geometry]) -> Option<f64> {
        let centre = of.first()?.centre()?;
        let [x, y] = self.nominal;
        Some(2.0 * libm::hypot(centre.x - x, centre.y - y))
    }
}
