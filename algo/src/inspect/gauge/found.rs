//! How much of a contour is seen.

use super::kind::*;

kind! {
    /// The share of a contour's rim that is seen, 0 where the contour is absent.
    Found {}
}

impl Kind for Found {
    fn facts(&self) -> Facts {
        Facts {
            unit: Unit::Share,
            never_negative: true,
            ..Facts::new(Basis::Rim, CONTOUR)
        }
    }

    fn of_rim(&self, rim: &Rim) -> Option<OfRim> {
        Some(OfRim {
            value: rim.found,
            ..OfRim::default()
        })
    }

    fn of_absent(&self) -> Option<f64> {
        Some(0.0)
    }
}
