//! `fringed-fleet backup`: write recipes, calibration and configuration of each head as files.

use crate::error::{Exit, Result};

/// Write recipes, calibration and configuration of each head as files.
#[derive(Debug, clap::Args)]
pub struct Backup {}

impl Backup {
    /// Runs the command.
    ///
    /// # Errors
    /// Always: it is not there yet.
    pub fn run(&self) -> Result<()> {
        Exit::Software.fail("not there yet")
    }
}
