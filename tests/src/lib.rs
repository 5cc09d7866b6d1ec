//! The harness of the integration suite, which judges the program and shares no code with it.
//!
//! - [`oracle`]: the textbook implementation in `f64`, from frames to heights.
//! - [`rig`], [`render`]: small rendered recordings with ground truth.
//! - [`small_head`]: a simulated head that is quick to examine and to calibrate.
//! - [`shared`]: the shared recordings beside the project, if they are there.
//! - [`program`]: runs the binary and keeps its output.
//! - [`files`]: reads its files; [`score`]: compares heights with the truth; [`plane`]: fits
//!   planes.
//! - [`random`]: a seeded generator.
//! - [`fuzz`]: functions of bytes that must not panic.
//! - [`imports`]: which files of a crate name each other.
//! - [`power`]: a model of what a loss of power leaves of a folder.
//! - [`once`]: what is made once for all tests.
//! - [`until`](mod@until): waits for what others do.

pub mod board;
pub mod files;
pub mod fuzz;
pub mod imports;
pub mod once;
pub mod oracle;
pub mod plane;
pub mod power;
pub mod program;
pub mod random;
pub mod render;
pub mod rig;
pub mod score;
pub mod shared;
pub mod small_head;
pub mod until;
