//! The plot of run time against error, with the Pareto front.

use super::report::Report;

impl Report {
    /// File names and contents of the plots.
    pub fn figures(&self) -> Vec<(String, Vec<u8>)> {
        Vec::new()
    }
}
