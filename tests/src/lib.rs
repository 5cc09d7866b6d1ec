//! The harness of the integration suite: what judges the program and shares no code with it.
//!
//! - [`oracle`]: the textbook in `f64`, from frames to heights.
//! - [`rig`], [`render`]: small recordings of our own, with their truth.
//! - [`small_head`]: a simulated head that is quick to examine and to calibrate.
//! - [`shared`]: the recordings that lie beside the project, where they are.
//! - [`program`]: runs the binary and keeps what it says.
//! - [`files`]: reads what it writes, [`score`]: compares it with the truth, [`plane`]: fits planes.
//! - [`random`]: a seeded generator.
//! - [`fuzz`]: functions of bytes that must not panic.
//! - [`power`]: what a loss of power leaves of a folder.

pub mod files;
pub mod fuzz;
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
