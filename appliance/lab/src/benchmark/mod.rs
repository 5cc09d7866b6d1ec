//! `fringed-lab bench`: times the kernels, run time against error, and trigger to verdict.

mod accuracy;
mod budget;
mod gauges;
mod kernel;
mod report;
mod timing;
mod workload;

pub use accuracy::{Point, Study, means};
pub use budget::{Budget, budgets};
pub use kernel::{KernelTable, Timing, kernel_table};
pub use report::{HEADER, Machine, Report};
pub use timing::{Effort, median};
pub use workload::frame_files;
