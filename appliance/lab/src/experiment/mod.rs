//! The paper's experiments on the simulated head, with fixed, the paper's adaptive and the better
//! patterns (`fringed-lab experiment`).

mod compared;
mod judge;
mod runner;
mod table;

pub use compared::{BetterSequence, Judged, Method, NoSequence, OpticsKind, PARTS, SHOWN, Scene};
pub use runner::{Run, Runner};
pub use table::{HEADER, RunRow, Values, csv, means, set_ratios, table};
