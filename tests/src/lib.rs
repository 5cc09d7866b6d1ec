//! The harness of the integration suite, which judges the program and shares no code with it.
//!
//! - [`oracle`], [`rig`], [`render`], [`board`], [`plane`], [`random`], [`once`]: of `scenes`, which is
//!   optimised.
//! - [`small_head`]: a simulated head that is quick to examine and to calibrate.
//! - [`shared`]: the shared recordings beside the project, if they are there.
//! - [`program`]: runs the binary and keeps its output.
//! - [`files`]: reads its files; [`score`]: compares heights with the truth.
//! - [`fuzz`]: functions of bytes that must not panic.
//! - [`imports`]: which files of a crate name each other.
//! - [`power`]: a model of what a loss of power leaves of a folder.
//! - [`until`](mod@until): waits for what others do.

pub use scenes::{board, once, oracle, plane, random, render, rig};

pub mod archives;
pub mod files;
pub mod fuzz;
pub mod imports;
pub mod power;
pub mod program;
pub mod score;
pub mod shared;
pub mod small_head;
pub mod until;
