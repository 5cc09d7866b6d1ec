//! `fringed-fleet status`: show a line per head.

use crate::error::{Exit, Result};

/// Show a line per head.
#[derive(Debug, clap::Args)]
pub struct Status {}

impl Status {
    /// Runs the command.
    ///
    /// # Errors
    /// Always: it is not there yet.
    pub fn run(&self) -> Result<()> {
        Exit::Software.fail("not there yet")
    }
}
