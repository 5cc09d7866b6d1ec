//! `fringed bench`: how fast the kernels are, what accuracy costs, and the time from trigger to verdict.

mod decoding;
mod floor;
mod frames;
mod kernel;
mod machine;
mod real;
mod reference;
mod stopwatch;
mod variants;
mod workload;

pub use kernel::{Effort, KernelTable, Timing, kernel_table};
pub use machine::Machine;
