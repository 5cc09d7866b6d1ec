//! `fringed-lab bench`: times the kernels, run time against error, and trigger to verdict.

mod accuracy;
mod budget;
mod counter;
mod decoding;
mod effort;
mod export;
mod floor;
mod frames;
mod gauges;
mod kernel;
mod machine;
mod median;
mod placed;
mod point;
mod real;
mod reference;
mod report;
mod timing;
mod variants;
mod workload;

pub use accuracy::Study;
pub use budget::{Budget, budgets};
pub use effort::Effort;
pub use export::frame_files;
pub use kernel::{KernelTable, Timing, kernel_table};
pub use machine::Machine;
pub use median::median;
pub use point::{Point, means};
pub use report::{HEADER, Report};

/// An error in words.
fn words(error: impl std::fmt::Display) -> String {
    error.to_string()
}
