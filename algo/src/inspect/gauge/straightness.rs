//! How far a straight edge is off its line.

use super::kind::*;

kind! {
    /// The largest less the smallest distance of the points of a straight edge from the least-squares
    /// line, mm: STRt of ISO 12780-1:2011.
    Straightness {}
}

impl Kind for Straightness {
    fn facts(&self) -> Facts {
        Facts {
            never_negative: true,
            ..Facts::new(Basis::Rim, LINE)
        }
    }

    fn of_rim(&self, rim: &Rim) -> Option<OfRim> {
        range_of(rim)
    }
}
