//! The height of a region above another one.

use super::kind::*;
use super::level::mean;

kind! {
    /// The mean height less that of a second region, mm.
    Step {
        /// The name of the second region.
        from: String,
    }
}

impl Kind for Step {
    fn facts(&self) -> Facts {
        Facts::new(Unit::Length, Basis::Region, "from {from}")
    }

    fn from(&self) -> Option<&str> {
        Some(&self.from)
    }

    fn find(&self, of: Evidence<'_>) -> Option<Found> {
        let value = mean(of.cells(), of.room)? - mean(of.from(), of.room)?;
        for weight in &mut of.room[of.count..] {
            *weight = -*weight;
        }
        Some(of.linear(value))
    }
}
