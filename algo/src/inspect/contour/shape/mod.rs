//! Shapes of contours, each a file with its signed distance.

mod circle;
mod distance;
mod line;
mod slot;

pub use circle::Circle;
pub use distance::{Foot, Shape};
pub use line::Line;
pub use slot::Slot;

#[cfg(test)]
mod tests;
