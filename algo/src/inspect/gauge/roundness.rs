//! How far a hole's rim is off its circle.

use super::kind::*;

kind! {
    /// The largest less the smallest distance of the points of a hole's rim from the least-squares
    /// circle, mm: RONt of ISO 12181-1:2011.
    Roundness {}
}

impl Kind for Roundness {
    fn facts(&self) -> Facts {
        Facts {
            never_negative: true,
            ..Facts::new(Basis::Rim, CIRCLE)
        }
    }

    fn of_rim(&self, rim: &Rim) -> Option<OfRim> {
        range_of(rim)
    }
}
