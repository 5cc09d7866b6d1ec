//! Stage 3: the part's motion is taken back.

mod coordinates;
pub mod displaced;
mod pose;

pub use coordinates::{Comparison, TaughtCoordinates};
pub(in crate::inspect::strips) use displaced::{
    BLOCK, BlockNumbers, Linear, Whole, floor, is_near,
};
pub use pose::{PoseField, SPACING, blocks_of_row, displacement};
