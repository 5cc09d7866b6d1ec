//! Sums over squares.

pub(super) mod extreme;
pub(super) mod narrow;
