//! The radius of an edge of a joint.

use super::kind::*;
use crate::inspect::section;

words! {
    /// A side of a joint.
    Side {
        /// The one at the section's beginning.
        Left: "left",
        /// The one at its end.
        Right: "right",
    }
}

kind! {
    /// The radius of the edge of one side, mm.
    Radius {
        /// Which side.
        side: Side = Side::WORDS,
    }
}

impl Kind for Radius {
    fn facts(&self) -> Facts {
        Facts {
            words: "{side}",
            never_negative: true,
            ..Facts::new(Basis::Section, SECTION)
        }
    }

    fn of_section(&self, of: &section::Joint) -> Option<f64> {
        Some(section::radius(
            of,
            match self.side {
                Side::Left => section::Side::Left,
                Side::Right => section::Side::Right,
            },
        ))
    }
}
