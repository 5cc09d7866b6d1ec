//! What the tests render and decode by themselves. It works on every pixel, so it is a package of its
//! own, which is optimised; the rest of the tests is not.
//!
//! - [`oracle`]: the textbook implementation in `f64`, from frames to heights.
//! - [`rig`], [`render`]: small rendered recordings with ground truth.
//! - [`board`]: a rendered checkerboard.
//! - [`plane`]: fits planes.
//! - [`random`]: a seeded generator.
//! - [`once`]: what is made once for all tests.

pub mod board;
pub mod once;
pub mod oracle;
pub mod plane;
pub mod random;
pub mod render;
pub mod rig;
